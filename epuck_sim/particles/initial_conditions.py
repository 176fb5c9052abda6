"""The beginning of a trial: the rules of its scenario, and its initial conditions (thesis 3, 5.1, 5.4, D.1).

The rules are made once for all seeds. All steps from a seed to the first event are compiled, except the draws of speeds
and periods that differ from agent to agent.
"""

import math
from collections.abc import Callable
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import types

from epuck_sim.arrays import ByteArray, FloatArray, IntArray, WordArray
from epuck_sim.faults import set_faults
from epuck_sim.particles import swarm
from epuck_sim.particles.events import advance
from epuck_sim.particles.faults import keep_heard
from epuck_sim.particles.motion import begin_motion, begin_run, continue_trajectory, random_heading, reorient_agents
from epuck_sim.particles.neighbours import RANDOM, neighbourhood_of, search_of
from epuck_sim.particles.oscillators import BRANCHES, FLAT, forget_earliest, max_phase_offset
from epuck_sim.particles.phase_response import CURVES, Response, make_response
from epuck_sim.particles.swarm import Arrays, Neighbours, Observed, Oscillators, Trajectories, aligned_bytes, make_block
from epuck_sim.scenario.particles import AgentsSection, ParticleScenario, RandomAgents
from epuck_sim.util import generators
from epuck_sim.util.elementary import exp, log
from epuck_sim.util.jit import jit, jit_no_alloc
from epuck_sim.util.native import address_of, call, carve
from epuck_sim.util.seeds import seed_words

SHORTEST_PERIOD = 0.1
"""Lower limit of a jittered period, in nominal periods; jitter is at most 0.2, so that hardly any draw is below it."""

TABLE_SIZE = 1000
"""Number of equally likely speeds that stand for a distribution where speeds are drawn again and again: the fastest of
them bounds the motion of all agents, and neighbours are cached by that bound."""


class Rules(NamedTuple):
    """Constants that all swarms of a scenario share, whatever their seeds."""

    beginning: ByteArray  # bytes with which the block of a new swarm begins; the rest of its bytes do not matter
    size: int  # number of bytes of a block
    addresses: IntArray
    """Addresses, in this process, of the functions that compiled code calls, see `swarm.SEARCH`; 0 where unused."""

    def new_block(self) -> ByteArray:
        """Return the block of a new swarm."""
        block = aligned_bytes(self.size)
        block[: len(self.beginning)] = self.beginning
        return block


KEPT = 4  # number of scenarios whose rules are kept for the next simulation

_kept: dict[tuple[int, ...], tuple[object, Rules]] = {}


def rules_of(scenario: ParticleScenario) -> Rules:
    """Return the rules of a scenario, which are made once for all seeds."""
    if scenario.response.curve not in CURVES:
        return _make_rules(scenario)  # the file may have changed
    moving = scenario.space, scenario.agents, scenario.neighbourhood, scenario.start
    sections = *moving, scenario.faults, scenario.response, scenario.clocks, scenario.stop
    key = tuple(map(id, sections))
    if key not in _kept:
        if len(_kept) >= KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = sections, _make_rules(scenario)  # keeps the sections alive, so that no others get their ids
    return _kept[key][1]


