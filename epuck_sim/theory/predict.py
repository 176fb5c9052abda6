"""Predictions of a scenario's regimes, and their table for a sweep."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.display.table import Row, Share, Table, cell_text
from epuck_sim.errors import ScenarioError
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.particles.phase_response import CURVES, Response, make_response
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import Point, load_of_model, points
from epuck_sim.scenario.particles import ParticleScenario, RandomAgents, StartSection
from epuck_sim.scenario.scenario import Scenario, ScenarioLike
from epuck_sim.theory.chains import Limit, Pair, Rise, Verdict, find_limit, find_rise, judge, measure_pair, time_at
from epuck_sim.theory.snapshots import GraphMeasures, changed_links, count_components, measure_graphs, take_snapshots
from epuck_sim.util.messages import comma_list

SNAPSHOTS, CELLS = 400, 2_000_000  # largest number of snapshots, and of pairs of agents in all of them
MOST_AGENTS = 300  # largest swarm for which predictions are made, as snapshots are matrices

LINK_SNAPSHOTS, TRIED_SIDES = 60, tuple(2.0**power for power in range(-9, 1))
"""Number of snapshots that tell the length of links, and the distances, in sides, that agents move in a period."""

HOLDS = tuple(2.0**power for power in range(8, -3, -1))
"""Holds, in cycles, for which chains give T_sync, from the slowest swarm to the fastest."""

IN_LIMITS = 200  # number of chains in the limits of swarms that stand, and that are fast

BRACKETS = "[]: V_m and V_p within the factor by which trials were off, one standard deviation; else 95 % of chains."

CHANGED = 0.1  # share of links that is replaced while agents move this share of the length of links

PLACES = {"v_m": (0.42, 1.9), "v_p": (0.73, 2.3)}
"""Speed at the minimum and at the peak, relative to that at which links last as long as the chain's hold, and the
factor of one standard deviation either way: for V_m in the scenarios by which the places were fixed, for V_p in those
by which they were judged (docs/theory.md)."""


class Prediction(NamedTuple):
    """Predictions for a scenario from the graph of who hears whom."""

    scenario: str
    intermediate_regime: Verdict
    v_m_cm_s: Estimate  # speed at the minimum before the peak; NaN where the verdict is no
    v_p_cm_s: Estimate  # speed at the peak
    t_sync: Estimate  # T_sync at the scenario's own speed, in cycles
    t_sync_fast: Estimate  # T_sync of the fastest swarms, in cycles
    t_sync_frozen: Estimate  # T_sync of swarms that stand and can synchronise, in cycles
    frozen_share: Estimate  # share of swarms that can synchronise though they stand
    link_cm: float  # distance that agents move until a link is gone
    link_cycles: float  # the same in cycles, at the scenario's own speed
    graph: GraphMeasures
    pair: Pair  # two oscillators with this response curve
    reason: str  # what decides, in a sentence
    notes: tuple[str, ...]  # what the prediction leaves out

    @property
    def quantities(self) -> list[tuple[str, str, Any, str]]:
        """Column in a table of several predictions, empty if it has none, name, value and unit of each quantity."""
        regime, graph = self.intermediate_regime, self.graph
        return [
            ("regime", "intermediate regime", regime.verdict, ""),
            ("probability", "its probability", Share(regime.probability), ""),
            ("v_m", "V_m, minimum of T_sync", self.v_m_cm_s, "cm/s"),
            ("v_p", "V_p, peak of T_sync", self.v_p_cm_s, "cm/s"),
            ("t_sync", "T_sync at this speed", self.t_sync, "cycles"),
            ("t_fast", "T_sync, fast limit", self.t_sync_fast, "cycles"),
            ("t_frozen", "T_sync, standing swarms", self.t_sync_frozen, "cycles"),
            ("frozen_share", "standing swarms that sync", Share(self.frozen_share.value), ""),
            ("", "link lasts", self.link_cm, "cm"),
            ("", "link lasts", self.link_cycles, "cycles"),
            ("", "links an agent", graph.links, ""),
            ("", "reciprocal links", Share(graph.reciprocity.value), ""),
            ("", "heard, hear nobody", Share(graph.sources.value), ""),
            ("", "frustrated clusters", Share(graph.frustrated.value), "of snapshots"),
        ]

    @property
    def cells(self) -> dict[str, Any]:
        """Cells of this prediction in a table of several."""
        return {column: value for column, _, value, _ in self.quantities if column}

    def table(self) -> Table:
        """Return a table with a row for each quantity."""
        rows = [{"quantity": name, "predicted": value, "unit": unit} for _, name, value, unit in self.quantities]
        return Table(self.scenario, [Row({}, row) for row in rows], (self.reason, BRACKETS, *self.notes))


def predict(scenario: ScenarioLike) -> Prediction:
    """Return the prediction for what `load_scenario` takes, without a sweep; raise ScenarioError if there is none."""
    loaded = load_of_model(scenario, Scenario)
    return predictor(loaded)(_speed_of(loaded))


def predict_points(scenario: ScenarioLike) -> list[tuple[Point, Prediction]]:
    """Return `predict` for each point of a scenario's sweep; points that differ only in speed share their chains."""
    kept: dict[str, Callable[[float], Prediction]] = {}
    found = []
    for point in points(scenario):
        key = str(without_speed(point.scenario))
        if key not in kept:
            kept[key] = predictor(point.scenario)
        found.append((point, kept[key](_speed_of(point.scenario))))
    return found


