"""The interface of measures, and how they are found: by name, or in a user's file as FILE.py:NAME or FILE.py.

A measure is a small class that follows a trial and returns one value at its end, or a function that is called then.
docs/measures.md has its methods and attributes. A trial calls the methods that a measure has; if these are `cycle` and
`value` alone, compiled code runs from one cycle to the next.
"""

import ast
import inspect
import re
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from epuck_sim.control.names import check_draws
from epuck_sim.errors import MeasureError
from epuck_sim.user_files import Kind, Place, PythonFile, kept, load_python_file, run_check, typed, with_defaults
from epuck_sim.util.messages import comma_list, did_you_mean, nearest_name, short_repr

Parameter = bool | int | float | str  # value of a parameter of a measure
Scalar = bool | int | float | None  # a number, a truth value, or None where it is undetermined
Value = Scalar | list[Scalar]  # value of a measure: one, or a series with one for each cycle

T_SYNC_S = "t_sync_s"  # name by which T_sync in seconds is asked for, as if it were a measure
T_SYNC = (None, T_SYNC_S)  # what is asked for if not a measure; None is T_sync in cycles

EVENT_METHODS = {"step": "every control step of robots", "event": "every event of point agents"}
"""Methods that are called after every event of a trial, and the events of each."""

CYCLE_METHOD = "cycle"  # method that is called at every firing of the reference

AT_ONCE = {"step": "stretch", CYCLE_METHOD: "batch"}
"""Methods that are called with many steps or firings in a row, by those in whose place they are called."""

TAKES: dict[str, tuple[str, ...]] = {each: ("self", each, "state") for each in (*EVENT_METHODS, *AT_ONCE.values())}
TAKES |= {CYCLE_METHOD: TAKES["event"], "value": ("self",)}  # what the methods take that trials call

CALLED = (*TAKES, "check", "check_scenario")  # all methods that are called, if a measure has them


@dataclass(frozen=True, eq=False)
class Measure:
    """A measure as it was found."""

    name: str  # name of its value in results
    stored_name: str  # that by which it is found again: of a shipped or installed one, or FILE.py:NAME with its path
    make: Callable[..., Any]  # the class or function
    parameters: Mapping[str, Parameter]  # name and default of each parameter
    sources: Mapping[Path, bytes]  # contents, when loaded, of every file that it comes from; empty for a shipped one
    unit: str = ""  # unit of its value, which figures name; empty if it has none
    over: str = "cycle"  # noun for the items of a series

    @property
    def is_function(self) -> bool:
        """Whether it is a function, which is called at the end alone."""
        return not inspect.isclass(self.make)

    def told_by(self, method: str) -> str | None:
        """Return the method to call for this one, that for many `AT_ONCE` if it has it; None if it has neither."""
        methods = (AT_ONCE.get(method, method), method)
        return None if self.is_function else next((each for each in methods if hasattr(self.make, each)), None)

    def check_model(self, model: str, event_method: str) -> None:
        """Raise ValueError if it cannot measure trials of a model."""
        models = getattr(self.make, "MODELS", None)
        if models is not None:
            if model not in models:
                raise ValueError(f"{self.name} measures model: {' or '.join(models)}; this is model: {model}")
            return
        methods = [method for method in EVENT_METHODS if self.told_by(method)]
        if methods and event_method not in methods:
            has = f"has a method {methods[0]}, for {EVENT_METHODS[methods[0]]}"
            calls = f"model: {model} calls {event_method}, for {EVENT_METHODS[event_method]}"
            raise ValueError(f"{self.name} {has}; {calls}")

    def check_scenario(self, scenario: Any, parameters: Mapping[str, Parameter]) -> None:
        """Raise ValueError if it cannot, with these parameters, measure trials of a resolved scenario."""
        if check := getattr(self.make, "check_scenario", None):
            check(scenario, SimpleNamespace(**parameters))

    def resolve(self, given: Mapping[str, object]) -> dict[str, Parameter]:
        """Return every parameter with its given value or its default."""
        values = with_defaults(self.name, given, self.parameters)
        run_check(getattr(self.make, "check", None), values, self.sources)
        return values


def default_parameters(make: Callable[..., Any]) -> dict[str, Parameter]:
    """Return name and default of each parameter that a class or function takes after the simulation."""
    try:
        first, *others = inspect.signature(make).parameters.values()
    except (TypeError, ValueError):
        raise ValueError("takes nothing; a measure takes the simulation, and its parameters as keywords") from None
    if first.kind not in (first.POSITIONAL_ONLY, first.POSITIONAL_OR_KEYWORD):
        raise ValueError(f"takes {first} first; a measure takes the simulation, and its parameters as keywords")
    parameters: dict[str, Parameter] = {}
    for parameter in others:
        default = parameter.default
        is_text_or_number = isinstance(default, Parameter) and parameter.kind != parameter.POSITIONAL_ONLY
        if not is_text_or_number or parameter.name == "measure":  # run folders store the measure itself under this name
            allowed = "keywords whose default is a number, true or false, or text, and none called measure"
            raise ValueError(f"has a parameter {parameter}; allowed: {allowed}")
        parameters[parameter.name] = typed(parameter.name, default, default)
    return parameters


