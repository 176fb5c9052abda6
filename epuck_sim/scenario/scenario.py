"""The scenario: what those of all models have in common. Validated and immutable."""

from numbers import Integral
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self, TypeVar

from pydantic import Field

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber
from epuck_sim.scenario.condition import Awaited
from epuck_sim.scenario.measures import MeasureSection, check_condition, resolve_measures
from epuck_sim.scenario.stop import StopSection

WITHOUT_EFFECT = {"name", "description", "trials", "figure", "measures", "overhead"}
"""Keys of a scenario on which no trial depends."""

STOP = "stop.when"
"""Dotted key of the condition that ends trials."""


class FigureSection(ConfigModel):
    """How `plot` draws a sweep, where the command does not say."""

    form: Literal["curves", "map", "violins", "series", "perturbation", "course"] = "curves"
    """How the sweep is drawn; `series` is for measures with a value for each cycle, and `perturbation` and `course` are
    for point agents."""
    x: str | None = None
    """Dotted key of the axis to draw against; the speed by default."""
    y: str | None = None
    """Dotted key of a map's vertical axis."""
    panels: str | None = None
    """Dotted key of the axis that has a panel for each of its values, for curves; one panel by default."""
    statistic: Literal["mean", "median", "weibull-mean"] = "mean"
    """What stands for the trials of a point in curves and maps."""
    censored_at_cycles: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Limit, in cycles, at which the estimate drawn in violins treats trials as censored."""
    base_case: dict[str, Any] = Field(default_factory=dict)
    """Values of axes, by dotted key, of the curve that is dashed because it is the base case."""
    title: str = ""
    """Title; by default there is none, as a caption beside the figure says what was run."""
    labels: dict[str, str] = Field(default_factory=dict)
    """Labels of axes, by dotted key, and of `T_sync` or a measure, by name."""
    scale: Literal["linear", "log"] | None = None
    """Scale of T_sync or the measure; by default logarithmic for T_sync and for positive values that are far apart."""
    points: bool = False
    """Whether each trial is a dot, in curves and violins."""
    width_cm: Annotated[Number, Field(ge=5, le=100)] | None = None
    """Width; by default that of a column, or of a page for several panels."""
    font_pt: Annotated[Number, Field(ge=4, le=30)] = 8.0
    """Size of letters; those at ticks and in legends are a point smaller."""


class Scenario(ConfigModel):
    """Everything on which a trial depends, except its seed."""

    foreign_keys: ClassVar[dict[str, str]] = {}
    """Dotted keys of another model, and the message for a scenario of this model that has them."""
    event_method: ClassVar[str] = "event"
    """Name of the method by which a measure is told of every event (`measures.interface.EVENT_METHODS`)."""

    name: Annotated[str, Field(min_length=1, max_length=100)] = "thesis"
    """Name in tables and figures; by default that of the file."""
    description: str = ""
    """What the scenario is, in a line: title of figures, and shown by `list`."""
    model: str
    stop: StopSection
    trials: Annotated[WholeNumber, Field(ge=1, le=10_000_000)] = 1
    """Number of trials; in a sweep, at each of its points."""
    seed: Annotated[WholeNumber, Field(ge=0)] = 0
    """The master seed, from which each trial gets its own."""
    measures: tuple[MeasureSection, ...] = ()
    """What is measured in each trial, besides T_sync."""
    sweep: SweepAxes | None = None
    figure: FigureSection = FigureSection()

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
    def conditions(self) -> dict[str, Awaited]:
        """Conditions that trials wait for, by their dotted keys."""
        return {} if self.stop.when is None else {STOP: Awaited(self.stop.when)}

    @property
    def has_events(self) -> bool:
        """Whether anything may change in its trials that they list among their events."""
        return False

    @property
    def scales(self) -> dict[str, float]:
        """Quantities, by name, that T_sync scales with (thesis 4.2.2); NaN for one that the scenario does not have."""
        return {}

    @property
    def scale_keys(self) -> tuple[str, ...]:
        """Dotted keys of the values on which `scales`, and the speed, depend."""
        return ()

    def resolved(self, origin: str, folder: Path | None = None) -> Self:
        """Return the scenario with everything filled in that lies in other files.

        Args:
            origin: Begins every line of an error message.
            folder: Files are looked for here first, then in the working directory.

        Raises:
            ScenarioError: A file is missing, or does not fit the scenario.
        """
        measures = resolve_measures(self, origin, folder)
        for key, awaited in self.conditions.items():
            check_condition(awaited.condition.measure, measures, self.event_method, f"{origin}: {key}")
        return self.model_copy(update={"measures": measures}) if measures else self

    def __repr__(self) -> str:
        """Return one line; `write_scenario` gives every key."""
        points = f", points={self.sweep.point_count}" if self.sweep else ""
        return f"{type(self).__name__}(name={self.name!r}, model={self.model!r}, population={self.population}{points})"

    __str__ = __repr__

    def _repr_html_(self) -> str:
        """Return what the scenario is, with every key to open, for notebooks."""
        from epuck_sim.scenario.notebook import show_scenario  # noqa: PLC0415 is for notebooks alone

        return show_scenario(self)


AnyScenario = TypeVar("AnyScenario", bound=Scenario)


def require_model(scenario: Scenario, kind: type[AnyScenario], why: str, origin: str | None = None) -> AnyScenario:
    """Return `scenario`, which must be of class `kind`.

    Raises:
        ScenarioError: It is of another class; the message begins with `origin`, or else the scenario's name, and ends
            with `why`.
    """
    if not isinstance(scenario, kind):
        raise ScenarioError(f"{origin or scenario.name}: model is {scenario.model!r}; {why}")
    return scenario


def seed_of_trial(scenario: Scenario, seed: int | None) -> int:
    """Return the seed with which to simulate one trial: `seed`, or the scenario's own if that is None.

    Raises:
        ScenarioError: The scenario holds a sweep, which is not one trial, or the seed is negative.
    """
    if scenario.sweep is not None:
        raise ScenarioError(f"{scenario.name}: is a sweep; simulate one of its points: `points(scenario)[0].scenario`")
    chosen = scenario.seed if seed is None else seed
    if not isinstance(chosen, Integral) or chosen < 0:
        raise ScenarioError(f"{scenario.name}: seed is {chosen!r}; allowed: whole numbers from 0")
    return chosen
