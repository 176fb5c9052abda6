"""Who hears the pulse of an agent that fires (thesis 3.1.2, 5.1.3), found anew only when it may have changed.

Nobody moves faster than the fastest agent, so that distances and edges of cones give a time until which a
neighbourhood stays as it is. Where agents are slow, that is many cycles.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.compiled import lean_kernel
from epuck_sim.particles.flight import Flights, locate
from epuck_sim.particles.least import least, place_of_least
from epuck_sim.particles.scenario import Cone, Everybody, Nearest, ParticleScenario

Floats = npt.NDArray[np.float64]
Whole = npt.NDArray[np.int64]

NEAREST, SEEN, REACHED = range(3)
"""The k nearest; those in whose cone of vision the one that fires is; those in its cone of emission."""


class Neighbourhood(NamedTuple):
    """The rule, and who is known to be whose neighbour."""

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
    members: npt.NDArray[np.int32]
    """(agents, agents - 1) each agent's neighbours; (1, agents - 1) where they are not kept."""
    counts: Whole
    """(agents,) how many they are."""
    until: Floats
    """(agents,) till when they are known."""
    pause: Whole
    """(agents,) for how many pulses nobody asks till when."""
    places: Floats
    """(dimensions, agents) cm: where everybody is at this instant."""
    placed: Floats
    """(1,) which instant that is; NaN where it is past."""
    square: Floats
    """(agents,) of the distances to the agent in question, cm^2."""
    along: Floats
    """(agents,) cm: how far they, or it, are ahead of the one whose cone counts."""
    apart: Floats
    """(agents,) cm: how far they are from it along one axis."""


FULL_CIRCLE = -2.0
"""Less than any cosine."""

PAUSE = 8
"""For so many pulses nobody asks how long neighbours stay, after they did not stay for a cycle."""

MOST_KEPT = 2000
"""Of more agents neighbours are not kept: it would take more than 16 MB."""


def make_neighbourhood(scenario: ParticleScenario, fastest: float) -> Neighbourhood:
    """Return a scenario's neighbourhoods, none of which is known yet; fastest: of the agents, cm in a cycle."""
    rule, agents = scenario.neighbourhood, scenario.agents.count
    kind, k, radius_cm, angle_deg = NEAREST, agents - 1, math.inf, 360.0
    if isinstance(rule, Nearest):
        k = rule.k
    elif not isinstance(rule, Everybody):
        kind = SEEN if rule.kind == "cone_of_vision" else REACHED
        radius_cm = math.inf if rule.radius_cm is None else rule.radius_cm
        angle_deg = rule.angle_deg if isinstance(rule, Cone) else 360.0
    # a cone turns when its agent does, and in a cyclic space when another one comes round the other way
    turns = angle_deg < 360 and (scenario.space.boundary == "cyclic" or bool(scenario.agents.reorient_on))
    keeps = agents <= MOST_KEPT and not turns
    return Neighbourhood(
        kind,
        min(k, agents - 1),
        radius_cm,
        FULL_CIRCLE if angle_deg >= 360 else math.cos(math.radians(angle_deg / 2)),
        math.sin(math.radians(angle_deg / 2)),
        keeps,
        1 / max(2 * fastest, 1e-300),
        np.zeros((agents if keeps else 1, agents), np.int32),
        np.zeros(agents, np.int64),
        np.full(agents, -math.inf),
        np.zeros(agents, np.int64),
        np.zeros((scenario.space.dimensions, agents)),
        np.full(1, np.nan),
        *(np.zeros(agents) for _ in range(3)),
    )


@lean_kernel
def find_neighbours(hood: Neighbourhood, flights: Flights, agent: int, time: float) -> int:
    """Have a row of `members` begin with the `counts[agent]` who hear `agent` fire at `time`; return the row."""
    row = agent if len(hood.members) > 1 else 0
    if time >= hood.until[agent]:
        if hood.placed[0] != time:
            locate(flights, time, hood.places)
            hood.placed[0] = time
        measure(hood, flights, agent)
        if hood.kind == NEAREST:
            take_nearest(hood, agent, time, hood.members[row])
        else:
            take_cone(hood, flights, agent, time, hood.members[row])
    return row


@lean_kernel
def measure(hood: Neighbourhood, flights: Flights, agent: int) -> None:
    """Find how far everybody is from `agent`, and how far ahead in the cones that count.

    Loops without branches over arrays in a row are what a processor is quickest at.
    """
    agents, side_cm = len(flights.speed), flights.side_cm
    square, apart = hood.square, hood.apart
    is_round = hood.kind == NEAREST or hood.cos == FULL_CIRCLE
    for axis in range(len(hood.places)):
        places, heading = hood.places[axis], flights.heading[axis]
        here = places[agent]
        for other in range(agents):
            apart[other] = places[other] - here
        if flights.is_cyclic:
            for other in range(agents):
                apart[other] -= side_cm * np.rint(apart[other] / side_cm)
        if axis == 0:
            for other in range(agents):
                square[other] = apart[other] * apart[other]
        else:
            for other in range(agents):
                square[other] += apart[other] * apart[other]
        if not is_round:
            add_ahead(hood, heading, agent, axis == 0)
    square[agent] = math.inf


