"""The sensors of a group, by the kind of its signal, and what of signals is on its way to a robot."""

from collections.abc import Callable

from epuck_sim.embodied.sensors.camera import NEVER, look, take_pictures
from epuck_sim.embodied.sensors.flash_cone import perceive_flashes
from epuck_sim.embodied.sensors.infrared import sense_infrared
from epuck_sim.embodied.sensors.radio import receive_pulses
from epuck_sim.embodied.sensors.reflections import add_reflections
from epuck_sim.embodied.swarm import Swarm
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.rng import uniform


def sensors_of(section: RobotGroup) -> list[Callable[..., None]]:
    """Return what a control step calls, in this order, to have a group sense: functions (block, addresses, group)."""
    if section.signal.kind != "camera":
        return [sense_infrared, perceive_flashes if section.signal.kind == "cone" else receive_pulses]
    camera = section.camera
    mirrors, waits = camera.reflection_range_cm > 0, camera.frames_per_s is not None
    return [sense_infrared, look, *[add_reflections] * mirrors, *[take_pictures] * waits]


@jit_inline
def restart_signals(swarm: Swarm, number: int) -> None:
    """Set what brings flashes to a group to before the first step; cameras draw when they take their first pictures."""
    group = swarm.groups[number]
    interval, pictures = group.camera.interval, group.count * group.pixels
    for pixel in range(pictures):
        swarm.pixels[group.row + pixel] = 0
        swarm.pixels[group.in_view + pixel] = 0
        swarm.pixels[group.waiting + pixel] = 0
    for place in range(group.radio.slots * group.count):
        swarm.air[group.radio.first + place].count = 0
    if interval == 0.0:
        return
    for place in range(group.count):
        robot = swarm.robots[group.first + place]
        robot.first_picture = interval * uniform(robot.signal_random)
        robot.pictures = 0
        robot.picture_arrives = NEVER


def forget_signals(swarm: Swarm, robot: int) -> None:
    """Have neither a picture nor a pulse be on its way to a robot; its camera goes on at its instants.

    Args:
        swarm: The swarm, of `open_block`.
        robot: Number of the robot.
    """
    swarm.robots[robot].picture_arrives = NEVER
    group = next(group for group in swarm.groups if group.first <= robot < group.first + group.count)
    first = group.radio.first + robot - group.first
    swarm.air.count[first : first + group.radio.slots * group.count : group.count] = 0
