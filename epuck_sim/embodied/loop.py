"""The control loop: move, sense, control, act, many steps in one call of compiled code (thesis 3.1.4.1).

Measures receive such a stretch of steps at once.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.embodied.bodies.chipmunk import move_bodies
from epuck_sim.embodied.bodies.world import World
from epuck_sim.embodied.changes.faults import blank_readings, change_faults, fail_actuators, freeze, hide_flashes, hold
from epuck_sim.embodied.changes.schedule import blank, rest
from epuck_sim.embodied.observers import MANY_SEEN, Scene, find_contacts, find_sightings
from epuck_sim.embodied.own_sensors import OwnSensor
from epuck_sim.embodied.sensors.camera import add_reflections, look, take_pictures
from epuck_sim.embodied.sensors.infrared import sense_infrared
from epuck_sim.embodied.sensors.signals import perceive_flashes, receive_pulses
from epuck_sim.embodied.swarm import BYTE, FLOAT64, HIDE, INT64, KEEP, PIXELS, Swarm, copy_array, open_block, swarm_at
from epuck_sim.embodied.user_code import GroupControllers
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.elementary import log, sin, sin_cos
from epuck_sim.util.generators import fill_doubles, fill_normals
from epuck_sim.util.jit import bind, jit_no_alloc
from epuck_sim.util.native import INTP, address_of, array_at, call
from epuck_sim.util.rng import uniform

DONE, FIRED, AT_WORK = -1, -2, -3
"""Outcomes of `take_steps`: no firing of the reference in the last step, a firing in it, or steps not yet taken."""


@jit_no_alloc
def tick(block: ByteArray, _addresses: IntArray, _number: int) -> None:
    """Write the ms until the next control step by each robot's own clock: 25, 25, 26 ...; fractions carry over."""
    swarm = swarm_at(block)
    step = swarm.scene[0].step
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        own_ms = robot.own_step_ms
        robot.sensors.step_ms = int(math.floor((step + 1) * own_ms) - math.floor(step * own_ms))


@jit_no_alloc
def stop_and_release(block: ByteArray, _addresses: IntArray, _number: int) -> None:
    """Switch robots between free and stuck after exponentially distributed times; they are free at first (4.4)."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    time_s = scene.step * scene.step_s
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        while robot.stuck_until_s <= time_s:
            robot.is_stuck = not robot.is_stuck
            mean_s = scene.mean_stuck_s if robot.is_stuck else scene.mean_free_s
            robot.stuck_until_s -= mean_s * log(1.0 - uniform(robot.variation_random))


@jit_no_alloc
def begin_step(block: ByteArray, addresses: IntArray) -> None:
    """Begin a control step, up to where robots sense: bodies move, unless it is the first, and noise is drawn."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    scene.step += 1
    if scene.step > 0 and not scene.moved_publicly:
        move_bodies(block, addresses)
    for number in range(len(swarm.robots) if scene.infrared_noise else 0):
        fill_normals(swarm.robots[number].infrared_noise, scene.noise_random)
    for number in range(len(swarm.robots) if scene.slip > 0.0 else 0):
        fill_doubles(swarm.robots[number].wheel_noise, scene.slip_random)


@jit_no_alloc
def apply_commands(swarm: Swarm) -> int:
    """Carry out wheels, turns and rings as commanded; return the first robot whose command is not a number, or -1.

    A robot whose wheels keep their speeds moves along an arc. Its rigid body gets the velocity along the arc's chord,
    so that, if it touches nothing, it ends the step exactly on the arc, with the right heading.
    """
    slip, step_s = swarm.scene[0].slip, swarm.scene[0].step_s
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        limit = robot.wheel_limit_cm_s
        left, right, turn = robot.actuators.left_cm_s, robot.actuators.right_cm_s, robot.actuators.turn_rad
        if math.isnan(left) or math.isnan(right) or not math.isfinite(turn):
            return number
        robot.left_cm_s = min(max(left, -limit), limit)
        robot.right_cm_s = min(max(right, -limit), limit)
        robot.ring_command = robot.actuators.ring_on != 0
        robot.ring_on = robot.ring_command
        # noise from 0 to 1 multiplies a wheel's speed by 1 - slip to 1 + slip (Enki); turns come first
        noise, gain = robot.wheel_noise, robot.wheel_gain
        left = robot.left_cm_s * (1.0 + slip * (2.0 * noise[0] - 1.0)) * gain[0]
        right = robot.right_cm_s * (1.0 + slip * (2.0 * noise[1] - 1.0)) * gain[1]
        if robot.is_stuck:
            left, right, turn = 0.0, 0.0, 0.0
        spin = (right - left) / robot.wheel_base_cm
        half = 0.5 * spin * step_s
        # the chord is shorter than the arc by sin(half) / half
        chord = 0.5 * (left + right) * (sin(half) / half if abs(half) > 1e-4 else 1.0 - half * half / 6.0)
        sine, cosine = sin_cos(robot.heading + turn + half)
        robot.vx, robot.vy, robot.spin = chord * cosine, chord * sine, spin + turn / step_s
    return -1


