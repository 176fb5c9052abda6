"""Trials of robots: what comes out, when they end, that looking on changes nothing, and what traces hold of them."""

import json
import math
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import EpuckSimError, Simulation, Step, Trace, load_scenario, run_trial
from epuck_sim.order_parameter import order_parameter, reference_order_parameter
from epuck_sim.trial import trace as trace_module
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.util.provenance import versions
from epuck_sim.util.yaml_io import parse_yaml
from tests.control.bench import with_step
from tests.embodied.steps import bare_step
from tests.measures.files import write
from tests.trial import without_wall


class Recorder:
    def __init__(self):
        self.numbers, self.rings, self.phases, self.watched = [], [], [], []

    def __call__(self, step, watch):
        assert isinstance(step, Step)
        assert isinstance(watch, SynchronyWatch)
        self.numbers.append(step.number)
        self.rings.append(step.ring_on.copy())
        self.phases.append(step.phase_ms)
        self.watched.append((watch.cycles, watch.order_parameter))


def firings(rings, robot):
    """Return the steps in which a robot's ring lights up."""
    ring = np.array(rings)[:, robot].astype(int)
    return np.flatnonzero(np.diff(ring, prepend=0) == 1)


@pytest.mark.parametrize(("seed", "reference"), [(0, 0), (1, 7), (2, 0)])
def test_t_sync_is_the_number_of_the_references_firings_until_order_reaches_the_threshold(seed, reference):
    recorder, other = Recorder(), Recorder()
    scenario = load_scenario("thesis", [f"stop.reference_robot={reference}"])
    result = run_trial(Simulation(scenario, seed), iter([recorder, other]))
    assert without_wall(result) == without_wall(run_trial(Simulation(scenario, seed)))
    fired = firings(recorder.rings, reference)
    orders = np.abs(np.exp(2j * np.pi * np.array(recorder.phases)[fired] / 5000).mean(axis=1))
    assert not result.censored
    assert result.t_sync_cycles == result.cycles == len(fired) > 1
    assert fired[-1] == result.steps - 1
    assert recorder.numbers == other.numbers == list(range(result.steps))
    cycles = np.cumsum(np.isin(recorder.numbers, fired))  # every step is shown after the watch has looked
    assert [count for count, _ in recorder.watched] == cycles.tolist()
    assert recorder.watched[-1] == (result.cycles, result.order_parameter)
    assert (orders[:-1] < 0.95).all()
    assert result.order_parameter == pytest.approx(orders[-1])
    assert orders[-1] >= 0.95


@pytest.mark.parametrize("further", [1, 3])
def test_after_synchrony_a_trial_goes_on_for_the_further_cycles_and_the_outcome_stays(further):
    recorder = Recorder()
    usual = run_trial(Simulation("thesis", 2))
    longer = run_trial(Simulation(load_scenario("thesis", [f"stop.further_cycles={further}"]), 2), [recorder])
    assert longer.steps > usual.steps
    assert longer.simulated_s == pytest.approx(longer.steps * 0.1)
    same_length = {"steps": usual.steps, "simulated_s": usual.simulated_s}
    assert without_wall(longer._replace(**same_length)) == without_wall(usual)
    fired = firings(recorder.rings, 0)
    assert len(fired) == usual.cycles + further
    assert fired[-1] == longer.steps - 1
    assert recorder.watched[-1][0] == len(fired)  # the watch goes on counting


@pytest.mark.parametrize(("limit", "more"), [("max_cycles", 1), ("max_cycles", 0), ("max_time_s", 2.0)])
def test_further_cycles_end_at_the_limits_of_the_trial_which_is_not_censored(limit, more):
    usual = run_trial(Simulation("thesis", 2))
    most = (usual.cycles if limit == "max_cycles" else usual.simulated_s) + more
    settings = ["stop.further_cycles=5", f"stop.{limit}={most}"]
    result = run_trial(Simulation(load_scenario("thesis", settings), 2))
    assert (result.censored, result.t_sync_cycles, result.cycles) == (False, usual.cycles, usual.cycles)
    if limit == "max_time_s":
        assert result.simulated_s == pytest.approx(most)
    else:
        assert usual.steps + 30 * more <= result.steps <= usual.steps + 51 * more


