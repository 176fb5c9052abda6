"""The rules of a scenario, and the block of memory that its swarms begin with (thesis 3.1, 5.1, D.1)."""

import math
from typing import Any, NamedTuple

import numpy as np
from numba import types

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.particles.events import advance, advance_in_cones
from epuck_sim.particles.initial_conditions import give_start, speed_table
from epuck_sim.particles.motion import begin_run, continue_trajectory, reorient_agents
from epuck_sim.particles.neighbours import (
    EMISSION_CONE,
    FULL_CIRCLE_COS,
    NEAREST,
    RANDOM,
    UNLIMITED_CM,
    VISION_CONE,
    draw_receivers,
    search_cells,
    search_cone,
    search_nearest,
)
from epuck_sim.particles.oscillators import BLOCK_SIZE, METRIC_CODES, max_phase_offset
from epuck_sim.particles.phase_response import CURVES, Response, make_response
from epuck_sim.particles.swarm import BEGIN_RUN, CALLS, CONTINUE, CURVE, REORIENT, SEARCH, Arrays, make_block
from epuck_sim.scenario.neighbourhoods import Cone, Nearest, RandomAgents, Range
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import address_of, compile_kernel

MAX_CACHED_AGENTS = 2000
"""Largest swarm whose neighbours are cached; the cache of a larger one would take more than 16 MB."""

MIN_CELL_LIST_AGENTS = 400
"""Smallest swarm that uses a cell list; in smaller ones a search over all pairs is faster."""

MAX_SHARE, MAX_SHARE_NEAREST = 1 / 3, 1 / 6
"""Largest share of all agents that a search in the cell list looks at; otherwise a search over all pairs is faster."""

BALL_VOLUME = {1: 2.0, 2: math.pi, 3: 4 / 3 * math.pi}
"""Length, area or volume of a ball of radius 1, by dimensions."""


class Rules(NamedTuple):
    """What the swarms of a scenario have in common, whatever their seeds."""

    beginning: ByteArray
    """Bytes with which the block of a swarm begins to which nothing has happened; others are of no account."""
    size: int
    """Number of bytes of a block."""
    addresses: IntArray
    """Addresses, in this process, of what compiled code calls; see `swarm.SEARCH`."""
    advance: Any
    """`events.advance`, or its like for cones."""

    def new_block(self) -> ByteArray:
        """Return the block of a new swarm."""
        block = np.zeros(self.size, np.uint8)
        block[: len(self.beginning)] = self.beginning
        return block


KEPT = 4
"""Number of scenarios whose rules are kept for the next simulation."""

_kept: dict[tuple[int, ...], tuple[object, Rules]] = {}


def rules_of(scenario: ParticleScenario) -> Rules:
    """Return the rules of a scenario, which are made once for all seeds.

    Raises:
        CurveError: The response curve is a user's, and cannot be found or compiled.
    """
    moving = scenario.space, scenario.agents, scenario.neighbourhood, scenario.start
    sections = *moving, scenario.response, scenario.clocks, scenario.stop
    if scenario.response.curve not in CURVES:
        return _make_rules(scenario)  # the file may have changed
    key = tuple(map(id, sections))
    if key not in _kept:
        if len(_kept) >= KEPT:
            del _kept[next(iter(_kept))]
        _kept[key] = sections, _make_rules(scenario)  # the sections are kept, and thus their numbers
    return _kept[key][1]


def _make_rules(scenario: ParticleScenario) -> Rules:
    """Return the rules of a scenario; compile what they call, before any clock runs."""
    agents, dimensions, response = scenario.agents, scenario.space.dimensions, make_response(scenario.response)
    values = {**_neighbourhood(scenario), **_scene_values(scenario, response)}
    speeds = speed_table(agents) * scenario.clocks.period_s if agents.speed_per_run else np.zeros(0)
    sizes = {
        "agents": agents.count,
        "rows": dimensions * agents.count,
        "events": agents.count + 1,
        "blocks": -(-agents.count // BLOCK_SIZE),
        "cell_starts": values["cells"] ** dimensions + 1 if values["cells"] else 0,
        "run_speeds": len(speeds),
        "curve": len(response.from_file.bytes),
        "members": agents.count * (agents.count if values["is_cached"] else 1),
    }
    arrays = Arrays(make_block(sizes))
    for name, value in values.items():
        arrays.scene[name] = value
    arrays.run_speeds[:] = speeds
    arrays.run_end_cycle[:] = -1
    arrays.period[:] = 1
    arrays.is_stale[:] = True
    arrays.cached_until[:] = -math.inf
    arrays.candidates[:] = np.arange(agents.count)
    arrays.curve[:] = response.from_file.bytes
    give_start(arrays, scenario)
    is_cone = values["kind"] in (VISION_CONE, EMISSION_CONE) and not values["cells"]
    root = advance_in_cones if is_cone else advance
    compile_kernel(root)
    beginning = arrays.block[: arrays.scene.at[-1][0]].copy()
    return Rules(beginning, len(arrays.block), _addresses(arrays.scene, response), root)


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
        "response": (*response[:-1], 0.0),
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


def _addresses(scene: Any, response: Response) -> IntArray:
    """Return the addresses of what is called under the rules of a scene, which is compiled if need be."""
    searches = {NEAREST: search_nearest, RANDOM: draw_receivers}
    search = search_cells if scene.cells else searches.get(scene.kind, search_cone)
    called = {CONTINUE: continue_trajectory, SEARCH: search}
    if scene.has_runs:
        called[BEGIN_RUN] = begin_run
    if scene.reorients_on_emitting or scene.reorients_on_receiving or scene.reorients_on_arriving:
        called[REORIENT] = reorient_agents
    addresses = np.zeros(CALLS, np.int64)
    addresses[CURVE] = response.from_file.address
    for number, function in called.items():
        addresses[number] = address_of(function, types.int64, types.float64)
    return addresses


def _neighbourhood(scenario: ParticleScenario) -> dict[str, Any]:
    """Return the fields of a scene that say who is whose neighbour, and how they are found."""
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
    side_cm, spacing_cm = scenario.space.side_cm, scenario.space.side_cm / agents ** (1 / dimensions)
    cell_cm = spacing_cm if kind == NEAREST else max(spacing_cm, radius_cm / 2)
    expected = k + 1 + 3 * math.sqrt(k + 1)  # agents in the radius: far from walls hardly ever too few
    reach_cm = spacing_cm * (expected / BALL_VOLUME[dimensions]) ** (1 / dimensions)
    search_cm = reach_cm if kind == NEAREST else radius_cm + cell_cm / 4
    share = ((2 * search_cm + 2 * cell_cm) / side_cm) ** dimensions  # of all agents which are candidates
    is_local = kind != RANDOM and share < (MAX_SHARE_NEAREST if kind == NEAREST else MAX_SHARE)
    cells = max(1, int(side_cm / cell_cm)) if agents >= MIN_CELL_LIST_AGENTS and is_local else 0
    return {
        "kind": kind,
        "k": k,
        "radius_cm": radius_cm,
        "cos": FULL_CIRCLE_COS if angle_deg >= 360 else math.cos(math.radians(angle_deg / 2)),
        "sin": math.sin(math.radians(angle_deg / 2)),
        "is_cached": agents <= MAX_CACHED_AGENTS and not jumps and kind != RANDOM,
        "search_radius_cm": search_cm,
        "cells": cells,
        "cell_cm": side_cm / max(cells, 1),
    }
