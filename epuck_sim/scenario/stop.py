"""When a trial ends, and what is measured in it."""

import operator
import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, model_serializer, model_validator

from epuck_sim.errors import ScenarioError
from epuck_sim.measures.measure import CYCLE_METHOD, Measure, find_measure
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber, refused_at
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

CONDITION = re.compile(r"\s*(\w+)\s*(>=|<=|>|<)\s*([-+.\w]+)\s*")
"""A condition as text: a measure, a relation and a number."""


RELATIONS = {">": operator.gt, ">=": operator.ge, "<": operator.lt, "<=": operator.le}
"""Functions by the relations that a condition may have."""


class Condition(ConfigModel):
    """A condition on a measure; also read from text, such as `near_walls < 0.2`."""

    measure: Annotated[str, Field(min_length=1)]
    """One of the scenario's measures, or `order_parameter`; of a series the last value counts, true counts as 1."""
    relation: Literal[">", ">=", "<", "<="]
    """How the measure is compared with the value."""
    value: Number
    """Number with which the measure is compared."""

    @model_validator(mode="before")
    @classmethod
    def _from_text(cls, given: Any) -> Any:
        if not isinstance(given, str):
            return given
        found = CONDITION.fullmatch(given)
        if found is None:
            raise ValueError("MEASURE >= NUMBER, with >=, >, <= or <")
        return dict(zip(("measure", "relation", "value"), found.groups(), strict=True))

    def holds(self, value: float) -> bool:
        """Return whether a value of the measure satisfies the condition."""
        return bool(RELATIONS[self.relation](value, self.value))

    def __str__(self) -> str:
        """Return the condition as text."""
        return f"{self.measure} {self.relation} {self.value:.12g}"


class StopSection(ConfigModel):
    """When a trial ends."""

    later_keys: ClassVar[tuple[str, ...]] = ("when",)

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None
    """The swarm is synchronised once the order parameter reaches this value at a firing of the reference.

    If it is null, trials have no T_sync and end otherwise; it is null by default where there is a condition `when`.
    """
    metric: Literal["complex", "reference"] = "complex"
    """`complex`: eqs. 4.2 and 5.7; `reference`: eq. 3.4."""
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)]
    """Firings of the reference after which the trial ends, and is censored if it was to be synchronised."""
    max_time_s: Annotated[Number, Field(gt=0, le=1e10)] | None = None
    """The trial also ends after this time."""
    when: Condition | None = None
    """The trial also ends when this holds."""

    @model_validator(mode="before")
    @classmethod
    def _end_by_condition_alone(cls, given: Any) -> Any:
        if isinstance(given, dict) and given.get("when") is not None:
            return {"order_parameter": None, **given}
        return given

    def _check_together(self) -> None:
        if self.when is not None and self.order_parameter is not None:
            shown = f"order_parameter is {self.order_parameter:g} and when is {str(self.when)!r}"
            raise ValueError(f"{shown}; give order_parameter: null, as one of them alone may end trials")


AS = "as"
"""Key among a measure's parameters that names its value, so that a scenario may have one measure several times."""

ORDER_PARAMETER = "order_parameter"  # name of the measure that conditions may be on in every trial

ONE_MEASURE = "a measure's name, or a mapping of one name to its parameters"


