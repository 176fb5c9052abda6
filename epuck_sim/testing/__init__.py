"""Unit tests of controllers: a robot whose sensors are set by hand, and scenes of the simulator in one line.

The fixture of pytest is in `epuck_sim.pytest_plugin`.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from operator import attrgetter
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.control.interface import EPUCK_WHEELS, Wheels
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.control.names import unknown_name
from epuck_sim.embodied.own_sensors import assign_sense, readings_of, sensed_bytes
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.embodied.user_code import GroupControllers, assign_bytes, bytes_needed
from epuck_sim.epuck import OUT_OF_RANGE_MM, RADIUS_CM
from epuck_sim.user_files import Value
from epuck_sim.util.messages import short_repr, whole
from epuck_sim.util.seeds import robot_streams

__all__ = ["TestRobot", "facing_robot", "facing_wall"]

T = TypeVar("T")

ALLOWED = {
    "infrared": (-1e6, 1e6),
    "distance_mm": (0, OUT_OF_RANGE_MM),
    "camera": (0, 1),
    "pulses": (0, 1e6),
    "step_ms": (1, 1e6),
}
"""Least and greatest values that a robot can sense."""

SIDE_CM = 100.0  # side of the arena of scenes


class _Field(Generic[T]):
    """A field of a record of `TestRobot`, read and set as its attribute; arrays are the robot's own."""

    def __init__(self, record: str, kind: Callable[[Any], T]) -> None:
        self._record, self._kind = record, kind

    def __set_name__(self, owner: type, name: str) -> None:
        self._name = name

    def __get__(self, robot: "TestRobot | None", owner: type) -> T:
        if robot is None:  # by a tool that documents the class
            return self  # type: ignore[return-value]
        return self._kind(getattr(getattr(robot, self._record), self._name))

    def __set__(self, robot: "TestRobot", value: object) -> None:
        setattr(getattr(robot, self._record), self._name, value)


def _refuse(_: "TestRobot", value: object) -> None:
    raise AttributeError(f"cannot be {value!r} as a whole; allowed: one of its values, as in robot.memory.turns = 3")


