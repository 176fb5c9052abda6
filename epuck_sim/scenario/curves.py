"""The response of an oscillator to a pulse: its curve, by name or in a user's file (thesis 2.4, 5.1.1).

PARAMETERS = {"bend": 2.0}                       optional: name -> default

def phase_shift(phase, coupling, parameters):    the shift, at phases from above the refractory period to 1
    return coupling * phase ** parameters.bend
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Annotated, Any, ClassVar

from pydantic import Field, model_validator

from epuck_sim.errors import CurveError, ScenarioError
from epuck_sim.scenario.base import ConfigModel, Number
from epuck_sim.user_files import Kind, Place, Value, kept, line_of_error, load_python_file, with_defaults
from epuck_sim.util.messages import short_repr

SHIPPED: Mapping[str, Mapping[str, Value]] = {
    "multiplicative": {},
    "sawtooth": {},
    "sine": {},
    "additive": {},
    "mirollo_strogatz": {"dissipation": 3.0},
    "piecewise_linear": {"knee": 0.5, "early_slope": 1.0},
}
"""Name and default of each parameter of the shipped curves, by their names."""

LIMITS = {"dissipation": (1e-3, 100.0), "knee": (0.0, 1.0), "early_slope": (-1000.0, 1000.0)}
"""Least and greatest value of the shipped curves' parameters."""

UP_TO_1 = ("sawtooth", "sine", "additive", "mirollo_strogatz")
"""Curves whose coupling is at most 1 (thesis 5.1.1; that of the last two is a part of the way to the threshold)."""

TRIED_PHASES = 100
"""Number of steps from phase 0 to 1 in which a user's curve is tried when a scenario is read."""


@dataclass(frozen=True, eq=False)
class Curve:
    """A response curve as a scenario names it."""

    name: str
    """Name of a shipped or installed curve, or a file."""
    parameters: Mapping[str, Value]
    """Name and default of each parameter."""
    phase_shift: Callable[[float, float, Any], float] | None = None
    """The function of a user's file."""
    sources: Mapping[Path, bytes] = field(default_factory=dict)
    """Contents of every file that a user's curve comes from, at the time of loading."""
    modules: Mapping[Path, ModuleType] = field(default_factory=dict)
    """The module made from each of these files."""

    def resolve(self, given: Mapping[str, object]) -> dict[str, Value]:
        """Return every parameter with its given value or its default.

        Raises:
            ValueError: A name or value is not allowed; the message says what is.
        """
        values = with_defaults(self.name, given, self.parameters)
        if self.phase_shift is None:
            for name, value in values.items():
                low, high = LIMITS[name]
                if not low <= value <= high:
                    raise ValueError(f"{name} is {value}; allowed: {low:g} to {high:g}")
        return values

    def check_shifts(self, coupling: float, parameters: Mapping[str, Value]) -> None:
        """Call a user's function at phases from 0 to 1.

        Raises:
            CurveError: It raises, or what it returns is no finite number.
        """
        for step in range(TRIED_PHASES + 1) if self.phase_shift else ():
            assert self.phase_shift is not None
            phase = step / TRIED_PHASES
            try:
                shift = self.phase_shift(phase, coupling, SimpleNamespace(**parameters))
                is_number = not isinstance(shift, complex) and math.isfinite(shift)
            except Exception as error:  # whatever a user's file may raise
                where = line_of_error(error, self.sources) or self.name
                raise CurveError(f"{where}: at phase {phase:g}: {type(error).__name__}: {error}") from error
            if not is_number:
                raise CurveError(f"{self.name}: phase_shift returns {short_repr(shift)} at phase {phase:g}")


_SHIPPED_CURVES = {name: Curve(name, parameters) for name, parameters in SHIPPED.items()}

CURVE = Kind(
    noun="response curve",
    error=CurveError,
    suffixes=(".py",),
    group="epuck_sim.curves",
    shipped=lambda: dict.fromkeys(SHIPPED),
)
"""What response curves are found by."""


def find_curve(name: str, folder: Path | None = None) -> Curve:
    """Return a response curve.

    Args:
        name: The name of a shipped curve, or of one that an installed package offers, or the path of a file.
        folder: Where a relative path begins; if there is no such file, it begins at the working directory.

    Raises:
        CurveError: There is no such curve, or the file does not define one.
    """
    place = CURVE.locate(name, folder)
    return _SHIPPED_CURVES[name] if place.path is None else _load(place)


@kept
def _load(place: Place) -> Curve:
    file = load_python_file(place, CurveError)
    function = file.parts.get("phase_shift")
    if not callable(function):
        said = "a response curve needs a function phase_shift(phase, coupling, parameters)"
        raise file.refusal("phase_shift", said)
    return Curve(place.name, file.parameters(), function, file.sources, file.modules)


def map_curves(key: str, value: Any, change: Callable[[Any], str]) -> Any:
    """Return the value of an axis in which `change` has replaced the response curve that it names."""
    if key == "response.curve":
        return change(value)
    if key == "response" and isinstance(value, Mapping) and "curve" in value:
        return {**value, "curve": change(value["curve"])}
    return value


class ResponseSection(ConfigModel):
    """How a pulse shifts the phase of an agent that receives it (2.4, 5.1.1)."""

    later_keys: ClassVar[tuple[str, ...]] = ("parameters",)

    curve: str = "multiplicative"
    """Phase response curve, shift of the phase against the phase (5.1.1): the name of a shipped or installed one, or a
    file that ends in .py, relative to the scenario's file."""
    coupling: Annotated[Number, Field(ge=0, le=1e6)] = 0.1
    """Strength of the response: epsilon, or kappa of the sawtooth and sine curves."""
    refractory: Annotated[Number, Field(ge=0, lt=0.5)] = 0.0
    """Phase D, up to which pulses have no effect."""
    parameters: dict[str, Any] = Field(default_factory=dict)
    """The curve's further parameters by name; those that are left out have the curve's defaults."""

    @model_validator(mode="after")
    def _check_coupling(self) -> "ResponseSection":
        if self.curve in UP_TO_1 and self.coupling > 1:
            raise ValueError(f"coupling is {self.coupling:g}; allowed: 0 to 1 for the {self.curve} curve")
        return self


def resolve_response(response: ResponseSection, origin: str, folder: Path | None = None) -> ResponseSection:
    """Return a response with the path of its curve, if that is a user's, and with all parameters.

    Raises:
        ScenarioError: There is no such curve, or it does not take these parameters; the message begins with `origin`.
    """
    try:
        curve = find_curve(response.curve, folder)
    except CurveError as error:
        raise ScenarioError(f"{origin}.curve: {error}") from error
    try:
        parameters = curve.resolve(response.parameters)
        curve.check_shifts(response.coupling, parameters)
    except (CurveError, ValueError) as error:
        raise ScenarioError(f"{origin}: {error}") from error
    if (curve.name, parameters) == (response.curve, response.parameters):
        return response
    return response.model_copy(update={"curve": curve.name, "parameters": parameters})
