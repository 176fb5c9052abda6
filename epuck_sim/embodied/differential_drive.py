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
    turns_rad: FloatArray,
    poses: FloatArray,
    gain: FloatArray,
    slip: float,
    step_s: float,
    velocities: FloatArray,
    noise: FloatArray,
    noise_step: int,
) -> int:
    """Carry out what controllers command; return the first robot with a speed or a turn that is no number, or -1.

    Args:
        actuators: (robots,) records, see `control.interface.ACTUATORS`.
        wheels_cm_s: (robots, 2) cm/s: left and right wheel, within the wheels' limit; written.
        ring_on: (robots,) whether each ring is lit; written.
        turns_rad: (robots,) rad: turns on the spot; written.
        poses: See `chord_velocities`, which takes it, and the next four, too.
        gain: See `chord_velocities`.
        slip: See `chord_velocities`.
        step_s: See `chord_velocities`.
        velocities: See `chord_velocities`; written.
        noise: (steps, robots, 2) numbers from [0, 1) for some steps.
        noise_step: Index of the step whose noise is used.
    """
    for robot in range(len(actuators)):
        left, right = actuators[robot].left_cm_s, actuators[robot].right_cm_s
        if math.isnan(left) or math.isnan(right) or not math.isfinite(actuators[robot].turn_rad):
            return robot
        wheels_cm_s[robot, 0] = min(max(left, -_LIMIT), _LIMIT)
        wheels_cm_s[robot, 1] = min(max(right, -_LIMIT), _LIMIT)
        ring_on[robot] = actuators[robot].ring_on != 0
        turns_rad[robot] = actuators[robot].turn_rad
    chord_velocities(poses, turns_rad, wheels_cm_s, gain, noise[noise_step], slip, step_s, velocities)
    return -1


@jit_no_alloc
def chord_velocities(
    poses: FloatArray,
    turns_rad: FloatArray,
    wheels_cm_s: FloatArray,
    gain: FloatArray,
    noise: FloatArray,
    slip: float,
    step_s: float,
    velocities: FloatArray,
) -> None:
    """Write the velocities that take each robot to the end of its arc in `step_s`.

    A turn on the spot changes the arc at once; the body turns while it moves, which makes no difference to a disc.

    Args:
        poses: (robots, 3) cm, cm, rad: x, y, heading.
        turns_rad: (robots,) rad: turns on the spot before the wheels move.
        wheels_cm_s: (robots, 2) cm/s: left and right wheel.
        gain: (robots, 2) factor of each wheel's speed: 1 for an ideal wheel, 0 for a robot that is stuck.
        noise: (robots, 2) numbers from [0, 1); 0 makes a speed 1 - slip times itself, 1 makes it 1 + slip times (Enki).
        slip: Largest relative deviation of a wheel's speed.
        step_s: Seconds of a control step.
        velocities: (robots, 3) cm/s, cm/s, rad/s; written.
    """
    for robot in range(len(poses)):
        left = wheels_cm_s[robot, 0] * (1.0 + slip * (2.0 * noise[robot, 0] - 1.0)) * gain[robot, 0]
        right = wheels_cm_s[robot, 1] * (1.0 + slip * (2.0 * noise[robot, 1] - 1.0)) * gain[robot, 1]
        speed = 0.5 * (left + right)
        turn = (right - left) / _BASE
        half = 0.5 * turn * step_s
        # the chord is shorter than the arc by sin(half) / half
        chord = speed * (math.sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        heading = poses[robot, 2] + turns_rad[robot]
        velocities[robot, 0] = chord * math.cos(heading + half)
        velocities[robot, 1] = chord * math.sin(heading + half)
        velocities[robot, 2] = turn + turns_rad[robot] / step_s
