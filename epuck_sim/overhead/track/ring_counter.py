"""Counts the lit rings of a film frame by frame, and detects synchrony while the film goes on (thesis 4.3.1)."""

from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera_model import CameraModel
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.track.ring_detection import Ring, RingFinder, is_lit
from epuck_sim.overhead.track.spread import Evaluation, SynchronyDetector, is_synchronised


class RingCounter:
    """Counts the lit rings in the frames of a film, which are given in their order.

    A film may begin in the light, before the robots start (thesis 4.3.1: they "only started moving once the room lights
    were switched off"). The trial therefore begins with the first dark frame after the light, and earlier counts are
    discarded. Once a ring has been seen in the dark, the trial has begun, and the light may go on and off.
    """

    start_s: float
    """Beginning of the trial on the film's clock."""
    frames: int
    """Number of frames so far, including those in the light."""
    camera: CameraModel
    """The camera that took the film."""

    def __init__(self, camera: CameraModel) -> None:
        self.camera = camera
        self._finder = RingFinder(camera)
        self._times = array("d")
        self._counts = array("q")
        self._was_lit = True
        self._has_begun = False
        self.start_s = 0.0
        self.frames = 0

    def process(self, frame: Frame) -> list[Ring]:
        """Find the lit rings in the next frame, add their number to `counts`, and return them."""
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
        """(frames,) s: times of the trial's frames on the film's clock."""
        return np.array(self._times, np.float64)

    @property
    def counts(self) -> IntArray:
        """(frames,) lit rings in each of the trial's frames."""
        return np.array(self._counts, np.int64)


class TrackedFrame(NamedTuple):
    """A frame of a film, and what is known once it has been processed."""

    frame: Frame
    rings: Sequence[Ring]
    """Lit rings found in it."""
    start_s: float
    """Beginning of the trial on the film's clock."""
    evaluation: Evaluation | None
    """The evaluation that this frame completed, whose mode was half a period ago."""
    t_sync_s: float | None
    """Time of the first mode around which the histogram was narrow enough, on the film's clock."""


def track_frames(
    frames: Iterable[Frame], counter: RingCounter, period_s: float, threshold_s: Callable[[], float]
) -> Iterator[TrackedFrame]:
    """Process frames one by one as they are asked for.

    Args:
        frames: The frames in their order.
        counter: Counts their rings.
        period_s: Period of the oscillators.
        threshold_s: Returns the standard deviation of the histogram at which the swarm counts as synchronised, as far
            as it can be estimated by then.
    """
    detector: SynchronyDetector | None = None
    t_sync_s = None
    for frame in frames:
        start_before_s = counter.start_s
        rings = counter.process(frame)
        if detector is None or counter.start_s != start_before_s:
            detector, t_sync_s = SynchronyDetector(period_s, counter.start_s), None
        evaluation = detector.update(frame.time_s, len(rings))
        if evaluation is not None and t_sync_s is None and is_synchronised(evaluation, threshold_s()):
            t_sync_s = evaluation.time_s
        yield TrackedFrame(frame, rings, counter.start_s, evaluation, t_sync_s)
