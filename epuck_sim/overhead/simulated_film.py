"""What would be found in a film of a simulated trial, without its pictures.

Rings are given to the tracker where they are, at a film's frame rate and for its duration; what pictures add, tenths of
a millimetre, is left out.
"""

from typing import NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.overhead.track.analysis import analyse
from epuck_sim.overhead.track.flashes import FlashLinker
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.ring_counter import CountedRings
from epuck_sim.overhead.track.ring_detection import Ring
from epuck_sim.overhead.track.tag_reading import Readings
from epuck_sim.scenario.embodied import EmbodiedScenario

SEEN_SHARE = 0.1
"""Share of an exposure for which a ring must be lit to be seen; our estimate: rings are much brighter than needed."""


class SimulatedFilm(NamedTuple):
    """Robots of a simulated trial in each frame of a film."""

    name: str
    times_s: FloatArray
    """(frames,) s."""
    poses: FloatArray
    """(frames, robots, 3) cm, cm, rad: x, y, heading; NaN where a robot is not in the arena."""
    is_lit: BoolArray
    """(frames, robots) whether rings are seen to be lit."""
    floor_cm: tuple[float, float]
    """Width and height, along y, of the floor."""

    def tag_readings(self) -> Readings:
        """Return what is read if all tags are read in all frames."""
        frames, robots = np.nonzero(~np.isnan(self.poses[..., 0]))
        return Readings(self.times_s[frames], robots, self.poses[frames, robots])


def simulate_film(scenario: EmbodiedScenario, seed: int, film: Track) -> SimulatedFilm:
    """Simulate a trial as if it were filmed, at the frame rate and for the duration of another film.

    Args:
        scenario: The scenario; its conditions of ending do not count.
        seed: Seed of the trial.
        film: The other film.
    """
    steps_s, poses, ring_on = _steps(scenario, seed, film.duration_s)
    exposure_s = min(scenario.overhead.exposure_ms / 1000, 1 / film.fps)
    frames_s = np.arange(0.0, film.duration_s - exposure_s, 1 / film.fps)
    at_s = frames_s + exposure_s / 2
    seen = poses[np.searchsorted(steps_s, at_s, side="right") - 1]  # headings of the step before do
    for robot in range(poses.shape[1]):
        for axis in (0, 1):
            seen[:, robot, axis] = np.interp(at_s, steps_s, poses[:, robot, axis])
    moments = (frames_s + share * exposure_s for share in (SEEN_SHARE, 1 - SEEN_SHARE))
    begin, end = (ring_on[np.searchsorted(steps_s, moment, side="right") - 1] for moment in moments)
    # between a step with a robot and one without it, it is nowhere
    is_there: BoolArray = np.logical_not(np.isnan(seen).any(axis=2))
    return SimulatedFilm(
        f"trial {seed} of {scenario.name}",
        frames_s,
        np.where(is_there[..., None], seen, np.nan),
        (begin | end) & is_there,
        (scenario.arena.width_cm, scenario.arena.height_cm),
    )


def _steps(scenario: EmbodiedScenario, seed: int, until_s: float) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Return (steps,) s, (steps, robots, 3) poses, and (steps, robots) whether rings are lit, of a trial."""
    times, poses, ring_on = [], [], []
    for step in Simulation(scenario, seed):
        times.append(step.time_s)
        poses.append(step.poses.copy())
        ring_on.append(step.ring_on & step.present)
        if step.time_s >= until_s:
            break
    return np.array(times), np.array(poses), np.array(ring_on)


def track_simulated(simulated: SimulatedFilm, film: Track) -> Track:
    """Return what is found in a simulated film, judged by the rules of another film.

    Args:
        simulated: The simulated film.
        film: The other film. The number of robots is told of the simulated one if it was told of this one.

    Raises:
        FilmError: The simulated film is too short, or has no flashes.
    """
    linker = FlashLinker()
    for time_s, poses, is_lit in zip(simulated.times_s.tolist(), simulated.poses, simulated.is_lit, strict=True):
        linker.add(time_s, [_ring(x_cm, y_cm) for x_cm, y_cm in poses[is_lit, :2].tolist()])
    counted = CountedRings(
        frames=len(simulated.times_s),
        start_s=0.0,
        times_s=simulated.times_s,
        counts=simulated.is_lit.sum(axis=1),
        areas_px=np.zeros(len(simulated.times_s), np.int64),
        flashes=linker.flashes,
        outside=0,
        always_lit=(),
        geometry=film.geometry._replace(floor_cm=simulated.floor_cm),
    )
    robots = None if film.options.robots is None else simulated.is_lit.shape[1]
    return analyse(simulated.name, counted, film.options._replace(robots=robots), ())


def _ring(x_cm: float, y_cm: float) -> Ring:
    return Ring(x_cm, y_cm, epuck.RING_RADIUS_CM, 0.0, 0.0, 0.0, 100.0)
