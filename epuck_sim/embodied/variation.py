"""How real robots deviate from ideal ones: they differ from each other, and get stuck (thesis 4.4).

Each robot draws from a stream of its own, so that adding robots changes nothing for the others.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.scenario.imperfections import SpreadSection, StuckSection
from epuck_sim.util.jit import jit, jit_no_alloc
from epuck_sim.util.rng import uniform

_DRAWS = 4 + SENSORS
"""Random numbers drawn for each robot; all are drawn, so that a spread of 0 leaves the other factors as they are."""


class RobotVariation(NamedTuple):
    """Factors in which robots differ; all are 1 for an ideal robot."""

    wheel_gain: FloatArray
    """(robots, 2) factor of the speed of the left and the right wheel."""
    clock_rate: FloatArray
    """(robots,) rate of a robot's clock, relative to real time."""
    infrared_gain: FloatArray
    """(robots, 8) factor of each infrared sensor's reading."""


def draw_variation(spread: SpreadSection, streams: StreamArray) -> RobotVariation:
    """Return factors drawn from the robots' streams, (robots, 4), which advance."""
    drawn = _draw(streams)
    both = 1 + spread.wheel_speed * drawn[:, :1]
    each = 1 + spread.wheel_imbalance * drawn[:, 1:3]
    return RobotVariation(both * each, 1 + spread.clock_rate * drawn[:, 3], 1 + spread.infrared_gain * drawn[:, 4:])


@jit
def _draw(streams: StreamArray) -> FloatArray:
    """Return (robots, _DRAWS) numbers from [-1, 1), one row from each stream."""
    drawn = np.empty((len(streams), _DRAWS))
    for robot in range(len(streams)):
        for draw in range(_DRAWS):
            drawn[robot, draw] = 2 * uniform(streams[robot]) - 1
    return drawn


class RobotClocks(NamedTuple):
    """The robots' own clocks, which count whole milliseconds."""

    step_ms: FloatArray
    """(robots,) ms of a control step by each clock; empty where all clocks are right."""
    elapsed_ms: IntArray
    """(robots,) whole ms until the next control step by each clock."""


@jit_no_alloc
def tick(clocks: RobotClocks, step: int) -> None:
    """Write the ms from this control step until the next by each clock: 25, 25, 26 ...; fractions carry over."""
    for robot in range(len(clocks.step_ms)):
        step_ms = clocks.step_ms[robot]
        clocks.elapsed_ms[robot] = int(math.floor((step + 1) * step_ms) - math.floor(step * step_ms))


class Stoppages(NamedTuple):
    """Random stoppages: robots are free and stuck by turns for exponentially distributed times, free at first."""

    mean_free_s: float
    """Mean time in seconds for which a robot is free."""
    mean_stuck_s: float
    """Mean time in seconds for which it is stuck."""
    streams: StreamArray
    """(robots, 4) random streams; no rows where robots never get stuck."""
    until_s: FloatArray
    """(robots,) times in seconds until which robots stay as they are."""
    is_stuck: BoolArray
    """(robots,) whether a robot is stuck."""
    free_gain: FloatArray
    """(robots, 2) factor of each wheel's speed when free."""
    wheel_gain: FloatArray
    """(robots, 2) factor of each wheel's speed: 0 while a robot is stuck."""


def begin_stoppages(section: StuckSection, streams: StreamArray, wheel_gain: FloatArray) -> Stoppages:
    """Return stoppages that free all robots at time 0; none for a section without any."""
    robots = len(streams) if section.per_hour > 0 else 0
    stoppages = Stoppages(
        mean_free_s=3600 / section.per_hour if robots else math.inf,
        mean_stuck_s=float(section.mean_s),
        streams=streams[:robots],
        until_s=np.empty(robots),
        is_stuck=np.empty(robots, np.bool_),
        free_gain=wheel_gain.copy(),
        wheel_gain=wheel_gain,
    )
    restart_stoppages(stoppages)
    return stoppages


def restart_stoppages(stoppages: Stoppages) -> None:
    """Free all robots at time 0; `wheel_gain` holds their factors when free."""
    stoppages.until_s[:] = 0.0
    stoppages.is_stuck[:] = True  # until time 0, when `stop_and_release` frees them
    stoppages.free_gain[:] = stoppages.wheel_gain


@jit_no_alloc
def stop_and_release(stoppages: Stoppages, time_s: float) -> None:
    """Stop and release the robots whose turn has come by this time."""
    for robot in range(len(stoppages.until_s)):
        while stoppages.until_s[robot] <= time_s:
            is_stuck = not stoppages.is_stuck[robot]
            stoppages.is_stuck[robot] = is_stuck
            mean_s = stoppages.mean_stuck_s if is_stuck else stoppages.mean_free_s
            stoppages.until_s[robot] -= mean_s * math.log(1.0 - uniform(stoppages.streams[robot]))
        for wheel in range(2):
            stuck = stoppages.is_stuck[robot]
            stoppages.wheel_gain[robot, wheel] = 0.0 if stuck else stoppages.free_gain[robot, wheel]
