"""What real robots have and ideal ones do not: they differ from each other, and get stuck (thesis 4.4).

Each robot draws from a stream of its own, so that further robots change nothing for those that are there.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.scenario.embodied import SpreadSection, StuckSection
from epuck_sim.util.jit import jit
from epuck_sim.util.rng import uniform

_DRAWS = 4 + SENSORS
"""Of a robot's traits; all are drawn, whatever the spread, so that none decides what another is."""


class RobotVariation(NamedTuple):
    """In what robots differ: factors, 1 of a robot that is as it should be."""

    wheel_gain: FloatArray
    """(robots, 2) what becomes of the speed of the left and the right wheel."""
    clock_rate: FloatArray
    """(robots,) how fast a robot's clock runs."""
    infrared_gain: FloatArray
    """(robots, 8) what becomes of each sensor's reading."""


def draw_variation(spread: SpreadSection, streams: StreamArray) -> RobotVariation:
    """Return the traits of robots, from (robots, 4) their streams, which advance."""
    drawn = np.array([[2 * uniform(stream) - 1 for _ in range(_DRAWS)] for stream in streams])
    both = 1 + spread.wheel_speed * drawn[:, :1]
    each = 1 + spread.wheel_imbalance * drawn[:, 1:3]
    return RobotVariation(both * each, 1 + spread.clock_rate * drawn[:, 3], 1 + spread.infrared_gain * drawn[:, 4:])


class RobotClocks:
    """Robots' own clocks, which run in whole milliseconds."""

    def __init__(self, rates: FloatArray, step_ms: int, passed_ms: IntArray) -> None:
        """rates: (robots,) of real time; step_ms: the control step's; passed_ms: (robots,) is written to."""
        self._step_ms = step_ms * rates
        self._passed_ms = passed_ms

    def tick(self, step: int) -> None:
        """Write what passes on each clock up to the next control step: 25, 25, 26 ... ms, of which none is lost."""
        self._passed_ms[:] = np.floor((step + 1) * self._step_ms) - np.floor(step * self._step_ms)


class Stoppages:
    """What robots get stuck on: after random times, for random times, both exponential. All begin free."""

    def __init__(self, section: StuckSection, step_s: float, streams: StreamArray, wheel_gain: FloatArray) -> None:
        """streams: (robots, 4); wheel_gain: (robots, 2) of free robots; is written to, 0 while a robot is stuck."""
        robots = len(streams)
        self._step_s = step_s
        self._arguments = (
            *(3600 / section.per_hour, section.mean_s, streams),
            *(np.zeros(robots), np.ones(robots, np.bool_), wheel_gain.copy(), wheel_gain),
        )

    def tick(self, step: int) -> None:
        """Stop and release those whose time has come by this control step."""
        _stop_and_release(step * self._step_s, *self._arguments)


@jit
def _stop_and_release(
    time_s: float,
    mean_free_s: float,
    mean_stuck_s: float,
    streams: StreamArray,
    until_s: FloatArray,
    is_stuck: BoolArray,
    free_gain: FloatArray,
    wheel_gain: FloatArray,
) -> None:
    """Bring (robots, 2) wheel_gain up to date; (robots,) is_stuck holds until the times until_s."""
    for robot in range(len(until_s)):
        while until_s[robot] <= time_s:
            is_stuck[robot] = not is_stuck[robot]
            mean_s = mean_stuck_s if is_stuck[robot] else mean_free_s
            until_s[robot] -= mean_s * math.log(1.0 - uniform(streams[robot]))
        for wheel in range(2):
            wheel_gain[robot, wheel] = 0.0 if is_stuck[robot] else free_gain[robot, wheel]
