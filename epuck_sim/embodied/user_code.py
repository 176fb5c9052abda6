"""Users' code that runs on robots, as plain Python or compiled, and messages about its errors; sensors in files.

Compiled code does not know the line at which it raised, so code that fails runs again as plain Python, which does.
Controllers have a module of their own, `controllers`.
"""

import sys
from abc import ABC, abstractmethod
from bdb import BdbQuit
from collections import namedtuple
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import lru_cache
from math import isnan
from time import perf_counter
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.compilation import compile_for
from epuck_sim.control.interface import Described, Sensor, Sensors, World
from epuck_sim.control.loader import check_imported_copies
from epuck_sim.embodied.start import SENSORS
from epuck_sim.embodied.swarm import FLOAT64, SENSED_BYTES, Swarm, open_block, swarm_at
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import line_of_definition, line_of_error
from epuck_sim.util.jit import bind, jit_inline
from epuck_sim.util.messages import describe_error
from epuck_sim.util.native import array_at, function_address, record_type
from epuck_sim.util.seeds import robot_streams

AGAIN_S = 1.0
"""Time limit, s, of the second run that finds the line of an error; compiled code may have run through a long loop."""


class RobotError(ControllerError):
    """The controller of a robot, or a sensor in a file of its own, has raised an error.

    Attributes:
        robot: The robot's number.
    """

    def __init__(self, user: Described, robot: int, error: BaseException, place: str) -> None:
        kind = "sensor" if isinstance(user, Sensor) else "controller"
        inside = "" if place.startswith(str(user.path)) else f" (in the {kind} {user.path})"
        super().__init__(f"{place}: {describe_error(error)}{inside}")
        self.robot = robot


class UserCode(ABC):
    """A user's code on robots of a block, which must not move in memory: the controllers of a group, or a sensor."""

    robots: slice  # numbers of the robots
    run: Callable[[ByteArray, IntArray, int], None]
    """Runs the code on each robot; takes the block, the addresses and the code's number. Compiled or interpreted."""
    address: int  # address of `run` in this process; 0 if it is interpreted
    _is_compiled = False

    def __init__(self, user: Described, block: ByteArray, swarm: Swarm, number: int, record: Any) -> None:
        """Find the robots of a user's code by `record`, its GROUP or SENSE of this number in the block."""
        check_imported_copies(user)
        self._user, self._block, self._swarm, self._number = user, block, swarm, number
        self._scene = swarm.scene[0]
        self.robots = slice(int(record.first), int(record.first + record.count))

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
        known = {"swarm_at": lambda _: swarm, "array_at": view_at}
        kernels = {
            name: bind(each.function, **known) for name, each in self._names.items() if hasattr(each, "function")
        }
        return np.errstate(divide="raise", invalid="raise")(bind(self._function, **known, **{**self._names, **kernels}))

    @abstractmethod
    def _is_at_work(self) -> bool: ...

    @abstractmethod
    def _undo(self, block: ByteArray, swarm: Swarm, robot: int) -> None:
        """Undo the changes made to the robot on which the code was running."""

    def _without_line(self, error: BaseException, robot: int) -> tuple[str, BaseException]:  # noqa: ARG002
        """Return the place of an error that did not recur, and the error."""
        return str(self._user.path), error

    def fault(self, error: BaseException) -> RobotError | None:
        """Return the RobotError for an error that this code raised on a robot; None for any other error."""
        if not self._is_at_work() or isinstance(error, BdbQuit | KeyboardInterrupt):  # the debugger was left, or Ctrl-C
            return None
        robot = int(self._scene.serving)
        place = self._line_again(error, robot) if self._is_compiled else line_of_error(error, self._user.sources)
        if place is None:
            place, error = self._without_line(error, robot)
        if isinstance(error, FloatingPointError) and "divide" in str(error):  # numpy's of 1 / 0
            error = ZeroDivisionError("division by zero")
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
        try:
            with _time_limit(AGAIN_S):
                again(block, np.zeros(0, np.int64), self._number)
        except KeyboardInterrupt:
            raise
        except BaseException as second:
            if isinstance(second, expected):
                return line_of_error(second, self._user.sources)
        return None


