"""Straight trajectories, and the position of every agent at any time (thesis 3.1, 5.1.2, D).

Agents are not moved step by step. A trajectory stores where and when it began and when it ends: at a wall, or at the
end of a run of a random walk if that is earlier. Trajectories that have ended are continued only when a position is
asked for. When this happens makes no difference, to the bit: each agent draws from a stream of its own, and the times
of a trajectory are stored as a cycle and the time in that cycle. So agents of two simulations with the same seed move
alike whatever their oscillators do.

Times passed as arguments are in cycles since the start of the present cycle (see `oscillators`).
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray, StreamArray
from epuck_sim.particles.headings import heading_from_wall, random_heading, turn_heading
from epuck_sim.particles.oscillators import argmin, minimum
from epuck_sim.particles.walks import Walk, begin_run, rest_of_run
from epuck_sim.scenario.particles import SpaceSection
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.native import unlikely
from epuck_sim.util.rng import randint

NO_WALL = -1
"""Stands for a wall where a trajectory ends because a run does."""


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
    """(agents,) the cycle in which each trajectory ends; inf for an agent that stands still."""
    end_time: FloatArray
    """(agents,) the time in that cycle."""
    wall: IntArray
    """(agents,) the wall that is reached: 2 * axis, or 2 * axis + 1 for the one at `side_cm`; or `NO_WALL`."""
    cycle: FloatArray
    """(1,) number of the present cycle, from 0."""
    earliest_end: FloatArray
    """(1,) a lower bound of the time at which the first one ends, in cycles since the start of the present cycle."""
    end_times: FloatArray
    """(agents,) scratch: when each trajectory ends, in cycles since the start of the present cycle."""
    streams: StreamArray
    """(agents, 4) states of the agents' random number generators."""
    walk: Walk
    """How agents turn between walls."""


def start_trajectories(
    space: SpaceSection, walk: Walk, origin: FloatArray, heading: FloatArray, speed: FloatArray, streams: StreamArray
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
        walk,
    )
    begin_runs(trajectories)
    find_ends(trajectories)
    return trajectories


def fastest_speed(trajectories: Trajectories) -> float:
    """Return the largest speed that any agent has, or may have later, in cm per cycle."""
    return float(np.concatenate([trajectories.speed, trajectories.walk.speeds]).max())


@jit_inline
def begin_runs(trajectories: Trajectories) -> None:
    """Draw when the first run of each agent ends, if there are any."""
    for agent in range(len(trajectories.walk.end_cycle)):
        begin_run(trajectories.walk, agent, 0.0, 0.0, trajectories.streams[agent])


@jit_inline
def find_ends(trajectories: Trajectories) -> None:
    """Compute when and where every trajectory ends."""
    for agent in range(len(trajectories.speed)):
        find_end(trajectories, agent)
    trajectories.earliest_end[0] = time_of_end(trajectories, first_to_end(trajectories))


@jit_inline
def find_end(trajectories: Trajectories, agent: int) -> None:
    """Compute when and where an agent's trajectory ends: at the first wall, or where its run ends before."""
    duration, wall = math.inf, trajectories.wall[agent]
    for axis in range(len(trajectories.origin)):  # directions are random: conditions that are no branches
        velocity = trajectories.heading[axis, agent] * trajectories.speed[agent]
        distance_cm = (trajectories.side_cm if velocity > 0 else 0.0) - trajectories.origin[axis, agent]
        until = distance_cm / velocity if velocity != 0 else math.inf
        wall = 2 * axis + (velocity > 0) if until < duration else wall
        duration = min(duration, until)
    trajectories.wall[agent] = wall
    start = trajectories.start_time[agent]
    if unlikely(not trajectories.walk.is_straight):
        walk = trajectories.walk
        if rest_of_run(walk, agent, trajectories.start_cycle[agent], start) < duration:
            trajectories.wall[agent] = NO_WALL
            trajectories.end_cycle[agent] = walk.end_cycle[agent]
            trajectories.end_time[agent] = walk.end_time[agent]
            return
    whole = int(start + duration) if duration < math.inf else math.inf
    trajectories.end_cycle[agent] = trajectories.start_cycle[agent] + whole
    trajectories.end_time[agent] = start + duration - whole if duration < math.inf else 0.0


@jit_inline
def time_of_end(trajectories: Trajectories, agent: int) -> float:
    """Return when an agent's trajectory ends, in cycles since the start of the present cycle."""
    time: float = (trajectories.end_cycle[agent] - trajectories.cycle[0]) + trajectories.end_time[agent]
    return time


@jit_inline
def compute_end_times(trajectories: Trajectories) -> None:
    """Write the time at which each trajectory ends to `end_times`."""
    for agent in range(len(trajectories.end_times)):
        trajectories.end_times[agent] = time_of_end(trajectories, agent)


