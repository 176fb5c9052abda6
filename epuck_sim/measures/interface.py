"""What a measure is: a small class, or a function, that is told of a trial and returns one value at its end.

docs/measures.md has its methods and attributes. A measure is told of what it has methods for; without any but `cycle`
and `value`, compiled code runs from one cycle to the next.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

from epuck_sim.user_files import run_check, typed, with_defaults

Parameter = bool | int | float | str  # value of a parameter of a measure
Scalar = bool | int | float | None  # a number, a truth value, or None where it is undetermined
Value = Scalar | list[Scalar]  # value of a measure: one, or a series with one for each cycle

STEP_METHOD, STRETCH_METHOD = "step", "stretch"
"""Methods that are told of control steps of robots: of each, and of many in a row at once."""

EVENT_METHODS = {STEP_METHOD: "every control step of robots", "event": "every event of point agents"}
"""Methods that are called after every event of a trial, and what they are told of."""

CYCLE_METHOD = "cycle"  # method that is called after every firing of the reference

CALLED = (*EVENT_METHODS, STRETCH_METHOD, CYCLE_METHOD, "value", "check", "check_scenario")
"""Methods that are called where a measure has them."""


@dataclass(frozen=True, eq=False)
class Measure:
    """A measure as it was found."""

    name: str  # name of its value in results
    stored_name: str
    """Name by which it is found again: of a shipped or installed one, or a file's path, a colon and a name in it."""
    make: Callable[..., Any]  # the class or function
    parameters: Mapping[str, Parameter]  # name and default of each parameter
    sources: Mapping[Path, bytes]
    """Contents of every file that a user's measure comes from, at the time of loading; empty for a shipped one."""
    unit: str = ""  # unit of its value, which figures name; empty if it has none

    @property
    def is_function(self) -> bool:
        """Whether it is a function, which is called at the end alone."""
        return not inspect.isclass(self.make)

    def is_told(self, method: str) -> bool:
        """Return whether it has a method of this name, or one in its place, to be told by."""
        return not self.is_function and hasattr(self.make, self.told_by(method))

    def told_by(self, method: str) -> str:
        """Return the name of the method by which it is told: of steps, that of stretches if it has it."""
        in_place = method == STEP_METHOD and hasattr(self.make, STRETCH_METHOD)
        return STRETCH_METHOD if in_place else method

    def check_model(self, model: str, event_method: str) -> None:
        """Raise ValueError if it cannot measure trials of a model."""
        models = getattr(self.make, "MODELS", None)
        if models is not None:
            if model not in models:
                raise ValueError(f"{self.name} measures model: {' or '.join(models)}; this is model: {model}")
            return
        methods = [method for method in EVENT_METHODS if self.is_told(method)]
        if methods and event_method not in methods:
            raise ValueError(
                f"{self.name} asks for {EVENT_METHODS[methods[0]]}, by its method {methods[0]}; model: {model} tells "
                f"of {EVENT_METHODS[event_method]}, by {event_method}"
            )

    def check_scenario(self, scenario: Any, parameters: Mapping[str, Parameter]) -> None:
        """Raise ValueError if it cannot measure trials of a scenario, which has everything filled in, with these."""
        check = getattr(self.make, "check_scenario", None)
        if check is not None:
            check(scenario, SimpleNamespace(**parameters))

    def resolve(self, given: Mapping[str, object]) -> dict[str, Parameter]:
        """Return every parameter with its given value or its default."""
        values = with_defaults(self.name, given, self.parameters)
        run_check(getattr(self.make, "check", None), values, self.sources)
        return values


def default_parameters(make: Callable[..., Any]) -> dict[str, Parameter]:
    """Return the parameters of a class or function, all that it takes after the simulation, and their defaults."""
    try:
        first, *others = inspect.signature(make).parameters.values()
    except (TypeError, ValueError):
        raise ValueError("takes nothing; a measure takes the simulation, and its parameters as keywords") from None
    if first.kind not in (first.POSITIONAL_ONLY, first.POSITIONAL_OR_KEYWORD):
        raise ValueError(f"takes {first} first; a measure takes the simulation, and its parameters as keywords")
    parameters: dict[str, Parameter] = {}
    for parameter in others:
        default = parameter.default
        if not isinstance(default, Parameter) or parameter.kind == parameter.POSITIONAL_ONLY:
            raise ValueError(
                f"has a parameter {parameter}; allowed: keywords whose default is a number, true or false, or text"
            )
        parameters[parameter.name] = typed(parameter.name, default, default)
    return parameters
