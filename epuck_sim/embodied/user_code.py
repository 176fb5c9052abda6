"""Users' code that runs on robots: controllers here, sensors in `own_sensors`, and messages about their errors.

It is compiled by numba, interpreted for breakpoints and any library, or firmware in C. Compiled and interpreted code
run the same source, users' files, `run_group` and `run_sensor`, with equal results bit for bit. Compiled code
does not know the line at which it raised, so code that fails runs again as plain Python, which does.
"""

import ctypes
import linecache
import math
import sys
from abc import ABC, abstractmethod
from bdb import BdbQuit
from collections import namedtuple
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from time import perf_counter
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.compilation import compile_for
from epuck_sim.control.firmware import Firmware
from epuck_sim.control.interface import ACTUATORS, Controller, RobotCode, Sensor, Sensors, Wheels
from epuck_sim.control.loader import check_imported_copies
from epuck_sim.control.names import check_sensed
from epuck_sim.embodied.swarm import BYTES, SENSED, SENSED_BYTES, Swarm, open_block, swarm_at
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import line_of_error
from epuck_sim.util.jit import bind, jit_inline, jit_no_alloc
from epuck_sim.util.messages import describe_error
from epuck_sim.util.native import INTP, address_of, array_at, call_c, function_address

if TYPE_CHECKING:  # `bind` provides them
    start: Callable[..., None]
    step: Callable[..., None]
    gather: Callable[..., Any]
    MEMORY: np.dtype[Any]
    PARAMETERS: np.dtype[Any]

Records = npt.NDArray[np.void]

AGAIN_S = 1.0
"""Time limit, s, of the second run that finds the line of an error; compiled code may have run through a long loop."""


class RobotError(ControllerError):
    """The controller of a robot, or a sensor in a file of its own, has raised an error.

    Attributes:
        robot: The robot's number.
    """

    def __init__(self, user: RobotCode, robot: int, error: BaseException, place: str) -> None:
        kind = "sensor" if isinstance(user, Sensor) else "controller"
        inside = "" if place.startswith(str(user.path)) else f" (in the {kind} {user.path})"
        super().__init__(f"{place}: {describe_error(error)}{inside}")
        self.robot = robot


def _divide_by_zero(_error: str, _flag: int) -> None:
    raise ZeroDivisionError("division by zero")  # as compiled code, where numpy has an error of its own


