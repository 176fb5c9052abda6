"""The scenario, validated and immutable: the part that is common to all models.

It says when a trial ends, and which measures a trial has.
"""

import operator
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import Field, ValidationError, model_serializer, model_validator

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.measures.measure import CYCLE_METHOD, Measure, find_measure
from epuck_sim.scenario.axes import FigureSection, SweepAxes
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber, keys_of, problems_in, refused_at
from epuck_sim.util.messages import comma_list, counted, did_you_mean, short_yaml, whole
from epuck_sim.util.yaml_io import write_yaml

CONDITION = re.compile(r"\s*([\w-]+)\s*(>=|<=|>|<)\s*([-+.\w]+)\s*")
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
        return f"{self.measure} {self.relation} {self.value:.12g}"


class StopSection(ConfigModel):
    """When a trial ends."""

    later_keys: ClassVar[tuple[str, ...]] = ("when", "gives_t_sync")

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None
    """The swarm is synchronised once the order parameter reaches this value at a firing of the reference.

    If it is null, trials end otherwise, and have no T_sync but by `gives_t_sync`; with a condition `when` it is null.
    """
    metric: Literal["complex", "reference"] = "complex"
    """`complex`: eqs. 4.2 and 5.7; `reference`: eq. 3.4."""
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)]
    """Firings of the reference after which the trial ends, and is censored if it was to be synchronised."""
    max_time_s: Annotated[Number, Field(gt=0, le=1e10)] | None = None
    """The trial also ends after this time."""
    when: Condition | None = None
    """The trial also ends when this holds."""
    gives_t_sync: bool = False
    """Whether T_sync is the number of cycles until `when` holds; trials that reach their limits first are censored."""

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
        if self.gives_t_sync and self.when is None:
            raise ValueError("gives_t_sync is true, but there is no condition `when`; give one")

    @property
    def has_t_sync(self) -> bool:
        """Whether trials have a T_sync: by a threshold, if their reference oscillates, or by the condition."""
        return self.order_parameter is not None or self.gives_t_sync


AS = "as"
"""Key among a measure's parameters that names its value, so that a scenario may have one measure several times."""

ORDER_PARAMETER = "order_parameter"  # name of the measure that every trial has, for conditions

ONE_MEASURE = "a measure's name, or a mapping of one name to its parameters"


class MeasureSection(ConfigModel):
    """A measure: its name, or a mapping of its name to its parameters and `as`; always written as a mapping."""

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
        if not isinstance(given, dict):
            raise ValueError(ONE_MEASURE)  # noqa: TRY004 pydantic gathers ValueErrors
        name, parameters = next(iter(given.items()), (None, None))
        if len(given) != 1 or not isinstance(name, str) or not isinstance(parameters, dict | None):
            raise ValueError(f"is {short_yaml(given)}; allowed: {ONE_MEASURE}")
        others = dict(parameters or {})
        shown_as = others.pop(AS, None)
        if shown_as is not None and not (isinstance(shown_as, str) and re.fullmatch(r"[\w-]+", shown_as)):
            raise ValueError(f"{AS} is {short_yaml(shown_as)}; allowed: letters, digits, _ and -")
        if shown_as == "T_sync":
            raise ValueError(f"{AS} is {shown_as!r}, which every trial has; allowed: other names")
        return {"measure": name, "parameters": others, "shown_as": shown_as}

    @property
    def name(self) -> str:
        """Name of its value in results, once `Scenario.resolved` has found it."""
        return self.measure.rpartition(":")[2] if self.shown_as is None else self.shown_as

    @model_serializer
    def _write(self) -> dict[str, dict[str, Any]]:
        return {self.measure: self.parameters if self.shown_as is None else {AS: self.shown_as, **self.parameters}}

    def find(self, folder: Path | None = None) -> Measure:
        """Return the measure, with the name of its value in results; see `measures.measure.find_measure`."""
        measure = find_measure(self.measure, folder)
        return measure if self.shown_as is None else replace(measure, name=self.shown_as)


WITHOUT_EFFECT = {"name", "description", "trials", "trial_timeout_s", "figure", "measures", "overhead"}
"""Keys of a scenario on which no trial depends."""

STOP = "stop.when"  # dotted key of the condition that ends trials


def condition_key(entry: int) -> str:
    """Return the dotted key of the condition of an entry of a schedule."""
    return f"schedule.{entry}.when"