class MeasureSection(ConfigModel):
    """A measure: its name, or a mapping of that to its parameters, and to `as`; written as the latter."""

    measure: str
    """Name of a shipped or installed measure, or FILE.py:NAME."""
    parameters: dict[str, Any]
    shown_as: str | None = None
    """Name of its value in results, given by the key `as`; the measure's own if None."""

    @model_validator(mode="before")
    @classmethod
    def _read(cls, given: Any) -> Any:
        if isinstance(given, str):
            return {"measure": given, "parameters": {}}
        if isinstance(given, MeasureSection):
            return given
        if not isinstance(given, dict):
            raise ValueError(ONE_MEASURE)  # noqa: TRY004 pydantic gathers ValueErrors
        if len(given) == 1:
            ((name, parameters),) = given.items()
            if isinstance(name, str) and (parameters is None or isinstance(parameters, dict)):
                others = {key: value for key, value in (parameters or {}).items() if key != AS}
                shown_as = (parameters or {}).get(AS)
                if shown_as is not None and not (isinstance(shown_as, str) and re.fullmatch(r"[\w-]+", shown_as)):
                    raise ValueError(f"{AS} is {short_repr(shown_as)}; allowed: letters, digits, _ and -")
                return {"measure": name, "parameters": others, "shown_as": shown_as}
        raise ValueError(f"is {short_repr(given)}; allowed: {ONE_MEASURE}")

    @property
    def name(self) -> str:
        """Name of its value in results, once `resolve_measures` has found it."""
        return self.measure.rpartition(":")[2] if self.shown_as is None else self.shown_as

    @model_serializer
    def _write(self) -> dict[str, dict[str, Any]]:
        return {self.measure: self.parameters if self.shown_as is None else {AS: self.shown_as, **self.parameters}}

    def find(self, folder: Path | None = None) -> Measure:
        """Return the measure, with the name of its value in results; see `measures.measure.find_measure`."""
        measure = find_measure(self.measure, folder)
        return measure if self.shown_as is None else replace(measure, name=self.shown_as)


def resolve_measures(scenario: Any, origin: str, folder: Path | None) -> tuple[MeasureSection, ...]:
    """Return a scenario's measures with the paths of those that are users', and with all parameters."""
    resolved: dict[str, MeasureSection] = {}
    for number, section in enumerate(scenario.measures):
        with refused_at(f"{origin}: measures.{number}"):
            measure = section.find(folder)
            measure.check_model(scenario.model, scenario.event_method)
            parameters = measure.resolve(section.parameters)
            if scenario.sweep is None:  # else its points are checked, which may differ in what matters
                measure.check_scenario(scenario, parameters)
            if measure.name in resolved:
                another = f"{{{section.measure}: {{as: another}}}}"
                raise ValueError(
                    f"{measure.name} is the name of two measures; give one of them another, such as {another}"
                )
        resolved[measure.name] = MeasureSection.model_construct(
            measure=measure.stored_name, parameters=parameters, shown_as=section.shown_as
        )
    return tuple(resolved.values())


OF_PRESENT = ("order_parameter", "threshold_cycles", "stays_above", "below_threshold", "moved")
"""Shipped measures that count those robots alone that are in the arena."""


def check_measures_of_present(measures: Sequence[MeasureSection], origin: str) -> None:
    """Raise ScenarioError for shipped measures that take all robots to be in the arena throughout a trial."""
    for number, section in enumerate(measures):
        measure = section.find()
        if not measure.sources and section.measure not in OF_PRESENT:
            raise ScenarioError(
                f"{origin}: measures.{number}: {section.measure} takes all robots to be in the arena, and some come or "
                f"go; allowed: {', '.join(OF_PRESENT)}, and measures of your own"
            )


def check_condition(name: str, measures: Sequence[MeasureSection], event_method: str, origin: str) -> None:
    """Raise ScenarioError unless a measure that a condition is on can be looked at while a trial runs.

    The order parameter can, whether it is among the measures or not: every trial measures it.
    """
    found = {measure.name: measure for measure in (section.find() for section in measures)}
    if name == ORDER_PARAMETER and name not in found:
        return
    if name not in found:
        raise ScenarioError(f"{origin}: {did_you_mean(name, dict(found))}; measures: {comma_list(found)}")
    if not any(found[name].is_told(method) for method in (event_method, CYCLE_METHOD)):
        methods = f"methods {CYCLE_METHOD} or {event_method}"
        raise ScenarioError(f"{origin}: {name} is measured at the end alone; allowed: measures with {methods}")