@jit_no_alloc
def act(block: ByteArray) -> int:
    """Carry out controllers' commands; return the first robot with a speed or turn that is not a number, or -1."""
    swarm = swarm_at(block)
    for robot in range(len(swarm.robots)):
        swarm.robots[robot].ring_before = swarm.robots[robot].ring_on  # as others see it
    return apply_commands(swarm)


@jit_no_alloc
def make_calls(block: ByteArray, addresses: IntArray, first: int, end: int) -> None:
    """Make the calls `first` to `end` - 1 of a control step."""
    calls = swarm_at(block).calls
    for index in range(first, end):
        call(addresses[calls[index].function], block, addresses, calls[index].argument)


@jit_no_alloc
def fires(block: ByteArray) -> bool:
    """Return whether the reference fires in this control step; to be called once in each (thesis 4.2.1).

    A robot fires when its ring is commanded to light up, or when the ring is already commanded to be lit and the phase
    falls. Commands count, even if the ring has a fault.
    """
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    if scene.reference < 0 or not swarm.robots[scene.reference].ring_command:
        scene.lit_phase = math.nan
        return False
    at = scene.reference_phase
    phase = array_at(block, at, at + 8, FLOAT64)[0]
    if not scene.reference_is_float:
        phase = float(array_at(block, at, at + 8, INT64)[0])
    is_firing = math.isnan(scene.lit_phase) or phase < scene.lit_phase
    scene.lit_phase = phase
    return is_firing


@jit_no_alloc
def take_steps(block: ByteArray, addresses: IntArray, steps: int, until_firing: bool) -> int:
    """Take a number of control steps; with `until_firing`, stop after a step in which the reference fires.

    Bodies move before each step but the first. All robots sense the same instant, as rings and wheels take effect after
    all controllers have run. A speed or a turn that is not a number ends the loop: then return the first robot whose
    controller set one; else `FIRED` if the reference fires in the last step, or `DONE`.
    """
    scene = swarm_at(block).scene[0]
    late, calls = scene.late, scene.calls
    is_firing = False
    for _ in range(steps):
        begin_step(block, addresses)
        make_calls(block, addresses, 0, late)
        invalid = act(block)
        if invalid >= 0:
            return invalid
        make_calls(block, addresses, late, calls)
        is_firing = fires(block)
        if is_firing and until_firing:
            break
    return FIRED if is_firing else DONE


@jit_no_alloc
def act_again(block: ByteArray, addresses: IntArray) -> None:
    """Carry out the actuators' commands from the last control step on, as if controllers had given them in it."""
    swarm = swarm_at(block)
    scene = swarm.scene[0]
    if scene.step >= 0:  # before the first step, no robot can act
        apply_commands(swarm)
        make_calls(block, addresses, scene.late, scene.calls)