@lean_kernel
def add_ahead(hood: Neighbourhood, heading: Floats, agent: int, is_first: bool) -> None:
    """Add along an axis how far `agent` is ahead in others' cones of vision, or they in its cone of emission."""
    along, apart = hood.along, hood.apart
    if is_first:
        for other in range(len(along)):
            along[other] = 0.0
    if hood.kind == SEEN:
        for other in range(len(along)):
            along[other] -= apart[other] * heading[other]
    else:
        ahead = heading[agent]
        for other in range(len(along)):
            along[other] += apart[other] * ahead


@lean_kernel
def is_worth_keeping(hood: Neighbourhood, agent: int) -> bool:
    """Whether to find out until when an agent's neighbours stay; not if that was before its next pulse of late."""
    if hood.pause[agent] > 0:
        hood.pause[agent] -= 1
        return False
    return hood.keeps


@lean_kernel
def keep(hood: Neighbourhood, agent: int, time: float, until: float) -> None:
    """Take note that an agent's neighbours stay until then."""
    hood.until[agent] = until
    if until < time + 1:
        hood.pause[agent] = PAUSE


@lean_kernel
def take_nearest(hood: Neighbourhood, agent: int, time: float, members: npt.NDArray[np.int32]) -> None:
    """Write the k nearest to `members`, the lower number first where two are equally far."""
    square = hood.square
    farthest = 0.0
    for rank in range(hood.k):
        other = place_of_least(square)
        members[rank] = other
        farthest = square[other]
        square[other] = math.inf
    hood.counts[agent] = hood.k
    if is_worth_keeping(hood, agent):
        gap = math.sqrt(least(square, 0, len(square))) - math.sqrt(farthest)
        # both distances may change
        keep(hood, agent, time, time + gap / 2 * hood.patience)


@lean_kernel
def take_cone(hood: Neighbourhood, flights: Flights, agent: int, time: float, members: npt.NDArray[np.int32]) -> None:
    """Write those to `members` to whom, or from whom, the cone reaches; who is at the same place is inside."""
    agents, square, along, inside = len(hood.square), hood.square, hood.along, hood.apart
    reach = hood.radius_cm * hood.radius_cm
    found = 0
    if hood.cos == FULL_CIRCLE:
        for other in range(agents):
            members[found] = other  # overwritten by the next one if it is out of reach: no branch
            found += square[other] <= reach
    else:
        for other in range(agents):  # along >= cos * distance, without a root
            inside[other] = along[other] * abs(along[other]) - hood.cos * abs(hood.cos) * square[other]
        for other in range(agents):
            members[found] = other
            found += (square[other] <= reach) & (inside[other] >= 0)
    hood.counts[agent] = found
    if is_worth_keeping(hood, agent):
        stays = hood.apart
        if hood.cos == FULL_CIRCLE:
            for other in range(agents):
                stays[other] = time + hood.patience * abs(math.sqrt(square[other]) - hood.radius_cm)
            keep(hood, agent, time, least(stays, 0, agents))
        else:
            find_stays(hood, flights, time)
            until = least(stays, 0, agents)
            keep(hood, agent, time, min(until, flights.ends[agent]) if hood.kind == REACHED else until)


@lean_kernel
def find_stays(hood: Neighbourhood, flights: Flights, time: float) -> None:
    """Replace what is known of cones in `apart` by a time until which each is, or is not, in the cone for sure.

    Agents can enter or leave it over its arc, or over an edge, and a cone of vision turns when its agent does.
    """
    agents, square, along, inside = len(hood.square), hood.square, hood.along, hood.apart
    until_turn = hood.kind == REACHED  # which has one cone, not one for each
    for other in range(agents):
        beyond = math.sqrt(square[other]) - hood.radius_cm
        # how far the cone's edge, or its extension beyond the apex, is
        edge = abs(
            math.sqrt(max(square[other] - along[other] * along[other], 0.0)) * hood.cos - along[other] * hood.sin
        )
        within = min(edge, -beyond) if inside[other] >= 0 else edge
        crossing = time + hood.patience * (beyond if beyond > 0 else within)
        turning = math.inf if until_turn or beyond > 0 else flights.ends[other]
        inside[other] = min(crossing, turning)


@lean_kernel
def begin_cycle_of_neighbours(hood: Neighbourhood) -> None:
    """Count times from a cycle later."""
    hood.placed[0] = math.nan
    for agent in range(len(hood.until)):
        hood.until[agent] -= 1.0
