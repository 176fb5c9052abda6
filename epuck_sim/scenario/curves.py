"""Response curves: shipped ones by name, a user's in a file, with every parameter filled in (thesis 2.4, 5.1.1).

PARAMETERS = {"bend": 2.0}                       optional: name -> default

def phase_shift(phase, coupling, parameters):    the shift, at phases from above the refractory period to 1
    return coupling * phase ** parameters.bend
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from epuck_sim.control.interface import Value, record_type, typed
from epuck_sim.errors import CurveError
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr
from epuck_sim.util.python_files import line_of_error, load_python_file

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
    """Name of a shipped curve, or a file."""
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
            CurveError: A name or value is not allowed; the message says what is.
        """
        for name in given:
            if name not in self.parameters:
                raise CurveError(
                    f"{did_you_mean(name, self.parameters)}; {self.name} has {comma_list(self.parameters)}"
                )
        try:
            values = {name: typed(name, given.get(name, own), own) for name, own in self.parameters.items()}
        except ValueError as error:
            raise CurveError(str(error)) from error
        if self.phase_shift is None:
            for name, value in values.items():
                low, high = LIMITS[name]
                if not low <= value <= high:
                    raise CurveError(f"{name} is {value}; allowed: {low:g} to {high:g}")
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
_loaded: dict[Path, tuple[list[int], Curve]] = {}


def find_curve(name: str, folder: Path | None = None) -> Curve:
    """Return a response curve.

    Args:
        name: The name of a shipped curve, or the path of a file, which ends in .py.
        folder: Where a relative path begins; if there is no such file, it begins at the working directory.

    Raises:
        CurveError: There is no such curve, or the file does not define one.
    """
    if name in _SHIPPED_CURVES:
        return _SHIPPED_CURVES[name]
    if not name.endswith(".py"):
        raise CurveError(
            f"{did_you_mean(name, dict(SHIPPED))}; allowed: {comma_list(dict(SHIPPED))}, or a file that ends in .py"
        )
    folders = dict.fromkeys([folder or Path(), Path()])
    for place in folders:
        if (place / name).is_file():
            path = (place / name).resolve()
            stamps, curve = _loaded.get(path, ([], None))
            if curve is None or stamps != _stamps(curve):
                curve = _load_curve(path)
                _loaded[path] = _stamps(curve), curve
            return curve
    raise CurveError(f"no file {name!r} in {' or '.join(str(place.resolve()) for place in folders)}")


def _stamps(curve: Curve) -> list[int]:
    """Return when each file of a curve was changed; it is loaded again after a change."""
    return [source.stat().st_mtime_ns for source in curve.sources if source.exists()]


def _load_curve(path: Path) -> Curve:
    try:
        file = load_python_file(path)
    except (Exception, SystemExit) as error:  # whatever a user's file may raise
        raise CurveError(f"{path}: cannot be loaded: {type(error).__name__}: {error}") from error
    function, parameters = vars(file.module).get("phase_shift"), vars(file.module).get("PARAMETERS", {})
    if not callable(function):
        raise CurveError(f"{path}: a response curve needs a function phase_shift(phase, coupling, parameters)")
    if not isinstance(parameters, dict):
        raise CurveError(f"{path}: PARAMETERS is {short_repr(parameters)}; allowed: a mapping of names to numbers")
    try:
        parameters = {name: typed(name, default, default) for name, default in parameters.items()}
        record_type({name: type(default) for name, default in parameters.items()})
    except (TypeError, ValueError) as error:
        raise CurveError(f"{path}: PARAMETERS: {error}") from error
    return Curve(str(path), parameters, function, file.sources, file.modules)


def map_curves(key: str, value: Any, change: Callable[[Any], str]) -> Any:
    """Return the value of an axis in which `change` has replaced the response curve that it names."""
    if key == "response.curve":
        return change(value)
    if key == "response" and isinstance(value, Mapping) and "curve" in value:
        return {**value, "curve": change(value["curve"])}
    return value