@jit_no_alloc
def act_together(
    block: ByteArray,
    addresses: IntArray,
    places: IntArray,
    copies: ByteArray,
    swarms: IntArray,
    steps: int,
    agents: IntArray,
    commands: FloatArray,
) -> None:
    """Take steps, until the reference fires, of swarms by their numbers, in whose place their outcomes are written.

    Before, agents carry out commands, (swarms, agents, numbers): left and right wheel in cm/s if there are two or more,
    and whether the ring is lit, above 0, if there are one or three. A row of `copies` holds the beginning of a swarm's
    block, and is updated at the end. A row of `places` has the offsets in bytes of a swarm's block and addresses from
    those of the first swarm.
    """
    numbers = commands.shape[2]
    for place in range(len(swarms)):
        swarm, swarms[place] = swarms[place], AT_WORK
        own = array_at(block, places[swarm, 0], places[swarm, 0] + len(block), BYTE)
        calls = array_at(addresses, places[swarm, 1], places[swarm, 1] + 8 * len(addresses), INT64)
        copy = array_at(copies, swarm * copies.shape[1], (swarm + 1) * copies.shape[1], BYTE)
        for agent in range(len(agents)):
            actuators = swarm_at(own).robots[agents[agent]].actuators
            if numbers >= 2:
                actuators.left_cm_s, actuators.right_cm_s = commands[swarm, agent, 0], commands[swarm, agent, 1]
            if numbers != 2:
                actuators.ring_on = commands[swarm, agent, numbers - 1] > 0.0
        act_again(own, calls)
        swarms[place] = take_steps(own, calls, steps, True)
        copy_array(array_at(own, 0, len(copy), INT64), array_at(copy, 0, len(copy), INT64))


SENSORS: Mapping[Callable[..., None], Callable[[RobotGroup], bool]] = {
    sense_infrared: lambda _: True,
    look: lambda group: group.signal.kind == "camera",
    add_reflections: lambda group: group.signal.kind == "camera" and group.camera.reflection_range_cm > 0,
    take_pictures: lambda group: group.signal.kind == "camera" and group.camera.frames_per_s is not None,
    perceive_flashes: lambda group: group.signal.kind in ("cone", "enki_camera"),
    receive_pulses: lambda group: group.signal.kind == "radio",
}
"""Functions (block, addresses, group) by which groups sense, in the order of their calls, and whether a group has each.
"""


def plan_calls(
    scenario: EmbodiedScenario, sensors: Sequence[OwnSensor], controllers: Sequence[GroupControllers]
) -> tuple[list[tuple[Any, int]], list[tuple[Any, int]]]:
    """Return the calls before and after commands are carried out: functions (block, addresses, number) and numbers."""
    differ, faulty = scenario.spread.clock_rate > 0, bool(scenario.faults)
    groups = [number for number, section in enumerate(scenario.robots) if section.count]  # kernels need one
    early = [
        *([(tick, 0)] * differ),
        *([(stop_and_release, 0)] * (scenario.stuck.per_hour > 0)),
        *([(change_faults, 0)] * faulty),
        *((hold, group) for group in groups if faulty),
        *((sense, group) for group in groups for sense, has in SENSORS.items() if has(scenario.robots[group])),
        *((sensor, number) for number, sensor in enumerate(sensors) if sensor.robots.start < sensor.robots.stop),
        *((blank_readings, group) for group in groups if faulty),
        *((blank, group) for group in groups if scenario.members_change),
        *((controllers[group], group) for group in groups),
        *((freeze, group) for group in groups if faulty),
    ]
    return early, [*([(fail_actuators, 0)] * faulty), *([(rest, 0)] * scenario.members_change)]


class ControlLoop:
    """The control loop of a swarm in this process: compiled, or in plain Python (see `_in_python`)."""

    addresses: IntArray  # addresses of all that a control step calls
    functions: Mapping[int, Any]
    """The kernels, controllers and sensors that it calls, by their indices in the addresses."""
    is_compiled: bool  # whether `take_steps` is compiled; else it is plain Python

    def __init__(
        self,
        scenario: EmbodiedScenario,
        scene: Scene,
        world: World,
        sensors: Sequence[OwnSensor],
        groups: Sequence[GroupControllers],
        *,
        interpret: bool,
    ) -> None:
        """Compile the kernels that a control step calls, and write the numbers of all its calls to the block."""
        block, swarm = scene.block, scene.swarm
        early, late = plan_calls(scenario, sensors, groups)
        every = [*early, *late]
        addresses = world.addresses()
        if swarm.scene[0].hides_flashes:
            addresses[HIDE] = address_of(hide_flashes, INTP)
        for group in groups:
            addresses += group.addresses(len(addresses))
        numbers = {group: int(swarm.groups[number].controller) for number, group in enumerate(groups)}
        for function, _ in every:
            if function not in numbers:
                numbers[function] = len(addresses)
                addresses.append(function.address if isinstance(function, OwnSensor) else address_of(function, INTP))
        swarm.calls[: len(every)] = [(numbers[function], argument) for function, argument in every]
        swarm.scene[0].late, swarm.scene[0].calls = len(early), len(every)
        self.functions = {number: function for function, number in numbers.items()}
        self.addresses = np.array(addresses, np.int64)
        self.kept: IntArray = np.zeros(0, np.int64)  # what cameras keep, see `KEEP`
        world.use(block, swarm, self.addresses)
        self.is_compiled = not (interpret or world.is_public)
        kernel: Any = take_steps  # called without a detour, for observers of every step
        self.take_steps: Any = kernel.for_python if self.is_compiled else _in_python(swarm, world, every)
        self.take_steps(block, self.addresses, 0, False)  # compiles now, so that no trial's time includes it


