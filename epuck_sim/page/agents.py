"""Facts of a scenario of point agents for its page: `web/agents.js` makes blocks from them, as `rules_of` here."""

import base64
import math
from dataclasses import replace
from typing import Any

from epuck_sim import elementary
from epuck_sim.page.roots import CURVE
from epuck_sim.page.settings import Setting, allowed, fields_of, refuse, stops
from epuck_sim.particles import neighbours
from epuck_sim.particles.initial_conditions import rules_of
from epuck_sim.particles.oscillators import BRANCHES, FLAT
from epuck_sim.particles.swarm import ARRAYS, CALLS, SCENE, SCENE_BYTES, Arrays
from epuck_sim.scenario.particles import Cone, Nearest, ParticleScenario, RandomAgents, Range

MOST_AGENTS = 2000  # most agents of a page, which draws all of them 60 times a second
ANGLE_STEP_DEG = 5  # step between the angles of cones on a slider: their sines are computed here, to the bit
REACH_CM = 30  # reach with which a page begins if the scenario has none
RANDOM_NUMBERS = "is drawn for each agent by numpy, which pages do not have"
CONES = "cone_of_vision cone_of_emission"
_CHECKED = ("agents.speed_cm_s", "response.coupling", "clocks.period_s", "space.side_cm")
_KIND = "neighbourhood.kind"  # key whose value decides which other keys there are
_KINDS = ("nearest", "random", "all", "range", "cone_of_vision", "cone_of_emission")

_EMPTY = ("run_speeds", "faults", "affected", "faulty", "groups", "parts")  # lengths that are 0; up to `FLAT` agents

CALL_NAMES = ["CURVE", "SEARCH", "CONTINUE", "BEGIN_RUN", "REORIENT", "HEAR"]  # functions that a swarm calls by address

assert MOST_AGENTS <= FLAT
assert len(CALL_NAMES) == CALLS


def check_agents(scenario: ParticleScenario) -> None:
    """Raise ScenarioError, which names the key, if a scenario of agents cannot be a page."""
    agents = scenario.agents
    refuse(
        scenario,
        (agents.count > MOST_AGENTS, "agents.count", f"is {agents.count}; a page shows up to {MOST_AGENTS}"),
        (agents.speed_distribution != "fixed", "agents.speed_distribution", RANDOM_NUMBERS),
        (scenario.clocks.jitter > 0, "clocks.jitter", RANDOM_NUMBERS),
        (scenario.start.like is not None, "start.like", "pages cannot begin with a trial of robots"),
    )


def agents_facts(scenario: ParticleScenario) -> dict[str, Any]:
    """Return the facts from which `web/agents.js` makes swarms; raise ScenarioError for scenarios that have no page."""
    check_agents(scenario)
    rules, start = rules_of(scenario), scenario.start
    arrays, walk, stop = Arrays(rules.new_block()), scenario.agents.walk, scenario.stop
    functions = {
        "CURVE": (CURVE, len(arrays.curve) > 0),
        "CONTINUE": ("continue_trajectory", True),
        "BEGIN_RUN": ("begin_run", walk.kind != "straight"),
        "REORIENT": ("reorient_agents", bool(scenario.agents.reorient_on)),
    }
    given = {
        "origin": start.positions_cm is not None,
        "heading": start.headings is not None,
        **dict.fromkeys(("phases_now", "next_firing"), isinstance(start.phases, tuple)),
    }
    return {
        "dimensions": scenario.space.dimensions,
        "scene": fields_of(SCENE),
        "scene_bytes": SCENE_BYTES,
        "scene_base": rules.beginning[:SCENE_BYTES].tolist(),
        "arrays": [(name, dtype.itemsize, size) for name, (dtype, size) in ARRAYS.items()],
        "sizes": {"curve": len(arrays.curve), **dict.fromkeys(_EMPTY, 0)},
        "curve": base64.b64encode(arrays.curve.tobytes()).decode(),
        "fill": {"run_end_cycle": -1, "period": 1, "cached_until": "-Infinity", "block_earliest": "-Infinity"},
        "given": {name: getattr(arrays, name).ravel().tolist() for name, is_given in given.items() if is_given},
        "is_synchronised": start.phases == "synchronised",
        "displacement": start.displacement,
        "calls": CALL_NAMES,
        "functions": {call: name for call, (name, is_called) in functions.items() if is_called},
        "kinds": {
            "nearest": neighbours.NEAREST,
            "vision": neighbours.VISION_CONE,
            "emission": neighbours.EMISSION_CONE,
            "random": neighbours.RANDOM,
        },
        "angles": [(angle, _cosine_and_sine(angle)) for angle in _angles(scenario)],
        "reach_cm": REACH_CM,
        "unlimited_cm": neighbours.UNLIMITED_CM,
        "ball_volume": neighbours.BALL_VOLUME[scenario.space.dimensions],
        "max_share": neighbours.MAX_SHARE,
        "max_share_nearest": neighbours.MAX_SHARE_NEAREST,
        "min_cell_list": neighbours.MIN_CELL_LIST_AGENTS,
        "max_cached": neighbours.MAX_CACHED,
        "branches": BRANCHES,
        "has_cycles": True,
        "reference": stop.reference,
        "metric": stop.metric,
        "is_cyclic": scenario.space.boundary == "cyclic",
        "reorients": bool(scenario.agents.reorient_on),
        "sends_every_pulse": "arriving" in scenario.agents.reorient_on,
        "run_s": walk.run_s or 0.0,
        "order_parameter": stop.order_parameter,
        "max_time_s": stop.max_time_s,
    }


