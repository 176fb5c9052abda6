"""The sensors of a group, by the kind of its signal, and what of signals is on its way to a robot."""

from collections.abc import Callable

from epuck_sim.arrays import ByteArray
from epuck_sim.embodied.sensors.camera import NEVER, look, take_pictures
from epuck_sim.embodied.sensors.flash_cone import perceive_flashes
from epuck_sim.embodied.sensors.infrared import sense_infrared
from epuck_sim.embodied.sensors.radio import receive_pulses
from epuck_sim.embodied.sensors.reflections import add_reflections
from epuck_sim.embodied.swarm import Swarm, swarm_at
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.rng import uniform


def sensors_of(section: RobotGroup) -> list[Callable[..., None]]:
    """Return what a control step calls, in this order, to have a group sense: functions (block, addresses, group)."""
    if section.signal.kind != "camera":
        return [sense_infrared, receive_pulses if section.signal.kind == "radio" else perceive_flashes]
    camera = section.camera
    mirrors, waits = camera.reflection_range_cm > 0, camera.frames_per_s is not None
    return [sense_infrared, look, *[add_reflections] * mirrors, *[take_pictures] * waits]


@jit_no_alloc
def begin_pictures(block: ByteArray, number: int) -> None:
    """Draw when the cameras of a group take their first pictures, which is in the first interval."""
    swarm = swarm_at(block)
    group = swarm.groups[number]
    for member in range(group.count):
        robot = swarm.robots[group.first + member]
        robot.first_picture = group.camera.interval * uniform(robot.signal_random)
        robot.picture_arrives = NEVER


def forget_signals(swarm: Swarm, robot: int) -> None:
    """Have neither a picture nor a pulse be on its way to a robot; its camera goes on at its instants."""
    swarm.robots[robot].picture_arrives = NEVER
    group = next(group for group in swarm.groups if group.first <= robot < group.first + group.count)
    first = group.radio.first + robot - group.first
    swarm.air.count[first : first + group.radio.slots * group.count : group.count] = 0
