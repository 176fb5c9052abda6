"""How real robots deviate from ideal ones: they differ from each other, and get stuck (thesis 4.4).

Each robot draws from a stream of its own, so that adding robots changes nothing for the others.
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
    drawn = np.array([[2 * uniform(stream) - 1 for _ in range(_DRAWS)] for stream in streams])
    both = 1 + spread.wheel_speed * drawn[:, :1]
    each = 1 + spread.wheel_imbalance * drawn[:, 1:3]
    return RobotVariation(both * each, 1 + spread.clock_rate * drawn[:, 3], 1 + spread.infrared_gain * drawn[:, 4:])


class RobotClocks:
    """The robots' own clocks, which count whole milliseconds."""

    def __init__(self, rates: FloatArray, step_ms: int, elapsed_ms: IntArray) -> None:
        """Set the clocks' rates.

        Args:
            rates: (robots,) rate of each clock, relative to real time.
            step_ms: Milliseconds of a control step.
            elapsed_ms: (robots,) ms that pass on each clock in a control step; written.
        """
        self._step_ms = step_ms * rates
        self._elapsed_ms = elapsed_ms

    def tick(self, step: int) -> None:
        """Write the ms until the next control step by each clock: 25, 25, 26 ...; fractions carry over."""
        self._elapsed_ms[:] = np.floor((step + 1) * self._step_ms) - np.floor(step * self._step_ms)


class Stoppages:
    """Random stoppages: robots are free and stuck by turns for exponentially distributed times, free at first."""

    def __init__(self, section: StuckSection, step_s: float, streams: StreamArray, wheel_gain: FloatArray) -> None:
        """Begin with all robots free.

        Args:
            section: How often robots get stuck, and for how long.
            step_s: Seconds of a control step.
            streams: (robots, 4) random streams.
            wheel_gain: (robots, 2) factor of each wheel's speed when free; written: 0 while a robot is stuck.
        """
        robots = len(streams)
        self._step_s = step_s
        mean_free_s, mean_stuck_s = 3600 / section.per_hour, section.mean_s
        until_s, is_stuck = np.zeros(robots), np.ones(robots, np.bool_)  # at time 0 all are released
        free_gain = wheel_gain.copy()
        self._arguments = (mean_free_s, mean_stuck_s, streams, until_s, is_stuck, free_gain, wheel_gain)

    def tick(self, step: int) -> None:
        """Stop and release the robots whose turn has come by this control step."""
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
    """Update (robots, 2) wheel_gain and (robots,) is_stuck, whose values hold until the times (robots,) until_s."""
    for robot in range(len(until_s)):
        while until_s[robot] <= time_s:
            is_stuck[robot] = not is_stuck[robot]
            mean_s = mean_stuck_s if is_stuck[robot] else mean_free_s
            until_s[robot] -= mean_s * math.log(1.0 - uniform(streams[robot]))
        for wheel in range(2):
            wheel_gain[robot, wheel] = 0.0 if is_stuck[robot] else free_gain[robot, wheel]
