"""The neighbourhood rule and the cache of neighbours: which agents receive each agent's pulses (thesis 3.1.2, 5.1.3).

No agent moves faster than the fastest one. Distances to other agents, and to the edges of cones, therefore bound the
time until which a neighbourhood cannot change; with slow agents that is many cycles.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IndexArray, IntArray, StreamArray
from epuck_sim.particles.cell_list import CellList, make_cell_list, rebase_cell_list
from epuck_sim.scenario.neighbourhoods import Cone, Nearest, RandomAgents, Range
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit_inline

NEAREST = 0
"""Kind of neighbourhood: the k agents nearest to the firing agent receive its pulse."""

VISION_CONE = 1
"""Kind of neighbourhood: the agents whose cones contain the firing agent receive its pulse."""

EMISSION_CONE = 2
"""Kind of neighbourhood: the agents inside the cone, or range, of the firing agent receive its pulse."""

RANDOM = 3
"""Kind of neighbourhood: k agents, which are drawn anew for each pulse, receive it."""

UNLIMITED_CM = 1e30
"""An unlimited radius: farther than any agent, but finite, as an agent's distance to itself is set to inf."""

FULL_CIRCLE_COS = -2.0
"""Stands for the cosine of a cone that is a full circle; below any cosine."""

SKIPPED_PULSES = 8
"""Number of pulses for which caching is skipped after a cached neighbourhood expired within a cycle."""

SKIPPED_PULSES_CONE = 32
"""The same for a cone or range, whose validity takes longer to compute."""

MAX_CACHED_AGENTS = 2000
"""Largest swarm whose neighbours are cached; the cache of a larger one would take more than 16 MB."""

MIN_CELL_LIST_AGENTS = 400
"""Smallest swarm that uses a cell list; in smaller ones a search over all pairs is faster."""

MAX_SHARE, MAX_SHARE_NEAREST = 1 / 3, 1 / 6
"""Largest share of all agents that a search in the cell list looks at; otherwise a search over all pairs is faster."""

BALL_VOLUME = {1: 2.0, 2: math.pi, 3: 4 / 3 * math.pi}
"""Length, area or volume of a ball of radius 1, by dimensions."""


class Neighbourhood(NamedTuple):
    """The rule, the cache of neighbours, and scratch arrays of the search.

    The candidates of a search are all agents, or those that the cell list finds. Index k of a scratch array belongs to
    the k-th candidate.
    """

    kind: int
    """`NEAREST`, `VISION_CONE`, `EMISSION_CONE` or `RANDOM`."""
    k: int
    """Number of neighbours of kinds `NEAREST` and `RANDOM`."""
    radius_cm: float
    """Radius of the cone or range; `UNLIMITED_CM` if there is none."""
    cos: float
    """Cosine of half the cone's angle, or `FULL_CIRCLE_COS`."""
    sin: float
    """Sine of half the cone's angle."""
    is_cached: bool
    """Whether neighbours are cached at all."""
    inverse_closing_speed: float
    """Cycles in which the two fastest agents can approach each other by 1 cm."""
    members: IndexArray
    """(agents, agents) each agent's neighbours; (1, agents), those of the last search, if they are not cached."""
    counts: IntArray
    """(agents,) number of neighbours of each agent."""
    cached_until: FloatArray
    """(agents,) time until which each agent's cached neighbours are valid, in cycles since the present one began."""
    skip_count: IntArray
    """(agents,) number of each agent's next pulses for which caching is skipped."""
    searches_all: bool
    """Whether all agents are candidates; else these are looked up in `cell_list`, or receivers are drawn."""
    cell_list: CellList
    """Agents sorted by cell; a single cell if it is not used."""
    search_radius_cm: float
    """Radius of the first search in the cell list."""
    candidates: IndexArray
    """(agents,) indices of the candidates."""
    positions: FloatArray
    """(dimensions, agents) cm: positions of the candidates."""
    headings: FloatArray
    """(dimensions, agents) unit vectors: headings of the candidates that the cell list found."""
    end_times: FloatArray
    """(agents,) cycles since the present one began: when the candidates' trajectories end."""
    positions_time: FloatArray
    """(1,) time for which `positions` holds all agents; NaN if it holds none."""
    square_distance: FloatArray
    """(agents,) cm^2: squared distances of the candidates from the firing agent, which has inf itself."""
    axial_distance: FloatArray
    """(agents,) cm: components of these distances along the axis of the cone."""
    angle_margin: FloatArray
    """(agents,) cm^2: not negative within the cone; overwritten by times of validity when these are needed."""
    bucket_of: IndexArray
    """(agents,) scratch of the selection of the k nearest."""
    bucket_end: IndexArray
    """(agents,) scratch of the selection of the k nearest."""
    is_drawn: BoolArray
    """(agents,) scratch of kind `RANDOM`: whether each agent has been drawn for the present pulse; else empty."""
    streams: StreamArray
    """(agents, 4) states of the generators from which each agent draws the receivers of its pulses; else empty."""


