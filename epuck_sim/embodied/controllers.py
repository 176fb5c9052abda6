"""Runs the controllers of a group of robots: compiled by numba, interpreted for breakpoints and any library, or in C.

Compiled and interpreted controllers run the same source, their file and `run_group` below, with equal results bit for
bit.
"""

import ctypes
import math
from collections.abc import Callable, Sequence
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.firmware import Firmware
from epuck_sim.control.interface import ACTUATORS, Controller, Sensor, Sensors, Wheels
from epuck_sim.control.names import check_sensed
from epuck_sim.embodied.swarm import BYTES, SENSED, Swarm, swarm_at
from epuck_sim.embodied.user_code import UserCode, completion, names_of_readings
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.native import address_of, array_at, call_c

Records = npt.NDArray[np.void]

E_GROUP = np.dtype(
    [
        *(("robots", np.int64), ("pixels", np.int64), ("memory_size", np.int64), ("parameters_size", np.int64)),
        *((name, np.intp) for name in ("step_ms", "distance_mm", "camera", "infrared", "new_picture", "pulses")),
        *((name, np.intp) for name in ("messages", "actuators", "memory", "parameters", "random")),
        *(("serving", np.intp), ("present", np.intp)),
    ]
)
"""Record `e_group` of the header: sizes, and addresses of arrays. Each robot has one, as a swarm of one robot."""

E_GROUP_BYTES = E_GROUP.itemsize

if TYPE_CHECKING:  # `bind` provides them
    start: Callable[..., None]
    step: Callable[..., None]
    complete: Callable[..., Any]
    MEMORY: np.dtype[Any]
    PARAMETERS: np.dtype[Any]


