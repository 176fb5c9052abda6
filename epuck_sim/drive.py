"""The differential drive: from wheel speeds to the motion of the body over one control step.

A robot whose wheels keep their speeds moves along an arc. Rigid bodies are given the velocity along the arc's chord, so
that one that touches nothing ends the step exactly on the arc, with the heading that belongs there.
"""

import math

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.compiled import kernel

_LIMIT = epuck.WHEEL_LIMIT_CM_S
_BASE = epuck.WHEEL_BASE_CM


@kernel
def limit_speeds(wheels_cm_s: npt.NDArray[np.float64]) -> int:
    """Bring (robots, 2) wheel speeds within the wheels' limit; return the first robot with one that is NaN, or -1."""
    for robot in range(len(wheels_cm_s)):
        for wheel in range(2):
            speed = wheels_cm_s[robot, wheel]
            if math.isnan(speed):
                return robot
            wheels_cm_s[robot, wheel] = min(max(speed, -_LIMIT), _LIMIT)
    return -1


@kernel
def chord_velocities(
    poses: npt.NDArray[np.float64],
    wheels_cm_s: npt.NDArray[np.float64],
    factors: npt.NDArray[np.float64],
    step_s: float,
    velocities: npt.NDArray[np.float64],
) -> None:
    """Write (robots, 3) velocities, cm/s, cm/s, rad/s, that take each robot to the end of its arc in `step_s`.

    poses: (robots, 3); wheels_cm_s: (robots, 2) left and right; factors: (robots, 2) what each is multiplied by.
    """
    for robot in range(len(poses)):
        left = wheels_cm_s[robot, 0] * factors[robot, 0]
        right = wheels_cm_s[robot, 1] * factors[robot, 1]
        speed = 0.5 * (left + right)
        turn = (right - left) / _BASE
        half = 0.5 * turn * step_s
        # the chord is shorter than the arc by sin(half) / half
        chord = speed * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        velocities[robot, 0] = chord * math.cos(poses[robot, 2] + half)
        velocities[robot, 1] = chord * math.sin(poses[robot, 2] + half)
        velocities[robot, 2] = turn
