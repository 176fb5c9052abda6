"""Draws the annotated film of thesis Figs. 4.5 and 4.6: found rings in cyan, and below them the evolving histogram.

The histogram moves from right, the present, to left. Long blue lines mark an interval of one period; its spread is
calculated when the mode passes the short blue line at its midpoint.
"""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.overhead.camera import Frame, Picture
from epuck_sim.overhead.rings import Ring
from epuck_sim.overhead.synchrony import Evaluation
from epuck_sim.util.messages import counted

PERIODS = 2  # past periods that the histogram shows
STRIP_SHARE = 0.2  # height of the strip below the picture, relative to the picture's; about that of Fig. 4.5
MIN_LINE_PX = 13  # minimum height of a legible line of text; the bars are at least twice as high
FULL_COUNT = 4  # count that the full height of the bars stands for; the largest so far if that is larger
SUBPIXEL_BITS = 4  # fractional bits of coordinates that OpenCV draws at
FONT = cv2.FONT_HERSHEY_SIMPLEX

CYAN = (0, 230, 255)  # colour of rings that were found; people who cannot tell green from red see it beside red, too
BARS = (70, 170, 70)
OLD_BARS = (40, 80, 40)  # bars that have left the interval of one period
BLUE = (90, 165, 255)
GREY = (28, 28, 28)
WHITE = (235, 235, 235)


class TrackedFrame(NamedTuple):
    """A frame of a film, and what is known once it has been processed."""

    frame: Frame
    rings: Sequence[Ring]
    start_s: float  # beginning of the trial on the film's clock
    evaluation: Evaluation | None  # the evaluation that this frame completed
    histogram_s: float | None  # first mode around which the histogram was narrow enough, on the film's clock
    t_sync_s: float | None = None  # T_sync on the film's clock; None while a camera films


class Annotator:
    """Annotates the frames of a film one by one; keeps only the counts that it shows."""

    def __init__(self, width_px: int, height_px: int, period_s: float) -> None:
        """Begin a film with pictures of this size, of oscillators with this period.

        Annotated pictures are `width_px` wide and, with the strip, `height_px` high; both are even, as H.264 requires.
        """
        self._period_s = period_s
        self._line_px = max(MIN_LINE_PX, round(min(width_px / 28, height_px / 24)))
        self._top_px = height_px + height_px % 2
        strip_px = max(round(STRIP_SHARE * height_px), 2 * self._line_px + 2 * MIN_LINE_PX)
        self.width_px = width_px + width_px % 2
        self.height_px = self._top_px + strip_px + strip_px % 2
        self._begin(0.0)

    def _begin(self, start_s: float) -> None:
        self._start_s = start_s
        self._counts: deque[tuple[float, int]] = deque()
        self._max_count = FULL_COUNT
        self._spread_s: float | None = None

    def annotate(self, tracked: TrackedFrame) -> Picture:
        """Return (height_px, width_px, 3) the next frame, annotated with what is known by then."""
        frame, rings, start_s, evaluation, histogram_s, t_sync_s = tracked
        if start_s != self._start_s:
            self._begin(start_s)
        if evaluation is not None:
            self._spread_s = evaluation.spread_s
        self._counts.append((frame.time_s, len(rings)))
        self._max_count = max(self._max_count, len(rings))
        while len(self._counts) > 1 and self._counts[1][0] < frame.time_s - PERIODS * self._period_s:
            self._counts.popleft()
        annotated = np.zeros((self.height_px, self.width_px, 3), np.uint8)
        picture = frame.picture  # which merges its colours each time
        annotated[: len(picture), : picture.shape[1]] = picture
        one, thick = 1 << SUBPIXEL_BITS, max(1, round(self._line_px / 10))
        for ring in rings:
            centre, radius = (round(ring.x_px * one), round(ring.y_px * one)), round(ring.radius_px * one)
            cv2.circle(annotated, centre, radius, CYAN, thick, cv2.LINE_AA, SUBPIXEL_BITS)
        strip = annotated[self._top_px :]
        strip[:] = GREY
        self._draw_bars(strip[2 * self._line_px :], frame.time_s)
        since_s = frame.time_s - self._start_s
        self._write(strip, 0, f"{since_s:.1f} s = {since_s / self._period_s:.1f} periods")
        self._write(strip, 1, counted(len(rings), "ring"))
        if self._spread_s is not None:
            self._write(strip, 0, f"spread {1000 * self._spread_s:.0f} ms", is_right=True)
        name, sync_s = ("by the histogram", histogram_s) if t_sync_s is None else ("T_sync", t_sync_s)
        if sync_s is not None:
            self._write(strip, 1, f"{name} {sync_s - self._start_s:.1f} s", CYAN, is_right=True)
        return annotated

    def _draw_bars(self, bars: Picture, now_s: float) -> None:
        rows, width = bars.shape[:2]
        counts = counts_by_column(self._counts, now_s, PERIODS * self._period_s, width)
        is_bar = np.arange(rows, 0, -1)[:, None] <= np.round(counts * (rows - 1) / self._max_count)
        begin = width - 1 - width // PERIODS
        bars[:, :begin][is_bar[:, :begin]] = OLD_BARS
        bars[:, begin:][is_bar[:, begin:]] = BARS
        thick = max(1, self._line_px // 8)
        bars[:, begin : begin + thick] = bars[:, -thick:] = BLUE
        middle = width - 1 - width // (2 * PERIODS)
        bars[rows * 2 // 3 :, middle : middle + thick] = BLUE

    def _write(
        self, strip: Picture, line: int, text: str, colour: tuple[int, int, int] = WHITE, *, is_right: bool = False
    ) -> None:
        """Write text into a line of the strip, at one end; it is made smaller if it would take more than half of it."""
        width_px, line_px = strip.shape[1], self._line_px
        margin, thick = line_px // 3, max(1, round(line_px / 20))
        (width, height), _ = cv2.getTextSize(text, FONT, 1.0, thick)
        scale = min(0.7 * line_px / height, (width_px / 2 - 2 * margin) / width)
        (width, _), _ = cv2.getTextSize(text, FONT, scale, thick)  # not exactly proportional to the scale
        left = width_px - margin - width if is_right else margin
        cv2.putText(strip, text, (left, round((line + 0.82) * line_px)), FONT, scale, colour, thick, cv2.LINE_AA)


def counts_by_column(history: Sequence[tuple[float, int]], now_s: float, window_s: float, width: int) -> IntArray:
    """Return (width,) the counts in a window whose last column is the present.

    The count of a frame holds until the next frame. Of several frames in a column the largest count is shown, because a
    mode may last for a single frame.
    """
    times = np.array([time_s for time_s, _ in history])
    counts = np.array([count for _, count in history], np.int64)
    places = width - 1 - (now_s - times) / window_s * width
    first = np.ceil(places - 1e-6).astype(int)
    held = np.searchsorted(first, np.arange(width), side="right") - 1
    shown = np.where(held >= 0, counts[held], 0)
    inside = first >= 0
    np.maximum.at(shown, first[inside], counts[inside])
    return shown
