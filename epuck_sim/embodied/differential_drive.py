"""The differential drive: from wheel speeds to the motion of the body over one control step.

A robot whose wheels keep their speeds moves along an arc. Rigid bodies are given the velocity along the arc's chord, so
that one that touches nothing ends the step exactly on the arc, with the heading that belongs there.
"""

import math

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.util.jit import jit_no_alloc

_LIMIT = epuck.WHEEL_LIMIT_CM_S
_BASE = epuck.WHEEL_BASE_CM


@jit_no_alloc
def apply_commands(
    actuators: npt.NDArray[np.void],
    wheels_cm_s: FloatArray,
    ring_on: BoolArray,
    poses: FloatArray,
    gain: FloatArray,
    noise: FloatArray,
    slip: float,
    step_s: float,
    velocities: FloatArray,
) -> int:
    """Carry out what controllers command; return the first robot with a wheel speed that is no number, or -1.

    actuators: (robots,) see `controller.ACTUATORS`. Written are (robots, 2) wheels_cm_s, within the wheels' limit, and
    (robots,) ring_on; the other arguments are those of `chord_velocities`, which writes velocities.
    """
    for robot in range(len(actuators)):
        left, right = actuators[robot].left_cm_s, actuators[robot].right_cm_s
        if math.isnan(left) or math.isnan(right):
            return robot
        wheels_cm_s[robot, 0] = min(max(left, -_LIMIT), _LIMIT)
        wheels_cm_s[robot, 1] = min(max(right, -_LIMIT), _LIMIT)
        ring_on[robot] = actuators[robot].ring_on != 0
    chord_velocities(poses, wheels_cm_s, gain, noise, slip, step_s, velocities)
    return -1


@jit_no_alloc
def chord_velocities(
    poses: FloatArray,
    wheels_cm_s: FloatArray,
    gain: FloatArray,
    noise: FloatArray,
    slip: float,
    step_s: float,
    velocities: FloatArray,
) -> None:
    """Write (robots, 3) velocities, cm/s, cm/s, rad/s, that take each robot to the end of its arc in `step_s`.

    poses: (robots, 3); wheels_cm_s: (robots, 2) left and right; gain: (robots, 2) each wheel's factor, 1 of one that
    does as it is told, 0 of one that does not move its robot; noise: (robots, 2) from [0, 1), which makes each speed
    that much of the way from 1 - slip to 1 + slip times itself (Enki).
    """
    for robot in range(len(poses)):
        left = wheels_cm_s[robot, 0] * (1.0 + slip * (2.0 * noise[robot, 0] - 1.0)) * gain[robot, 0]
        right = wheels_cm_s[robot, 1] * (1.0 + slip * (2.0 * noise[robot, 1] - 1.0)) * gain[robot, 1]
        speed = 0.5 * (left + right)
        turn = (right - left) / _BASE
        half = 0.5 * turn * step_s
        # the chord is shorter than the arc by sin(half) / half
        chord = speed * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        velocities[robot, 0] = chord * math.cos(poses[robot, 2] + half)
        velocities[robot, 1] = chord * math.sin(poses[robot, 2] + half)
        velocities[robot, 2] = turn
