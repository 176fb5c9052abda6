"""Straight trajectories, the position of every agent at any time, and random walks (thesis 3.1, 5.1.2, 6.2, D).

Agents are not moved step by step. A trajectory stores where and when it began and when it ends: at a wall, or at the
end of a run of a random walk if that is earlier. Trajectories that have ended are continued only when a position is
needed. The moment of this does not change the outcome, to the bit: each agent draws from a stream of its own, and the
times of a trajectory are stored as a cycle and the time in that cycle. So agents of two simulations with the same seed
move alike whatever their oscillators do.

A heading is a unit vector, (dimensions,), which is overwritten; a stream is a generator's state, (4,); see `util.rng`.
Times passed as arguments are in cycles since the start of the present cycle (see `swarm`).
"""

import math

import numpy as np

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IndexArray, IntArray, StreamArray
from epuck_sim.particles.selection import minimum
from epuck_sim.particles.swarm import BEGIN_RUN, CONTINUE, Arrays, Instant, Trajectories, entry_of
from epuck_sim.util.elementary import atan, exp, log, sin_cos, tan
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import call, carve, row_at, unlikely
from epuck_sim.util.rng import randint, uniform

NO_WALL = -1  # stands for a wall where a trajectory ends because a run does

LONGEST_RUN = 1e12
"""Longest duration of a run, cycles; no trial lasts as long, and times as long as this still have digits to spare."""


@jit_inline
def time_of_end(trajectories: Trajectories, agent: int) -> float:
    """Return when an agent's trajectory ends, in cycles since the start of the present cycle."""
    time: float = (trajectories.end_cycle[agent] - trajectories.scene.cycle) + trajectories.end_time[agent]
    return time


@jit_inline
def distance_travelled(trajectories: Trajectories, agent: int, time: float) -> float:
    """Return how many cm of its trajectory an agent has covered at `time`, which is not after its end."""
    elapsed = (trajectories.scene.cycle - trajectories.start_cycle[agent]) + (time - trajectories.start_time[agent])
    distance_cm: float = trajectories.speed[agent] * elapsed
    return distance_cm


@jit_inline
def find_end(trajectories: Trajectories, agent: int) -> None:
    """Compute when and where an agent's trajectory ends: at the first wall, or at the end of its run if earlier."""
    scene, agents = trajectories.scene, len(trajectories.speed)
    side_cm, speed = scene.side_cm, trajectories.speed[agent]
    duration, wall = math.inf, trajectories.wall[agent]
    for axis in range(scene.dimensions):  # no branches, as directions are random
        velocity = trajectories.heading[axis * agents + agent] * speed
        distance_cm = (side_cm if velocity > 0 else 0.0) - trajectories.origin[axis * agents + agent]
        until = distance_cm / velocity if velocity != 0 else math.inf
        wall = 2 * axis + (velocity > 0) if until < duration else wall
        duration = min(duration, until)
    trajectories.wall[agent] = wall
    start = trajectories.start_time[agent]
    if unlikely(scene.has_runs):
        end_cycle, end_time = trajectories.run_end_cycle[agent], trajectories.run_end_time[agent]
        if (end_cycle - trajectories.start_cycle[agent]) + (end_time - start) < duration:
            trajectories.wall[agent] = NO_WALL
            trajectories.end_cycle[agent] = end_cycle
            trajectories.end_time[agent] = end_time
            return
    whole = int(start + duration) if duration < math.inf else math.inf
    trajectories.end_cycle[agent] = trajectories.start_cycle[agent] + whole
    trajectories.end_time[agent] = start + duration - whole if duration < math.inf else 0.0


@jit_no_alloc
def begin_motion(block: ByteArray) -> None:
    """Find the fastest speed, and when and where every trajectory ends, once positions, headings and speeds are set."""
    trajectories = carve(block, Trajectories)
    scene = trajectories.scene
    fastest = 0.0
    for speeds in (trajectories.speed, trajectories.run_speeds):
        for index in range(len(speeds)):
            fastest = max(fastest, speeds[index])
    scene.max_speed = fastest
    scene.closing_time = 1 / max(2 * fastest, 1e-300)
    for agent in range(len(trajectories.speed)):
        find_end(trajectories, agent)
    scene.earliest_end = time_of_end(trajectories, first_to_end(trajectories))


