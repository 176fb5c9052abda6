"""How a trial begins: where agents are, where they go, how fast, and the phases and periods of their oscillators."""

import numpy as np

from epuck_sim.arrays import FloatArray, StreamArray
from epuck_sim.particles.motion import Flights, set_out_anywhere, take_off
from epuck_sim.particles.oscillators import Oscillators, start_oscillators
from epuck_sim.scenario.particles import AgentsSection, ParticleScenario
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.seeds import robot_streams

SHORTEST_PERIOD = 0.1
"""Of what is nominal: jitter of at most 0.2 hardly ever leads below, and a period must not end before it begins."""


def place_agents(
    scenario: ParticleScenario, placing: np.random.SeedSequence, moving: np.random.SeedSequence
) -> Flights:
    """Return agents anywhere in their space, on their way in any direction (thesis 3.2, 5.1.2)."""
    space, agents = scenario.space, scenario.agents
    random = np.random.Generator(np.random.PCG64(placing))
    origin = space.side_cm * random.random((space.dimensions, agents.count))
    speed = _draw_speeds(agents, random) * scenario.clocks.period_s
    streams = robot_streams(moving, agents.count)
    heading = np.empty_like(origin)
    _point_anywhere(heading, streams)
    return take_off(space.side_cm, space.boundary == "cyclic", origin, heading, speed, streams)


@jit_inline
def _point_anywhere(heading: FloatArray, streams: StreamArray) -> None:
    for agent in range(len(streams)):
        set_out_anywhere(heading[:, agent], streams[agent])


def _draw_speeds(agents: AgentsSection, random: np.random.Generator) -> FloatArray:
    """Return (agents,) cm/s."""
    spread = agents.speed_spread or 0.0
    if agents.speed_distribution == "uniform":
        shares = random.uniform(1 - spread, 1 + spread, agents.count)
    elif agents.speed_distribution == "normal":
        shares = _redrawn(random, agents.count, spread, 0, 2)
    elif agents.speed_distribution == "exponential":
        shares = random.exponential(1, agents.count)
    else:
        shares = np.ones(agents.count)
    return agents.speed_cm_s * shares


def _redrawn(random: np.random.Generator, count: int, sigma: float, low: float, high: float) -> FloatArray:
    """Return normal numbers around 1, (count,), drawn again where they are not between `low` and `high`."""
    drawn = random.normal(1, sigma, count)
    while (outside := (drawn < low) | (drawn > high)).any():
        drawn[outside] = random.normal(1, sigma, np.count_nonzero(outside))
    return drawn


def set_clocks(scenario: ParticleScenario, starting: np.random.SeedSequence) -> Oscillators:
    """Return oscillators with the phases and periods that the scenario asks for (thesis 3.2, 5.4)."""
    agents = scenario.agents.count
    random = np.random.Generator(np.random.PCG64(starting))
    phases = random.random(agents)
    if scenario.start.phases == "synchronised":
        phases = np.zeros(agents)
        phases[0] = scenario.start.displacement
    period = np.ones(agents)
    if scenario.clocks.jitter:
        period = _redrawn(random, agents, scenario.clocks.jitter, SHORTEST_PERIOD, np.inf)
    return start_oscillators(phases, period)
