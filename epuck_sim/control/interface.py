"""The interface of controllers and sensors in files of users: docs/controllers.md and docs/sensors.md have their parts.

`step` reads `sensors` (see `Sensors`), and sets fields of `memory` and of `actuators` (see `ACTUATORS`). `sense` looks
at `world` (see `World`) from `robot`, the record of the robot that senses, and sets fields of `readings`.
A robot whose memory has `phase_ms` and whose parameters have `period_s` is an oscillator: its synchrony is measured.
Its period is a float, even where the default is written as a whole number.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.user_files import Value, parameter_type, run_check, with_defaults

EXTERNAL = ("wheels", "ring")  # parts of a robot that a controller may leave to commands from outside
SENSORS = 8  # number of proximity sensors that a robot can read; it may have fewer
MAX_MESSAGES = 8  # largest number of messages that a robot can read in one control step

_NO_MESSAGES = np.zeros(MAX_MESSAGES, np.int64)
_NO_MESSAGES.flags.writeable = False


class Wheels(NamedTuple):
    """A robot's two wheels."""

    limit_cm_s: float  # largest speed of each, cm/s, forwards or backwards
    base_cm: float  # distance between them, cm


EPUCK_WHEELS = Wheels(epuck.WHEEL_LIMIT_CM_S, epuck.WHEEL_BASE_CM)  # the wheels of the e-puck


class Sensors(NamedTuple):
    """Sensor readings of one robot at the start of a control step."""

    step_ms: int
    """Whole milliseconds of a control step on the robot's own clock."""
    infrared: FloatArray
    """(8,) counts: raw readings of the proximity sensors; 0 for those that a robot with fewer sensors lacks."""
    distance_mm: IntArray
    """(8,) mm: distances computed from the readings; `epuck.OUT_OF_RANGE_MM` where nothing is in range, and
    for sensors that the robot lacks."""
    camera: IntArray
    """(pixels,): 1 where a lit ring is seen, 0 where not; index 0 is the left edge of the picture. A robot with another
    signal than the camera has one pixel: 1 if a flash or a pulse reaches it."""
    new_picture: bool = True
    """Whether `camera` holds a picture that the controller has not seen before. Cameras that take fewer pictures than
    there are control steps hold the last one until the next arrives."""
    pulses: int = 0
    """Number of radio pulses that arrive in this control step."""
    messages: IntArray = _NO_MESSAGES
    """(MAX_MESSAGES,): messages of the first of them, as set in the senders' `actuators.send`; 0 for a bare pulse."""
    wheels: Wheels = EPUCK_WHEELS
    """Constants of the wheels, for controllers that compute turns."""


class World(NamedTuple):
    """The world at one instant, as sensors in files of their own see it."""

    time_s: float  # simulated time, s
    width_cm: float  # length of the floor along x, cm
    height_cm: float  # length of the floor along y, cm
    radius_cm: float  # radius of the robot that senses, cm
    robots: Any
    """(robots,) records: `x` and `y` (cm), `heading` (rad), `radius_cm`, `ring_on` (whether the ring is lit), `present`
    (whether the robot is in the arena), `number`, and `actuators.send` (the message that it sends)."""
    circles: Any  # (n,) records: `x`, `y` and `radius` (cm) of round obstacles and of movables
    edges: Any  # (n,) records: `ax`, `ay`, `bx` and `by` (cm), the ends of an edge of another obstacle
    swarm: Any  # all of the swarm, for the functions of `epuck_sim.embodied.sensing`


ACTUATORS = np.dtype(
    [
        ("left_cm_s", np.float64),  # of the left wheel, within the wheels' limit
        ("right_cm_s", np.float64),
        ("ring_on", np.int64),  # 1 lights the ring
        ("send", np.int64),  # a message, sent by radio in each control step in which it is not 0
        ("turn_rad", np.float64),  # an instantaneous turn to the left in each control step, before the wheels move
    ],
    align=True,
)
"""Record of a controller's commands, one for each robot; it keeps its values until they are set again."""


@dataclass(frozen=True, eq=False)
class RobotCode:
    """Code of a user's file that runs on robots, a controller or a sensor, or on agents: a response curve."""

    name: str
    stored_name: str  # name by which it is found again, see `user_files.Place`
    path: Path
    parameters: Mapping[str, Value]  # name and default of each parameter
    check: Callable[[SimpleNamespace], None] | None
    sources: Mapping[Path, bytes]  # contents of every file that its code comes from, at the time of loading
    modules: Mapping[Path, ModuleType]
    """The module made from each of these files: its own copy, which no `import` statement returns."""

    def resolve(self, given: Mapping[str, object]) -> dict[str, Value]:
        """Return every parameter with its given value or its default; ValueError says what is allowed."""
        values = with_defaults(self.name, given, self.parameters)
        self.check_values(values)
        run_check(self.check, values, self.sources)
        return values

    def check_values(self, values: Mapping[str, Value]) -> None:
        """Raise ValueError for parameters that make no sense, whatever the file's own `check` says."""

    @cached_property
    def parameter_type(self) -> np.dtype[Any]:
        """Record type of its parameters."""
        return parameter_type(self.parameters)

    def parameter_values(self, record: np.void) -> dict[str, Value]:
        """Return the parameters that a record holds, by name; see `parameter_record`."""
        return {
            name: tuple(record[name].tolist()) if isinstance(default, tuple) else type(default)(record[name])
            for name, default in self.parameters.items()
        }

    def parameter_record(self, values: Mapping[str, Value]) -> npt.NDArray[np.void]:
        """Return (1,) a record that holds the value of each parameter."""
        record = np.zeros(1, self.parameter_type)
        for name, value in values.items():
            record[name] = value
        return record


@dataclass(frozen=True, eq=False)
class Controller(RobotCode):
    """A controller as its file describes it."""

    memory: np.dtype[Any]  # record type of a robot's memory
    start: Callable[..., None]
    step: Callable[..., None]
    external: tuple[str, ...]  # the parts, of `EXTERNAL`, that are commanded from outside

    @property
    def has_phase(self) -> bool:
        """Whether its robots have a phase, one number."""
        return "phase_ms" in (self.memory.names or ()) and self.memory["phase_ms"].shape == ()

    @property
    def is_oscillator(self) -> bool:
        """Whether its robots have a phase, and a period."""
        return self.has_phase and isinstance(self.parameters.get("period_s"), float)

    def check_values(self, values: Mapping[str, Value]) -> None:
        """Raise ValueError if an oscillator's period is not above 0."""
        if self.is_oscillator and self.period_s(values) <= 0:
            raise ValueError(f"period_s is {values['period_s']}; allowed: above 0")

    @staticmethod
    def period_s(values: Mapping[str, Value]) -> float:
        """Return the period of an oscillator, s, from its parameters."""
        return cast("float", values["period_s"])


@dataclass(frozen=True, eq=False)
class Sensor(RobotCode):
    """A sensor as its file describes it."""

    readings: np.dtype[Any]  # record type of its readings, as controllers find them in `sensors`
    sense: Callable[..., None]
