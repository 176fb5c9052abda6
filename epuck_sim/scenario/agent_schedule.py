"""What changes while a trial of point agents runs, and when: the section `schedule` of their scenarios."""

import re
from collections.abc import Sequence
from typing import Annotated, ClassVar

from pydantic import Field

from epuck_sim.scenario.base import WholeNumber
from epuck_sim.scenario.schedule import Displacement, ScheduleEntry
from epuck_sim.util.messages import comma_list

KEYS = (
    "agents.speed_cm_s",
    "neighbourhood.k",
    "neighbourhood.radius_cm",
    "neighbourhood.angle_deg",
    "response.coupling",
    "response.refractory",
)
"""Keys that a schedule may set, besides parameters of the response curve."""

PARAMETER = re.compile(r"response\.parameters\.\w+")
"""A key of a parameter of the response curve."""


class AgentDisplacement(Displacement):
    """A displacement of phases of agents."""

    whose: ClassVar[str] = "agents"
    agents: tuple[Annotated[WholeNumber, Field(ge=0)], ...] | None = None
    """Numbers of the agents; all by default."""


class AgentScheduleEntry(ScheduleEntry):
    """Changes at one moment of a trial of point agents."""

    displace: AgentDisplacement | None = None

    @staticmethod
    def check_key(key: str) -> None:
        """Raise ValueError for a key that cannot change during a trial."""
        if key not in KEYS and PARAMETER.fullmatch(key) is None:
            raise ValueError(
                f"set: {key} cannot change during a trial; allowed: "
                f"{comma_list([*KEYS, 'response.parameters.NAME'])}; besides, displace phases"
            )


def check_agents(schedule: Sequence[AgentScheduleEntry], agents: int, *, speed_per_run: bool) -> None:
    """Raise ValueError if a schedule displaces phases of agents that there are not, or sets speeds that runs draw."""
    for number, entry in enumerate(schedule):
        if speed_per_run and "agents.speed_cm_s" in entry.set:
            raise ValueError(
                f"schedule.{number}.set: agents.speed_cm_s cannot change where agents.speed_per_run is true, "
                "as each run draws its speed; leave one of them out"
            )
        for agent in (entry.displace and entry.displace.agents) or ():
            if agent >= agents:
                raise ValueError(f"schedule.{number}.displace.agents: is {agent}; allowed: 0 to {agents - 1}")
