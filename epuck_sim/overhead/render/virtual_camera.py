"""The webcam above the arena while a trial goes on: what it sees of each exposure, frame by frame."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.overhead.camera_model import overhead_lens
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.render.renderer import Instant, Painter
from epuck_sim.scenario.overhead import OverheadSection

SAMPLES = 4
"""So many instants of an exposure are painted, evenly spread over it.

A robot at 12.8 cm/s moves by less than the width of a ring from one to the next, in exposures of up to 90 ms.
"""

ROUNDING_S = 1e-6
"""Times that differ by no more are the same, but for rounding."""


class _State(NamedTuple):
    """A control step."""

    time_s: float
    """On the film's clock."""
    poses: FloatArray
    ring_on: BoolArray


class Webcam:
    """Films a trial: frame k begins k / frames_per_s after the film does; it holds no more than an exposure's steps.

    The film begins `lit_start_s` before the first step: with the room lit, the robots where that step has them, and
    all rings off.
    """

    def __init__(self, section: OverheadSection, arena: Arena, seed: int) -> None:
        """Hang the camera above an arena; seed: of the noise. Raises EpuckSimError as `overhead_lens` does."""
        lens = overhead_lens(section, arena.width_cm, arena.height_cm)
        self._painter = Painter(section, lens, arena, seed)
        self._section = section
        self._exposure_s = section.exposure_ms / 1000
        self._offset_s = 0.0  # of the film's clock, ahead of the trial's
        self._states: deque[_State] = deque()
        self._frames = 0

    def take(self, time_s: float, poses: FloatArray, ring_on: BoolArray) -> Iterator[Frame]:
        """Note a control step; yield the frames whose exposures have ended by then. Steps come in order of time.

        poses: (robots, 3) cm, cm, rad, of which headings may be wrapped; robots move evenly from step to step.
        ring_on: (robots,) who is lit from now until the next step. Both are copied.
        """
        if not self._states:
            self._offset_s = self._section.lit_start_s - time_s
        self._states.append(_State(self._offset_s + time_s, np.array(poses, float), np.array(ring_on, bool)))
        return self._begun_by(self._states[-1].time_s - self._exposure_s)

    def end(self) -> Iterator[Frame]:
        """Yield the frames that had begun by the last step: nothing changes while their exposures end."""
        return self._begun_by(self._states[-1].time_s if self._states else -math.inf)

    def _begun_by(self, time_s: float) -> Iterator[Frame]:
        """Yield the frames not yet yielded that begin by then."""
        while (begin_s := self._frames / self._section.frames_per_s) <= time_s + ROUNDING_S:
            self._frames += 1
            yield self._expose(begin_s)
            next_s = self._frames / self._section.frames_per_s
            while len(self._states) > 1 and self._states[1].time_s <= next_s:
                self._states.popleft()

    def _expose(self, begin_s: float) -> Frame:
        instants = [self._at(begin_s + (part + 0.5) / SAMPLES * self._exposure_s) for part in range(SAMPLES)]
        is_lit_start = begin_s < self._section.lit_start_s - ROUNDING_S
        return Frame(begin_s, self._painter.paint(instants, is_lit_room=is_lit_start or self._section.light == "lit"))

    def _at(self, time_s: float) -> Instant:
        """Return where the robots are at a moment of the film."""
        begun = bisect_right(self._states, time_s + ROUNDING_S, key=lambda state: state.time_s)
        if begun == 0:
            return Instant(self._states[0].poses, np.zeros_like(self._states[0].ring_on))
        last = self._states[begun - 1]
        if begun == len(self._states):
            return Instant(last.poses, last.ring_on)
        following = self._states[begun]
        share = (time_s - last.time_s) / (following.time_s - last.time_s)
        way = following.poses - last.poses
        way[:, 2] = (way[:, 2] + math.pi) % math.tau - math.pi  # the shorter way round
        return Instant(last.poses + share * way, last.ring_on)
