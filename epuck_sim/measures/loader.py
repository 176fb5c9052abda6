"""Finds measures: shipped and installed ones by name, users' as FILE.py:NAME, or as FILE.py if it holds one."""

import inspect
import re
from functools import cache
from importlib import import_module
from pathlib import Path

from epuck_sim.control.names import check_draws
from epuck_sim.errors import MeasureError
from epuck_sim.measures.interface import CALLED, Measure, default_parameters
from epuck_sim.user_files import Kind, Place, PythonFile, kept, load_python_file
from epuck_sim.util.messages import comma_list, did_you_mean, nearest_name, short_repr

_BY_MODULE = {
    "clusters": "cluster_count cluster_life largest_cluster",
    "consensus": "consensus words",
    "flashes": "flashes_missed flashes_repeated flashes_seen",
    "links": "component_count degree isolated largest_component link_life neighbour_change spanning_time",
    "memory": "memory",
    "motion": "avoiding coverage density in_contact mean_speed mean_squared_displacement moved near_walls "
    "velocity_correlation_time",
    "order": "below_threshold order_parameter stays_above threshold_cycles",
    "perturbations": "perturbation perturbation_exponent perturbation_growth perturbation_transient",
    "suspicion": "detection_delay false_alarms",
}

SHIPPED = {name: module for module, names in _BY_MODULE.items() for name in names.split()}
"""Module of each shipped measure, by its name, which is that of its class: `link_life` is `LinkLife`."""

MEASURE = Kind(
    noun="measure",
    error=MeasureError,
    suffixes=(".py",),
    group="epuck_sim.measures",
    shipped=lambda: dict.fromkeys(sorted(SHIPPED)),
    form="FILE.py:NAME",
)
"""What measures are found by."""


def find_measure(name: str, folder: Path | None = None) -> Measure:
    """Return a measure."""
    file, _, member = name.rpartition(":") if ":" in name and not name.endswith(".py") else (name, "", "")
    place = MEASURE.locate(file, folder)
    if place.path is not None:
        return _measure_in(_load(place), place, member)
    if member:
        raise MeasureError(f"{name!r} names no file; give FILE.py:NAME, or FILE.py")
    return _shipped_measure(place.name)


@cache
def _shipped_measure(name: str) -> Measure:
    make = getattr(import_module(f"epuck_sim.measures.{SHIPPED[name]}"), name.title().replace("_", ""))
    return Measure(name, name, make, default_parameters(make), {}, getattr(make, "UNIT", ""))


@kept
def _load(place: Place) -> PythonFile:
    file = load_python_file(place, MeasureError)
    check_draws(file, "draw from numpy.random.default_rng(simulation.seed)")
    return file


def _measure_in(file: PythonFile, place: Place, member: str) -> Measure:
    """Return the measure of this name in a file, or its only one, under the name by which a package offers it.

    A file holds its classes with a method `value`, or else its public functions; others are given by name.
    """
    own = {
        name: value
        for name, value in file.parts.items()
        if not name.startswith("_") and getattr(value, "__module__", None) == file.path.stem
    }
    classes = {name: value for name, value in own.items() if inspect.isclass(value) and hasattr(value, "value")}
    functions = {name: value for name, value in own.items() if inspect.isfunction(value)}
    found = classes or functions
    known = found | {name: value for name, value in functions.items() if inspect.signature(value).parameters}
    chosen = member
    if not member:
        if len(found) != 1:
            raise MeasureError(f"{file.path}: holds {comma_list(known)}; give one of them as {file.path.name}:NAME")
        (chosen,) = found
    if chosen not in file.parts:
        raise MeasureError(f"{file.path}: {did_you_mean(chosen, known)}; it holds {comma_list(known)}")
    make = file.parts[chosen]
    if not callable(make):
        raise file.refusal(chosen, f"{chosen} is {short_repr(make)}; a measure is a class or a function")
    if inspect.isclass(make):
        _check_methods(make, file)
    try:
        parameters = default_parameters(make)
    except ValueError as error:
        raise file.refusal(chosen, f"{chosen} {error}") from error
    unit = getattr(make, "UNIT", file.parts.get("UNIT", ""))
    if not isinstance(unit, str):
        raise file.refusal("UNIT", f"{chosen} has UNIT = {short_repr(unit)}; a unit is text")
    stored = place.name if not member and place.package else f"{place.name}:{chosen}"
    return Measure(place.name if stored == place.name else chosen, stored, make, parameters, file.sources, unit)


def _check_methods(make: type, file: PythonFile) -> None:
    """Raise MeasureError for a class without `value`, or with what looks like a method that trials call and is none."""
    name = make.__name__
    if not callable(getattr(make, "value", None)):
        raise file.refusal(name, f"{name} has no method value(self), which returns what was measured")
    for method, function in vars(make).items():
        if not inspect.isfunction(function) or method.startswith("_") or method in CALLED:
            continue
        looks_so = nearest_name(method, CALLED) or len(inspect.signature(function).parameters) == 3
        use = re.compile(rf"\b(self|{name})\.{method}\b".encode())  # `state.cycles` is no use of a method cycles
        if looks_so and not any(map(use.search, file.sources.values())):
            where = f"{file.path}:{function.__code__.co_firstlineno}: {name}"
            said = f"nothing calls {method}: {did_you_mean(method, [*CALLED])}; trials call {', '.join(CALLED)}"
            raise MeasureError(f"{where}: {said}")