class UserCode(ABC):
    """A user's code on robots of a block, which must not move in memory: the controllers of a group, or a sensor."""

    robots: slice  # numbers of the robots
    parameters: Records  # (1,) the parameters of all of them, in place
    run: Callable[[ByteArray, IntArray, int], None]
    """Runs the code on each robot; takes the block, the addresses and the code's number. Compiled or interpreted."""
    address: int  # address of `run` in this process; 0 if it is interpreted
    _is_compiled = False
    _sensing = 0  # `scene.sensing` while it runs

    def __init__(
        self, user: RobotCode, block: ByteArray, swarm: Swarm, number: int, record: Any, parameters: ByteArray
    ) -> None:
        """Find the robots of a user's code by `record`, its GROUP or SENSE of this number in the block."""
        check_imported_copies(user)
        self._user, self._block, self._swarm, self._number = user, block, swarm, number
        self._scene = swarm.scene[0]
        self.robots = slice(int(record.first), int(record.first + record.count))
        self.parameters = parameters.view(user.parameter_type)

    def _make_run(self, function: Any, names: Mapping[str, Any], contents: str = "", *, interpret: bool) -> None:
        """Set `run` to the function, compiled (`compile_for`) or interpreted; now, so that no trial's time has it."""
        self._function, self._names, self._is_compiled = function, names, not interpret
        if interpret:
            self.run, self.address = self._interpreted(self._swarm), 0
        else:
            self.run = compile_for(self._user, function, names, contents)
            self.address = function_address(self.run)

    def _interpreted(self, swarm: Swarm) -> Any:
        """Return the function as plain Python, which raises where compiled code does: at 1 / 0."""
        known = {
            "swarm_at": lambda _: swarm,
            "array_at": lambda block, first, end, dtype: block[first:end].view(dtype).view(np.recarray),
        }
        kernels = {
            name: bind(each.function, **known) for name, each in self._names.items() if hasattr(each, "function")
        }
        raises = np.errstate(divide="call", invalid="raise", call=_divide_by_zero)
        return raises(bind(self._function, **known, **{**self._names, **kernels}))

    @abstractmethod
    def _undo(self, block: ByteArray, swarm: Swarm, robot: int) -> None:
        """Undo the changes made to the robot on which the code was running."""

    def _without_line(self, error: BaseException, robot: int) -> tuple[str, BaseException]:  # noqa: ARG002
        """Return the place of an error that did not recur, and the error."""
        return str(self._user.path), error

    def fault(self, error: BaseException) -> RobotError | None:
        """Return the RobotError for an error that this code raised on a robot; None for any other error."""
        robot, is_at_work = int(self._scene.serving), self._scene.sensing == self._sensing
        if isinstance(error, BdbQuit | KeyboardInterrupt):  # the debugger was left, or Ctrl-C
            return None
        if not (is_at_work and self.robots.start <= robot < self.robots.stop):
            return None
        place = self._line_again(error, robot) if self._is_compiled else line_of_error(error, self._user.sources)
        if place is None:
            place, error = self._without_line(error, robot)
        if isinstance(error, FloatingPointError) and "divide" in str(error):  # numpy's of 0 / 0
            error = ZeroDivisionError("division by zero")
        elif type(error) is TypeError and str(error).endswith(", got None"):  # of compiled code
            error = TypeError(f"{error}: a function that it calls has a way without return")
        self._scene.serving, self._scene.sensing = -1, 0
        return RobotError(self._user, robot, error, place)

    def _line_again(self, error: BaseException, robot: int) -> str | None:
        """Return FILE:LINE of an error by running the code again in plain Python; None if the error does not recur."""
        expected = ArithmeticError if isinstance(error, ArithmeticError) else type(error)  # numpy's of 1 / 0 is its own
        block = self._block.copy()
        swarm = open_block(block)
        self._undo(block, swarm, robot)
        others = np.arange(len(swarm.robots)) != robot
        swarm.robots.present[others] = swarm.robots.starts[others] = False
        again = self._interpreted(swarm)
        end_s, before = perf_counter() + AGAIN_S, sys.gettrace()

        def trace(*_: object) -> Any:
            if perf_counter() > end_s:
                raise TimeoutError
            return trace

        sys.settrace(trace)
        try:
            again(block, np.zeros(0, np.int64), self._number)
        except KeyboardInterrupt:
            raise
        except BaseException as second:
            if isinstance(second, expected):
                return line_of_error(second, self._user.sources)
        finally:
            sys.settrace(before)
        return None


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
        row = group.row + member * group.pixels
        camera = swarm.pixels[row : row + group.pixels]
        sensors = gather(block, swarm, group.sense, member, robot.sensors, camera, wheels)  # noqa: F821
        step(sensors, memories[member], robot.actuators, parameters, robot.random[:])  # noqa: F821
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
    """Return how many bytes in `Swarm.bytes` a group of this number of robots needs for a controller."""
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
    memory: Records  # (robots,) memory of each robot, in place

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
        self._group = group = swarm.groups[number]
        super().__init__(controller, block, swarm, number, group, block[group.parameters : group.memory])
        self.memory = block[group.memory :][: group.count * group.memory_bytes].view(controller.memory)
        check_sensed(controller, names_of_readings(sensors))
        self.controller, self._of_firmware = controller, list[int]()
        if isinstance(controller, Firmware):
            self._e_groups = _e_groups(swarm, number)
            functions = (controller.library.e_start_all, controller.library.e_step_all)
            self._of_firmware = [ctypes.cast(function, ctypes.c_void_p).value or 0 for function in functions]
            self._of_firmware.append(self._e_groups.ctypes.data)
            self.run, self.address = _run_firmware, address_of(_run_firmware, INTP)
        else:
            names = {"start": controller.start, "step": controller.step, "gather": gatherer(tuple(sensors))}
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
            if self._group.count:  # compiled code looks at the first robot
                self.run(self._block, addresses, self._number)
        except BaseException as error:  # whatever a user's controller may raise
            if fault := self.fault(error):
                raise fault from error
            raise

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


def _e_groups(swarm: Swarm, number: int) -> Records:
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


def names_of_readings(sensors: Sequence[Sensor]) -> tuple[str, ...]:
    """Return the names of all readings of sensors, in order."""
    return tuple(name for sensor in sensors for name in sensor.readings.names or ())


@lru_cache
def gatherer(sensors: tuple[Sensor, ...]) -> Any:
    """Return a kernel that makes the `Sensors` of a robot, with readings of its own sensors, `Swarm.senses` from first.

    Each field of `SENSED`, and each reading, becomes a field: a number, or an array, as a slice, since numba takes
    arrays of different lengths in records for different types.
    """
    names = *Sensors._fields, *names_of_readings(sensors)
    known: dict[str, Any] = {
        "__name__": __name__,
        "array_at": array_at,
        "Sensors": cast(Any, namedtuple)("Sensors", names) if sensors else Sensors,
        **{f"TYPE_{number}": sensor.readings for number, sensor in enumerate(sensors)},
    }
    lines, fields = [], {"camera": "camera", "wheels": "wheels"} | _fields_of("sensed", SENSED)
    for number, sensor in enumerate(sensors):
        place = f"at + swarm.senses[first + {number}]"
        lines.append(f"    own_{number} = array_at(block, {place}.readings, {place}.random, TYPE_{number})[member]")
        fields |= _fields_of(f"own_{number}", sensor.readings)
    lines = [
        "def gather(block, swarm, first, member, sensed, camera, wheels):",
        f"    at = swarm.scene[0].at[{SENSED_BYTES}]",
        *lines,
        f"    return Sensors({', '.join(fields[name] for name in names)})",
    ]
    source, file = "\n".join(lines), f"<sensors {', '.join(names)}>"
    linecache.cache[file] = len(source), None, source.splitlines(keepends=True), file  # for debuggers, and for pages
    exec(compile(source, file, "exec"), known)
    return jit_inline(known["gather"])


def _fields_of(record: str, kind: np.dtype[Any]) -> dict[str, str]:
    kinds = {"f": "float", "i": "int", "b": "bool"}
    return {
        name: f"{record}.{name}[:]" if kind[name].shape else f"{kinds[kind[name].kind]}({record}.{name})"
        for name in kind.names or ()
    }