def make_neighbourhood(scenario: ParticleScenario, max_speed: float, streams: StreamArray) -> Neighbourhood:
    """Return the neighbourhood of a scenario, with an empty cache.

    Args:
        scenario: The space, the agents and the rule.
        max_speed: Speed of the fastest agent in cm per cycle.
        streams: (agents, 4) see `Neighbourhood`; of no agents unless receivers are drawn.
    """
    rule, agents, dimensions = scenario.neighbourhood, scenario.agents.count, scenario.space.dimensions
    kind, k, radius_cm, angle_deg = NEAREST, agents - 1, UNLIMITED_CM, 360.0
    if isinstance(rule, Nearest | RandomAgents):
        kind, k = NEAREST if isinstance(rule, Nearest) else RANDOM, min(rule.k, agents - 1)
    else:
        kind = VISION_CONE if rule.kind == "cone_of_vision" else EMISSION_CONE
    if isinstance(rule, Range | Cone):
        radius_cm = UNLIMITED_CM if rule.radius_cm is None else rule.radius_cm
    if isinstance(rule, Cone):
        angle_deg = rule.angle_deg
    # cones jump when their agents reorient, and when the nearest image of an agent changes in a cyclic space
    jumps = angle_deg < 360 and (scenario.space.boundary == "cyclic" or bool(scenario.agents.reorient_on))
    is_cached = agents <= MAX_CACHED_AGENTS and not jumps and kind != RANDOM
    side_cm, spacing_cm = scenario.space.side_cm, scenario.space.side_cm / agents ** (1 / dimensions)
    cell_cm = spacing_cm if kind == NEAREST else max(spacing_cm, radius_cm / 2)
    expected = k + 1 + 3 * math.sqrt(k + 1)  # agents in the radius: far from walls hardly ever too few
    reach_cm = spacing_cm * (expected / BALL_VOLUME[dimensions]) ** (1 / dimensions)
    search_cm = reach_cm if kind == NEAREST else radius_cm + cell_cm / 4
    share = ((2 * search_cm + 2 * cell_cm) / side_cm) ** dimensions  # of all agents which are candidates
    is_local = kind != RANDOM and share < (MAX_SHARE_NEAREST if kind == NEAREST else MAX_SHARE)
    uses_cell_list = agents >= MIN_CELL_LIST_AGENTS and is_local
    return Neighbourhood(
        kind,
        k,
        radius_cm,
        FULL_CIRCLE_COS if angle_deg >= 360 else math.cos(math.radians(angle_deg / 2)),
        math.sin(math.radians(angle_deg / 2)),
        is_cached,
        1 / max(2 * max_speed, 1e-300),
        np.zeros((agents if is_cached else 1, agents), np.uint32),
        np.zeros(agents, np.int64),
        np.full(agents, -math.inf),
        np.zeros(agents, np.int64),
        not uses_cell_list and kind != RANDOM,
        make_cell_list(dimensions, side_cm, agents, cell_cm if uses_cell_list else side_cm, max_speed),
        search_cm,
        np.arange(agents, dtype=np.uint32),
        np.zeros((dimensions, agents)),
        np.zeros((dimensions, agents)),
        np.zeros(agents),
        np.full(1, np.nan),
        np.zeros(agents),
        np.zeros(agents),
        np.zeros(agents),
        np.zeros(agents, np.uint32),
        np.zeros(agents, np.uint32),
        np.zeros(len(streams), np.bool_),
        streams,
    )


@jit_inline
def should_cache(neighbourhood: Neighbourhood, agent: int) -> bool:
    """Return whether caching an agent's neighbours is likely to pay off; count the pulses for which it is skipped."""
    if neighbourhood.skip_count[agent] > 0:
        neighbourhood.skip_count[agent] -= 1
        return False
    return neighbourhood.is_cached


@jit_inline
def cache_until(neighbourhood: Neighbourhood, agent: int, time: float, until: float) -> None:
    """Declare the neighbours of an agent, found at `time`, valid until a later time."""
    neighbourhood.cached_until[agent] = until
    if until < time + 1:
        neighbourhood.skip_count[agent] = SKIPPED_PULSES if neighbourhood.kind == NEAREST else SKIPPED_PULSES_CONE


@jit_inline
def rebase_neighbourhood(neighbourhood: Neighbourhood) -> None:
    """Count all times from the start of the next cycle."""
    neighbourhood.positions_time[0] = math.nan
    rebase_cell_list(neighbourhood.cell_list)
    for agent in range(len(neighbourhood.cached_until)):
        neighbourhood.cached_until[agent] -= 1.0
