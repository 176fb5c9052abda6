"""The work of a worker: simulations that are started anew give what new ones give, and notice what has changed."""

from itertools import product
from pathlib import Path

import pytest

from epuck_sim.runs.reader import read_points
from epuck_sim.runs.records import Task
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.sweep import worker
from epuck_sim.sweep.run import run_sweep
from epuck_sim.sweep.worker import run_chunk
from epuck_sim.trial.model import run_trial, simulate
from tests.control.bench import with_step, write_soon_after
from tests.sweep.pool_here import pool_here

SHORT = {"name": "short", "stop": {"max_cycles": 4}}
SCENARIOS = {
    "robots": {**SHORT, "robots": [{"count": 3}], "sweep": {"grid": {"robots.0.parameters.speed_cm_s": [1, 8]}}},
    "a schedule of robots": {
        **SHORT,
        "robots": [{"count": 3}],
        "schedule": [{"at_s": 2, "set": {"robots.0.parameters.speed_cm_s": 2}}, {"at_s": 7, "remove": [2]}],
        "measures": ["order_parameter"],
    },
    "faults": {**SHORT, "robots": [{"count": 3}], "faults": [{"kind": "ring_dead", "share": 0.4, "at_s": 3}]},
    "agents": {
        **SHORT,
        "model": "particles",
        "agents": {"count": 9, "speed_cm_s": 5},
        "schedule": [{"at_cycle": 2, "set": {"agents.speed_cm_s": 50}}],
        "sweep": {"grid": {"response.coupling": [0.1, 0.3]}},
    },
    "agents like robots": {
        **SHORT,
        "model": "particles",
        "agents": {"count": 10},
        "space": {"side_cm": 60},
        "start": {"like": "thesis"},
    },
}


def tasks_of(given, trials: int = 4) -> list[Task]:
    found = points(load_scenario(given))
    return [Task(p.number, trial, p.key, p.scenario, False) for trial, p in product(range(trials), found)]


def outcomes(tasks: list[Task]):
    return [each.result and each.result._replace(wall_s=0.0) for each in run_chunk(tasks)]


@pytest.mark.parametrize("name", SCENARIOS)
def test_trials_of_a_chunk_are_those_of_new_simulations(name: str, monkeypatch) -> None:
    monkeypatch.setattr(worker, "_kept", {})
    tasks = tasks_of(SCENARIOS[name])
    new = [run_trial(simulate(each.scenario, each.seed))._replace(wall_s=0.0) for each in tasks]
    made = []
    monkeypatch.setattr(worker, "simulate", lambda *given, **more: made.append(given) or simulate(*given, **more))
    assert outcomes(tasks) == outcomes(tasks[::-1])[::-1] == new
    points_made = len({each.point for each in tasks})
    assert len(made) == (2 * len(tasks) if "like" in name else points_made)


def test_a_controller_that_is_edited_between_two_chunks_is_set_up_anew(tmp_path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(with_step("actuators.left_cm_s = 1"))
    tasks = tasks_of({"stop": {"max_time_s": 1}, "robots": [{"count": 2, "controller": str(path)}]}, 2)
    first = run_chunk(tasks)
    assert all(each.error is None for each in first)
    write_soon_after(path, with_step("1 / 0"))
    assert all("ZeroDivisionError" in str(each.error) for each in run_chunk(tasks_of(tasks[0].scenario, 2)))


def test_a_trial_that_fails_leaves_no_simulation_behind(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(worker, "_kept", {})
    path = tmp_path / "mine.py"
    path.write_text(with_step("1 / 0"))
    run_chunk(tasks_of({"stop": {"max_time_s": 1}, "robots": [{"count": 2, "controller": str(path)}]}, 2))
    assert worker._kept == {}


def test_no_more_simulations_are_kept_than_memory_allows(monkeypatch) -> None:
    monkeypatch.setattr(worker, "_kept", {})
    monkeypatch.setattr(worker, "KEPT", 1)
    run_chunk(tasks_of(SCENARIOS["agents"]))
    assert len(worker._kept) == 1


def test_a_scenario_that_changes_on_disk_while_its_sweep_starts_runs_as_it_was_read(tmp_path) -> None:
    path, folder = tmp_path / "s.yaml", tmp_path / "run"
    path.write_text("{model: particles, trials: 2, stop: {max_cycles: 3}, sweep: {grid: {agents.count: [3, 4]}}}")

    def change(_) -> None:
        path.write_text("{model: particles, trials: 9, sweep: {grid: {agents.count: [30]}}}")

    run_sweep(str(path), folder, pool_here, begin=change)
    assert [point.axes for point in read_points(folder)] == [{"agents.count": 3}, {"agents.count": 4}]
    assert load_scenario(folder).trials == 2
    assert Path(path).read_text() == "{model: particles, trials: 9, sweep: {grid: {agents.count: [30]}}}"
