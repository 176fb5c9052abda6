"""The scenario: what those of all models have in common. Validated and immutable."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, TypeVar, get_args

from pydantic import Field, ValidationError

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import FigureSection, SweepAxes
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber, keys_of, problems_in, refused_at
from epuck_sim.scenario.changes import condition_key
from epuck_sim.scenario.stop import Condition, MeasureSection, StopSection, check_condition, resolve_measures
from epuck_sim.scenario.yaml_io import write_yaml
from epuck_sim.util.messages import counted, whole

WITHOUT_EFFECT = {"name", "description", "trials", "trial_timeout_s", "figure", "measures", "overhead"}
"""Keys of a scenario on which no trial depends."""

STOP = "stop.when"  # dotted key of the condition that ends trials


class Scenario(ConfigModel):
    """Everything on which a trial depends, except its seed."""

    event_method: ClassVar[str] = "event"
    """Name of the method by which a measure is told of every event (`measures.measure.EVENT_METHODS`)."""

    name: Annotated[str, Field(min_length=1, max_length=100)] = "thesis"
    """Name in tables and figures; by default that of the file."""
    description: str = ""
    """What the scenario is, in a line: title of figures, and shown by `list`."""
    model: str
    stop: StopSection
    trials: Annotated[WholeNumber, Field(ge=1, le=10_000_000)] = 1
    """Number of trials; in a sweep, at each of its points."""
    trial_timeout_s: Annotated[Number, Field(gt=0)] | None = None
    """Wall time after which a trial of a sweep has failed; None for no limit."""
    seed: Annotated[WholeNumber, Field(ge=0)] = 0
    """The master seed, from which each trial gets its own."""
    measures: tuple[MeasureSection, ...] = ()
    """What is measured in each trial, besides T_sync."""
    sweep: SweepAxes | None = None
    figure: FigureSection = FigureSection()

    @classmethod
    def all_keys(cls, given: Mapping[str, Any], folder: Path | None = None) -> list[str]:
        """Return every dotted key that may be typed of a scenario, those first on which trials depend.

        Keys of sections are among them; those of `sweep` and `measures` are others', or names of measures.
        """
        sections = {key: key.partition(".")[0] for key in keys_of(cls, given, folder)}
        typed = (key for key, section in sections.items() if section not in ("sweep", "measures"))
        return sorted(typed, key=lambda key: sections[key] in WITHOUT_EFFECT)

    @classmethod
    def validated(cls, given: Mapping[str, Any], origin: str) -> Self:
        """Return the scenario with these keys; each line of what refuses them begins with `origin`."""
        try:
            return cls.model_validate(given)
        except ValidationError as error:
            models = {kind: get_args(kind.model_fields["model"].annotation) for kind in Scenario.__subclasses__()}
            owners = {key: model for kind, names in models.items() for model in names for key in kind.model_fields}
            problems = problems_in(cls, error, cls.all_keys(given), owners)
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

        With each, the firings of the reference in a row at which it must hold; None: wherever the measure is told.
        """
        schedule = enumerate(getattr(self, "schedule", ()))
        awaited = {condition_key(number): (entry.when, entry.for_cycles) for number, entry in schedule if entry.when}
        return {STOP: (self.stop.when, None), **awaited} if self.stop.when else awaited

    @property
    def has_events(self) -> bool:
        """Whether anything may change in its trials that they list among their events: it has faults or a schedule."""
        return any(getattr(self, key, ()) for key in ("faults", "schedule"))

    @property
    def notes(self) -> list[str]:
        """What is allowed and may not be meant: changes that come when trials are over; not of what a sweep decides."""
        found: list[str] = []
        for key in () if self.sweep else ("faults", "schedule"):
            for number, each in enumerate(getattr(self, key, ())):
                for name, moment in (("max_time_s", each.at_s), ("max_cycles", getattr(each, "at_cycle", None))):
                    end = getattr(self.stop, name)
                    if None not in (moment, end) and moment >= end:
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
        """Return the scenario with everything filled in that lies in other files."""
        measures = resolve_measures(self, origin, folder)
        for key, (condition, _) in self.conditions.items():
            check_condition(condition.measure, measures, self.event_method, f"{origin}: {key}")
        return self.model_copy(update={"measures": measures}) if measures else self

    def __repr__(self) -> str:
        """Return one line; `write_scenario` gives every key."""
        points = f", points={self.sweep.point_count}" if self.sweep else ""
        return f"{type(self).__name__}(name={self.name!r}, model={self.model!r}, population={self.population}{points})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Return a summary of the scenario, with every key to open, for notebooks."""
        from epuck_sim.display.html import details, element, facts, to_html  # noqa: PLC0415 is for notebooks alone

        stop, noun = self.stop, "robots" if self.controllers else "agents"
        rows = [
            ("model", self.model),
            (noun, str(self.population)),
            ("trials", str(self.trials)),
            ("ends at", f"an order parameter of {stop.order_parameter}, or after {stop.max_cycles} cycles"),
        ]
        rows += [("measures", ", ".join(measure.measure for measure in self.measures))] * bool(self.measures)
        if self.sweep is not None:
            rows += [("sweep", f"{counted(self.sweep.point_count, 'point')} over {', '.join(self.swept)}")]
        return to_html(
            element("p", element("b", self.name), f": {self.description}" if self.description else ""),
            facts(rows),
            details("every key", element("pre", write_yaml(self.model_dump(mode="json")))),
        )


AnyScenario = TypeVar("AnyScenario", bound=Scenario)


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