def run_group(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Run a control step of each robot of a group in the arena; if `scene.starts`, start those that are flagged."""
    swarm = swarm_at(block)
    scene, group = swarm.scene[0], swarm.groups[number]
    kept = group.count
    memories = array_at(block, group.memory, group.memory + (kept + 1) * group.memory_bytes, MEMORY)  # noqa: F821
    parameters = array_at(block, group.parameters, group.memory, PARAMETERS)[0]  # noqa: F821
    first = swarm.robots[group.first]
    wheels = Wheels(float(first.wheel_limit_cm_s), float(first.wheel_base_cm))
    for member in range(group.count):
        robot = swarm.robots[group.first + member]
        if not (robot.starts if scene.starts else robot.present):
            continue
        scene.serving = group.first + member
        memories[kept] = memories[member]
        scene.kept_random = robot.random
        scene.kept_actuators = robot.actuators
        if scene.starts:
            start(memories[member], parameters, robot.random[:])  # noqa: F821
            continue
        sensed, row = robot.sensors, group.row + member * group.pixels
        # slices, as numba takes arrays of different lengths in records for different types
        sensors = Sensors(
            int(sensed.step_ms),
            sensed.infrared[:],
            sensed.distance_mm[:],
            swarm.pixels[row : row + group.pixels],
            bool(sensed.new_picture),
            int(sensed.pulses),
            sensed.messages[:],
            wheels,
        )
        sensed_by_all = complete(sensors, block, swarm, group.sense, member)  # noqa: F821
        step(sensed_by_all, memories[member], robot.actuators, parameters, robot.random[:])  # noqa: F821
    scene.serving = -1


@jit_no_alloc
def _run_firmware(block: ByteArray, addresses: IntArray, number: int) -> None:
    """Do what `run_group` does, for firmware in C."""
    swarm = swarm_at(block)
    scene, group = swarm.scene[0], swarm.groups[number]
    function = addresses[group.controller + (1 if scene.starts else 2)]
    for member in range(group.count):
        robot = swarm.robots[group.first + member]
        if robot.starts if scene.starts else robot.present:
            scene.serving = group.first + member
            call_c(function, addresses[group.controller + 3] + member * E_GROUP_BYTES)
    scene.serving = -1


def bytes_needed(controller: Controller, robots: int) -> int:
    """Return the number of bytes that a group with this controller needs in `Swarm.bytes`."""
    return controller.parameter_type.itemsize + (robots + 1) * controller.memory.itemsize


def assign_bytes(swarm: Swarm, group: Any, controller: Controller, first: int) -> int:
    """Write to a GROUP where its controllers' bytes are, from `first` in `Swarm.bytes` on; return their end there."""
    parameters, memory = controller.parameter_type, controller.memory
    group.parameters = swarm.scene[0].at[BYTES] + first
    group.memory = group.parameters + parameters.itemsize
    group.memory_bytes = memory.itemsize
    group.phase = group.period = -1
    if controller.is_oscillator:
        assert memory.fields
        assert parameters.fields
        group.phase, group.period = memory.fields["phase_ms"][1], parameters.fields["period_s"][1]
        group.phase_is_float = memory["phase_ms"].kind == "f"
    return first + bytes_needed(controller, group.count)


class GroupControllers(UserCode):
    """The controllers of one group of robots."""

    controller: Controller  # controller of the robots

    def __init__(
        self,
        block: ByteArray,
        swarm: Swarm,
        number: int,
        controller: Controller,
        sensors: Sequence[Sensor] = (),
        *,
        interpret: bool = False,
    ) -> None:
        """Prepare a group's controllers without starting them; the block, which has room for them, stays as it is."""
        self._group = swarm.groups[number]
        super().__init__(controller, block, swarm, number, self._group)
        check_sensed(controller, names_of_readings(sensors))
        self.controller, self._of_firmware = controller, list[int]()
        if isinstance(controller, Firmware):
            self._e_groups = _e_groups(swarm, number)
            functions = (controller.library.e_start_all, controller.library.e_step_all)
            self._of_firmware = [ctypes.cast(function, ctypes.c_void_p).value or 0 for function in functions]
            self._of_firmware.append(self._e_groups.ctypes.data)
            self.run, self.address = _run_firmware, address_of(_run_firmware)
        else:
            names = {"start": controller.start, "step": controller.step, "complete": completion(tuple(sensors))}
            types = {"MEMORY": controller.memory, "PARAMETERS": controller.parameter_type}
            contents = repr([(each.name, each.readings) for each in sensors])
            self._make_run(run_group, names | types, contents, interpret=interpret)

    def addresses(self, first: int) -> list[int]:
        """Write to the group's record that its entries in the addresses begin at index `first`; return these entries.

        They are the address of `run`; for firmware also of `e_start_all`, `e_step_all` and the first robot's record.
        """
        self._group.controller = first
        return [self.address, *self._of_firmware]

    @property
    def memory(self) -> Records:
        """(robots,) memory of each robot, in place."""
        group = self._group
        return self._block[group.memory :][: group.count * group.memory_bytes].view(self.controller.memory)

    @property
    def parameters(self) -> Records:
        """(1,) the parameters of all robots, in place."""
        return self._block[self._group.parameters : self._group.memory].view(self.controller.parameter_type)

    @property
    def period_ms(self) -> float:
        """Period of the oscillators in ms; NaN if the robots are not oscillators."""
        return float(self.parameters["period_s"][0]) * 1000 if self.controller.is_oscillator else math.nan

    def start(self, members: Sequence[int] | None = None) -> None:
        """Start controllers of all robots, or of `members` (numbers in the group); clear their memory and actuators."""
        chosen = np.arange(self._group.count) if members is None else np.asarray(members, np.intp)
        robots = self._swarm.robots[self.robots]
        robots.starts = False
        robots.starts[chosen] = True
        robots.actuators[chosen] = np.zeros(1, ACTUATORS)
        self.memory[chosen] = np.zeros(1, self.controller.memory)
        self._scene.starts = True
        try:
            self.step()
        finally:
            self._scene.starts = False

    def step(self) -> None:
        """Run one control step of each robot that is in the arena; raise RobotError where a controller does."""
        addresses = np.array([0] * self._group.controller + self.addresses(self._group.controller))
        try:
            self.run(self._block, addresses, self._number)
        except BaseException as error:  # whatever a user's controller may raise
            if fault := self.fault(error):
                raise fault from error
            raise

    def _is_at_work(self) -> bool:
        return bool(not self._scene.sensing and self.robots.start <= self._scene.serving < self.robots.stop)

    def _undo(self, block: ByteArray, swarm: Swarm, robot: int) -> None:
        scene, group, served = swarm.scene[0], self._group, swarm.robots[robot]
        served.random, served.actuators = scene.kept_random, scene.kept_actuators
        kept = group.memory + group.count * group.memory_bytes
        memory = group.memory + (robot - group.first) * group.memory_bytes
        block[memory:][: group.memory_bytes] = block[kept:][: group.memory_bytes]

    def _interpreted(self, swarm: Swarm) -> Any:
        return super()._interpreted(_views(swarm))


def _views(swarm: Swarm) -> Swarm:
    """Return a swarm whose robots have views of their fields as attributes: reading a record's takes microseconds."""
    robots, sensors = swarm.robots, swarm.robots.sensors
    fields = ("starts", "present", "random", "wheel_limit_cm_s", "wheel_base_cm")
    views = [
        SimpleNamespace(
            sensors=SimpleNamespace(**{name: sensors[name][robot, ...] for name in SENSED.names or ()}),
            actuators=robots.actuators[robot],
            **{name: robots[name][robot, ...] for name in fields},
        )
        for robot in range(len(robots))
    ]
    return swarm._replace(robots=views)


def _e_groups(swarm: Swarm, number: int) -> npt.NDArray[np.void]:
    """Return (robots + 1,) the record of each robot for its firmware, and one to which firmware writes `serving`."""
    group = swarm.groups[number]
    members = swarm.robots[group.first :][: group.count]
    records = np.zeros(group.count + 1, E_GROUP)
    records["robots"], records["pixels"] = 1, group.pixels
    records["serving"] = records[-1:].ctypes.data
    each, block, numbers = records[:-1], swarm.scene.ctypes.data, np.arange(group.count)
    camera = swarm.pixels[group.row :][: group.count * group.pixels].reshape(group.count, group.pixels)
    rows = {name: members[name] for name in ("actuators", "random", "present")} | {"camera": camera}
    for name in ("step_ms", "distance_mm", "infrared", "new_picture", "pulses", "messages"):
        rows[name] = members.sensors[name]
    for name, array in rows.items():
        each[name] = int(array.ctypes.data) + array.strides[0] * numbers
    each["memory"] = block + group.memory + group.memory_bytes * numbers
    each["parameters"] = block + group.parameters
    return records