_BY_MODULE = {
    "consensus": "consensus words",
    "flashes": "detection_delay false_alarms flashes_missed flashes_repeated flashes_seen",
    "links": "component_count degree isolated largest_component link_life neighbour_change spanning_time",
    "memory": "memory",
    "motion": "avoiding coverage density in_contact mean_speed mean_squared_displacement moved near_walls "
    "velocity_correlation_time",
    "perturbations": "perturbation perturbation_exponent perturbation_growth perturbation_transient",
    "synchrony": "below_threshold cluster_count cluster_life group_order largest_cluster order_parameter stays_above "
    "threshold_cycles",
}

SHIPPED = {name: module for module, names in _BY_MODULE.items() for name in names.split()}
"""Module of each shipped measure, by its name, which is that of its class: `link_life` is `LinkLife`."""

NAMED = {"UNIT": "", "OVER": "cycle"}
"""Constants that a measure, or its file, may have, and their defaults: see `Measure.unit` and `over`."""

SERIES_COLUMNS = ("trials", "known", "mean", "low", "high", "median", "median_low", "median_high")
"""Columns of a table of series after the one of its items; `known` is the number of trials that have a value there."""

MEASURE = Kind(
    noun="measure",
    error=MeasureError,
    suffixes=(".py",),
    group="epuck_sim.measures",
    shipped=lambda: dict.fromkeys(sorted(SHIPPED)),
    form="FILE.py:NAME",
)
"""How measures are found."""


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
    named = (getattr(make, part, by_default) for part, by_default in NAMED.items())
    return Measure(name, name, make, default_parameters(make), {}, *named)


@kept
def _load(place: Place) -> PythonFile:
    file = load_python_file(place, MeasureError)
    check_draws(file, "draw from numpy.random.default_rng(simulation.seed)")
    return file


def _measure_in(file: PythonFile, place: Place, member: str) -> Measure:
    """Return the measure of this name in a file, or its only one, under the name by which a package offers it.

    Its measures are classes with a method `value`, and public functions of a simulation, of which others are helpers
    if it uses them itself; a name may give any.
    """
    own = {
        name: value
        for name, value in file.parts.items()
        if not name.startswith("_") and getattr(value, "__module__", None) == file.path.stem
    }
    classes = {name: value for name, value in own.items() if inspect.isclass(value) and hasattr(value, "value")}
    functions = {name: value for name, value in own.items() if inspect.isfunction(value) and name != "check"}
    fitting: dict[str, Any] = {}
    for name, value in functions.items():
        with suppress(ValueError):
            fitting[name] = default_parameters(value)
    known = classes | fitting
    if not (chosen := member):
        used = {node.id for node in ast.walk(ast.parse(file.sources[file.path])) if isinstance(node, ast.Name)}
        unused = {name: each for name, each in fitting.items() if name not in used}
        found = classes | unused or fitting or functions
        if len(found) != 1:
            given = place.name if place.package else file.path.name
            several = f"{comma_list(known)}; give one of them as {given}:NAME"
            none = "no measure: a class with a method `value`, or a function of a simulation"
            raise MeasureError(f"{file.path}: holds {several if known else none}")
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
    named = {part: getattr(make, part, file.parts.get(part, by_default)) for part, by_default in NAMED.items()}
    for part, text in named.items():
        if not isinstance(text, str):
            raise file.refusal(part, f"{chosen} has {part} = {short_repr(text)}; allowed: text")
    if not named["OVER"].isidentifier() or named["OVER"] in SERIES_COLUMNS:
        allowed = f"a noun of one word for one item, such as cycle; not {', '.join(SERIES_COLUMNS)}"
        raise file.refusal("OVER", f"{chosen} has OVER = {short_repr(named['OVER'])}; allowed: {allowed}")
    stored = place.name if not member and place.package else f"{place.name}:{chosen}"
    name = place.name if stored == place.name else chosen
    return Measure(name, stored, make, parameters, file.sources, *named.values())


def _check_methods(make: type, file: PythonFile) -> None:
    """Raise MeasureError for a class that lacks `value`, or has a method that trials would call wrongly, or never."""
    name = make.__name__
    if not callable(getattr(make, "value", None)):
        raise file.refusal(name, f"{name} has no method value(self), which returns what was measured")
    for method, function in vars(make).items():
        if not inspect.isfunction(function) or method.startswith("_"):
            continue
        where = f"{file.path}:{function.__code__.co_firstlineno}: {name}"
        if method in TAKES:
            try:
                inspect.signature(function).bind(*TAKES[method])
            except TypeError:
                own, called = inspect.signature(function), f"{method}({', '.join(TAKES[method])})"
                raise MeasureError(f"{where}: has {method}{own}; trials call {called}") from None
        if method in CALLED:
            continue
        looks_so = nearest_name(method, CALLED) or len(inspect.signature(function).parameters) == 3
        use = re.compile(rf"\b(self|{name})\.{method}\b".encode())  # `state.cycles` is no use of a method cycles
        if looks_so and not any(map(use.search, file.sources.values())):
            said = f"nothing calls {method}: {did_you_mean(method, [*CALLED])}; trials call {', '.join(CALLED)}"
            raise MeasureError(f"{where}: {said}")