class TestRobot:
    """A robot without an arena: a test sets its sensors by hand, and reads its commands and memory.

    Nothing is near and nothing is seen until a test sets it. Sensors, memory and actuators keep their values.

    >>> robot = TestRobot("firefly", speed_cm_s=5)
    >>> robot.step()
    >>> robot.left_cm_s, robot.right_cm_s
    (5.0, 5.0)
    >>> robot.distance_mm[0] = 10
    >>> robot.step()
    >>> robot.left_cm_s < 0 < robot.right_cm_s
    True
    """

    __slots__ = ("_actuators", "_controllers", "_memory", "_parameters", "_pixels", "_readings", "_senses")
    __test__: ClassVar[bool] = False  # or pytest would take this class for tests

    memory = property(attrgetter("_memory"), _refuse)
    """The robot's memory, by name."""
    parameters = property(attrgetter("_parameters"), _refuse)
    """The controller's parameters, by name; changes count from the next step on."""
    readings = property(attrgetter("_readings"), _refuse)
    """Readings of sensors in files of their own, by name."""
    infrared = _Field[FloatArray]("_senses", np.asarray)
    """(8,) counts: raw readings of the proximity sensors; distances do not follow from them here."""
    distance_mm = _Field[IntArray]("_senses", np.asarray)
    """(8,) mm: distances, 65535 where nothing is in range; sensor 0 is front-right, then clockwise."""
    camera = _Field[IntArray]("_pixels", np.asarray)
    """(pixels,): 1 where a lit ring is seen, else 0; index 0 is the left edge."""
    pulses = _Field("_senses", int)
    """Number of radio pulses that arrive."""
    messages = _Field[IntArray]("_senses", np.asarray)
    """(8,): messages of the pulses; 0 for a pulse without one."""
    new_picture = _Field("_senses", bool)
    """Whether `camera` is a picture that the robot has not seen before; True unless it is set."""
    step_ms = _Field("_senses", int)
    """Milliseconds of a control step on the robot's own clock."""
    left_cm_s = _Field("_actuators", float)
    """Speed of the left wheel as commanded, which the simulator limits to 12.8 either way."""
    right_cm_s = _Field("_actuators", float)
    """Speed of the right wheel as commanded, which the simulator limits to 12.8 either way."""
    ring_on = _Field("_actuators", bool)
    """Whether the LED ring is lit."""
    send = _Field("_actuators", int)
    """The message that is sent by radio; 0 if none is."""
    turn_rad = _Field("_actuators", float)
    """The turn on the spot, to the left."""

    def __init__(
        self,
        controller: str | Path,
        parameters: Mapping[str, Value] | None = None,
        *,
        seed: int = 0,
        pixels: int = 60,
        step_ms: int = 100,
        interpret: bool = True,
        wheels: Wheels = EPUCK_WHEELS,
        sensors: Sequence[str | Path] = (),
        **more_parameters: Value,
    ) -> None:
        """Start the controller.

        Args:
            controller: A shipped controller's name, or a file, relative to the working directory.
            parameters: Parameters by name; needed for parameters with the name of another argument.
            seed: Seed of the robot's random numbers.
            pixels: Length of the camera's row.
            step_ms: Milliseconds from one step to the next.
            interpret: Whether the controller runs as plain Python, so that breakpoints and coverage work, or compiled.
            wheels: Largest speed of the wheels, and their distance; for a Kilobot, `RobotKind(kind="kilobot").wheels`.
            sensors: Sensors in files of their own, relative to the working directory, whose `readings` a test sets.
            more_parameters: Further parameters.

        Raises:
            ControllerError: There is no such controller, it cannot be compiled, or it raises at its start.
            ValueError: A parameter is not allowed.
        """
        found = find_controller(str(controller))
        record = found.parameter_record(found.resolve({**(parameters or {}), **more_parameters}))
        sensors = sensors if isinstance(sensors, str | Path) else list(sensors)
        if isinstance(sensors, str | Path) or not all(isinstance(each, str | Path) for each in sensors):
            raise ValueError(f"sensors is {short_repr(sensors)}; allowed: a list of files, without parameters")
        own = [find_sensor(str(sensor)) for sensor in sensors]
        told = [name for sensor in own for name in sensor.readings.names or ()]
        if twice := next((name for name in told if told.count(name) > 1), None):
            raise ValueError(f"two of the sensors have the reading {twice!r}; give one of them")
        needed, sensed = bytes_needed(found, 1), sum(sensed_bytes(sensor, 1) for sensor in own)
        lengths = {"robots": 1, "groups": 1, "pixels": whole("pixels", pixels), "senses": len(own)}
        block = make_block({**lengths, "bytes": needed, "sensed": sensed})
        swarm, byte = open_block(block), 0
        for sense, sensor in zip(swarm.senses, own, strict=True):
            byte = assign_sense(sense, sensor, 0, 1, byte)
        robots = swarm.robots
        swarm.scene[0].serving = -1
        robots.wheel_limit_cm_s, robots.wheel_base_cm = wheels
        swarm.groups.count, swarm.groups.pixels = 1, pixels
        robots.present, robots.random = True, robot_streams(np.random.SeedSequence(whole("seed", seed, 0)), 1)
        assign_bytes(swarm, swarm.groups[0], found, 0)
        self._senses, self._actuators = Record("sensors", robots.sensors), Record("actuators", robots.actuators)
        self._pixels = Record("sensors", swarm.pixels.view([("camera", swarm.pixels.dtype, pixels)]))
        self.step_ms, self.distance_mm, self.new_picture = whole("step_ms", step_ms), OUT_OF_RANGE_MM, True
        self._controllers = GroupControllers(block, swarm, 0, found, own, interpret=interpret)
        self._controllers.parameters[:] = record
        self._controllers.start()
        self._memory = Record("memory", self._controllers.memory)
        self._parameters = Record("parameters", self._controllers.parameters)
        self._readings = Record("readings", *map(partial(readings_of, swarm), swarm.senses, own))

    def step(self, steps: int = 1) -> None:
        """Run control steps; sensors stay as they are.

        Raises:
            RobotError: The controller raises; the message has file and line.
            ValueError: A reading is out of the range of robots, or no number.
        """
        for name, (least, most) in ALLOWED.items():
            values = np.atleast_1d(getattr(self, name))
            wrong = np.flatnonzero(~((values >= least) & (values <= most)))
            if len(wrong):
                where = f"{name}[{wrong[0]}]" if values.size > 1 else name
                raise ValueError(f"{where} is {values[wrong[0]]:g}; allowed: {least:g} to {most:g}")
        for name in dir(self.readings):
            if np.isnan(getattr(self.readings, name)).any():
                raise ValueError(f"readings.{name} is {getattr(self.readings, name)}; allowed: numbers")
        for _ in range(whole("steps", steps, 0)):
            self._controllers.step()


