"""Straight trajectories from wall to wall, and the position of every agent at any time (thesis 3.1, 5.1.2, D).

Agents are not moved step by step. A trajectory stores where and when it began and when it reaches a wall; trajectories
that have ended are continued only when a position is asked for. When this happens makes no difference, to the bit:
each agent draws its directions from a stream of its own, and the times of a trajectory are stored as a cycle and the
time in that cycle. So agents of two simulations with the same seed move alike whatever their oscillators do.

Times passed as arguments are in cycles since the start of the present cycle (see `oscillators`).
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray, StreamArray
from epuck_sim.particles.oscillators import argmin, minimum
from epuck_sim.scenario.particles import SpaceSection
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.rng import uniform


class Trajectories(NamedTuple):
    """The present straight path of each agent, in a segment, square or cube from 0 to `side_cm`."""

    side_cm: float
    """Side of the space."""
    is_cyclic: bool
    """Whether an agent that leaves on one side enters on the opposite one, instead of being reflected."""
    is_mirrored: bool
    """Whether walls reflect agents as mirrors do, instead of in a random direction."""
    origin: FloatArray
    """(dimensions, agents) cm: where each trajectory began."""
    heading: FloatArray
    """(dimensions, agents) unit vectors."""
    speed: FloatArray
    """(agents,) cm per cycle."""
    start_cycle: FloatArray
    """(agents,) the cycle in which each trajectory began."""
    start_time: FloatArray
    """(agents,) the time in that cycle, 0 to 1."""
    end_cycle: FloatArray
    """(agents,) the cycle in which each trajectory reaches a wall; inf for an agent that stands still."""
    end_time: FloatArray
    """(agents,) the time in that cycle."""
    wall: IntArray
    """(agents,) the wall that is reached: 2 * axis, or 2 * axis + 1 for the one at `side_cm`."""
    cycle: FloatArray
    """(1,) number of the present cycle, from 0."""
    earliest_end: FloatArray
    """(1,) a lower bound of the time of the first wall hit, in cycles since the start of the present cycle."""
    end_times: FloatArray
    """(agents,) scratch: the time of each wall hit, in cycles since the start of the present cycle."""
    streams: StreamArray
    """(agents, 4) states of the agents' random number generators."""


def start_trajectories(
    space: SpaceSection, origin: FloatArray, heading: FloatArray, speed: FloatArray, streams: StreamArray
) -> Trajectories:
    """Return trajectories that begin at time 0 in a space; the arrays are fields of `Trajectories`."""
    start_cycle, start_time, end_cycle, end_time, end_times = np.zeros((5, len(speed)))
    trajectories = Trajectories(
        space.side_cm,
        space.boundary == "cyclic",
        space.boundary == "mirrored",
        origin,
        heading,
        speed,
        start_cycle,
        start_time,
        end_cycle,
        end_time,
        np.zeros(len(speed), np.int64),
        np.zeros(1),
        np.zeros(1),
        end_times,
        streams,
    )
    find_wall_hits(trajectories)
    return trajectories


@jit_inline
def find_wall_hits(trajectories: Trajectories) -> None:
    """Compute when and where every trajectory reaches a wall."""
    for agent in range(len(trajectories.speed)):
        find_wall_hit(trajectories, agent)
    trajectories.earliest_end[0] = wall_hit_time(trajectories, first_to_hit_wall(trajectories))


@jit_inline
def find_wall_hit(trajectories: Trajectories, agent: int) -> None:
    """Compute when and where an agent's trajectory reaches a wall."""
    duration, wall = math.inf, trajectories.wall[agent]
    for axis in range(len(trajectories.origin)):  # directions are random: conditions that are no branches
        velocity = trajectories.heading[axis, agent] * trajectories.speed[agent]
        distance_cm = (trajectories.side_cm if velocity > 0 else 0.0) - trajectories.origin[axis, agent]
        until = distance_cm / velocity if velocity != 0 else math.inf
        wall = 2 * axis + (velocity > 0) if until < duration else wall
        duration = min(duration, until)
    trajectories.wall[agent] = wall
    start = trajectories.start_time[agent]
    whole = int(start + duration) if duration < math.inf else math.inf
    trajectories.end_cycle[agent] = trajectories.start_cycle[agent] + whole
    trajectories.end_time[agent] = start + duration - whole if duration < math.inf else 0.0


