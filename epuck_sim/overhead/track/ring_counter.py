"""Counts the lit rings in a film frame by frame and follows their histogram, as the experiments did (thesis 4.3.1)."""

from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera_model import Lens
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.track.ring_detection import Ring, RingFinder, is_lit
from epuck_sim.overhead.track.spread import Evaluation, SpreadWatch, is_synchronised


class Tracker:
    """Looks at a film's frames in their order.

    A film may begin in the light, before the robots do (thesis 4.3.1: they "only started moving once the room lights
    were switched off"). So the trial begins with the first dark frame after the light, and what was counted before is
    forgotten: as long as no ring was seen in the dark, for afterwards the light may go on and off as it likes.
    """

    start_s: float
    """When the trial begins, on the film's clock."""
    frames: int
    """Looked at so far, those in the light among them."""
    lens: Lens
    """The camera that took the film."""

    def __init__(self, lens: Lens) -> None:
        self.lens = lens
        self._finder = RingFinder(lens)
        self._times = array("d")
        self._counts = array("q")
        self._was_lit = True
        self._has_begun = False
        self.start_s = 0.0
        self.frames = 0

    def look(self, frame: Frame) -> list[Ring]:
        """Return the lit rings in a frame, and count them."""
        rings = self._finder.find(frame.picture)
        lit = is_lit(frame.picture)
        if self._was_lit and not lit and not self._has_begun:
            self.start_s = frame.time_s
            del self._times[:], self._counts[:]
        self._was_lit = lit
        self._has_begun |= bool(rings) and not lit
        self._times.append(frame.time_s)
        self._counts.append(len(rings))
        self.frames += 1
        return rings

    @property
    def times_s(self) -> FloatArray:
        """(frames,) s: when the trial's frames were taken."""
        return np.array(self._times, np.float64)

    @property
    def counts(self) -> IntArray:
        """(frames,): lit rings in each of them."""
        return np.array(self._counts, np.int64)


class Moment(NamedTuple):
    """A frame of a film, and what is known when it has been looked at."""

    frame: Frame
    rings: Sequence[Ring]
    start_s: float
    """When the trial began."""
    evaluation: Evaluation | None
    """The one that this frame made possible, of a mode half a period ago."""
    t_sync_s: float | None
    """Time of the first mode around which the histogram was narrow enough, on the film's clock."""


def follow(
    frames: Iterable[Frame], tracker: Tracker, period_s: float, threshold_s: Callable[[], float]
) -> Iterator[Moment]:
    """Yield what is known at each frame while it is looked at.

    period_s: of the oscillators; threshold_s: gives the standard deviation of the histogram at which the swarm is
    synchronised, as far as it can be told by then.
    """
    watch: SpreadWatch | None = None
    t_sync_s = None
    for frame in frames:
        before = tracker.start_s
        rings = tracker.look(frame)
        if watch is None or tracker.start_s != before:
            watch, t_sync_s = SpreadWatch(period_s, tracker.start_s), None
        evaluation = watch.look(frame.time_s, len(rings))
        if evaluation is not None and t_sync_s is None and is_synchronised(evaluation, threshold_s()):
            t_sync_s = evaluation.time_s
        yield Moment(frame, rings, tracker.start_s, evaluation, t_sync_s)
