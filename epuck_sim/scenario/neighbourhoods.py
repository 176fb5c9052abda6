"""Neighbourhoods of point-like agents: who receives the pulse of one that fires (thesis 2.4, 3.1.2, 5.1.3)."""

from typing import Annotated, Literal

from pydantic import Field

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber


class Nearest(ConfigModel):
    """The k agents nearest to the one that fires."""

    kind: Literal["nearest"]
    k: Annotated[WholeNumber, Field(ge=1)] = 1
    """Number K of agents that receive a pulse."""


class Range(ConfigModel):
    """All agents within a radius around the one that fires."""

    kind: Literal["range"]
    radius_cm: Positive
    """Radius R."""


class Cone(ConfigModel):
    """A cone in the direction of motion: of vision, around the agent that receives, or of emission."""

    kind: Literal["cone_of_vision", "cone_of_emission"]
    """`cone_of_vision`: around the agent that receives; `cone_of_emission`: around the one that fires."""
    radius_cm: Positive | None = None
    """Reach of the cone; unlimited by default."""
    angle_deg: Annotated[Number, Field(gt=0, le=360)]
    """Full opening angle."""


class Everybody(ConfigModel):
    """All agents."""

    kind: Literal["all"]


class RandomAgents(ConfigModel):
    """Agents drawn anew for each pulse, wherever they are: the mean field of fast agents (2.4)."""

    kind: Literal["random"]
    k: Annotated[WholeNumber, Field(ge=1)] = 1
    """Number K of agents that receive a pulse."""


Neighbourhood = Nearest | Range | Cone | Everybody | RandomAgents
"""The agents that receive the pulse of one that fires (2.4, 3.1.2, 5.1.3)."""
