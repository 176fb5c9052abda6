"""The rules of a scenario, and the block of memory that its swarms begin with (thesis 3.1, 5.1, D.1)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.particles.events import advance
from epuck_sim.particles.initial_conditions import give_start, speed_table
from epuck_sim.particles.motion import begin_run, continue_trajectory, reorient_agents
from epuck_sim.particles.neighbours import neighbourhood_of, search_of
from epuck_sim.particles.oscillators import BRANCHES, FLAT, METRIC_CODES, forget_earliest, max_phase_offset
from epuck_sim.particles.phase_response import CURVES, Response, make_response
from epuck_sim.particles.swarm import BEGIN_RUN, CALLS, CONTINUE, CURVE, REORIENT, SEARCH, Arrays, make_block
from epuck_sim.scenario.particles import ParticleScenario, RandomAgents
from epuck_sim.util.native import address_of, compile_kernel


class Rules(NamedTuple):
    """What the swarms of a scenario have in common, whatever their seeds."""

    beginning: ByteArray
    """Bytes with which the block of a swarm begins to which nothing has happened; others are of no account."""
    size: int
    """Number of bytes of a block."""
    addresses: IntArray
    """Addresses, in this process, of what compiled code calls, see `swarm.SEARCH`; 0 for what it does not."""

    def new_block(self) -> ByteArray:
        """Return the block of a new swarm."""
        block = np.zeros(self.size, np.uint8)
        block[: len(self.beginning)] = self.beginning
        return block


KEPT = 4
"""Number of scenarios whose rules are kept for the next simulation."""

_kept: dict[tuple[int, ...], tuple[object, Rules]] = {}


def rules_of(scenario: ParticleScenario) -> Rules:
    """Return the rules of a scenario, which are made once for all seeds."""
    if scenario.response.curve not in CURVES:
        return _make_rules(scenario)  # the file may have changed
    moving = scenario.space, scenario.agents, scenario.neighbourhood, scenario.start
    sections = *moving, scenario.response, scenario.clocks, scenario.stop
    key = tuple(map(id, sections))
    if key not in _kept:
        if len(_kept) >= KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = sections, _make_rules(scenario)  # the sections are kept, and thus their numbers
    return _kept[key][1]


def _make_rules(scenario: ParticleScenario) -> Rules:
    """Return the rules of a scenario; compile what they call, before any clock runs."""
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
    give_start(arrays, scenario)
    compile_kernel(advance)
    called = {
        CONTINUE: continue_trajectory,
        SEARCH: search_of(arrays.scene),
        BEGIN_RUN: begin_run if values["has_runs"] else None,
        REORIENT: reorient_agents if agents.reorient_on else None,
    }
    addresses = np.zeros(CALLS, np.int64)
    addresses[CURVE] = response.address
    for number, function in called.items():
        if function is not None:
            addresses[number] = address_of(function, types.int64, types.float64)
    beginning = arrays.block[: arrays.scene.at[-1][0]].copy()
    return Rules(beginning, len(arrays.block), addresses)


def _scene_values(scenario: ParticleScenario, response: Response) -> dict[str, Any]:
    """Return the fields of a scene that a scenario gives, but for its neighbourhood."""
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
        # they turn agents, or receivers are drawn, and draws must not depend on the order of the cascade
        "sends_every_pulse": "arriving" in agents.reorient_on or isinstance(scenario.neighbourhood, RandomAgents),
        "reference": stop.reference,
        "metric": METRIC_CODES[stop.metric],
        "threshold": threshold,
        "max_offset": 1.0 if stop.max_time_s is not None else max_offset,  # then it may end between two firings
        "order_parameter": math.nan,
    }