def test_a_trial_without_oscillators_counts_a_cycle_every_5_s_and_a_reference_that_never_fires_keeps_none(tmp_path):
    for most, cycles, steps in ((100, 4, 220), (3, 3, 150)):
        limits = ["stop.max_time_s=22", f"stop.max_cycles={most}"]
        result = run_trial(Simulation(load_scenario("spotlight", limits)))
        assert (result.cycles, result.steps, result.order_parameter) == (cycles, steps, None)
        assert (result.censored, result.t_sync_cycles) == (None, None)
    never_fires = with_step("actuators.ring_on = False", PARAMETERS="{'period_s': 5.0}", MEMORY="{'phase_ms': float}")
    robots = [{"count": 2, "controller": str(write(tmp_path / "own.py", never_fires))}]
    for max_cycles in (1, 3):
        result = run_trial(Simulation({"robots": robots, "stop": {"max_cycles": max_cycles}}, interpret=True))
        assert (result.censored, result.cycles, result.steps) == (True, 0, 2 * max_cycles * 51)


def test_an_observer_may_command_robots_as_a_program_does():
    driven = {"robots": [{"controller": "external", "count": 3}], "stop": {"max_time_s": 5}}
    trial, alone = (Simulation(driven, 2) for _ in range(2))
    run_trial(trial, [lambda step, _: trial.command(step.number % 9)])
    for step in islice(alone, 50):
        alone.command(step.number % 9)
    np.testing.assert_array_equal(step.poses, trial.last_step.poses)


def test_a_firing_counts_though_the_ring_is_lit_already():
    parameters = {"flash_fraction": 0.15, "coupling": 10, "speed_cm_s": 2}
    simulation = Simulation({"robots": [{"count": 10, "parameters": parameters}], "stop": {"order_parameter": 1}}, 1)
    watched, resets, before, edges, was_on = SynchronyWatch(simulation), 0, np.inf, 0, False
    for step, _ in zip(simulation, range(2000), strict=False):
        watched.look(step, is_firing=simulation.is_firing)
        resets += bool(step.phase_ms[0] < before)
        edges += bool(step.ring_on[0] and not was_on)
        before, was_on = step.phase_ms[0], step.ring_on[0]
    first = 1  # the phase at the start falls from nowhere
    assert watched.cycles == resets - first > edges


TAU = 5000.0


@settings(max_examples=30)
@given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.floats(100, 9000)), min_size=1, max_size=30))
def test_order_parameters_are_those_of_angles_by_each_robots_own_period(robots):
    shares, periods = np.array(robots).T
    angles = 2 * np.pi * shares
    assert order_parameter(shares * periods, periods) == pytest.approx(abs(np.exp(1j * angles).mean()), abs=1e-9)
    assert reference_order_parameter(shares * periods, periods) == pytest.approx(np.cos(angles).mean(), abs=1e-9)


def watch(periods, step_s=0.1, **stop):
    """Return a watch on robots with these periods in ms, NaN for no oscillator."""
    timing, arena = {"control_hz": round(1 / step_s), "physics_hz": 1000}, {"width_cm": 200, "height_cm": 200}
    scenario = load_scenario({"robots": [{"count": len(periods)}], "stop": stop, "arena": arena, "timing": timing})
    return SynchronyWatch(SimpleNamespace(scenario=scenario, period_ms=np.array(periods, float), events=[]))


def step(number, rings, phase_ms):
    """Return a step in which these rings are lit and oscillators have these phases."""
    return bare_step(number, 0.0, np.array(rings, bool), phase_ms)


@pytest.mark.parametrize("delay_ms", [0, 62])
@pytest.mark.parametrize("metric", ["complex", "reference"])
def test_the_metric_is_the_scenarios_and_delta_of_the_references_phase_does_not_count(metric, delay_ms):
    watched = watch([2000, np.nan, 8000], metric=metric)  # each has a period of its own, or none
    assert watched.outcome == (0, None)
    watched.look(step(0, [1, 0, 0], [delay_ms, np.nan, 4 * delay_ms + 800]), is_firing=True)
    behind = 0.2 * math.pi
    expected = {"complex": math.cos(behind / 2), "reference": (1 + math.cos(behind)) / 2}[metric]
    assert watched.order_parameter == pytest.approx(expected)
    assert watched.is_synchronised == (expected > 0.95)
    assert watched.outcome == (1, watched.order_parameter)


def test_a_trial_is_censored_after_max_time_rounded_up_to_a_whole_step():
    for control_hz, max_time_s, steps in [
        *[(10, 0.1, 1), (10, 0.3, 3), (10, 0.7, 7), (10, 60, 600), (10, 0.25, 3), (10, 0.01, 1)],
        *[(25, 0.28, 7), (25, 0.56, 14), (50, 0.14, 7), (100, 0.07, 7), (40, 1.1, 44), (200, 0.035, 7)],
    ]:
        watched = watch([TAU, TAU], 1 / control_hz, max_time_s=max_time_s)
        for number in range(steps):
            watched.look(step(number, [0, 0], [0, 2500]), is_firing=False)
            assert watched.is_over == (number + 1 == steps)


