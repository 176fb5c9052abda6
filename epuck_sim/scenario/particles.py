"""A scenario of point-like agents: their space, their motion, their neighbourhoods, and how a pulse shifts a phase.

The defaults are those of thesis section 5.1: 20 agents in a square of side 100, nearest neighbours, the multiplicative
response curve. Its lengths have no unit and its period is 1; here they are centimetres and seconds, as in chapter 3.
"""

from typing import Annotated, ClassVar, Literal

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.stop import StopSection

MOST_SIDES = 1000
"""Largest mean distance, in sides of the space, that agents may move in a cycle; the thesis's fastest move one."""

_ELSEWHERE = {
    "arena": "space",
    "robots": "agents, clocks, response and neighbourhood",
    "noise": "clocks.jitter for clocks; agents neither sense nor drive",
    "spread": "no counterpart, because agents are all alike",
    "stuck": "no counterpart, because agents are points",
    "faults": "no counterpart, because agents do not fail",
    "schedule": "no counterpart, because its agents stay as they are",
    "contact": "no counterpart, because agents are points",
    "timing": "no counterpart, because time has no steps",
    "stop.reference_robot": "stop.reference",
    "stop.further_cycles": "no counterpart, because its trials end with synchrony",
}
"""Keys of embodied scenarios, and the keys of particle scenarios that correspond to them."""


class SpaceSection(ConfigModel):
    """The space in which agents move: a segment, a square or a cube (5.1.2, D.2, D.3)."""

    dimensions: Annotated[WholeNumber, Field(ge=1, le=3)] = 2
    side_cm: Positive = 100.0
    boundary: Literal["bounded", "cyclic"] = "bounded"
    """`bounded`: agents leave a wall in a random direction; `cyclic`: they leave on one side and enter opposite."""


class AgentsSection(ConfigModel):
    """Number of agents, and how they move."""

    count: Annotated[WholeNumber, Field(ge=1, le=100_000)] = 20
    speed_cm_s: Annotated[Number, Field(ge=0, le=1e6)] = 1.0
    """Speed of each agent, or the mean of the distribution of speeds."""
    speed_distribution: Literal["fixed", "uniform", "normal", "exponential"] = "fixed"
    """Distribution from which the speed of each agent is drawn, once a trial (thesis 6.2)."""
    speed_spread: Annotated[Number, Field(gt=0, le=1)] | None = None
    """Half-width of `uniform`, or standard deviation of `normal`, relative to the mean; `normal` is cut at 0 and 2."""
    reorient_on: tuple[Literal["emitting", "receiving"], ...] = ()
    """Pulses at which an agent turns to a random direction (D.1)."""

    @model_validator(mode="after")
    def _check_spread(self) -> "AgentsSection":
        needs = self.speed_distribution in ("uniform", "normal")
        if needs != (self.speed_spread is not None):
            what = "needs a speed_spread, above 0 and up to 1" if needs else "takes no speed_spread; leave it out"
            raise ValueError(f"speed_distribution {self.speed_distribution!r} {what}")
        return self


class Nearest(ConfigModel):
    """The k agents nearest to the one that fires."""

    kind: Literal["nearest"]
    k: Annotated[WholeNumber, Field(ge=1)] = 1


class Range(ConfigModel):
    """All agents within a radius around the one that fires."""

    kind: Literal["range"]
    radius_cm: Positive


