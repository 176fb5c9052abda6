"""The simulated webcam above the arena: collects the control steps of a trial and exposes frame after frame."""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.overhead.camera_model import CameraModel, overhead_camera
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.render.renderer import ExposureSample, Renderer
from epuck_sim.scenario.overhead import OverheadSection
from epuck_sim.scenario.robot_kind import EPUCK, RobotKind

SAMPLES = 4
"""Number of moments, evenly spread over an exposure, that are rendered into one picture.

A robot at 12.8 cm/s moves by less than the width of a ring from one to the next, in exposures of up to 90 ms.
"""

TIME_TOLERANCE_S = 1e-6
"""Times that differ by no more than this are taken as equal; the difference is rounding."""


NO_MOVABLES = np.empty((0, 2))
"""Places of the movables of an arena that has none."""


class _State(NamedTuple):
    """The robots at a control step."""

    time_s: float
    """Time of the step on the film's clock."""
    poses: FloatArray
    ring_on: BoolArray
    movables: FloatArray
    arena: Arena | None


class VirtualCamera:
    """Films a trial: frame k begins at k / frames_per_s; only the steps of one exposure are kept in memory.

    The film begins `lit_start_s` before the first step. Until then the room is lit, the robots stand where the first
    step has them, and all rings are off.
    """

    def __init__(
        self,
        section: OverheadSection,
        arena: Arena,
        seed: int,
        robot: RobotKind = EPUCK,
        camera: CameraModel | None = None,
    ) -> None:
        """Place the camera above an arena.

        Args:
            section: The section `overhead` of a scenario.
            arena: The arena below the camera.
            seed: Seed of the noise.
            robot: What kind of robots are in it.
            camera: Its geometry; by default that of the section.

        Raises:
            EpuckSimError: The camera cannot see the arena (see `overhead_camera`).
        """
        camera = camera or overhead_camera(section, arena.width_cm, arena.height_cm)
        self._renderer = Renderer(section, camera, arena, seed, robot)
        self._section = section
        self._exposure_s = section.exposure_ms / 1000
        self._offset_s = 0.0  # film's clock minus trial's clock
        self._states: deque[_State] = deque()
        self._frames = 0

    def observe(
        self,
        time_s: float,
        poses: FloatArray,
        ring_on: BoolArray,
        movables: FloatArray = NO_MOVABLES,
        arena: Arena | None = None,
    ) -> Iterator[Frame]:
        """Add a control step; yield the frames whose exposures have ended by then.

        Args:
            time_s: Time of the step; later than that of all steps before.
            poses: (robots, 3) cm, cm, rad: x, y, heading; headings may be wrapped. Robots move evenly between steps.
            ring_on: (robots,) which rings are on from now until the next step.
            movables: (movables, 2) cm: where the arena's movables are; they move evenly, too.
            arena: Walls and obstacles from now until the next step; by default those of the start.
        """
        if not self._states:
            self._offset_s = self._section.lit_start_s - time_s
        poses, ring_on = np.array(poses, float), np.array(ring_on, bool)
        arrays = poses, ring_on & ~np.isnan(poses[:, 0]), np.array(movables, float)
        self._states.append(_State(self._offset_s + time_s, *arrays, arena))
        return self._frames_begun_by(self._states[-1].time_s - self._exposure_s)

    def finish(self) -> Iterator[Frame]:
        """Yield the frames that had begun by the last step; nothing changes until their exposures end."""
        return self._frames_begun_by(self._states[-1].time_s if self._states else -math.inf)

    def _frames_begun_by(self, time_s: float) -> Iterator[Frame]:
        """Yield the frames not yet yielded that begin at `time_s` or before."""
        while (begin_s := self._frames / self._section.frames_per_s) <= time_s + TIME_TOLERANCE_S:
            self._frames += 1
            yield self._expose(begin_s)
            next_s = self._frames / self._section.frames_per_s
            while len(self._states) > 1 and self._states[1].time_s <= next_s:
                self._states.popleft()

    def _expose(self, begin_s: float) -> Frame:
        samples = [self._sample(begin_s + (part + 0.5) / SAMPLES * self._exposure_s) for part in range(SAMPLES)]
        is_lit_start = begin_s < self._section.lit_start_s - TIME_TOLERANCE_S
        return Frame(begin_s, self._renderer.render(samples, room_is_lit=is_lit_start or self._section.light == "lit"))

    def _sample(self, time_s: float) -> ExposureSample:
        """Return the robots at a moment of the film, interpolated between the steps around it."""
        begun = bisect_right(self._states, time_s + TIME_TOLERANCE_S, key=lambda state: state.time_s)
        if begun == 0:
            first = self._states[0]
            return ExposureSample(first.poses, np.zeros_like(first.ring_on), first.movables, first.arena)
        last = self._states[begun - 1]
        if begun == len(self._states):
            return ExposureSample(last.poses, last.ring_on, last.movables, last.arena)
        following = self._states[begun]
        share = (time_s - last.time_s) / (following.time_s - last.time_s)
        change = following.poses - last.poses
        change[:, 2] = (change[:, 2] + math.pi) % math.tau - math.pi  # the shorter way round
        pushed = last.movables + share * (following.movables - last.movables)
        return ExposureSample(last.poses + share * change, last.ring_on, pushed, last.arena)