def _in_python(swarm: Swarm, world: World, calls: Sequence[tuple[Any, int]]) -> Any:
    """Return `take_steps` as plain Python, for controllers that are interpreted, or bodies that Python moves."""
    steps: Any = take_steps
    functions = [getattr(function, "run", function) for function, _ in calls]

    def begin(block: ByteArray, addresses: IntArray) -> None:
        if world.is_public and swarm.scene[0].step >= 0:
            world.step()
        begin_step(block, addresses)

    def make(block: ByteArray, addresses: IntArray, first: int, end: int) -> None:
        for index in range(first, end):
            functions[index](block, addresses, calls[index][1])

    return bind(steps.function, swarm_at=lambda _: swarm, begin_step=begin, make_calls=make)


MOST_STEPS = 50
"""Largest number of steps that compiled code takes before Python has its turn, for Ctrl-C and for progress."""


@dataclass
class Stretch:
    """Consecutive steps, in one arena with the same robots; the last of them is the simulation's last step.

    The arrays are overwritten by the next stretch: copy what you keep.
    """

    first: int  # number of the first step
    present: BoolArray  # (robots,): whether each robot is in the arena
    scene: Scene  # the arena and its robots, for observers
    kept: IntArray | None  # (sightings, 3) whom cameras saw lit, by number of the step; None if they kept not all
    keep: Callable[[], None]  # has cameras keep whom they see in the next stretches, if they can
    poses: FloatArray  # (steps, robots, 3) cm, cm, rad: x, y, heading
    wheels_cm_s: FloatArray  # (steps, robots, 2) cm/s: left and right wheel as commanded
    ring_on: BoolArray  # (steps, robots): whether the ring is lit
    ring_before: BoolArray  # (steps, robots): whether it was lit before controllers acted, as others see it
    flash_seen: BoolArray  # (steps, robots): whether the robot sees a flash, as `Step.flash_seen`

    @cached_property
    def sightings(self) -> IntArray:
        """(sightings, 3) step from 0, robot that looks, and robot whose lit ring it sees, as `Step.sightings`."""
        self.keep()
        if self.kept is None:
            return find_sightings(self.scene, self.poses, self.present, self.ring_before)
        found: IntArray = self.kept[self.present[self.kept[:, 1]]]
        found[:, 0] -= self.first
        return found

    @cached_property
    def views(self) -> IntArray:
        """(views, 3) step from 0, robot that looks, and robot that is in its view, lit or not."""
        return find_sightings(self.scene, self.poses, self.present)

    @cached_property
    def contacts(self) -> IntArray:
        """(contacts, 3) step from 0, robot, and the robot that it touches, or -1, as `Step.contacts`."""
        return find_contacts(self.scene, self.poses)[0]


@jit_no_alloc
def record_steps(
    block: ByteArray,
    addresses: IntArray,
    steps: int,
    poses: FloatArray,
    wheels_cm_s: FloatArray,
    ring_on: BoolArray,
    ring_before: BoolArray,
    flash_seen: BoolArray,
    places: IntArray,
) -> int:
    """Take control steps until the reference fires, as `take_steps` does, and write each to arrays as in `Stretch`.

    A robot sees a flash if not all bytes of the block are 0 between its `places`, (robots, 2) first and end.
    """
    robots = swarm_at(block).robots
    outcome = DONE
    for step in range(steps):
        outcome = take_steps(block, addresses, 1, True)
        if outcome >= 0:
            break
        for number in range(len(robots)):
            robot = robots[number]
            poses[step, number, 0], poses[step, number, 1], poses[step, number, 2] = robot.x, robot.y, robot.heading
            wheels_cm_s[step, number, 0], wheels_cm_s[step, number, 1] = robot.left_cm_s, robot.right_cm_s
            ring_on[step, number], ring_before[step, number] = robot.ring_on, robot.ring_before
            flash_seen[step, number] = block[places[number, 0] : places[number, 1]].any()
        if outcome == FIRED:
            break
    return outcome


