"""A scenario of point-like agents: their space, their motion, who hears whom, and how a pulse shifts a phase.

The defaults are those of thesis section 5.1: 20 agents in a square of side 100, nearest neighbours, the multiplicative
response curve. Its lengths have no unit and its period is 1; here they are centimetres and seconds, as in chapter 3.
"""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.scenario import Scenario, StopSection

MOST_SIDES = 1000
"""So many sides are flown in a cycle at most, on the mean; the fastest in the thesis fly one."""


class SpaceSection(ConfigModel):
    """Where agents move: a segment, a square or a cube (5.1.2, D.2, D.3)."""

    dimensions: Annotated[WholeNumber, Field(ge=1, le=3)] = 2
    side_cm: Positive = 100.0
    boundary: Literal["bounded", "cyclic"] = "bounded"
    """`bounded`: walls, from which agents set out in a random direction; `cyclic`: who leaves comes in opposite."""


class AgentsSection(ConfigModel):
    """How many there are, and how they move."""

    count: Annotated[WholeNumber, Field(ge=1, le=100_000)] = 20
    speed_cm_s: Annotated[Number, Field(ge=0, le=1e6)] = 1.0
    """Of each agent, or the mean of its distribution."""
    speed_distribution: Literal["fixed", "uniform", "normal", "exponential"] = "fixed"
    """Each agent keeps the speed that is drawn for it (thesis 6.2)."""
    speed_spread: Annotated[Number, Field(gt=0, le=1)] | None = None
    """Half width of `uniform`, standard deviation of `normal`, as a share of the mean; `normal` is cut at 0 and 2."""
    reorient_on: tuple[Literal["emitting", "receiving"], ...] = ()
    """Pulses on which an agent sets out in a random direction (D.1)."""

    @model_validator(mode="after")
    def _spread_fits(self) -> "AgentsSection":
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
    """A cone in the direction of motion: of vision, that of an agent who sees the one that fires, or of emission."""

    kind: Literal["cone_of_vision", "cone_of_emission"]
    radius_cm: Positive | None = None
    """Unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)]
    """From side to side."""


class Everybody(ConfigModel):
    """All agents."""

    kind: Literal["all"]


Neighbourhood = Nearest | Range | Cone | Everybody
"""Who hears the pulse of an agent that fires (3.1.2, 5.1.3)."""


class ResponseSection(ConfigModel):
    """How a pulse shifts the phase of one who hears it (5.1.1)."""

    curve: Literal["multiplicative", "sawtooth", "sine"] = "multiplicative"
    coupling: Annotated[Number, Field(ge=0, le=1e6)] = 0.1
    """The factor epsilon of the multiplicative curve, or kappa, up to 1, of the others."""
    refractory: Annotated[Number, Field(ge=0, lt=0.5)] = 0.0
    """D: from 0 to this phase nothing is heard."""

    @model_validator(mode="after")
    def _kappa_fits(self) -> "ResponseSection":
        if self.curve != "multiplicative" and self.coupling > 1:
            raise ValueError(f"coupling is {self.coupling:g}; allowed: 0 to 1 for the {self.curve} curve")
        return self


class ClocksSection(ConfigModel):
    """The oscillators' periods."""

    period_s: Positive = 1.0
    jitter: Annotated[Number, Field(ge=0, le=0.2)] = 0.0
    """Standard deviation of their periods, as a share of `period_s` (5.4.2); none is below a tenth of it."""


class StartSection(ConfigModel):
    """The phases with which a trial begins."""

    phases: Literal["random", "synchronised"] = "random"
    displacement: Annotated[Number, Field(ge=0, lt=1)] = 0.0
    """Of the phase of agent 0, where all others begin at 0 (5.4.1)."""

    @model_validator(mode="after")
    def _displaces_synchrony(self) -> "StartSection":
        if self.displacement and self.phases != "synchronised":
            raise ValueError(
                f"displacement is {self.displacement:g} and phases is {self.phases!r}; allowed: 0, or phases: "
                "synchronised"
            )
        return self


class ParticleStop(StopSection):
    """When a trial ends (3.1.5, 5.1.4)."""

    order_parameter: Annotated[Number, Field(gt=0, le=1)] | None = 1 - 1e-9
    """Null: every trial lasts `max_cycles`."""
    max_cycles: Annotated[WholeNumber, Field(ge=1, le=10**9)] = 10**7
    reference: Annotated[WholeNumber, Field(ge=0)] = 0
    """Agents are numbered from 0."""


class ParticleScenario(Scenario):
    """A swarm of point-like agents (chapters 3 and 5)."""

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
    def _fits(self) -> "ParticleScenario":
        others = self.agents.count - 1
        if self.agents.speed_cm_s * self.clocks.period_s > MOST_SIDES * self.space.side_cm:
            raise ValueError(
                f"agents.speed_cm_s is {self.agents.speed_cm_s:g}; allowed: up to "
                f"{MOST_SIDES * self.space.side_cm / self.clocks.period_s:g}, {MOST_SIDES} sides a period"
            )
        if isinstance(self.neighbourhood, Nearest) and self.neighbourhood.k > max(others, 1):
            raise ValueError(
                f"neighbourhood.k is {self.neighbourhood.k}; allowed: 1 to {max(others, 1)}, for agents.count is "
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
