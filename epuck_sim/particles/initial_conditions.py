"""Initial conditions of a trial: positions, headings, speeds, phases and periods (thesis 3.2, 5.1.2, 5.4).

From a seed to the first event all is compiled, but for speeds and periods that differ from agent to agent.
"""

import numpy as np

from epuck_sim.arrays import ByteArray, FloatArray, IntArray, WordArray
from epuck_sim.particles.distributions import draw_speeds, truncated_normal
from epuck_sim.particles.headings import random_heading
from epuck_sim.particles.motion import begin_motion
from epuck_sim.particles.swarm import (
    BEGIN_RUN,
    FLOAT,
    SCENE,
    SCENE_BYTES,
    WORD,
    Arrays,
    Trajectories,
    oscillators_at,
    trajectories_at,
)
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.generators import fill_doubles, seed_pcg64
from epuck_sim.util.jit import jit
from epuck_sim.util.native import array_at, call
from epuck_sim.util.seed_sequences import begin_sequence, draw_words, spawn

SHORTEST_PERIOD = 0.1
"""Lower limit of a jittered period, in nominal periods; jitter is at most 0.2, so that hardly any draw is below it."""

POSITION_SEED, PHASE_SEED, MOTION_SEED, RECEIVER_SEED = range(4)
"""Indices among the children of a trial's seed: of positions and speeds; of phases and periods; of directions, now and
later, and of runs; and of receivers."""


@jit
def start(block: ByteArray, addresses: IntArray, seed: WordArray) -> None:
    """Begin a trial: agents at uniform positions with uniform directions, and uniform phases, where none are given.

    What is given takes the place of what is drawn; all else is drawn as it would be without.

    Args:
        block: A swarm to which nothing has happened, with the speeds and periods.
        addresses: Addresses of what compiled code calls.
        seed: The words of the trial's seed; see `util.seed_sequences`.
    """
    scene, oscillators, trajectories = (
        array_at(block, 0, SCENE_BYTES, SCENE)[0],
        oscillators_at(block),
        trajectories_at(block),
    )
    first, end = scene.first, scene.end
    agents, child, generator = len(trajectories.speed), scene.child, scene.generator
    begin_sequence(scene.seed, seed)
    if not scene.has_positions:
        spawn(child, scene.seed, POSITION_SEED)
        seed_pcg64(generator, child)
        fill_doubles(trajectories.origin, generator)
        for place in range(len(trajectories.origin)):
            trajectories.origin[place] *= scene.side_cm
    if not scene.has_phases:
        spawn(child, scene.seed, PHASE_SEED)
        seed_pcg64(generator, child)
        fill_doubles(oscillators.next_firing, generator)
        for agent in range(agents):
            oscillators.next_firing[agent] = (1 - oscillators.next_firing[agent]) * oscillators.period[agent]
    spawn(child, scene.seed, MOTION_SEED)
    draw_words(array_at(block, first.streams, end.streams, WORD), child)
    draw_headings(block, trajectories)
    spawn(child, scene.seed, RECEIVER_SEED)
    draw_words(array_at(block, first.receiver_streams, end.receiver_streams, WORD), child)
    if scene.has_runs:
        for agent in range(agents):
            call(addresses[BEGIN_RUN], block, addresses, agent, 0.0)
    begin_motion(block)


@jit
def draw_headings(block: ByteArray, trajectories: Trajectories) -> None:
    """Draw the headings of all agents; where headings are given, what is drawn is left unused."""
    scene, agents = trajectories.scene[0], len(trajectories.speed)
    unused = array_at(block, scene.first.positions_now, scene.end.positions_now, FLOAT)
    for agent in range(agents):
        heading = unused[agent::agents] if scene.has_headings else trajectories.heading[agent::agents]
        random_heading(heading, trajectories.streams[agent].words)


def give_start(arrays: Arrays, scenario: ParticleScenario) -> None:
    """Write to a new swarm what its scenario gives of the start, whatever the seed."""
    scene, given = arrays.scene, scenario.start
    if given.positions_cm is not None:
        scene.has_positions = True
        arrays.origin[:] = np.array(given.positions_cm).T
    if given.headings is not None:
        scene.has_headings = True
        headings = np.array(given.headings).T
        arrays.heading[:] = headings / np.linalg.norm(headings, axis=0)
    if given.phases != "random":
        scene.has_phases = True
        phases = np.zeros(scene.agents)
        phases[0] = given.displacement
        arrays.phases_now[:] = phases if given.phases == "synchronised" else np.array(given.phases)
        arrays.next_firing[:] = 1 - arrays.phases_now
    if scenario.agents.speed_distribution == "fixed":
        arrays.speed[:] = scenario.agents.speed_cm_s * scenario.clocks.period_s


def draw_differences(arrays: Arrays, scenario: ParticleScenario, seed: int) -> None:
    """Draw speeds and periods that differ from agent to agent, which numpy does: few scenarios have any."""
    if scenario.agents.speed_distribution != "fixed":
        arrays.speed[:] = initial_speeds(scenario, seed)
    if scenario.clocks.jitter:
        agents = scenario.agents.count
        random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(PHASE_SEED,))))
        random.random(agents)  # the phases
        arrays.period[:] = truncated_normal(random, agents, scenario.clocks.jitter, SHORTEST_PERIOD, np.inf)
        if arrays.scene.has_phases:
            arrays.next_firing[:] = (1 - arrays.phases_now) * arrays.period


def initial_speeds(scenario: ParticleScenario, seed: int) -> FloatArray:
    """Return (agents,) cm per cycle: the speeds with which a trial with this seed begins."""
    agents = scenario.agents
    random = np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(POSITION_SEED,))))
    random.random(scenario.space.dimensions * agents.count)  # the positions
    return draw_speeds(agents, random) * scenario.clocks.period_s
