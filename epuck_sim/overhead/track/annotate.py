"""The annotated film of thesis Figs. 4.5 and 4.6: found rings in green, and below them the evolving histogram.

The histogram moves from right, where it is now, to left. Long blue lines mark an interval of one period; its spread is
calculated when the mode passes the short blue line at its midpoint.
"""

from collections import deque
from collections.abc import Sequence

import cv2
import numpy as np

from epuck_sim.arrays import IntArray
from epuck_sim.overhead.film.frame import Frame, Picture
from epuck_sim.overhead.track.ring_detection import Ring
from epuck_sim.overhead.track.spread import Evaluation

PERIODS = 2
"""So much of the past is shown."""

STRIP_SHARE = 0.2
"""Height of the strip beside the picture's, about that of Fig. 4.5."""

LINE_PX = 13
"""Least height of a line of text that can be read, and half of the least height of the bars."""

FULL_COUNT = 4
"""The bars' full height stands for the largest count so far, or for this where that is less."""

GREEN = (0, 230, 0)
BARS = (70, 170, 70)
OLD_BARS = (40, 80, 40)
"""Of what has left the interval."""
BLUE = (90, 165, 255)
GREY = (28, 28, 28)
WHITE = (235, 235, 235)

FONT = cv2.FONT_HERSHEY_SIMPLEX
SUBPIXEL_BITS = 4


class Annotator:
    """Draws what was found into a film's frames, given one by one; remembers no more of them than it shows."""

    width_px: int
    height_px: int
    """Of the annotated pictures; both are even, as H.264 needs it: a black column or row is added to an odd picture."""

    def __init__(self, width_px: int, height_px: int, period_s: float) -> None:
        """width_px, height_px: of the film's pictures; period_s: of the oscillators."""
        self._period_s = period_s
        self._line_px = max(LINE_PX, round(min(width_px / 28, height_px / 24)))
        self._top_px = height_px + height_px % 2
        strip_px = max(round(STRIP_SHARE * height_px), 2 * self._line_px + 2 * LINE_PX)
        self.width_px = width_px + width_px % 2
        self.height_px = self._top_px + strip_px + strip_px % 2
        self._seen: deque[tuple[float, int]] = deque()
        self._start_s = 0.0
        self._most = FULL_COUNT
        self._spread_s: float | None = None

    def annotate(
        self,
        frame: Frame,
        rings: Sequence[Ring],
        start_s: float,
        evaluation: Evaluation | None,
        t_sync_s: float | None,
    ) -> Picture:
        """Return (height_px, width_px, 3) the next frame with all that is known when it has been looked at.

        start_s: when the trial began, on the film's clock; what was before is forgotten. evaluation: one that this
        frame made possible. t_sync_s: when the swarm was synchronised, on the film's clock; None until it is.
        """
        if start_s != self._start_s:
            self._start_s, self._spread_s, self._most = start_s, None, FULL_COUNT
            self._seen.clear()
        if evaluation is not None:
            self._spread_s = evaluation.spread_s
        self._remember(frame.time_s, len(rings))
        annotated = np.zeros((self.height_px, self.width_px, 3), np.uint8)
        height, width = frame.picture.shape[:2]
        annotated[:height, :width] = frame.picture
        for ring in rings:
            _draw_ring(annotated, ring, max(1, round(self._line_px / 10)))
        strip = annotated[self._top_px :]
        strip[:] = GREY
        self._draw_bars(strip[2 * self._line_px :], frame.time_s)
        self._write(strip, frame.time_s, len(rings), t_sync_s)
        return annotated

    def _remember(self, time_s: float, count: int) -> None:
        self._seen.append((time_s, count))
        self._most = max(self._most, count)
        while len(self._seen) > 1 and self._seen[1][0] < time_s - PERIODS * self._period_s:
            self._seen.popleft()

    def _draw_bars(self, bars: Picture, now_s: float) -> None:
        """Draw the histogram and its marks into (rows, width_px, 3)."""
        rows, width = bars.shape[:2]
        counts = _counts_by_column(self._seen, now_s, PERIODS * self._period_s, width)
        heights = np.round(counts * (rows - 1) / self._most)
        is_bar = np.arange(rows, 0, -1)[:, None] <= heights
        begin = width - 1 - width // PERIODS
        bars[:, :begin][is_bar[:, :begin]] = OLD_BARS
        bars[:, begin:][is_bar[:, begin:]] = BARS
        thick = max(1, self._line_px // 8)
        bars[:, begin : begin + thick] = bars[:, -thick:] = BLUE
        middle = width - 1 - width // (2 * PERIODS)
        bars[rows * 2 // 3 :, middle : middle + thick] = BLUE

    def _write(self, strip: Picture, now_s: float, count: int, t_sync_s: float | None) -> None:
        since_s = now_s - self._start_s
        _write_text(strip, 0, self._line_px, f"{since_s:.1f} s = {since_s / self._period_s:.1f} cycles", WHITE, 0.0)
        _write_text(strip, 1, self._line_px, "1 ring" if count == 1 else f"{count} rings", WHITE, 0.0)
        if self._spread_s is not None:
            _write_text(strip, 0, self._line_px, f"spread {1000 * self._spread_s:.0f} ms", WHITE, 1.0)
        if t_sync_s is not None:
            cycles = (t_sync_s - self._start_s) / self._period_s
            _write_text(strip, 1, self._line_px, f"synchronised at {cycles:.1f} cycles", GREEN, 1.0)


def _counts_by_column(seen: Sequence[tuple[float, int]], now_s: float, window_s: float, width: int) -> IntArray:
    """Return (width,) the counts in the window that ends now, in the last column.

    seen: times and counts of frames; a frame's count holds until the next one. Where several frames share a column, the
    largest is shown: a mode may last no longer than a frame.
    """
    times = np.array([time_s for time_s, _ in seen])
    counts = np.array([count for _, count in seen], np.int64)
    places = width - 1 - (now_s - times) / window_s * width
    first = np.ceil(places - 1e-6).astype(int)
    held = np.searchsorted(first, np.arange(width), side="right") - 1
    shown = np.where(held >= 0, counts[held], 0)
    inside = first >= 0
    np.maximum.at(shown, first[inside], counts[inside])
    return shown


def _draw_ring(picture: Picture, ring: Ring, thickness_px: int) -> None:
    one = 1 << SUBPIXEL_BITS
    centre = (round(ring.x_px * one), round(ring.y_px * one))
    cv2.circle(picture, centre, round(ring.radius_px * one), GREEN, thickness_px, cv2.LINE_AA, SUBPIXEL_BITS)


def _write_text(
    strip: Picture, line: int, line_px: int, text: str, colour: tuple[int, int, int], alignment: float
) -> None:
    """Write into a line of the strip, from its left end (alignment 0) or up to its right one (1).

    The text is smaller where it needs more than half of the width, which the other end has.
    """
    width_px = strip.shape[1]
    margin = line_px // 3
    thick = max(1, round(line_px / 20))
    (width, height), _ = cv2.getTextSize(text, FONT, 1.0, thick)
    scale = min(0.7 * line_px / height, (width_px / 2 - 2 * margin) / width)
    (width, _), _ = cv2.getTextSize(text, FONT, scale, thick)  # in some fonts it is not quite in proportion
    left = margin + int(alignment * (width_px - 2 * margin - width))
    cv2.putText(strip, text, (left, round((line + 0.82) * line_px)), FONT, scale, colour, thick, cv2.LINE_AA)