@jit_inline
def first_to_end(trajectories: Trajectories) -> int:
    """Return the agent whose trajectory ends first."""
    compute_end_times(trajectories)
    return argmin(trajectories.end_times, len(trajectories.end_times))


@jit_inline
def distance_travelled(trajectories: Trajectories, agent: int, time: float) -> float:
    """Return how many cm of its trajectory an agent has covered at `time`."""
    elapsed = (trajectories.cycle[0] - trajectories.start_cycle[agent]) + (time - trajectories.start_time[agent])
    distance_cm: float = trajectories.speed[agent] * elapsed
    return distance_cm


@jit_inline
def coordinate_at(trajectories: Trajectories, agent: int, axis: int, time: float) -> float:
    """Return an agent's position along an axis, in cm, at a time which is not after the end of its trajectory."""
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
def begin_next(trajectories: Trajectories, agent: int) -> None:
    """Continue an agent's trajectory beyond its end, as a new one."""
    wall = trajectories.wall[agent]
    end_cycle, end_time = trajectories.end_cycle[agent], trajectories.end_time[agent]
    duration = (end_cycle - trajectories.start_cycle[agent]) + (end_time - trajectories.start_time[agent])
    restart_at(trajectories, agent, trajectories.speed[agent] * duration, end_cycle, end_time)
    if unlikely(wall == NO_WALL):
        begin_next_run(trajectories, agent)
    else:
        reflect(trajectories, agent, wall // 2, wall % 2 == 1)
    find_end(trajectories, agent)


@jit_inline
def reflect(trajectories: Trajectories, agent: int, axis: int, is_far: bool) -> None:
    """Turn an agent at a wall in a random direction, or as a mirror does; in a cyclic space let it enter opposite."""
    trajectories.origin[axis, agent] = trajectories.side_cm if is_far != trajectories.is_cyclic else 0.0
    if trajectories.is_mirrored:
        trajectories.heading[axis, agent] = -trajectories.heading[axis, agent]
    elif not trajectories.is_cyclic:
        heading_from_wall(trajectories.heading[:, agent], axis, -1.0 if is_far else 1.0, trajectories.streams[agent])


@jit_inline
def begin_next_run(trajectories: Trajectories, agent: int) -> None:
    """Turn an agent where its run has ended, and draw the next one, and its speed if runs differ in that."""
    walk, stream = trajectories.walk, trajectories.streams[agent]
    turn_heading(trajectories.heading[:, agent], walk.persistence, stream)
    begin_run(walk, agent, trajectories.start_cycle[agent], trajectories.start_time[agent], stream)
    if len(walk.speeds):
        trajectories.speed[agent] = walk.speeds[randint(stream, len(walk.speeds))]


@jit_inline
def turn_first(trajectories: Trajectories) -> int:
    """Continue the trajectory that ends first beyond its end; return whose it is."""
    agent = first_to_end(trajectories)
    begin_next(trajectories, agent)
    trajectories.earliest_end[0] = time_of_end(trajectories, first_to_end(trajectories))
    return agent


@jit_inline
def advance_all(trajectories: Trajectories, time: float) -> None:
    """Continue all trajectories that end by `time`, over as many walls and runs as it takes."""
    if time < trajectories.earliest_end[0]:
        return
    compute_end_times(trajectories)
    for agent in range(len(trajectories.speed)):
        if trajectories.end_times[agent] <= time:
            advance_one(trajectories, agent, time)
            trajectories.end_times[agent] = time_of_end(trajectories, agent)
    trajectories.earliest_end[0] = minimum(trajectories.end_times, 0, len(trajectories.end_times))


@jit_inline
def advance_one(trajectories: Trajectories, agent: int, time: float) -> None:
    """Continue an agent's trajectory until it lasts beyond `time`."""
    while time_of_end(trajectories, agent) <= time:
        begin_next(trajectories, agent)


@jit_inline
def reorient(trajectories: Trajectories, agent: int, time: float) -> None:
    """Turn an agent in a random direction at `time`, before the end of its trajectory (D.1); its run goes on."""
    restart_at(trajectories, agent, distance_travelled(trajectories, agent, time), trajectories.cycle[0], time)
    random_heading(trajectories.heading[:, agent], trajectories.streams[agent])
    find_end(trajectories, agent)
    trajectories.earliest_end[0] = min(trajectories.earliest_end[0], time_of_end(trajectories, agent))


@jit_inline
def rebase_trajectories(trajectories: Trajectories) -> None:
    """Count all times from the start of the next cycle."""
    trajectories.cycle[0] += 1.0
    trajectories.earliest_end[0] -= 1.0