def _cosine_and_sine(angle_deg: float) -> tuple[float, float]:
    half = math.radians(angle_deg / 2)
    return neighbours.FULL_CIRCLE_COS if angle_deg >= 360 else elementary.cos(half), elementary.sin(half)


def _angles(scenario: ParticleScenario) -> tuple[float, ...]:
    rule = scenario.neighbourhood
    own = [rule.angle_deg] if isinstance(rule, Cone) else []
    return stops(ANGLE_STEP_DEG, 360, step=ANGLE_STEP_DEG, also=own)


def agents_settings(scenario: ParticleScenario) -> list[Setting]:
    """Return the settings of a page of agents, each with its value in the thesis's base case."""
    agents, rule, own = scenario.agents, scenario.neighbourhood, scenario.space
    period_s, side_cm = scenario.clocks.period_s, own.side_cm
    speed, coupling, count = agents.speed_cm_s, scenario.response.coupling, agents.count
    k = rule.k if isinstance(rule, Nearest | RandomAgents) else 1
    radius = rule.radius_cm if isinstance(rule, Range | Cone) else REACH_CM
    angle = rule.angle_deg if isinstance(rule, Cone) else 90.0
    given = scenario.start
    is_free = given.positions_cm is None and given.headings is None and not isinstance(given.phases, tuple)
    radii = [*stops(1, 200, also=[REACH_CM, radius or REACH_CM]), None]
    settings = [
        Setting("agents.speed_cm_s", "speed", "cm/s", stops(0.1, 100, also=[speed, 30]), speed, 30),
        Setting("response.coupling", "coupling", "", stops(0, 1, step=0.01, also=[coupling]), coupling, 0.1),
        Setting(_KIND, "pulses reach", "", _KINDS, rule.kind, "nearest"),
        Setting("neighbourhood.k", "neighbours", "", stops(1, 20, step=1, also=[k]), k, 1, (_KIND, "nearest random")),
        Setting("neighbourhood.radius_cm", "reach", "cm", tuple(radii), radius, None, (_KIND, f"range {CONES}")),
        Setting("neighbourhood.angle_deg", "opening angle", "°", _angles(scenario), angle, None, (_KIND, CONES)),
        Setting("clocks.period_s", "period", "s", stops(0.1, 10, also=[period_s, 1]), period_s, 1),
    ]
    if is_free:
        sides = stops(10, 1000, also=[side_cm, 100])
        larger = [count, 20, *(int(each) for each in stops(10, 500) if isinstance(each, int))]
        counts = [each for each in stops(1, 10, step=1, also=larger) if each > scenario.stop.reference]
        settings.insert(0, Setting("agents.count", "agents", "", tuple(counts), count, 20))
        settings.append(Setting("space.side_cm", "side of the space", "cm", sides, side_cm, 100.0))
    return [
        replace(each, stops=allowed(scenario, each.key, each.stops)) if each.key in _CHECKED else each
        for each in settings
    ]