class Record:
    """Values by name, read and set as attributes; numbers are Python's, arrays are the robot's own."""

    __slots__ = ("_kind", "_values")
    _kind: str
    _values: dict[str, npt.NDArray[Any]]

    def __init__(self, kind: str, *values: npt.NDArray[np.void]) -> None:
        """Show the fields of records, (1,) each; error messages call them `kind`."""
        fields = {name: record.view(np.ndarray)[name] for record in values for name in record.dtype.names or ()}
        object.__setattr__(self, "_kind", kind)
        object.__setattr__(self, "_values", fields)

    def __getattr__(self, name: str) -> Any:
        value = self._field(name)[0]
        return value.item() if isinstance(value, np.generic) else value

    def __setattr__(self, name: str, value: object) -> None:
        kept = self._field(name)
        before = kept.copy()
        kept[0] = value
        if kept.dtype.kind in "iub" and not np.all(kept[0] == value):
            kept[:] = before
            allowed = "true and false" if kept.dtype == np.bool_ else "whole numbers"
            raise ValueError(f"{name} is {value!r}; allowed: {allowed}")

    def __reduce__(self) -> str:
        raise TypeError(f"{self._kind} of a robot cannot be copied; make another TestRobot")

    def __dir__(self) -> list[str]:
        return list(self._values)

    def __repr__(self) -> str:
        return f"{self._kind}({', '.join(f'{name}={getattr(self, name)}' for name in dir(self))})"

    def _field(self, name: str) -> npt.NDArray[Any]:
        if name not in self._values:
            raise AttributeError(unknown_name(self._kind, name, list(self._values)))
        return self._values[name]


def facing_wall(
    controller: str | Path,
    gap_cm: float = 5.0,
    *,
    seed: int = 0,
    interpret: bool = True,
    sensors: Sequence[Any] = (),
    **parameters: Value,
) -> Simulation:
    """Return a simulation in which robot 0 faces a wall.

    Args:
        controller: A shipped controller's name, or a file, relative to the working directory.
        gap_cm: Distance between its body and the wall, above 0.
        seed: Seed of the trial.
        interpret: Whether the controller runs as plain Python.
        sensors: Sensors in files of their own, as in a scenario.
        parameters: The controller's parameters.

    >>> facing_wall("obstacle_avoidance", gap_cm=1).advance(2).wheels_cm_s[0]
    array([ 12.8, -12.8])
    """
    pose = (SIDE_CM - RADIUS_CM - gap_cm, SIDE_CM / 2, 0.0)
    return _simulate(sensors, seed, interpret, (controller, pose, parameters))


def facing_robot(
    controller: str | Path,
    gap_cm: float = 20.0,
    *,
    lit: bool = True,
    seed: int = 0,
    interpret: bool = True,
    sensors: Sequence[Any] = (),
    **parameters: Value,
) -> Simulation:
    """Return a simulation in which robot 0 faces robot 1, which stands still.

    Args:
        controller: A shipped controller's name, or a file, relative to the working directory.
        gap_cm: Distance between their bodies, above 0.
        lit: Whether the ring of robot 1 is lit; robot 0 sees it from the second step on.
        seed: Seed of the trial.
        interpret: Whether controllers run as plain Python.
        sensors: Sensors of both in files of their own, as in a scenario.
        parameters: The parameters of robot 0's controller.

    >>> int(facing_robot("oscillator", gap_cm=10).advance(2).camera[0].sum()) > 10
    True
    """
    middle, apart = SIDE_CM / 2, gap_cm + 2 * RADIUS_CM
    looks, stands = (middle - apart / 2, middle, 0.0), (middle + apart / 2, middle, math.pi)
    return _simulate(sensors, seed, interpret, (controller, looks, parameters), ("constant", stands, {"ring_on": lit}))


def _simulate(sensors: Sequence[Any], seed: int, interpret: bool, *robots: tuple[Any, Any, Any]) -> Simulation:
    """Return a simulation of robots with these sensors, each of which has a controller, a pose and parameters."""
    arena = {"width_cm": SIDE_CM, "height_cm": SIDE_CM}
    groups = [{"controller": str(file), "poses": [pose], "parameters": given} for file, pose, given in robots]
    scene = {"name": "scene", "arena": arena, "noise": "off", "sensors": sensors, "robots": groups}
    return Simulation(scene, seed, interpret=interpret)