class Cone(ConfigModel):
    """A cone in the direction of motion: of vision, around the agent that receives, or of emission."""

    kind: Literal["cone_of_vision", "cone_of_emission"]
    radius_cm: Positive | None = None
    """Reach of the cone; unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)]
    """Full opening angle."""


class Everybody(ConfigModel):
    """All agents."""

    kind: Literal["all"]


Neighbourhood = Nearest | Range | Cone | Everybody
"""The agents that receive the pulse of one that fires (3.1.2, 5.1.3)."""


class ResponseSection(ConfigModel):
    """How a pulse shifts the phase of an agent that receives it (5.1.1)."""

    curve: Literal["multiplicative", "sawtooth", "sine"] = "multiplicative"
    coupling: Annotated[Number, Field(ge=0, le=1e6)] = 0.1
    """Factor epsilon of the multiplicative curve; kappa, up to 1, of the others."""
    refractory: Annotated[Number, Field(ge=0, lt=0.5)] = 0.0
    """Phase D, up to which pulses have no effect."""

    @model_validator(mode="after")
    def _check_kappa(self) -> "ResponseSection":
        if self.curve != "multiplicative" and self.coupling > 1:
            raise ValueError(f"coupling is {self.coupling:g}; allowed: 0 to 1 for the {self.curve} curve")
        return self


class ClocksSection(ConfigModel):
    """The oscillators' periods."""

    period_s: Positive = 1.0
    jitter: Annotated[Number, Field(ge=0, le=0.2)] = 0.0
    """Standard deviation of the periods relative to `period_s` (5.4.2); no period is below a tenth of it."""


class StartSection(ConfigModel):
    """The phases at the start of a trial."""

    phases: Literal["random", "synchronised"] = "random"
    displacement: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Phase of agent 0, where all others start at 0 (5.4.1)."""

    @model_validator(mode="after")
    def _check_displacement(self) -> "StartSection":
        if self.displacement and self.phases != "synchronised":
            raise ValueError(
                f"displacement is {self.displacement:g} and phases is {self.phases!r}; allowed: 0, or phases: "
                "synchronised"
            )
        return self


class ParticleStop(StopSection):
    """When a trial ends (3.1.5, 5.1.4)."""

    later_keys: ClassVar[tuple[str, ...]] = ("when", "max_time_s")

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None = 1 - 1e-9
    """Threshold of the order parameter; null: trials do not end with synchrony."""
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)] = 10**7
    reference: Annotated[WholeNumber, Field(ge=0)] = 0
    """Number of the agent whose firings are counted, from 0."""


class ParticleScenario(Scenario):
    """A swarm of point-like agents (chapters 3 and 5)."""

    foreign_keys: ClassVar[dict[str, str]] = {
        key: f"belongs to model: embodied; model: particles has {place}" for key, place in _ELSEWHERE.items()
    }

    name: Annotated[str, Field(min_length=1, max_length=100)] = "particles"
    model: Literal["particles"]
    space: SpaceSection = SpaceSection()
    agents: AgentsSection = AgentsSection()
    neighbourhood: Annotated[Neighbourhood, Field(discriminator="kind")] = Nearest(kind="nearest")
    response: ResponseSection = ResponseSection()
    clocks: ClocksSection = ClocksSection()
    start: StartSection = StartSection()
    stop: ParticleStop = ParticleStop()

    @model_validator(mode="after")
    def _check_sections_together(self) -> "ParticleScenario":
        others = self.agents.count - 1
        if self.agents.speed_cm_s * self.clocks.period_s > MOST_SIDES * self.space.side_cm:
            raise ValueError(
                f"agents.speed_cm_s is {self.agents.speed_cm_s:g}; allowed: up to "
                f"{MOST_SIDES * self.space.side_cm / self.clocks.period_s:g}, {MOST_SIDES} sides a period"
            )
        if isinstance(self.neighbourhood, Nearest) and self.neighbourhood.k > max(others, 1):
            raise ValueError(
                f"neighbourhood.k is {self.neighbourhood.k}; allowed: 1 to {max(others, 1)}, because agents.count is "
                f"{others + 1}"
            )
        if self.stop.reference > others:
            raise ValueError(f"stop.reference is {self.stop.reference}; allowed: 0 to {others}")
        return self

    @property
    def scales(self) -> dict[str, float]:
        """The coupling epsilon, the side L in cm, the number N of agents and the period tau in s."""
        return {
            "epsilon": self.response.coupling,
            "L": self.space.side_cm,
            "N": float(self.agents.count),
            "tau": self.clocks.period_s,
        }

    @property
    def scale_keys(self) -> tuple[str, ...]:
        """Dotted keys of the values on which `scales`, and the speed, depend."""
        return ("agents.speed_cm_s", "response.coupling", "space.side_cm", "agents.count", "clocks.period_s")

    @property
    def population(self) -> int:
        """Number of agents."""
        return self.agents.count
