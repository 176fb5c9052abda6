"""Counts the lit rings of a film frame by frame, and detects synchrony while the film goes on (thesis 4.3.1)."""

from array import array
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.camera import Geometry
from epuck_sim.overhead.flashes import Flash, FlashLinker
from epuck_sim.overhead.frame import Frame
from epuck_sim.overhead.light import Background, LightMeter, RingLight
from epuck_sim.overhead.rings import Ring, RingFinder
from epuck_sim.overhead.synchrony import Evaluation, SynchronyDetector, is_synchronised


class CountedRings(NamedTuple):
    """The lit rings of a trial that was filmed, or simulated as if it were."""

    frames: int
    """Number of frames, including those of a lit beginning."""
    start_s: float
    """Beginning of the trial on the film's clock."""
    times_s: FloatArray
    """(frames,) s: times of the trial's frames on the film's clock."""
    counts: IntArray
    """(frames,) lit rings in each of the trial's frames."""
    areas_px: IntArray
    """(frames,) pixels of the floor that are lit, in each of the trial's frames; 0 where there are no pictures."""
    flashes: tuple[Flash, ...]
    """Flashes of the trial, in order of their onsets."""
    outside: int
    """Number of rings seen outside of the floor, in all frames of the trial: those of a neighbour, or mirror images."""
    always_lit: Sequence[Ring]
    """Rings on the floor that never went off."""
    geometry: Geometry
    """The camera and the floor."""
    rings: Sequence[Sequence[Ring]] = ()
    """Rings on the floor in each frame, including those of a lit beginning; empty if it was not filmed."""


class RingCounter:
    """Counts the lit rings in the frames of a film, which are given in their order.

    A film may begin in the light, before the robots start (thesis 4.3.1: they "only started moving once the room lights
    were switched off"). The trial therefore begins with the first dark frame after the light, and earlier counts are
    discarded. Once a ring has been seen in the dark, the trial has begun, and the light may go on and off.
    """

    start_s: float
    """Beginning of the trial on the film's clock."""

    def __init__(self, geometry: Geometry) -> None:
        self._geometry = geometry
        self._finder = RingFinder(geometry.camera, geometry.ring_light, sees_discs=geometry.knows_floor)
        self._background = Background(geometry.background)
        self._meter = LightMeter(geometry)
        self._was_lit, self._has_begun = True, False
        self._rings: list[list[Ring]] = []
        self._begin(0.0)

    def process(self, frame: Frame) -> list[Ring]:
        """Find the lit rings on the floor in the next frame, count them, and return them."""
        light = self._background.light_beyond(frame)
        seen = self._finder.find_in(light)
        rings = self._on_floor(seen)
        lit = light.room_is_lit
        if not self._rings or (self._was_lit and not lit and not self._has_begun):
            self._begin(frame.time_s)
        self._was_lit = lit
        self._has_begun |= bool(rings) and not lit
        area_px = self._meter.lit_px(light.levels)
        self._times.append(frame.time_s)  # all at once: Ctrl-C, which ends a live film, must not come in between
        self._counts.append(len(rings))
        self._areas.append(area_px)
        self._linker.add(frame.time_s, rings)
        self._outside += len(seen) - len(rings)
        self._rings.append(rings)
        return rings

    def _begin(self, start_s: float) -> None:
        """Begin the trial, and forget what was before."""
        self.start_s = start_s
        self._times, self._counts, self._areas = array("d"), array("q"), array("q")
        self._linker = FlashLinker()
        self._outside = 0

    def _on_floor(self, rings: list[Ring]) -> list[Ring]:
        return [ring for ring in rings if self._geometry.is_on_floor(ring.x_cm, ring.y_cm)]

    def lit_since(self, time_s: float) -> int:
        """Return the number of rings in the last frame that have been lit since before a time."""
        return self._linker.lit_since(time_s)

    @property
    def times_s(self) -> FloatArray:
        """(frames,) s: times of the trial's frames on the film's clock."""
        return np.array(self._times, np.float64)

    @property
    def counts(self) -> IntArray:
        """(frames,) lit rings in each of the trial's frames."""
        return np.array(self._counts, np.int64)

    def counted(self) -> CountedRings:
        """Return what has been counted so far."""
        background = self._background.levels
        return CountedRings(
            frames=len(self._rings),
            start_s=self.start_s,
            times_s=self.times_s,
            counts=self.counts,
            areas_px=np.array(self._areas, np.int64),
            flashes=self._linker.flashes,
            outside=self._outside,
            always_lit=[] if background is None else self._on_floor(self._finder.find_in(RingLight(background, False))),
            geometry=self._geometry,
            rings=self._rings,
        )


class TrackedFrame(NamedTuple):
    """A frame of a film, and what is known once it has been processed."""

    frame: Frame
    rings: Sequence[Ring]
    """Lit rings found in it."""
    start_s: float
    """Beginning of the trial on the film's clock."""
    evaluation: Evaluation | None
    """The evaluation that this frame completed, whose mode was half a period ago."""
    histogram_s: float | None
    """Time of the first mode around which the histogram was narrow enough, on the film's clock."""


def track_frames(
    frames: Iterable[Frame],
    counter: RingCounter,
    period_s: float,
    threshold_s: Callable[[], float],
    steady: Callable[[float], int],
) -> Iterator[TrackedFrame]:
    """Process frames one by one as they are asked for.

    Args:
        frames: The frames in their order.
        counter: Counts their rings.
        period_s: Period of the oscillators.
        threshold_s: Returns the standard deviation of the histogram at which the swarm counts as synchronised, as far
            as it can be estimated by then.
        steady: Returns how many of the rings in a frame, whose time it is given, stay lit; they do not count.
    """
    detector: SynchronyDetector | None = None
    histogram_s = None
    for frame in frames:
        start_before_s = counter.start_s
        rings = counter.process(frame)
        if detector is None or counter.start_s != start_before_s:
            detector, histogram_s = SynchronyDetector(period_s, counter.start_s), None
        evaluation = detector.update(frame.time_s, max(0, len(rings) - steady(frame.time_s)))
        if evaluation is not None and histogram_s is None and is_synchronised(evaluation, threshold_s()):
            histogram_s = evaluation.time_s
        yield TrackedFrame(frame, rings, counter.start_s, evaluation, histogram_s)