def view_at(block: Any, first: int, end: int, dtype: np.dtype[Any]) -> Any:
    """Do what `native.array_at` does, in plain Python."""
    return block[first:end].view(dtype).view(np.recarray)


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    end_s, before = perf_counter() + seconds, sys.gettrace()

    def trace(*_: object) -> Any:
        if perf_counter() > end_s:
            raise TimeoutError
        return trace

    sys.settrace(trace)
    try:
        yield
    finally:
        sys.settrace(before)


# --- sensors in files of their own (see `control.loader`) ----------------------------------------------

STREAM = record_type([("words", "u8", 4)])  # a stream of random numbers

STREAM_BYTES = STREAM.itemsize

if TYPE_CHECKING:  # `bind` provides them
    sense: Callable[..., None]
    READINGS: np.dtype[Any]
    PARAMETERS: np.dtype[Any]


def run_sensor(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Read a sensor on each robot of a group that is in the arena; others read 0."""
    swarm = swarm_at(block)
    scene, own = swarm.scene[0], swarm.senses[number]
    at = scene.at[SENSED_BYTES]
    parameters = array_at(block, at + own.parameters, at + own.readings, PARAMETERS)[0]  # noqa: F821
    readings = array_at(block, at + own.readings, at + own.random, READINGS)  # noqa: F821
    words = array_at(block, at + own.readings, at + own.random, FLOAT64)
    streams = array_at(block, at + own.random, at + own.kept, STREAM)
    world = World(
        float(scene.step * scene.step_s),
        float(scene.width_cm),
        float(scene.height_cm),
        float(swarm.robots[own.first].radius_cm),
        swarm.robots,
        swarm.circles[: scene.circles],
        swarm.edges[: scene.edges],
        swarm,
    )
    first_robot, count, floats = own.first, own.count, own.floats
    size = len(words) // count
    scene.sensing = number + 1
    for member in range(count):
        robot, first = swarm.robots[first_robot + member], member * size
        if not robot.present:
            for place in range(first, first + size):
                words[place] = 0.0
            continue
        stream = streams[member]
        scene.serving = first_robot + member
        scene.kept_random = stream.words
        sense(world, robot, readings[member], parameters, stream.words[:])  # noqa: F821
        for place in range(first, first + floats):
            if isnan(words[place]):
                raise ValueError("a reading is not a number")
    scene.serving, scene.sensing = -1, 0


def sensed_bytes_needed(sensor: Sensor, robots: int) -> int:
    """Return the number of bytes that a sensor of a group needs in `Swarm.sensed`."""
    return sensor.parameter_type.itemsize + robots * (2 * sensor.readings.itemsize + STREAM_BYTES)


def assign_sense(record: Any, sensor: Sensor, first: int, count: int, byte: int) -> int:
    """Set the SENSE of a sensor of `count` robots from `first` on; return the end of its bytes, from `byte` on."""
    record.first, record.count, record.parameters = first, count, byte
    record.readings = byte + sensor.parameter_type.itemsize
    record.random = record.readings + count * sensor.readings.itemsize
    record.kept = record.random + count * STREAM_BYTES
    fields = [sensor.readings[name] for name in sensor.readings.names or ()]
    record.floats = sum(int(np.prod(field.shape, dtype=int)) for field in fields if field.base.kind == "f")
    return byte + sensed_bytes_needed(sensor, count)


def readings_of(swarm: Swarm, record: Any, sensor: Sensor) -> npt.NDArray[np.void]:
    """Return (robots,) each robot's readings of a sensor, by its SENSE record, in place."""
    readings: npt.NDArray[np.void] = swarm.sensed[record.readings : record.random].view(sensor.readings)
    return readings


class OwnSensor(UserCode):
    """A sensor in a file of its own, of one group of robots."""

    sensor: Sensor
    name: str  # its name in the scenario

    def __init__(
        self, block: ByteArray, swarm: Swarm, number: int, name: str, sensor: Sensor, *, interpret: bool = False
    ) -> None:
        """Compile a sensor of a scenario, without calling it; number: its index in `Swarm.senses`, see `assign_sense`.

        Raises:
            ControllerError: It cannot be compiled, or the program has set a value in its own import of the file.
        """
        self._own = swarm.senses[number]
        super().__init__(sensor, block, swarm, number, self._own)
        self.sensor, self.name = sensor, name
        types = {"READINGS": sensor.readings, "PARAMETERS": sensor.parameter_type}
        self._make_run(run_sensor, {"sense": sensor.sense, **types}, interpret=interpret)

    @property
    def readings(self) -> npt.NDArray[np.void]:
        """(robots,) each robot's readings, in place."""
        return readings_of(self._swarm, self._own, self.sensor)

    @property
    def parameters(self) -> npt.NDArray[np.void]:
        """(1,) the parameters, in place."""
        first, kind = int(self._scene.at[SENSED_BYTES]), self.sensor.parameter_type
        return self._block[first + self._own.parameters : first + self._own.readings].view(kind)

    @property
    def keys(self) -> tuple[int, int]:
        """Spawn key of its seed sequence, a child of the trial's."""
        return SENSORS, crc32(self.name.encode())

    @property
    def streams_at(self) -> tuple[int, int]:
        """Offsets in the block, in bytes, at which its robots' streams begin and end."""
        first = int(self._scene.at[SENSED_BYTES])
        return first + int(self._own.random), first + int(self._own.kept)

    def draw_streams(self, seed: int) -> None:
        """Set the robots' streams for the trial with a seed: they depend on the sensor's name and the robot alone."""
        sequence = np.random.SeedSequence(seed, spawn_key=self.keys)
        streams = robot_streams(sequence, self.robots.stop)[self.robots]
        self._swarm.sensed[self._own.random : self._own.kept] = streams.view(np.uint8).ravel()

    def _is_at_work(self) -> bool:
        return bool(self._scene.sensing == self._number + 1)

    def _undo(self, block: ByteArray, swarm: Swarm, robot: int) -> None:  # noqa: ARG002
        stream = swarm.senses[self._number].random + STREAM_BYTES * (robot - self.robots.start)
        swarm.sensed[stream : stream + STREAM_BYTES] = swarm.scene[0].kept_random.view(np.uint8)

    def _without_line(self, error: BaseException, robot: int) -> tuple[str, BaseException]:
        reading = self.readings[robot - self.robots.start]
        for name in self.sensor.readings.names or ():
            if np.isnan(np.asarray(reading[name], float)).any():
                error = ValueError(f"readings.{name} is not a number; allowed: numbers")
                break
        return f"{self.sensor.path}:{line_of_definition('sense', self.sensor.sources[self.sensor.path])}", error


# --- readings for controllers: further fields of `Sensors`, by the names of the readings -------------------


def names_of_readings(sensors: Sequence[Sensor]) -> tuple[str, ...]:
    """Return the names of all readings of sensors, in order."""
    return tuple(name for sensor in sensors for name in sensor.readings.names or ())


@lru_cache
def completion(sensors: tuple[Sensor, ...]) -> Any:
    """Return a kernel that adds to `Sensors` the readings of a group's own sensors, `Swarm.senses` from `first` on."""
    if not sensors:
        return _as_they_are
    known: dict[str, Any] = {
        "array_at": array_at,
        "Complete": namedtuple("Sensors", (*Sensors._fields, *names_of_readings(sensors))),
    }
    lines, fields = [], [f"sensors.{name}" for name in Sensors._fields]
    for number, sensor in enumerate(sensors):
        known[f"TYPE_{number}"] = sensor.readings
        place = f"swarm.senses[first + {number}]"
        lines.append(
            f"    own_{number} = array_at(block, at + {place}.readings, at + {place}.random, TYPE_{number})[member]"
        )
        for name in sensor.readings.names or ():
            field = sensor.readings[name]
            number_type = "float" if field.kind == "f" else "int"
            fields.append(f"own_{number}.{name}[:]" if field.shape else f"{number_type}(own_{number}.{name})")
    source = [
        "def complete(sensors, block, swarm, first, member):",
        f"    at = swarm.scene[0].at[{SENSED_BYTES}]",
        *lines,
        f"    return Complete({', '.join(fields)})",
    ]
    exec("\n".join(source), known)
    return jit_inline(known["complete"])


@jit_inline
def _as_they_are(sensors: Any, block: ByteArray, swarm: Any, first: int, member: int) -> Any:  # noqa: ARG001
    return sensors