INFRARED = [f"{reading}_{sensor}" for reading in ("distance_mm", "infrared") for sensor in range(8)]
MOTION = ["time_s", "robot", "x_cm", "y_cm", "heading_rad", "left_cm_s", "right_cm_s"]
COLUMNS = [*MOTION, "ring_on", "phase_ms", "flash_seen", *INFRARED, "camera"]


@pytest.mark.parametrize("arena", ["thesis", "spotlight"])
def test_every_value_is_that_of_the_simulation(tmp_path, monkeypatch, arena: str) -> None:
    monkeypatch.setattr(trace_module, "CHUNK_ROWS", 35)  # three steps of ten robots, and no whole number of chunks
    scenario = load_scenario(arena, ["stop.max_time_s=8"])
    (tmp_path / "link.parquet").symlink_to(tmp_path / "t.parquet")
    assert Trace(tmp_path / "m.parquet", "thesis", 0, memory="phase_ms")  # one field, and not eight letters
    with Trace(tmp_path / "link.parquet", scenario, 0) as trace:
        result = run_trial(Simulation(scenario, 0), [trace])
    assert result._replace(wall_s=0) == run_trial(Simulation(scenario, 0))._replace(wall_s=0)
    table = pq.read_table(tmp_path / "t.parquet")
    metadata = table.schema.metadata
    assert load_scenario(parse_yaml(metadata[b"scenario"].decode(), "metadata")) == scenario
    assert (metadata[b"seed"], json.loads(metadata[b"versions"])) == (b"0", versions())
    groups = math.ceil(result.steps / max(1, 35 // scenario.population))
    assert pq.ParquetFile(tmp_path / "t.parquet").num_row_groups == groups
    assert table.column_names == COLUMNS
    assert table.num_rows == result.steps * scenario.population
    numbers = np.column_stack([table[name].to_numpy().astype(float) for name in COLUMNS[:-1]])
    camera = np.array(table["camera"].to_pylist())
    simulation = Simulation(scenario, 0)
    for number, step in zip(range(result.steps), simulation, strict=False):
        rows = slice(number * scenario.population, (number + 1) * scenario.population)
        moment = np.full(scenario.population, number / 10), np.arange(scenario.population)
        seen = step.ring_on, step.phase_ms, step.flash_seen, step.distance_mm, step.infrared
        expected = np.column_stack([*moment, step.poses, step.wheels_cm_s, *seen])
        np.testing.assert_array_equal(numbers[rows], expected)
        np.testing.assert_array_equal(camera[rows], step.camera)


def test_where_the_trial_fails_or_has_no_step_an_older_trace_stays_and_nothing_else_is_left(tmp_path) -> None:
    path = tmp_path / "t.parquet"
    path.write_text("older")
    with pytest.raises(ZeroDivisionError), Trace(path, load_scenario("thesis"), 0):
        1 / 0  # noqa: B018
    said = r"t\.parquet: cannot be written: there was no step"
    with pytest.raises(EpuckSimError, match=said), Trace(path, load_scenario("thesis"), 0):
        pass
    with pytest.raises(EpuckSimError, match=r"t\.csv: a trace's name must end in \.parquet"):
        Trace(tmp_path / "t.csv", "thesis", 0)
    assert [each.read_text() for each in tmp_path.iterdir()] == ["older"]


def test_memory_and_relations_are_columns_if_asked_for(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(trace_module, "CHUNK_ROWS", 35)
    scenario = load_scenario("thesis", ["stop.max_cycles=3"])
    memory = ["rotation_time", "phase_ms"]
    with Trace(tmp_path / "t.parquet", scenario, 1, memory=memory, relations=True) as trace:
        result = run_trial(Simulation(scenario, 1), [trace])
    table = pq.read_table(tmp_path / "t.parquet")
    assert table.column_names == [*COLUMNS, "memory.rotation_time", "memory.phase_ms", "sees", "touches"]
    assert table["memory.phase_ms"].to_pylist() == table["phase_ms"].to_pylist()
    sees, touches = table["sees"].to_pylist(), table["touches"].to_pylist()
    for number, step in zip(range(result.steps), Simulation(scenario, 1), strict=False):
        rows = range(10 * number, 10 * number + 10)
        rotations = [table["memory.rotation_time"][row].as_py() for row in rows]
        assert rotations == step.memories[0]["rotation_time"].tolist()
        pairs = [[row % 10, seen] for row in rows for seen in sees[row]]
        assert sorted(pairs) == sorted(step.sightings.tolist())
        touching = [[row % 10, other] for row in rows for other in touches[row]]
        contacts = step.contacts.tolist()
        assert sorted(touching) == sorted([*contacts, *[[b, a] for a, b in contacts if b >= 0]])
    assert any(sees)
    assert any(touches)