class History:
    """Takes steps of a simulation's control loop in one arena, and records them for measures."""

    def __init__(self, scene: Scene, loop: ControlLoop) -> None:
        self._loop, self._block, swarm = loop, scene.block, scene.swarm
        self._present: BoolArray = swarm.robots.present
        robots, places = len(swarm.robots), []
        self._arrays: tuple[Any, ...] = (
            *(np.zeros((MOST_STEPS, robots, columns)) for columns in (3, 2)),
            *(np.zeros((MOST_STEPS, robots), np.bool_) for _ in range(3)),
        )
        for group in swarm.groups:  # `flash_seen` in its memories, or else its pixels
            field = loop.functions[group.controller].controller.memory.fields.get("flash_seen")
            row = swarm.scene[0].at[PIXELS] + 8 * group.row, 8 * group.pixels, 8 * group.pixels
            first, apart, length = (group.memory + field[1], group.memory_bytes, 8) if field else row
            places.append((first + apart * np.arange(group.count))[:, None] + [0, length])
        self._places = np.concatenate(places)
        record: Any = record_steps
        in_python = {"take_steps": loop.take_steps, "swarm_at": lambda _: swarm}
        self._record = record if loop.is_compiled else bind(record.function, **in_python)
        copy = scene.block.copy()  # in which observers put robots where they were
        self._scene = Scene(scene.groups, copy, open_block(copy))
        self._circles = [each.view(np.ndarray) for each in (self._scene.swarm.circles, swarm.circles)]  # quicker
        signals = {group.signal.kind for group in scene.groups}  # others do not look for all rings
        self._can_keep = signals <= {"camera", "radio"} and not swarm.scene[0].hides_flashes

    def take(self, steps: int) -> int:
        """Take up to this number of steps, as `record_steps` does."""
        self._loop.kept[:1] = 0
        return int(self._record(self._block, self._loop.addresses, steps, *self._arrays, self._places))

    def stretch(self, first: int, steps: int) -> Stretch:
        """Return the steps just taken: this number of them, from step `first` on."""
        self._circles[0][:] = self._circles[1]  # movables move
        kept = self._loop.kept
        are_all = len(kept) and 3 * kept[0] <= kept[1]
        found = kept[2 : 2 + 3 * kept[0]].reshape(-1, 3) if are_all else None
        return Stretch(first, self._present, self._scene, found, self._keep, *(each[:steps] for each in self._arrays))

    def _keep(self) -> None:
        loop, robots = self._loop, len(self._present)
        if self._can_keep and not len(loop.kept):
            room = 3 * MOST_STEPS * robots * min(robots, MANY_SEEN)
            loop.kept = np.zeros(2 + room, np.int64)
            loop.kept[1] = room
            loop.addresses[KEEP] = loop.kept.ctypes.data - self._block.ctypes.data


def check_command(name: str, values: npt.NDArray[Any], robots: IntArray) -> None:
    """Raise ValueError if a command, by its name in `ACTUATORS`, to these robots is not allowed."""
    part = "ring" if name == "ring_on" else "wheels"
    if not len(robots):
        instead = f"give a group `controller: external`, external_{part} or a file with EXTERNAL = ({part!r},)"
        raise ValueError(f"{name} is given, but no robot has its {part} commanded from outside; {instead}")
    if values.shape not in ((), robots.shape):
        allowed = f"one value for each robot with {part} commanded from outside, or a single one for all"
        raise ValueError(f"{name} has the shape {values.shape}; allowed: {robots.shape}, {allowed}")
    allowed, fits = "numbers, in cm/s", np.zeros(values.shape, np.bool_)
    if part == "ring":
        allowed, fits = "true and false, or 1 and 0", (values == 0) | (values == 1)
    elif values.dtype.kind in "iuf":
        fits = ~np.isnan(values)
    if not fits.all():
        robot = robots[np.broadcast_to(fits, robots.shape).argmin()]
        raise ValueError(f"{name} is {values[~fits][0]} for robot {robot}; allowed: {allowed}")