def sweep_table(name: str, found: Sequence[tuple[Point, Prediction]]) -> Table:
    """Return the predictions of a sweep of this name, with a row for each point."""
    notes = dict.fromkeys(note for _, prediction in found for note in prediction.notes)
    rows = [Row(point.axes, prediction.cells) for point, prediction in found]
    headings = {column: f"{said}{f' ({unit})' * bool(unit)}" for column, said, _, unit in found[0][1].quantities}
    return Table(name, rows, (BRACKETS, *notes), headings)


def predictor(scenario: Scenario) -> Callable[[float], Prediction]:
    """Return the prediction as a function of the speed, cm/s: a swarm's graph and chains serve for all speeds."""
    response, threshold, jitter = _oscillators(scenario)
    agents, period_s = scenario.population, scenario.scales["tau"]
    snapshots = take_snapshots(scenario, min(SNAPSHOTS, CELLS // agents**2))
    graph, pair = measure_graphs(snapshots), measure_pair(response, threshold)
    slower = [find_limit(response, threshold, snapshots, hold, jitter) for hold in HOLDS]
    fast = find_limit(response, threshold, snapshots, 0.0, jitter, IN_LIMITS)
    course = [*slower, fast]
    rise = find_rise(course)
    if isinstance(scenario, ParticleScenario) and isinstance(scenario.neighbourhood, RandomAgents):
        verdict, frozen, frozen_share, link_cm = Verdict("no", 0.0), fast, fast.ended, math.nan
        reason = "No regime: receivers are drawn anew for each pulse, at any speed."
    else:
        verdict, link_cm = judge(rise), _link_length(scenario)
        joined = snapshots[count_components(snapshots)[1] == 1]
        frozen = find_limit(response, threshold, joined, math.inf, jitter, IN_LIMITS)
        frozen_share = graph.joined.apply(lambda value: value * frozen.ended.value)
        reason = _reason(verdict.verdict, graph, pair, rise, fast)

    def place(name: str, hold: float) -> Estimate:
        if verdict.verdict == "no":
            return UNDETERMINED
        ratio, factor = PLACES[name]
        value = ratio * link_cm / (hold * period_s)
        return Estimate(value, value / factor, value * factor)

    def at(speed: float) -> Prediction:
        cycles = link_cm / (speed * period_s) if speed else math.inf
        stays = not speed or math.isnan(link_cm)
        return Prediction(
            scenario=scenario.name,
            intermediate_regime=verdict,
            v_m_cm_s=place("v_m", rise.minimum),
            v_p_cm_s=place("v_p", rise.peak),
            t_sync=frozen.cycles if stays else time_at(course, cycles),
            t_sync_fast=fast.cycles,
            t_sync_frozen=frozen.cycles,
            frozen_share=frozen_share,
            link_cm=link_cm,
            link_cycles=cycles,
            graph=graph,
            pair=pair,
            reason=reason,
            notes=_left_out(scenario),
        )

    return at


def _reason(verdict: str, graph: GraphMeasures, pair: Pair, rise: Rise, fast: Limit) -> str:
    if graph.joined.value > 0.999 and graph.reciprocity.value > 0.999:
        return "No regime: one cluster reaches all, and all links are reciprocal."
    clusters = (
        f"{cell_text(Share(graph.frustrated.value))} of snapshots have clusters that nothing brings together "
        f"({graph.links.value:.2g} links an agent, {cell_text(Share(graph.reciprocity.value))} reciprocal)"
    )
    if verdict == "no":
        renewed = f"renewed links {'join them all the same' if fast.ended.value else 'do not join them either'}"
        drives = "pulses pull leads back" if pair.lead < 0 else renewed
        return f"No regime: {clusters}, and {drives}."
    kept = f"T_sync at links of {rise.peak:g} cycles is {math.exp(rise.log_ratio):.2g} times that at {rise.minimum:g}"
    if math.isnan(rise.minimum):
        kept = f"T_sync falls {2 * math.exp(rise.excess):.2g}-fold when links are renewed twice as often"
    return f"{'Regime' if verdict == 'yes' else 'Open'}: {clusters}; {kept}."


def _oscillators(scenario: Scenario) -> tuple[Response, float, float]:
    """Return the response curve, the threshold of the order parameter, and the jitter of the periods."""
    name, agents = scenario.name, scenario.population
    if not 2 <= agents <= MOST_AGENTS:
        key = "agents.count" if isinstance(scenario, ParticleScenario) else "robots.0.count"
        raise ScenarioError(f"{name}: {key} is {agents}; allowed: 2 to {MOST_AGENTS} for a prediction")
    threshold = scenario.stop.order_parameter
    if threshold is None:
        raise ScenarioError(f"{name}: stop.order_parameter is null; give a number up to 1, at which T_sync ends")
    if isinstance(scenario, ParticleScenario):
        response, jitter, key = make_response(scenario.response), scenario.clocks.jitter, "response.coupling"
    else:
        assert isinstance(scenario, EmbodiedScenario)
        jitter, key = 0.0, "robots.0.parameters.coupling"
        for number, group in enumerate(scenario.robots):
            if not {"coupling", "period_s"} <= set(group.parameters):
                raise ScenarioError(
                    f"{name}: robots.{number}.controller: is {group.controller!r}, which has no parameters coupling "
                    "and period_s; predict needs oscillators, such as firefly"
                )
        parameters: Mapping[str, Any] = scenario.robots[0].parameters
        refractory = float(parameters.get("refractory_fraction", 0.0))
        response = Response(CURVES.index("multiplicative"), float(parameters["coupling"]), refractory)
    if response.coupling == 0:
        raise ScenarioError(f"{name}: {key} is 0; allowed: above 0, because without coupling nothing synchronises")
    return response, float(threshold), jitter


def _left_out(scenario: Scenario) -> tuple[str, ...]:
    notes = []
    if isinstance(scenario, EmbodiedScenario):
        notes.append(
            "Robots are treated as point oscillators that move straight ahead: a rough guide, which misses the regime "
            "that trials of thesis have."
        )
        if all(group.poses is not None for group in scenario.robots):
            notes.append("poses are as given, in all snapshots.")
        names = ("coupling", "period_s", "refractory_fraction", "speed_cm_s")
        if differing := [name for name in names if len({each.parameters.get(name) for each in scenario.robots}) > 1]:
            notes.append(f"All robots are treated as in the first group; groups differ in {comma_list(differing)}.")
    elif isinstance(scenario, ParticleScenario) and scenario.start != StartSection():
        notes.append("start is left out: places and phases are random.")
    if scenario.stop.metric != "complex":
        notes.append("stop.metric is left out: the order parameter is the complex one.")
    assert isinstance(scenario, EmbodiedScenario | ParticleScenario)
    if scenario.faults:
        notes.append("faults are left out.")
    if scenario.schedule:
        notes.append("schedule is left out: the prediction is for the swarm as it starts.")
    return tuple(notes)


def _speed_of(scenario: Scenario) -> float:
    if isinstance(scenario, ParticleScenario):
        return scenario.agents.speed_cm_s
    assert isinstance(scenario, EmbodiedScenario)
    return float(scenario.robots[0].parameters.get("speed_cm_s", 0.0))


def without_speed(scenario: Scenario) -> dict[str, Any]:
    """Return the keys on which a prediction depends, without the speed."""
    dump = scenario.trial_keys
    section: Any = dump["agents"] if isinstance(scenario, ParticleScenario) else dump["robots"][0]["parameters"]
    section.pop("speed_cm_s", None)
    return dump


def _link_length(scenario: Scenario) -> float:
    """Return the distance, cm, that agents move until a link is gone; NaN if none goes.

    A period in which a small share x of links is replaced changes 2 x / (1 + x) of those before and after it.
    """
    side = scenario.scales["L"]
    speeds = [share * side / scenario.scales["tau"] for share in TRIED_SIDES]
    changed = changed_links(scenario, speeds, LINK_SNAPSHOTS)
    renewed = changed / (2 - changed)
    known = np.isfinite(renewed) & (renewed > 0)
    if not known.any():
        return math.nan
    log_share = np.log(np.maximum.accumulate(renewed[known]))
    log_moved = np.log(np.array(TRIED_SIDES)[known] * side)
    return math.exp(np.interp(math.log(CHANGED), log_share, log_moved)) / CHANGED
