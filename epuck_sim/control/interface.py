"""What a controller is: one Python file with `PARAMETERS`, `MEMORY`, `start` and `step`; see `controller_file`.

    PARAMETERS = {"speed_cm_s": 6.0}     name -> default; the default's type is the parameter's type
    MEMORY = {"turns": int}              name -> type, or (type, shape): what a robot remembers between two steps

    def start(memory, parameters, random): ...
    def step(sensors, memory, actuators, parameters, random): ...
    def check(parameters): ...           optional: raises ValueError on values that make no sense

`step` reads `sensors` (see `Sensors`), keeps what it likes in `memory`, and sets `actuators.left_cm_s`,
`actuators.right_cm_s` and `actuators.ring_on`. `random` is the robot's own stream for `epuck_sim.util.rng`.
A robot whose memory has `phase_ms` and whose parameters have `period_s` is an oscillator: its synchrony is measured.
A controller may import others that lie beside it, and shipped ones, by their file's name.
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

Value = bool | int | float

MAX_WHOLE = 2**53
"""Whole parameters are smaller than this: they are the same as `int` and as `float`."""


class Sensors(NamedTuple):
    """What one robot senses at the start of a control step."""

    step_ms: int
    """Whole milliseconds that have passed on the robot's own clock since its last control step."""
    infrared: FloatArray
    """(8,) counts: raw readings of the proximity sensors."""
    distance_mm: IntArray
    """(8,) mm: distances that belong to the readings; `epuck.OUT_OF_RANGE_MM` where nothing is in range."""
    camera: IntArray
    """(pixels,): 1 where a lit ring is seen, 0 where not; index 0 is the left edge of the picture."""
    new_picture: bool = True
    """Whether `camera` holds a picture that the controller has not had before; where cameras take fewer pictures than
    there are control steps, it holds the last one until the next is there."""


ACTUATORS = np.dtype([("left_cm_s", np.float64), ("right_cm_s", np.float64), ("ring_on", np.int64)], align=True)
"""What a controller sets, one record a robot; it keeps its values until they are set anew."""


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller as its file describes it."""

    name: str
    path: Path
    parameters: Mapping[str, Value]
    """Name and default of each parameter."""
    memory: np.dtype[Any]
    """The record of what a robot remembers."""
    start: Callable[..., None]
    step: Callable[..., None]
    check: Callable[[SimpleNamespace], None] | None
    sources: Mapping[Path, bytes]
    """What stood in every file that the controller's code comes from when it was loaded."""

    @property
    def is_oscillator(self) -> bool:
        """Whether its robots have a phase, one number, and a period."""
        has_phase = "phase_ms" in (self.memory.names or ()) and self.memory["phase_ms"].shape == ()
        return has_phase and isinstance(self.parameters.get("period_s"), float)

    def resolve(self, given: Mapping[str, object]) -> dict[str, Value]:
        """Return every parameter with its given value or its default.

        Raises ValueError, which names the parameter, the value and what is allowed.
        """
        for name in given:
            if name not in self.parameters:
                raise ValueError(
                    f"{did_you_mean(name, self.parameters)}; {self.name} has {comma_list(self.parameters)}"
                )
        values = {
            name: typed(name, given[name], default) if name in given else default
            for name, default in self.parameters.items()
        }
        if self.is_oscillator and values["period_s"] <= 0:
            raise ValueError(f"period_s is {values['period_s']}; allowed: above 0")
        if self.check is not None:
            try:
                self.check(SimpleNamespace(**values))
            except Exception as error:  # whatever a user's file may raise
                raise ValueError(str(error) if isinstance(error, ValueError) else f"check: {error!r}") from error
        return values

    def parameter_record(self, values: Mapping[str, Value]) -> npt.NDArray[np.void]:
        """Return a record array of length 1 that holds `values`."""
        record = np.zeros(1, record_type({name: type(value) for name, value in self.parameters.items()}))
        for name, value in values.items():
            record[name] = value
        return record


def typed(name: str, given: object, default: Value) -> Value:
    """Return `given` as a value of the default's type, or raise ValueError."""
    if isinstance(default, bool):
        if isinstance(given, bool):
            return given
        raise ValueError(f"{name} is {given!r}; allowed: true or false")
    if isinstance(given, int | float) and not isinstance(given, bool):
        if isinstance(default, float) and abs(given) <= sys.float_info.max:
            return float(given)
        if isinstance(default, int) and abs(given) < MAX_WHOLE and given == int(given):
            return int(given)
    wanted = "a whole number" if isinstance(default, int) else "a number"
    raise ValueError(f"{name} is {short_repr(given)}; allowed: {wanted}")


def record_type(fields: Mapping[str, Any]) -> np.dtype[Any]:
    """Return the record with `fields`, name -> type or (type, shape); truth values are kept as 0 and 1.

    Raises ValueError on a name that a record cannot have, or a type that is not int, float or bool.
    """
    columns: list[tuple[Any, ...]] = []
    for name, field in fields.items():
        kind, *shape = field if isinstance(field, tuple) else (field,)
        if kind not in (bool, int, float):
            raise ValueError(f"{name!r} is {field!r}; allowed: int, float, bool, or one of them and a shape")
        if not isinstance(name, str) or not name.isidentifier() or hasattr(np.recarray, name):
            raise ValueError(f"{name!r} is no name that a record can have, or one that numpy needs; choose another")
        columns.append((name, np.float64 if kind is float else np.int64, *shape))
    return np.dtype(columns or [("nothing", np.int64)], align=True)
