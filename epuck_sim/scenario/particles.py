"""A scenario of point-like agents: their space, their motion, their neighbourhoods, and how a pulse shifts a phase.

The defaults are those of thesis section 5.1: 20 agents in a square of side 100, nearest neighbours, the multiplicative
response curve. Its lengths have no unit and its period is 1; here they are centimetres and seconds, as in chapter 3.
"""

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

from pydantic import Field, model_validator

from epuck_sim.errors import CurveError, ScenarioError
from epuck_sim.scenario.agent_schedule import AgentScheduleEntry, check_agents
from epuck_sim.scenario.agents import AgentsSection
from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.condition import Awaited
from epuck_sim.scenario.curves import SHIPPED, find_curve, map_curves
from epuck_sim.scenario.neighbourhoods import Nearest, Neighbourhood, RandomAgents
from epuck_sim.scenario.response import ResponseSection, resolve_response
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.schedule import conditions_in
from epuck_sim.scenario.start import StartSection
from epuck_sim.scenario.stop import StopSection

MOST_SIDES = 1000
"""Largest mean distance, in sides of the space, that agents may move in a cycle; the thesis's fastest move one."""

MOST_RUNS = 1000
"""Largest number of runs of a random walk that agents may begin in a cycle, on average."""

_ELSEWHERE = {
    "arena": "space",
    "robots": "agents, clocks, response and neighbourhood",
    "noise": "clocks.jitter for clocks; agents neither sense nor drive",
    "spread": "no counterpart, because agents are all alike",
    "stuck": "no counterpart, because agents are points",
    "faults": "no counterpart, because agents do not fail; schedule changes them",
    "contact": "no counterpart, because agents are points",
    "timing": "no counterpart, because time has no steps",
    "stop.reference_robot": "stop.reference",
    "stop.further_cycles": "no counterpart, because its trials end with synchrony",
}
"""Keys of embodied scenarios, and the keys of particle scenarios that correspond to them."""


class SpaceSection(ConfigModel):
    """The space in which agents move: a segment, a square or a cube (5.1.2, D.2, D.3)."""

    dimensions: Annotated[WholeNumber, Field(ge=1, le=3)] = 2
    """1: a segment; 2: a square; 3: a cube."""
    side_cm: Positive = 100.0
    """Side L of the space."""
    boundary: Literal["bounded", "cyclic", "mirrored"] = "bounded"
    """`bounded`: agents leave a wall in a random direction; `mirrored`: as light leaves a mirror; `cyclic`: agents
    leave on one side and enter opposite."""


class ClocksSection(ConfigModel):
    """The oscillators' periods."""

    period_s: Positive = 1.0
    """Period tau."""
    jitter: Annotated[Number, Field(ge=0, le=0.2)] = 0.0
    """Standard deviation of the periods relative to `period_s` (5.4.2); no period is below a tenth of it."""


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

    later_keys: ClassVar[tuple[str, ...]] = ("schedule",)

    name: Annotated[str, Field(min_length=1, max_length=100)] = "particles"
    model: Literal["particles"]
    space: SpaceSection = SpaceSection()
    agents: AgentsSection = AgentsSection()
    neighbourhood: Annotated[Neighbourhood, Field(discriminator="kind")] = Nearest(kind="nearest")
    response: ResponseSection = ResponseSection()
    clocks: ClocksSection = ClocksSection()
    start: StartSection = StartSection()
    schedule: tuple[AgentScheduleEntry, ...] = ()
    stop: ParticleStop = ParticleStop()

    @model_validator(mode="after")
    def _check_sections_together(self) -> "ParticleScenario":
        others = self.agents.count - 1
        if self.agents.speed_cm_s * self.clocks.period_s > MOST_SIDES * self.space.side_cm:
            raise ValueError(
                f"agents.speed_cm_s is {self.agents.speed_cm_s:g}; allowed: up to "
                f"{MOST_SIDES * self.space.side_cm / self.clocks.period_s:g}, {MOST_SIDES} sides a period"
            )
        shortest_s = self.clocks.period_s / MOST_RUNS
        if self.agents.walk.run_s is not None and self.agents.walk.run_s < shortest_s:
            raise ValueError(
                f"agents.walk.run_s is {self.agents.walk.run_s:g}; allowed: from {shortest_s:g}, {MOST_RUNS} runs a "
                "period"
            )
        if isinstance(self.neighbourhood, Nearest | RandomAgents) and self.neighbourhood.k > max(others, 1):
            raise ValueError(
                f"neighbourhood.k is {self.neighbourhood.k}; allowed: 1 to {max(others, 1)}, because agents.count is "
                f"{others + 1}"
            )
        self.start.check_fits(others + 1, self.space.dimensions, self.space.side_cm)
        if self.stop.reference > others:
            raise ValueError(f"stop.reference is {self.stop.reference}; allowed: 0 to {others}")
        check_agents(self.schedule, self.agents.count, speed_per_run=self.agents.speed_per_run)
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

    @property
    def conditions(self) -> dict[str, Awaited]:
        """Conditions that trials wait for, by their dotted keys."""
        return {**super().conditions, **conditions_in(self.schedule)}

    @property
    def has_events(self) -> bool:
        """Whether there is a schedule."""
        return bool(self.schedule)

    @property
    def compiled(self) -> tuple[str, ...]:
        """Names of what is compiled for its trials: the model, and a user's response curve."""
        curve = self.response.curve
        return (self.model,) if curve in SHIPPED else (self.model, curve)

    def resolved(self, origin: str, folder: Path | None = None) -> Self:
        """Return the scenario with the response curve, measures and their parameters; see `Scenario.resolved`."""
        swept = self.sweep.keys if self.sweep else ()
        response = self.response  # its curve, hence its parameters, may be known at each point only
        if "response.curve" not in swept and "response" not in swept:
            response = resolve_response(response, f"{origin}: response", folder)
        if self.schedule and not set(swept) & {"response", "response.curve", "neighbourhood", "neighbourhood.kind"}:
            from epuck_sim.scenario.agent_changes import check_changes  # noqa: PLC0415 it imports this module

            check_changes(self.model_copy(update={"response": response}), f"{origin}: schedule")
        start = self.start
        if start.like is not None:
            from epuck_sim.scenario.like_robots import resolve_like  # noqa: PLC0415 it imports this module

            start = resolve_like(self, f"{origin}: start.like", folder)
        sweep = self.sweep and self.sweep.mapped(lambda key, value: _resolve_axis(key, value, origin, folder))
        resolved = super().resolved(origin, folder)
        if response is self.response and start is self.start and sweep is None:
            return resolved  # a copy would take a tenth of the time of a short trial
        return resolved.model_copy(update={"response": response, "start": start, "sweep": sweep})


def _resolve_axis(key: str, value: Any, origin: str, folder: Path | None) -> Any:
    """Return the value of an axis with the path of the user's curve that it names."""
    try:
        return map_curves(key, value, lambda name: find_curve(str(name), folder).name)
    except CurveError as error:
        raise ScenarioError(f"{origin}: sweep: {key}: {error}") from error