def start_at_present(swarm: Arrays, speeds: FloatArray) -> None:
    """Let trajectories whose speed changes, (agents,) cm per cycle, begin where agents were observed to be."""
    other, scene = speeds != swarm.speed, swarm.scene
    swarm.origin[:, other] = np.clip(swarm.positions_now[:, other], 0.0, scene.side_cm)
    swarm.start_cycle[other], swarm.start_time[other] = scene.cycle, scene.now
    swarm.speed[:] = speeds


@jit_inline
def compute_end_times(trajectories: Trajectories) -> None:
    """Write to `end_times` when each trajectory ends."""
    for agent in range(len(trajectories.end_times)):
        trajectories.end_times[agent] = time_of_end(trajectories, agent)


@jit_no_alloc
def first_to_end(trajectories: Trajectories) -> int:
    """Return the agent whose trajectory ends first."""
    compute_end_times(trajectories)
    first = 0
    for agent in range(len(trajectories.end_times)):
        first = agent if trajectories.end_times[agent] < trajectories.end_times[first] else first
    return first


@jit_inline
def compute_positions(
    block: ByteArray, addresses: IntArray, trajectories: Trajectories, time: float, positions: FloatArray
) -> None:
    """Write all positions at `time`, (dimensions * agents,) cm; trajectories that have ended by then are continued."""
    advance_all(block, addresses, trajectories, time)
    agents, cycle = len(trajectories.speed), trajectories.scene.cycle
    speed, start_cycle, start_time = trajectories.speed, trajectories.start_cycle, trajectories.start_time
    for axis in range(trajectories.scene.dimensions):
        origin, heading = row_at(trajectories.origin, axis, agents), row_at(trajectories.heading, axis, agents)
        row = row_at(positions, axis, agents)
        for agent in range(agents):
            travelled_cm = speed[agent] * ((cycle - start_cycle[agent]) + (time - start_time[agent]))
            row[agent] = origin[agent] + heading[agent] * travelled_cm


@jit_inline
def advance_all(block: ByteArray, addresses: IntArray, trajectories: Trajectories, time: float) -> None:
    """Continue all trajectories that end by `time`, over as many walls and runs as it takes."""
    if time < trajectories.scene.earliest_end:
        return
    compute_end_times(trajectories)
    for agent in range(len(trajectories.speed)):
        if trajectories.end_times[agent] <= time:
            call(addresses[CONTINUE], block, addresses, agent, time)
            trajectories.end_times[agent] = time_of_end(trajectories, agent)
    trajectories.scene.earliest_end = minimum(trajectories.end_times, 0, len(trajectories.end_times))


@jit_inline
def advance_one(block: ByteArray, addresses: IntArray, trajectories: Trajectories, agent: int, time: float) -> None:
    """Continue an agent's trajectory until it lasts beyond `time`."""
    if unlikely(time_of_end(trajectories, agent) <= time):
        call(addresses[CONTINUE], block, addresses, agent, time)


