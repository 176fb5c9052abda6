"""The differential drive: from what controllers command to the motion of the body over one control step.

A robot whose wheels keep their speeds moves along an arc. Rigid bodies are given the velocity along the arc's chord, so
that one that touches nothing ends the step exactly on the arc, with the heading that belongs there.
"""

import math

from epuck_sim.embodied.swarm import Swarm
from epuck_sim.util.elementary import sin, sin_cos
from epuck_sim.util.jit import jit_no_alloc


@jit_no_alloc
def apply_commands(swarm: Swarm) -> int:
    """Carry out wheels, turns and rings as commanded; return the first robot whose command is no number, or -1."""
    slip, step_s = swarm.scene[0].slip, swarm.scene[0].step_s
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        limit = robot.wheel_limit_cm_s
        left, right, turn = robot.actuators.left_cm_s, robot.actuators.right_cm_s, robot.actuators.turn_rad
        if math.isnan(left) or math.isnan(right) or not math.isfinite(turn):
            return number
        robot.left_cm_s = min(max(left, -limit), limit)
        robot.right_cm_s = min(max(right, -limit), limit)
        robot.turn_rad = turn
        robot.ring_command = robot.actuators.ring_on != 0
        robot.ring_on = robot.ring_command
        # a noise of 0 makes a wheel's speed 1 - slip times itself, 1 makes it 1 + slip times (Enki); turns come first
        noise, gain = robot.wheel_noise, robot.wheel_gain
        if gain[0] == gain[1] == 0.0:  # it is stuck
            turn = 0.0
        left = robot.left_cm_s * (1.0 + slip * (2.0 * noise[0] - 1.0)) * gain[0]
        right = robot.right_cm_s * (1.0 + slip * (2.0 * noise[1] - 1.0)) * gain[1]
        spin = (right - left) / robot.wheel_base_cm
        half = 0.5 * spin * step_s
        # the chord is shorter than the arc by sin(half) / half
        chord = 0.5 * (left + right) * (sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        sine, cosine = sin_cos(robot.heading + turn + half)
        robot.vx, robot.vy, robot.spin = chord * cosine, chord * sine, spin + turn / step_s
    return -1