@jit_inline
def wall_hit_time(trajectories: Trajectories, agent: int) -> float:
    """Return when an agent reaches a wall, in cycles since the start of the present cycle."""
    time: float = (trajectories.end_cycle[agent] - trajectories.cycle[0]) + trajectories.end_time[agent]
    return time


@jit_inline
def compute_wall_hit_times(trajectories: Trajectories) -> None:
    """Write the time of each wall hit to `end_times`."""
    for agent in range(len(trajectories.end_times)):
        trajectories.end_times[agent] = wall_hit_time(trajectories, agent)


@jit_inline
def first_to_hit_wall(trajectories: Trajectories) -> int:
    """Return the agent that reaches a wall first."""
    compute_wall_hit_times(trajectories)
    return argmin(trajectories.end_times, len(trajectories.end_times))


@jit_inline
def distance_travelled(trajectories: Trajectories, agent: int, time: float) -> float:
    """Return how many cm of its trajectory an agent has covered at `time`."""
    elapsed = (trajectories.cycle[0] - trajectories.start_cycle[agent]) + (time - trajectories.start_time[agent])
    distance_cm: float = trajectories.speed[agent] * elapsed
    return distance_cm


@jit_inline
def coordinate_at(trajectories: Trajectories, agent: int, axis: int, time: float) -> float:
    """Return an agent's position along an axis, in cm, at a time which is not after its wall hit."""
    travelled_cm = distance_travelled(trajectories, agent, time)
    coordinate_cm: float = trajectories.origin[axis, agent] + trajectories.heading[axis, agent] * travelled_cm
    return coordinate_cm


@jit_inline
def compute_positions(trajectories: Trajectories, time: float, positions: FloatArray) -> None:
    """Write the positions of all agents at `time` to `positions`, (dimensions, agents) cm.

    Trajectories that have ended by then are continued.
    """
    advance_all(trajectories, time)
    for axis in range(len(positions)):
        for agent in range(len(trajectories.speed)):
            positions[axis, agent] = coordinate_at(trajectories, agent, axis, time)


@jit_inline
def restart_at(trajectories: Trajectories, agent: int, travelled_cm: float, cycle: float, time: float) -> None:
    """Begin an agent's next trajectory `travelled_cm` along the present one, at `time` of `cycle`."""
    for axis in range(len(trajectories.origin)):
        reached = trajectories.origin[axis, agent] + trajectories.heading[axis, agent] * travelled_cm
        trajectories.origin[axis, agent] = min(max(reached, 0.0), trajectories.side_cm)
    trajectories.start_cycle[agent] = cycle
    trajectories.start_time[agent] = time


@jit_inline
def reflect(trajectories: Trajectories, agent: int) -> None:
    """Continue an agent's trajectory beyond its wall hit.

    It goes on in a random direction, as from a mirror, or in a cyclic space from the opposite edge.
    """
    axis, is_far = trajectories.wall[agent] // 2, trajectories.wall[agent] % 2 == 1
    end_cycle, end_time = trajectories.end_cycle[agent], trajectories.end_time[agent]
    duration = (end_cycle - trajectories.start_cycle[agent]) + (end_time - trajectories.start_time[agent])
    restart_at(trajectories, agent, trajectories.speed[agent] * duration, end_cycle, end_time)
    trajectories.origin[axis, agent] = trajectories.side_cm if is_far != trajectories.is_cyclic else 0.0
    if trajectories.is_mirrored:
        trajectories.heading[axis, agent] = -trajectories.heading[axis, agent]
    elif not trajectories.is_cyclic:
        heading_from_wall(trajectories.heading[:, agent], axis, -1.0 if is_far else 1.0, trajectories.streams[agent])
    find_wall_hit(trajectories, agent)