class Scenario(ConfigModel):
    """Everything on which a trial depends, except its seed."""

    event_method: ClassVar[str] = "event"
    """Name of the method by which a measure is told of every event (`measures.measure.EVENT_METHODS`)."""
    refused: ClassVar[tuple[str, ...]] = ()
    """Keys, and kinds, of sections of several models that this one refuses."""

    name: Annotated[str, Field(min_length=1, max_length=100)] = "thesis"
    """Name in tables and figures; by default that of the file."""
    description: str = ""
    """Description in a line: title of figures, and shown by `list`."""
    model: str
    stop: StopSection
    trials: Annotated[WholeNumber, Field(ge=1, le=10_000_000)] = 1
    """Number of trials; in a sweep, at each of its points."""
    trial_timeout_s: Annotated[Number, Field(gt=0)] | None = None
    """Wall time after which a trial of a sweep has failed; null for no limit."""
    seed: Annotated[WholeNumber, Field(ge=0)] = 0
    """The master seed, from which each trial gets its own."""
    measures: tuple[MeasureSection, ...] = ()
    """Measures of each trial, besides T_sync; `list --measures` names them."""
    sweep: SweepAxes | None = None
    figure: FigureSection = FigureSection.model_construct()

    @classmethod
    def all_keys(cls, given: Mapping[str, Any], folder: Path | None = None) -> list[str]:
        """Return every dotted key of a scenario that may be typed; those on which trials depend come first.

        They include keys in sections, but not in `sweep` and in what a schedule sets; of measures, only parameters.
        """
        not_typed = re.compile(r"sweep\b|measures\b|schedule\.\d+\.set\.")
        typed = [key for key in dict.fromkeys(keys_of([cls], given, folder)) if not not_typed.match(key)]
        typed.sort(key=lambda key: key.partition(".")[0] in WITHOUT_EFFECT)
        measures = given.get("measures")
        for number, each in enumerate(measures if isinstance(measures, list | tuple) else ()):
            with suppress(EpuckSimError, ValueError):  # invalid ones are refused later
                measure = MeasureSection.model_validate(each).find(folder)
                typed += (f"measures.{number}.{measure.name}.{parameter}" for parameter in measure.parameters)
        return typed

    @classmethod
    def validated(cls, given: Mapping[str, Any], origin: str) -> Self:
        """Return the scenario with these keys; if they are refused, each line of the message begins with `origin`."""
        try:
            return cls.model_validate(given)
        except ValidationError as error:
            others = [each for each in Scenario.__subclasses__() if each is not cls]
            problems = problems_in(cls, error, cls.all_keys(given), others)
            raise ScenarioError("\n".join(f"{origin}: {said}" for _, said in problems)) from error

    @property
    def population(self) -> int:
        """Number of robots or agents."""
        raise NotImplementedError

    @property
    def memory_bytes(self) -> int:
        """Estimate of the memory that a trial takes, besides that of the program; 0 where it is negligible."""
        return 0

    @property
    def controllers(self) -> tuple[str, ...]:
        """Controller of each group; empty for a model without controllers."""
        return ()

    @property
    def trial_keys(self) -> dict[str, Any]:
        """All keys on which trials depend, but their seeds, with their values."""
        return self.model_dump(mode="json", exclude=WITHOUT_EFFECT | {"seed"})

    @property
    def compiled(self) -> tuple[str, ...]:
        """Names of what is compiled for its trials."""
        return self.controllers or (self.model,)

    @property
    def swept(self) -> Sequence[str]:
        """Dotted keys of the axes of its sweep."""
        return self.sweep.keys if self.sweep else ()

    @property
    def conditions(self) -> dict[str, tuple[Condition, int | None]]:
        """Conditions that trials wait for, by their dotted keys: that of their end, and those of a schedule.

        With each, the number of firings of the reference in a row at which it must hold; None: once at any moment.
        """
        schedule = enumerate(getattr(self, "schedule", ()))
        awaited = {condition_key(number): (entry.when, entry.for_cycles) for number, entry in schedule if entry.when}
        return {STOP: (self.stop.when, None), **awaited} if self.stop.when else awaited

    @property
    def has_events(self) -> bool:
        """Whether its trials may have events: it has faults or a schedule."""
        return any(getattr(self, key, ()) for key in ("faults", "schedule"))

    @property
    def has_t_sync(self) -> bool:
        """Whether trials have a T_sync, known or censored, or may have one at a point of its sweep."""
        return self.stop.has_t_sync

    @property
    def notes(self) -> list[str]:
        """Notes on what is allowed but may not be meant: conditions and changes that never come, unless swept."""
        orders = {key: each for key, (each, _) in self.conditions.items() if each.measure == ORDER_PARAMETER}
        least = -1 if self.stop.metric == "reference" else 0
        never = f"never holds: the order parameter is from {least} to 1"
        found = [f"{key} {never}" for key, each in orders.items() if not (each.holds(least) or each.holds(1))]
        for key in () if self.sweep else ("faults", "schedule"):
            for number, each in enumerate(getattr(self, key, ())):
                for name, moment in (("max_time_s", each.at_s), ("max_cycles", getattr(each, "at_cycle", None))):
                    end = getattr(self.stop, name)
                    if moment is None or end is None or moment < end:
                        continue
                    if moment == end and name == "max_time_s" and not self.controllers:  # agents still change then
                        continue
                    found.append(f"{key}.{number} never begins: trials are over then, as stop.{name} is {end:g}")
        return found

    @property
    def scales(self) -> dict[str, float]:
        """Quantities, by name, that T_sync scales with (thesis 4.2.2); NaN for one that the scenario does not have."""
        return {}

    @property
    def scale_keys(self) -> tuple[str, ...]:
        """Dotted keys of the values on which `scales`, and the speed, depend."""
        return ()

    def resolved(self, origin: str, folder: Path | None = None) -> Self:
        """Return the scenario with all that lies in other files filled in."""
        found: dict[str, Measure] = {}
        sections: list[MeasureSection] = []
        for number, section in enumerate(self.measures):
            with refused_at(f"{origin}: measures.{number}"):
                measure = section.find(folder)
                measure.check_model(self.model, self.event_method)
                parameters = measure.resolve(section.parameters)
                if self.sweep is None:  # else each point is checked, as points may differ
                    measure.check_scenario(self, parameters)
                if measure.name in found:
                    said = f"{measure.name} is the name of two measures; give one of them another, such as"
                    raise ValueError(f"{said} {{{section.measure}: {{as: another}}}}")
            found[measure.name] = measure
            known = {"measure": measure.stored_name, "parameters": parameters}
            sections.append(section.model_copy(update=known))
        for key, (condition, _) in self.conditions.items():
            name, methods = condition.measure, (CYCLE_METHOD, self.event_method)
            if name not in found and name != ORDER_PARAMETER:  # which every trial measures
                listed = f"measures: {comma_list(found)}; add another to the section `measures`"
                raise ScenarioError(f"{origin}: {key}: {did_you_mean(name, found)}; {listed}")
            if name in found and not any(map(found[name].told_by, methods)):
                allowed = f"measures with methods {' or '.join(methods)}"
                raise ScenarioError(f"{origin}: {key}: {name} is measured only at the end; allowed: {allowed}")
        return self.model_copy(update={"measures": tuple(sections)}) if sections else self

    def __repr__(self) -> str:
        """Return one line; `write_scenario` gives every key."""
        points = f", points={self.sweep.point_count}" if self.sweep else ""
        return f"{type(self).__name__}(name={self.name!r}, model={self.model!r}, population={self.population}{points})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Return a summary of the scenario, with every key to open, for notebooks."""
        from epuck_sim.display.html import details, element, facts, to_html  # noqa: PLC0415 is for notebooks alone

        stop, noun = self.stop, "robots" if self.controllers else "agents"
        limit = f" or {stop.max_time_s:g} s" if stop.max_time_s else ""
        reached = "" if stop.order_parameter is None else f"at an order parameter of {stop.order_parameter}, or "
        rows = [
            ("model", self.model),
            (noun, str(self.population)),
            ("trials", str(self.trials)),
            ("ends", f"{reached}after {stop.max_cycles} cycles{limit}"),
        ]
        if self.measures:
            rows.append(("measures", ", ".join(measure.measure for measure in self.measures)))
        if self.sweep is not None:
            rows += [("sweep", f"{counted(self.sweep.point_count, 'point')} over {', '.join(self.swept)}")]
        return to_html(
            element("p", element("b", self.name), f": {self.description}" if self.description else ""),
            facts(rows),
            details("every key", element("pre", write_yaml(self.model_dump(mode="json")))),
        )


AnyScenario = TypeVar("AnyScenario", bound=Scenario)
ScenarioLike = Scenario | str | Path | Mapping[str, Any]  # what `load_scenario` takes


def require_model(scenario: Scenario, kind: type[AnyScenario], why: str, origin: str | None = None) -> AnyScenario:
    """Return `scenario`, which must be of class `kind`."""
    if not isinstance(scenario, kind):
        raise ScenarioError(f"{origin or scenario.name}: model is {scenario.model!r}; {why}")
    return scenario


def seed_of_trial(scenario: Scenario, seed: int | None) -> int:
    """Return the seed with which to simulate one trial: `seed`, or the scenario's own if that is None."""
    if scenario.sweep is not None:
        raise ScenarioError(f"{scenario.name}: is a sweep; simulate one of its points: `points(scenario)[0].scenario`")
    with refused_at(scenario.name):
        return whole("seed", scenario.seed if seed is None else seed, 0)