@jit_no_alloc
def continue_trajectory(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """Replace an agent's trajectory, which has ended, by the next one, and again until one lasts beyond `time`."""
    trajectories, has_ended = carve(block, Trajectories), True
    while has_ended:
        wall = trajectories.wall[agent]
        end_cycle, end_time = trajectories.end_cycle[agent], trajectories.end_time[agent]
        duration = (end_cycle - trajectories.start_cycle[agent]) + (end_time - trajectories.start_time[agent])
        restart_at(trajectories, agent, trajectories.speed[agent] * duration, end_cycle, end_time)
        if unlikely(wall == NO_WALL):
            call(addresses[BEGIN_RUN], block, addresses, agent, time)
        else:
            reflect(trajectories, agent, wall // 2, wall % 2 == 1)
        find_end(trajectories, agent)
        has_ended = time_of_end(trajectories, agent) <= time


@jit_inline
def restart_at(trajectories: Trajectories, agent: int, travelled_cm: float, cycle: float, time: float) -> None:
    """Begin an agent's next trajectory `travelled_cm` along the present one, at `time` of `cycle`."""
    side_cm = trajectories.scene.side_cm
    for place in range(agent, len(trajectories.origin), len(trajectories.speed)):
        reached = trajectories.origin[place] + trajectories.heading[place] * travelled_cm
        trajectories.origin[place] = min(max(reached, 0.0), side_cm)
    trajectories.start_cycle[agent] = cycle
    trajectories.start_time[agent] = time


@jit_inline
def reflect(trajectories: Trajectories, agent: int, axis: int, is_far: bool) -> None:
    """Turn an agent at a wall in a random direction, or as a mirror does; in a cyclic space let it enter opposite.

    A random one is within 90 degrees of the wall's normal: in a square the angle to the normal is uniform (thesis 3.1),
    in a cube the direction is uniform over the hemisphere (D.3), and in a segment the normal is the only direction.
    """
    scene, place = trajectories.scene, axis * len(trajectories.speed) + agent
    trajectories.origin[place] = scene.side_cm if is_far != scene.is_cyclic else 0.0
    if scene.is_mirrored:
        trajectories.heading[place] = -trajectories.heading[place]
    elif not scene.is_cyclic:
        heading, stream = trajectories.heading[agent :: len(trajectories.speed)], trajectories.streams[agent].words
        inward = -1.0 if is_far else 1.0
        if len(heading) == 1:
            heading[0] = inward
        elif len(heading) == 2:
            heading[1 - axis], cosine = sin_cos(math.pi * (uniform(stream) - 0.5))
            heading[axis] = inward * cosine
        else:
            set_heading(heading, axis, inward * (1.0 - uniform(stream)), uniform(stream))


@jit_no_alloc
def begin_run(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:  # noqa: ARG001
    """Turn an agent at the end of its run; draw the end of its next run, and its speed if speeds differ between runs.

    At its first run, the agent does not turn, and no speed is drawn.
    """
    trajectories = carve(block, Trajectories)
    scene, run_speeds = trajectories.scene, trajectories.run_speeds
    stream, is_first = trajectories.streams[agent].words, trajectories.run_end_cycle[agent] < 0
    if not is_first:
        turn_heading(trajectories.heading[agent :: len(trajectories.speed)], scene.persistence, stream)
    share = 1.0 - uniform(stream)  # above 0
    duration = scene.run * (exp(scene.tail * log(share)) if scene.tail < 0 else -log(share))
    end = trajectories.start_time[agent] + min(duration, LONGEST_RUN)
    whole = math.floor(end)
    trajectories.run_end_cycle[agent] = trajectories.start_cycle[agent] + whole
    trajectories.run_end_time[agent] = end - whole
    if len(run_speeds) and not is_first:
        trajectories.speed[agent] = run_speeds[randint(stream, len(run_speeds))]


@jit_no_alloc
def reorient_agents(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:  # noqa: ARG001
    """Reorient the agents that emitted, received or were reached by a pulse, as the rules ask; none twice (D.1)."""
    trajectories, instant = carve(block, Trajectories), carve(block, Instant)
    scene, is_done = trajectories.scene, instant.is_done
    advance_all(block, addresses, trajectories, time)
    for place in range(len(trajectories.heading)):
        instant.headings_before[place] = trajectories.heading[place]
    emitting, receiving = instant.fired[: scene.fired], instant.received[: scene.received]
    reached = instant.reached[: scene.reached]
    if scene.reorients_on_emitting:
        reorient_each(block, emitting, is_done, time)
    if scene.reorients_on_receiving:
        reorient_each(block, receiving, is_done, time)
    if scene.reorients_on_arriving:
        reorient_each(block, reached, is_done, time)
    for agents in (emitting, receiving, reached):
        for index in range(len(agents)):
            is_done[agents[index]] = instant.is_reached[agents[index]] = False
    scene.reached = 0


@jit_no_alloc
def reorient_each(block: ByteArray, agents: IndexArray, is_done: BoolArray, time: float) -> None:
    """Turn agents in a random direction at `time`, except those turned already; their runs go on."""
    trajectories = carve(block, Trajectories)
    scene = trajectories.scene
    for index in range(len(agents)):
        agent = entry_of(agents, index)
        if not is_done[agent]:
            restart_at(trajectories, agent, distance_travelled(trajectories, agent, time), scene.cycle, time)
            random_heading(trajectories.heading[agent :: scene.agents], trajectories.streams[agent].words)
            find_end(trajectories, agent)
            scene.earliest_end = min(scene.earliest_end, time_of_end(trajectories, agent))
            is_done[agent] = True


@jit_inline
def random_heading(heading: FloatArray, stream: StreamArray) -> None:
    """Draw a heading, (dimensions,), uniformly over all directions."""
    if len(heading) == 1:
        heading[0] = 1.0 if uniform(stream) < 0.5 else -1.0
    elif len(heading) == 2:
        heading[1], heading[0] = sin_cos(2 * math.pi * uniform(stream))
    else:
        set_heading(heading, 2, 2 * uniform(stream) - 1, uniform(stream))


@jit_inline
def set_heading(heading: FloatArray, axis: int, height: float, turn: float) -> None:
    """Set a heading, (3,), by its component along an axis, -1 to 1, and its azimuth around it, 0 to 1 turn."""
    rim = math.sqrt(1 - height * height)
    sine, cosine = sin_cos(2 * math.pi * turn)
    heading[axis] = height
    heading[(axis + 1) % 3] = rim * cosine
    heading[(axis + 2) % 3] = rim * sine


@jit_inline
def turn_heading(heading: FloatArray, persistence: float, stream: StreamArray) -> None:
    """Turn a heading by a random angle whose mean cosine is `persistence`; with 0, any direction is as likely.

    In a segment it is reversed with the chance that gives this mean. In a square the angle has a wrapped Cauchy
    distribution, in a cube that of Henyey and Greenstein (1941), whose axis is the old heading; the two directions
    across it are those of Duff et al. (2017), which have no singularity.
    """
    if len(heading) == 1:
        heading[0] = -heading[0] if uniform(stream) < (1 - persistence) / 2 else heading[0]
    elif len(heading) == 2:
        narrowing = (1 - persistence) / (1 + persistence)
        sine, cosine = sin_cos(2 * atan(narrowing * tan(math.pi * (uniform(stream) - 0.5))))
        x = heading[0] * cosine - heading[1] * sine
        y = heading[0] * sine + heading[1] * cosine
        length = math.sqrt(x * x + y * y)  # is set to 1, so that rounding errors do not add up
        heading[0] = x / length
        heading[1] = y / length
    else:
        share = 1.0 - uniform(stream)  # above 0, so that the denominator is, too
        spread = 1 - persistence + 2 * persistence * share
        cosine = 2 * share * (1 + persistence) ** 2 * (1 - persistence * (1 - share)) / (spread * spread) - 1
        cosine = min(max(cosine, -1.0), 1.0)
        x, y, z = heading[0], heading[1], heading[2]
        side = math.copysign(1.0, z)
        a = -1 / (side + z)
        b = x * y * a
        rim = math.sqrt(1 - cosine * cosine)
        sine, aside = sin_cos(2 * math.pi * uniform(stream))
        one, other = rim * aside, rim * sine
        heading[0] = one * (1 + side * x * x * a) + other * b + cosine * x
        heading[1] = one * (side * b) + other * (side + y * y * a) + cosine * y
        heading[2] = one * (-side * x) - other * y + cosine * z
        length = math.sqrt(heading[0] ** 2 + heading[1] ** 2 + heading[2] ** 2)
        for axis in range(3):
            heading[axis] /= length