@jit_inline
def reflect_next(trajectories: Trajectories) -> int:
    """Reflect the agent that reaches a wall first; return its index."""
    agent = first_to_hit_wall(trajectories)
    reflect(trajectories, agent)
    trajectories.earliest_end[0] = wall_hit_time(trajectories, first_to_hit_wall(trajectories))
    return agent


@jit_inline
def advance_all(trajectories: Trajectories, time: float) -> None:
    """Continue all trajectories that end by `time`, over as many walls as are reached."""
    if time < trajectories.earliest_end[0]:
        return
    compute_wall_hit_times(trajectories)
    for agent in range(len(trajectories.speed)):
        if trajectories.end_times[agent] <= time:
            advance_one(trajectories, agent, time)
            trajectories.end_times[agent] = wall_hit_time(trajectories, agent)
    trajectories.earliest_end[0] = minimum(trajectories.end_times, 0, len(trajectories.end_times))


@jit_inline
def advance_one(trajectories: Trajectories, agent: int, time: float) -> None:
    """Continue an agent's trajectory until it lasts beyond `time`."""
    while wall_hit_time(trajectories, agent) <= time:
        reflect(trajectories, agent)


@jit_inline
def reorient(trajectories: Trajectories, agent: int, time: float) -> None:
    """Turn an agent in a random direction at `time`, which is not after its wall hit (D.1)."""
    restart_at(trajectories, agent, distance_travelled(trajectories, agent, time), trajectories.cycle[0], time)
    random_heading(trajectories.heading[:, agent], trajectories.streams[agent])
    find_wall_hit(trajectories, agent)
    trajectories.earliest_end[0] = min(trajectories.earliest_end[0], wall_hit_time(trajectories, agent))


@jit_inline
def rebase_trajectories(trajectories: Trajectories) -> None:
    """Count all times from the start of the next cycle."""
    trajectories.cycle[0] += 1.0
    trajectories.earliest_end[0] -= 1.0


@jit_inline
def heading_from_wall(heading: FloatArray, axis: int, inward: float, stream: StreamArray) -> None:
    """Draw a heading within 90 degrees of a wall's normal.

    In a square the angle to the normal is uniform (thesis 3.1), in a cube the direction is uniform over the hemisphere
    (D.3), and in a segment the normal is the only direction.

    Args:
        heading: (dimensions,) unit vector, which is overwritten.
        axis: Axis of the normal.
        inward: Sign of the normal, 1 or -1.
        stream: (4,) state of the random number generator.
    """
    if len(heading) == 1:
        heading[0] = inward
    elif len(heading) == 2:
        angle = math.pi * (uniform(stream) - 0.5)
        heading[axis] = inward * math.cos(angle)
        heading[1 - axis] = math.sin(angle)
    else:
        set_heading(heading, axis, inward * (1.0 - uniform(stream)), uniform(stream))


@jit_inline
def random_heading(heading: FloatArray, stream: StreamArray) -> None:
    """Draw a heading, (dimensions,), uniformly over all directions."""
    if len(heading) == 1:
        heading[0] = 1.0 if uniform(stream) < 0.5 else -1.0
    elif len(heading) == 2:
        angle = 2 * math.pi * uniform(stream)
        heading[0] = math.cos(angle)
        heading[1] = math.sin(angle)
    else:
        set_heading(heading, 2, 2 * uniform(stream) - 1, uniform(stream))


@jit_inline
def set_heading(heading: FloatArray, axis: int, height: float, turn: float) -> None:
    """Set a heading, (3,), by its component along an axis, -1 to 1, and its azimuth around it, 0 to 1 turn."""
    rim = math.sqrt(1 - height * height)
    heading[axis] = height
    heading[(axis + 1) % 3] = rim * math.cos(2 * math.pi * turn)
    heading[(axis + 2) % 3] = rim * math.sin(2 * math.pi * turn)