def _make_rules(scenario: ParticleScenario) -> Rules:
    agents, dimensions, response = scenario.agents, scenario.space.dimensions, make_response(scenario.response)
    values = {**neighbourhood_of(scenario), **_scene_values(scenario, response)}
    speeds = speed_table(agents) * scenario.clocks.period_s if agents.speed_per_run else np.zeros(0)
    sizes = {
        "agents": agents.count,
        "rows": dimensions * agents.count,
        "events": agents.count + 1,
        "blocks": -(-agents.count // BRANCHES),
        "groups": -(-agents.count // BRANCHES**2) if agents.count > FLAT else 0,
        "parts": -(-agents.count // BRANCHES**3) if agents.count > FLAT else 0,
        "cell_starts": values["cells"] ** dimensions + 1 if values["cells"] else 0,
        "run_speeds": len(speeds),
        "curve": len(response.bytes),
        "faults": len(scenario.faults),
        "affected": len(scenario.faults) * agents.count,
        "faulty": agents.count if scenario.faults else 0,
        "members": values["row"] * (agents.count if values["is_cached"] else 1),
    }
    arrays = Arrays(make_block(sizes))
    for name, value in values.items():
        arrays.scene[name] = value
    arrays.run_speeds[:] = speeds
    arrays.run_end_cycle[:] = -1
    arrays.period[:] = 1
    forget_earliest(arrays)
    arrays.cached_until[:] = -math.inf
    arrays.candidates[:] = np.arange(agents.count)
    arrays.curve[:] = response.bytes
    set_faults(arrays.faults, scenario.faults)
    give_start(arrays, scenario)
    address_of(advance)
    called = {
        swarm.CONTINUE: continue_trajectory,
        swarm.SEARCH: search_of(arrays.scene),
        swarm.BEGIN_RUN: begin_run if values["has_runs"] else None,
        swarm.REORIENT: reorient_agents if agents.reorient_on else None,
        swarm.HEAR: keep_heard if scenario.faults else None,
    }
    addresses = np.zeros(swarm.CALLS, np.int64)
    addresses[swarm.CURVE] = response.address
    for number, function in called.items():
        if function is not None:
            addresses[number] = address_of(function, types.int64, types.float64)
    beginning = arrays.block[: arrays.scene.at[-1][0]].copy()
    return Rules(beginning, len(arrays.block), addresses)


def _scene_values(scenario: ParticleScenario, response: Response) -> dict[str, Any]:
    """Return the fields of a scene that a scenario gives, except those of its neighbourhood."""
    agents, space, walk, stop = scenario.agents, scenario.space, scenario.agents.walk, scenario.stop
    is_single = agents.count == 1  # a single agent is never synchronised
    threshold = math.inf if is_single or stop.order_parameter is None else stop.order_parameter
    max_offset = max_phase_offset(agents.count, threshold) if threshold < math.inf else -1.0
    return {
        "agents": agents.count,
        "dimensions": space.dimensions,
        "positions_time": math.nan,
        "sorted_at": -math.inf,
        "side_cm": space.side_cm,
        "is_cyclic": space.boundary == "cyclic",
        "is_mirrored": space.boundary == "mirrored",
        "has_runs": walk.kind != "straight",
        "run": (walk.run_s or 0.0) / scenario.clocks.period_s,
        "tail": 0.0 if walk.exponent is None else 1 / (1 - walk.exponent),
        "persistence": walk.persistence or 0.0,
        "response": response.record,
        "reorients_on_emitting": "emitting" in agents.reorient_on,
        "reorients_on_receiving": "receiving" in agents.reorient_on,
        "reorients_on_arriving": "arriving" in agents.reorient_on,
        # pulses that turn agents, or whose receivers are drawn: draws must not depend on the order of the cascade
        "sends_every_pulse": "arriving" in agents.reorient_on or isinstance(scenario.neighbourhood, RandomAgents),
        "reference": stop.reference,
        "is_relative": stop.metric == "reference",
        "threshold": threshold,
        "max_offset": 1.0 if stop.max_time_s is not None else max_offset,  # then a trial may end between two firings
        "order_parameter": math.nan,
    }


@jit
def start(block: ByteArray, addresses: IntArray, seed: WordArray) -> None:
    """Begin a trial: draw uniform positions, directions and phases where the scenario gives none.

    Given ones do not change what is drawn for the others. The block is new and has the speeds and periods already.
    """
    oscillators, trajectories = carve(block, Oscillators), carve(block, Trajectories)
    scene, agents = oscillators.scene, len(trajectories.speed)
    generators.begin_sequence(scene.seed, seed)
    if not scene.has_positions:
        _draw_doubles(trajectories.origin, scene, swarm.POSITION_SEED)
        for place in range(len(trajectories.origin)):
            trajectories.origin[place] *= scene.side_cm
    if not scene.has_phases:
        _draw_doubles(oscillators.next_firing, scene, swarm.PHASE_SEED)
        for agent in range(agents):
            oscillators.next_firing[agent] = (1 - oscillators.next_firing[agent]) * oscillators.period[agent]
    _seed_streams(trajectories.streams, scene, swarm.MOTION_SEED)
    if scene.kind == RANDOM:
        _seed_streams(carve(block, Neighbours).receiver_streams, scene, swarm.RECEIVER_SEED)
    unused = carve(block, Observed).positions_now
    for agent in range(agents):
        heading = unused[agent::agents] if scene.has_headings else trajectories.heading[agent::agents]
        random_heading(heading, trajectories.streams[agent].words)
    if scene.has_runs:
        for agent in range(agents):
            call(addresses[swarm.BEGIN_RUN], block, addresses, agent, 0.0)
    begin_motion(block)


@jit_no_alloc
def _draw_doubles(numbers: FloatArray, scene: Any, child: int) -> None:
    """Write random numbers from [0, 1), (n,), drawn with a child of the trial's seed."""
    generators.spawn(scene.child, scene.seed, child)
    generators.seed_pcg64(scene.generator, scene.child)
    generators.fill_doubles(numbers, scene.generator)


@jit_no_alloc
def _seed_streams(streams: npt.NDArray[np.void], scene: Any, child: int) -> None:
    generators.spawn(scene.child, scene.seed, child)
    factor = generators.DRAW_BEGIN
    for agent in range(len(streams)):
        factor = generators.draw_row(streams[agent].words, scene.child, factor)


def give_start(arrays: Arrays, scenario: ParticleScenario) -> None:
    """Write to a new swarm the part of the start that its scenario gives, for all seeds."""
    scene, given = arrays.scene, scenario.start
    if given.positions_cm is not None:
        scene.has_positions = True
        arrays.origin[:] = np.array(given.positions_cm).T
    if given.headings is not None:
        scene.has_headings = True
        headings = np.array(given.headings).T
        _, exponents = np.frexp(np.abs(headings).max(axis=0))
        headings = np.ldexp(headings, -exponents)  # so that squares neither overflow nor vanish
        arrays.heading[:] = headings / np.linalg.norm(headings, axis=0)
    if given.phases != "random":
        scene.has_phases = True
        arrays.phases_now[:] = 0.0 if given.phases == "synchronised" else np.array(given.phases)
        arrays.phases_now[0] += given.displacement
        arrays.next_firing[:] = 1 - arrays.phases_now
    if scenario.agents.speed_distribution == "fixed":
        arrays.speed[:] = scenario.agents.speed_cm_s * scenario.clocks.period_s


def draw_differences(arrays: Arrays, scenario: ParticleScenario, seed: int) -> None:
    """Draw speeds and periods, where they differ from agent to agent; in few scenarios they do."""
    if scenario.agents.speed_distribution != "fixed":
        arrays.speed[:] = initial_speeds(scenario, seed)
    if scenario.clocks.jitter:
        agents = scenario.agents.count
        generator = _generator_after(seed, swarm.PHASE_SEED, agents)  # the phases
        arrays.period[:] = truncated_normal(generator, agents, scenario.clocks.jitter, SHORTEST_PERIOD, np.inf)
        if arrays.scene.has_phases:
            arrays.next_firing[:] = (1 - arrays.phases_now) * arrays.period


def _generator_after(seed: int, child: int, numbers: int) -> WordArray:
    """Return the generator of a child of the trial's seed after it has drawn this many numbers from [0, 1)."""
    generator = np.empty(generators.GENERATOR_WORDS, np.uint64)
    sequence = np.empty(generators.SEQUENCE_WORDS, np.uint64)
    generators.begin_sequence(sequence, seed_words(seed))
    generators.spawn(sequence, sequence, child)
    generators.seed_pcg64(generator, sequence)
    generators.fill_doubles(np.empty(numbers), generator)
    return generator


def initial_speeds(scenario: ParticleScenario, seed: int) -> FloatArray:
    """Return (agents,) cm per cycle: the speeds with which a trial with this seed begins (thesis 6.2)."""
    agents = scenario.agents
    generator = _generator_after(seed, swarm.POSITION_SEED, scenario.space.dimensions * agents.count)  # the positions
    spread, shares = agents.speed_spread or 0.0, np.ones(agents.count)
    if agents.speed_distribution == "uniform":
        generators.fill_doubles(shares, generator)
        shares = (1 - spread) + ((1 + spread) - (1 - spread)) * shares
    elif agents.speed_distribution == "normal":
        shares = truncated_normal(generator, agents.count, spread, 0, 2)
    elif agents.speed_distribution == "exponential":
        generators.fill_doubles(shares, generator)
        shares = -_each(log, 1 - shares)
    elif agents.speed_distribution == "lognormal":
        sigma = _lognormal_sigma(spread)
        generators.fill_normals(shares, generator)
        shares = _each(exp, -(sigma**2) / 2 + sigma * shares)
    elif agents.speed_distribution == "two_speeds":
        slow, fast = _two_speeds(agents)
        generators.fill_doubles(shares, generator)
        shares = np.where(shares < (agents.fast_share or 0.0), fast, slow)
    return agents.speed_cm_s * shares * scenario.clocks.period_s


def speed_table(agents: AgentsSection) -> FloatArray:
    """Return (`TABLE_SIZE`,) cm/s, ascending: the quantiles of the distribution of speeds, scaled to its mean."""
    spread = agents.speed_spread or 0.0
    levels = (np.arange(TABLE_SIZE) + 0.5) / TABLE_SIZE
    if agents.speed_distribution == "uniform":
        shares = 1 + spread * (2 * levels - 1)
    elif agents.speed_distribution == "normal":
        cut = NormalDist().cdf(-1 / spread)
        shares = 1 + spread * _normal_quantiles(cut + levels * (1 - 2 * cut))
    elif agents.speed_distribution == "exponential":
        shares = -_each(log, 1 - levels)
    elif agents.speed_distribution == "lognormal":
        shares = _each(exp, _lognormal_sigma(spread) * _normal_quantiles(levels))
    elif agents.speed_distribution == "two_speeds":
        slow, fast = _two_speeds(agents)
        shares = np.where(levels > 1 - (agents.fast_share or 0.0), fast, slow)
    else:
        shares = np.ones(TABLE_SIZE)
    speeds: FloatArray = agents.speed_cm_s * shares / shares.mean()
    return speeds


def _normal_quantiles(levels: FloatArray) -> FloatArray:
    """Return quantiles to nine digits, which do not depend on the last digit of a system's logarithm."""
    return _each(NormalDist().inv_cdf, levels).round(9)


def _each(function: Callable[[float], float], numbers: FloatArray) -> FloatArray:
    return np.array([function(number) for number in numbers.tolist()])


def _lognormal_sigma(spread: float) -> float:
    """Return the standard deviation of the logarithm of lognormal numbers of mean 1 and deviation `spread`."""
    return math.sqrt(log(1 + spread**2))


def _two_speeds(agents: AgentsSection) -> tuple[float, float]:
    share, ratio = agents.fast_share or 0.0, agents.fast_ratio or 1.0
    slow = 1 / (1 + share * (ratio - 1))
    return slow, ratio * slow


def truncated_normal(generator: WordArray, count: int, sigma: float, low: float, high: float) -> FloatArray:
    """Return normal numbers of mean 1, (count,), each drawn again until it is between `low` and `high`."""
    drawn, outside = np.zeros(count), np.ones(count, np.bool_)
    while outside.any():
        again = np.empty(np.count_nonzero(outside))
        generators.fill_normals(again, generator)
        drawn[outside] = 1 + sigma * again
        outside = (drawn < low) | (drawn > high)
    return drawn
