"""What is known of who hears whose pulses (thesis 3.1.2, 5.1.3).

Nobody moves faster than the fastest agent, so that distances and edges of cones give a time until which a
neighbourhood stays as it is. Where agents are slow, that is many cycles.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.particles.cell_list import CellList, begin_cycle_of_lattice, make_cell_list
from epuck_sim.scenario.particles import Cone, Nearest, ParticleScenario, Range
from epuck_sim.util.jit import jit_inline

NEAREST, SEEN, REACHED = range(3)
"""The k nearest; those in whose cone of vision the one that fires is; those in its cone of emission."""

UNLIMITED_CM = 1e30
"""Farther than anybody can be, but not inf, which is how far an agent is from itself."""

FULL_CIRCLE = -2.0
"""Less than any cosine."""

PAUSE = 8
"""For so many pulses nobody asks how long neighbours stay, after they did not stay for a cycle."""

MOST_KEPT = 2000
"""Of more agents neighbours are not kept: it would take more than 32 MB."""

FEWEST_IN_CELLS = 400
"""Fewer agents are not looked up in cells: all pairs are quicker."""


class Neighbourhood(NamedTuple):
    """The rule, and who is known to be whose neighbour.

    Candidates are all agents, or those that the lattice finds; what is known of the k-th stands at place k.
    """

    kind: int
    k: int
    radius_cm: float
    cos: float
    """Of half the cone's angle, or `FULL_CIRCLE`."""
    sin: float
    keeps: bool
    """Whether neighbours are kept at all."""
    patience: float
    """Cycles that it takes two of the fastest agents to come nearer by 1 cm."""
    members: IntArray
    """(agents, agents) each agent's neighbours; (1, agents) where they are not kept."""
    counts: IntArray
    """(agents,) how many they are."""
    until: FloatArray
    """(agents,) till when they are known."""
    pause: IntArray
    """(agents,) for how many pulses nobody asks till when."""
    has_lattice: bool
    lattice: CellList
    reach_cm: float
    """So far the lattice is searched."""
    who: IntArray
    """(agents,) the candidates."""
    places: FloatArray
    """(dimensions, agents) cm: where they are at this instant."""
    facing: FloatArray
    """(dimensions, agents) unit vectors: where they go; of candidates that the lattice found."""
    ends: FloatArray
    """(agents,) when their flights end."""
    placed: FloatArray
    """(1,) the instant at which all agents are in `places`; NaN where it is past."""
    square: FloatArray
    """(agents,) cm^2: of their distances to the agent in question, whose own is inf."""
    along: FloatArray
    """(agents,) cm: how far they, or it, are ahead of the one whose cone counts."""
    inside: FloatArray
    """(agents,) cm^2: not below 0 for who is within the cone's angle; then, till when each stays in or out of it."""


def make_neighbourhood(scenario: ParticleScenario, fastest: float) -> Neighbourhood:
    """Return a scenario's neighbourhoods, none of which is known yet; fastest: of the agents, cm in a cycle."""
    rule, agents, dimensions = scenario.neighbourhood, scenario.agents.count, scenario.space.dimensions
    kind, k, radius_cm, angle_deg = NEAREST, agents - 1, UNLIMITED_CM, 360.0
    if isinstance(rule, Nearest):
        k = min(rule.k, agents - 1)
    else:
        kind = SEEN if rule.kind == "cone_of_vision" else REACHED
    if isinstance(rule, Range | Cone):
        radius_cm = UNLIMITED_CM if rule.radius_cm is None else rule.radius_cm
    if isinstance(rule, Cone):
        angle_deg = rule.angle_deg
    # a cone turns when its agent does, and in a cyclic space when another one comes round the other way
    turns = angle_deg < 360 and (scenario.space.boundary == "cyclic" or bool(scenario.agents.reorient_on))
    keeps = agents <= MOST_KEPT and not turns
    side_cm, spacing_cm = scenario.space.side_cm, scenario.space.side_cm / agents ** (1 / dimensions)
    cell_cm = spacing_cm if kind == NEAREST else max(spacing_cm, radius_cm / 2)
    reach_cm = spacing_cm * (k + 1) ** (1 / dimensions) if kind == NEAREST else radius_cm + cell_cm / 4
    share = ((2 * reach_cm + 2 * cell_cm) / side_cm) ** dimensions  # of all agents: those in the cells within reach
    has_lattice = agents >= FEWEST_IN_CELLS and share < 1 / 3
    return Neighbourhood(
        kind,
        k,
        radius_cm,
        FULL_CIRCLE if angle_deg >= 360 else math.cos(math.radians(angle_deg / 2)),
        math.sin(math.radians(angle_deg / 2)),
        keeps,
        1 / max(2 * fastest, 1e-300),
        np.zeros((agents if keeps else 1, agents), np.int64),
        np.zeros(agents, np.int64),
        np.full(agents, -math.inf),
        np.zeros(agents, np.int64),
        has_lattice,
        make_cell_list(dimensions, side_cm, agents, cell_cm if has_lattice else side_cm, fastest),
        reach_cm,
        np.arange(agents),
        np.zeros((dimensions, agents)),
        np.zeros((dimensions, agents)),
        np.zeros(agents),
        np.full(1, np.nan),
        *(np.zeros(agents) for _ in range(3)),
    )


@jit_inline
def is_worth_keeping(hood: Neighbourhood, agent: int) -> bool:
    """Whether to find out until when an agent's neighbours stay; not if that was before its next pulse of late."""
    if hood.pause[agent] > 0:
        hood.pause[agent] -= 1
        return False
    return hood.keeps


@jit_inline
def keep(hood: Neighbourhood, agent: int, time: float, until: float) -> None:
    """Take note that an agent's neighbours stay until then."""
    hood.until[agent] = until
    if until < time + 1:
        hood.pause[agent] = PAUSE


@jit_inline
def begin_cycle_of_neighbours(hood: Neighbourhood) -> None:
    """Count times from a cycle later."""
    hood.placed[0] = math.nan
    begin_cycle_of_lattice(hood.lattice)
    for agent in range(len(hood.until)):
        hood.until[agent] -= 1.0
