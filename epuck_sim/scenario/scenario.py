"""What scenarios of all models have in common. Validated and immutable."""

from typing import Annotated, Literal, TypeVar

from pydantic import Field

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber

WITHOUT_EFFECT = {"name", "description", "trials", "figure", "overhead"}
"""Keys of a scenario on which no trial depends."""


class FigureSection(ConfigModel):
    """How `plot` draws a sweep, where the command does not say."""

    form: Literal["curves", "map", "violins", "perturbation", "course"] = "curves"
    x: str | None = None
    """Dotted key of the axis to draw against; the speed by default."""
    y: str | None = None
    """Of a map, the axis that goes up."""
    panels: str | None = None
    """Of curves, the axis that has a panel for each of its values; one panel by default."""
    censored_at_cycles: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Of violins: the estimate is made as if trials had been censored there."""


class StopSection(ConfigModel):
    """When a trial ends."""

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None
    """The swarm is synchronised once the order parameter reaches this at a firing of the reference."""
    metric: Literal["complex", "reference"] = "complex"
    """`complex`: eqs. 4.2 and 5.7; `reference`: eq. 3.4."""
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)]
    """The trial is censored after so many firings of the reference."""


class Scenario(ConfigModel):
    """All that a trial depends on, but for its seed."""

    name: Annotated[str, Field(min_length=1, max_length=100)] = "thesis"
    description: str = ""
    model: str
    stop: StopSection
    trials: Annotated[WholeNumber, Field(ge=1, le=10_000_000)] = 1
    """How many; of a sweep, at each of its points."""
    seed: Annotated[WholeNumber, Field(ge=0)] = 0
    """The master seed, from which each trial gets its own."""
    sweep: SweepAxes | None = None
    figure: FigureSection = FigureSection()

    @property
    def population(self) -> int:
        """Number of robots or agents."""
        raise NotImplementedError

    @property
    def controllers(self) -> tuple[str, ...]:
        """Controller of each group; empty for a model without controllers."""
        return ()

    @property
    def compiled(self) -> tuple[str, ...]:
        """What is compiled for its trials, by name."""
        return self.controllers or (self.model,)

    @property
    def scales(self) -> dict[str, float]:
        """Quantities, by name, that T_sync scales with (thesis 4.2.2); NaN for one that the scenario does not have."""
        return {}

    @property
    def scale_keys(self) -> tuple[str, ...]:
        """Dotted keys of the values on which `scales`, and the speed, depend."""
        return ()


Kind = TypeVar("Kind", bound=Scenario)


def require_model(scenario: Scenario, kind: type[Kind], why: str) -> Kind:
    """Return `scenario`, which must be of class `kind`; raise ScenarioError, which ends with `why`, where it is not."""
    if not isinstance(scenario, kind):
        raise ScenarioError(f"{scenario.name}: model is {scenario.model!r}; {why}")
    return scenario


def seed_of_trial(scenario: Scenario, seed: int | None) -> int:
    """Return the seed with which to simulate one trial: `seed`, or the scenario's own if that is None.

    Raises:
        ScenarioError: the scenario holds a sweep, which is not one trial, or the seed is negative.
    """
    if scenario.sweep is not None:
        raise ScenarioError(f"{scenario.name}: is a sweep; simulate one of its points: `points(scenario)[0].scenario`")
    chosen = scenario.seed if seed is None else seed
    if chosen < 0:
        raise ScenarioError(f"{scenario.name}: seed is {chosen}; allowed: whole numbers from 0")
    return chosen
