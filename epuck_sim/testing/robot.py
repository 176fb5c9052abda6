"""One robot under its controller, with sensors that a test sets."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.control.interface import ACTUATORS, MAX_MESSAGES, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.control.names import unknown_name
from epuck_sim.control.runner import ControllerRunner, SensorArrays
from epuck_sim.epuck import INFRARED_POSITIONS_CM, OUT_OF_RANGE_MM
from epuck_sim.util.seeds import robot_streams

SENSORS = len(INFRARED_POSITIONS_CM)
"""Number of proximity sensors."""


class TestRobot:
    """A robot that stands nowhere: what it senses is set by hand, what it commands and remembers can be read.

    Nothing is near and nothing is seen until a test says so. Sensors, memory and actuators keep their values.

    >>> robot = TestRobot("firefly", speed_cm_s=5)
    >>> robot.step()
    >>> robot.left_cm_s, robot.right_cm_s
    (5.0, 5.0)
    >>> robot.distance_mm[0] = 10
    >>> robot.step()
    >>> robot.left_cm_s < 0 < robot.right_cm_s
    True
    """

    __slots__ = ("_actuators", "_runner", "_senses", "memory", "parameters")
    __test__: ClassVar[bool] = False  # or pytest would take this class for tests

    memory: "Record"
    """What the robot remembers, by name."""
    parameters: "Record"
    """The controller's parameters, by name; changes count from the next step on."""

    def __init__(
        self,
        controller: str | Path,
        parameters: Mapping[str, Value] | None = None,
        *,
        seed: int = 0,
        pixels: int = 60,
        step_ms: int = 100,
        interpret: bool = True,
        **more_parameters: Value,
    ) -> None:
        """Start the controller.

        Args:
            controller: A shipped controller's name, or a file, relative to the working directory.
            parameters: Parameters by name; needed for those that are called like another argument.
            seed: Seed of the robot's random numbers.
            pixels: Length of the camera's row.
            step_ms: Milliseconds from one step to the next.
            interpret: Whether the controller runs as plain Python, so that breakpoints and coverage work, or compiled.
            more_parameters: Further parameters.

        Raises:
            ControllerError: There is no such controller, it cannot be compiled, or it raises at its start.
            ValueError: A parameter is not allowed.
        """
        found = find_controller(str(controller))
        record = found.parameter_record(found.resolve({**(parameters or {}), **more_parameters}))
        self._senses = SensorArrays(
            step_ms=np.full(1, step_ms),
            infrared=np.zeros((1, SENSORS)),
            distance_mm=np.full((1, SENSORS), OUT_OF_RANGE_MM),
            camera=np.zeros((1, pixels), np.int64),
            new_picture=np.ones(1, np.bool_),
            pulses=np.zeros(1, np.int64),
            messages=np.zeros((1, MAX_MESSAGES), np.int64),
            present=np.ones(1, np.bool_),
        )
        self._actuators = np.zeros(1, ACTUATORS)
        streams = robot_streams(np.random.SeedSequence(seed), 1)
        self._runner = ControllerRunner(found, record, streams, self._senses, self._actuators, interpret)
        self._runner.start()
        self.memory = Record("memory", self._runner.memory)
        self.parameters = Record("parameters", record)

    def step(self, steps: int = 1) -> None:
        """Run control steps; sensors stay as they are.

        Raises:
            RobotError: The controller raises; the message has file and line.
            ValueError: A reading is not a number.
        """
        invalid = np.flatnonzero(~np.isfinite(self.infrared))
        if len(invalid):
            raise ValueError(f"infrared[{invalid[0]}] is {self.infrared[invalid[0]]}; allowed: counts")
        for _ in range(steps):
            self._runner.step()

    @property
    def infrared(self) -> FloatArray:
        """(8,) counts: raw readings of the proximity sensors; distances do not follow from them here."""
        row: FloatArray = self._senses.infrared[0]
        return row

    @infrared.setter
    def infrared(self, counts: npt.ArrayLike) -> None:
        self.infrared[:] = counts

    @property
    def distance_mm(self) -> IntArray:
        """(8,) mm: distances, 65535 where nothing is in range; sensor 0 is front-right, then clockwise."""
        row: IntArray = self._senses.distance_mm[0]
        return row

    @distance_mm.setter
    def distance_mm(self, distances: npt.ArrayLike) -> None:
        self.distance_mm[:] = distances

    @property
    def camera(self) -> IntArray:
        """(pixels,): 1 where a lit ring is seen, else 0; index 0 is the left edge."""
        row: IntArray = self._senses.camera[0]
        return row

    @camera.setter
    def camera(self, row: npt.ArrayLike) -> None:
        self.camera[:] = row

    @property
    def pulses(self) -> int:
        """Number of radio pulses that arrive."""
        return int(self._senses.pulses[0])

    @pulses.setter
    def pulses(self, count: int) -> None:
        self._senses.pulses[0] = count

    @property
    def messages(self) -> IntArray:
        """(8,): what the pulses say; 0 for a bare one."""
        row: IntArray = self._senses.messages[0]
        return row

    @messages.setter
    def messages(self, messages: npt.ArrayLike) -> None:
        self.messages[:] = messages

    @property
    def new_picture(self) -> bool:
        """Whether `camera` is a picture that the robot has not seen before; True unless it is set."""
        return bool(self._senses.new_picture[0])

    @new_picture.setter
    def new_picture(self, is_new: bool) -> None:
        self._senses.new_picture[0] = is_new

    @property
    def step_ms(self) -> int:
        """Milliseconds on the robot's own clock since its last step."""
        return int(self._senses.step_ms[0])

    @step_ms.setter
    def step_ms(self, milliseconds: int) -> None:
        self._senses.step_ms[0] = milliseconds

    @property
    def left_cm_s(self) -> float:
        """Speed of the left wheel as commanded, which the simulator limits to 12.8 either way."""
        return float(self._actuators["left_cm_s"][0])

    @left_cm_s.setter
    def left_cm_s(self, speed: float) -> None:
        self._actuators["left_cm_s"] = speed

    @property
    def right_cm_s(self) -> float:
        """Speed of the right wheel as commanded, which the simulator limits to 12.8 either way."""
        return float(self._actuators["right_cm_s"][0])

    @right_cm_s.setter
    def right_cm_s(self, speed: float) -> None:
        self._actuators["right_cm_s"] = speed

    @property
    def ring_on(self) -> bool:
        """Whether the LED ring is lit."""
        return bool(self._actuators["ring_on"][0])

    @ring_on.setter
    def ring_on(self, is_on: bool) -> None:
        self._actuators["ring_on"] = is_on

    @property
    def send(self) -> int:
        """The message that is sent by radio; 0 if none is."""
        return int(self._actuators["send"][0])

    @property
    def turn_rad(self) -> float:
        """The turn on the spot, to the left."""
        return float(self._actuators["turn_rad"][0])


class Record:
    """Values by name, read and set as attributes; numbers are Python's, arrays are the robot's own."""

    __slots__ = ("_kind", "_values")
    _kind: str
    _values: npt.NDArray[np.void]

    def __init__(self, kind: str, values: npt.NDArray[np.void]) -> None:
        """Show the only record of an array.

        Args:
            kind: What it is called in messages.
            values: (1,) the record.
        """
        object.__setattr__(self, "_kind", kind)
        object.__setattr__(self, "_values", values.view(np.ndarray))

    def __getattr__(self, name: str) -> Any:
        value = self._field(name)[0]
        return value.item() if isinstance(value, np.generic) else value

    def __setattr__(self, name: str, value: object) -> None:
        self._field(name)[0] = value

    def __dir__(self) -> list[str]:
        return list(self._values.dtype.names or ())

    def __repr__(self) -> str:
        return f"{self._kind}({', '.join(f'{name}={getattr(self, name)}' for name in dir(self))})"

    def _field(self, name: str) -> npt.NDArray[Any]:
        if name not in (self._values.dtype.names or ()):
            raise AttributeError(unknown_name(self._kind, name, list(self._values.dtype.names or ())))
        return self._values[name]
