"""Initial conditions of a trial: positions, headings, speeds, phases and periods."""

import numpy as np

from epuck_sim.arrays import FloatArray, StreamArray
from epuck_sim.particles.distributions import draw_speeds, truncated_normal
from epuck_sim.particles.headings import random_heading
from epuck_sim.particles.motion import Trajectories, start_trajectories
from epuck_sim.particles.oscillators import Oscillators, start_oscillators
from epuck_sim.particles.walks import make_walk
from epuck_sim.scenario.neighbourhoods import RandomAgents
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.seeds import robot_streams

SHORTEST_PERIOD = 0.1
"""Lower limit of a jittered period, in nominal periods; jitter is at most 0.2, so that hardly any draw is below it."""

RECEIVER_SEED = 3
"""Index of the seed of receivers among the children of a trial's seed: positions, phases and motion come before it."""


def initial_trajectories(
    scenario: ParticleScenario, position_seed: np.random.SeedSequence, motion_seed: np.random.SeedSequence
) -> Trajectories:
    """Return the trajectories of agents at uniform positions with uniform directions (thesis 3.2, 5.1.2), or at given.

    What is given takes the place of what is drawn; all else is drawn as it would be without.

    Args:
        scenario: The space and the agents.
        position_seed: Decides positions and speeds.
        motion_seed: Decides directions, now and later, and when runs end.
    """
    space, agents = scenario.space, scenario.agents
    origin, speed = _draw_places_and_speeds(scenario, position_seed)
    streams = robot_streams(motion_seed, agents.count)
    heading = np.empty_like(origin)
    _draw_headings(heading, streams)
    if scenario.start.positions_cm is not None:
        origin[:] = np.array(scenario.start.positions_cm).T
    if scenario.start.headings is not None:
        given = np.array(scenario.start.headings).T
        heading[:] = given / np.linalg.norm(given, axis=0)
    return start_trajectories(space, make_walk(agents, scenario.clocks.period_s), origin, heading, speed, streams)


def initial_speeds(scenario: ParticleScenario, seed: int) -> FloatArray:
    """Return (agents,) cm per cycle: the speeds with which a trial with this seed begins."""
    return _draw_places_and_speeds(scenario, np.random.SeedSequence(seed).spawn(1)[0])[1]


def _draw_places_and_speeds(
    scenario: ParticleScenario, position_seed: np.random.SeedSequence
) -> tuple[FloatArray, FloatArray]:
    """Return (dimensions, agents) cm: positions, and (agents,) cm per cycle: speeds."""
    space, agents = scenario.space, scenario.agents
    random = np.random.Generator(np.random.PCG64(position_seed))
    places = space.side_cm * random.random((space.dimensions, agents.count))
    return places, draw_speeds(agents, random) * scenario.clocks.period_s


def receiver_streams(scenario: ParticleScenario, seed: int) -> StreamArray:
    """Return (agents, 4) the streams from which agents draw the receivers of their pulses; of no agents if none do."""
    if isinstance(scenario.neighbourhood, RandomAgents):
        receiver_seed = np.random.SeedSequence(seed).spawn(RECEIVER_SEED + 1)[RECEIVER_SEED]
        return robot_streams(receiver_seed, scenario.agents.count)
    return np.zeros((0, 4), np.uint64)


@jit_inline
def _draw_headings(heading: FloatArray, streams: StreamArray) -> None:
    for agent in range(len(streams)):
        random_heading(heading[:, agent], streams[agent])


def initial_oscillators(scenario: ParticleScenario, phase_seed: np.random.SeedSequence) -> Oscillators:
    """Return oscillators with the initial phases and the periods of the scenario (thesis 3.2, 5.4)."""
    agents = scenario.agents.count
    random = np.random.Generator(np.random.PCG64(phase_seed))
    phases = random.random(agents)
    if scenario.start.phases == "synchronised":
        phases = np.zeros(agents)
        phases[0] = scenario.start.displacement
    elif scenario.start.phases != "random":
        phases = np.array(scenario.start.phases)
    period = np.ones(agents)
    if scenario.clocks.jitter:
        period = truncated_normal(random, agents, scenario.clocks.jitter, SHORTEST_PERIOD, np.inf)
    return start_oscillators(phases, period)
