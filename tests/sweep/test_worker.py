"""The work of a worker, and of pilots: new simulations, edits that are noticed, code that crashes or never returns."""

import time
from itertools import count, product, repeat

import pytest

from epuck_sim.runs.reader import read_points
from epuck_sim.scenario.loader import Point, load_scenario, points
from epuck_sim.sweep import demand, worker
from epuck_sim.sweep.demand import time_trials
from epuck_sim.sweep.run import run_sweep
from epuck_sim.sweep.worker import LIMIT_VARIABLE, Task, Watchdog, make_outcome, out_of_time, run_chunk
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.util.yaml_io import write_yaml
from tests.cli.commands import called
from tests.control.bench import with_step, write_soon_after
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import begin, errors, stored
from tests.tools import needs_compiler

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
        "schedule": [{"at_cycle": 2, "set": {"agents.speed_cm_s": 50}, "displace": {"by_cycles": "random"}}],
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
    return [Task(p, trial, False) for trial, p in product(range(trials), found)]


def outcomes(tasks: list[Task]):
    return [each._replace(wall_s=0.0) for each in run_chunk(tasks)]


@pytest.mark.parametrize("name", SCENARIOS)
def test_trials_of_a_chunk_are_those_of_new_simulations(name: str, monkeypatch) -> None:
    monkeypatch.setattr(worker, "_kept", {})
    tasks = tasks_of(SCENARIOS[name])
    simulations = (simulate(each.point.scenario, each.point.seed(each.trial)) for each in tasks)
    results = [run_trial(each)._replace(wall_s=0.0) for each in simulations]
    new = [*map(make_outcome, tasks, results, repeat(None))]
    made = []
    monkeypatch.setattr(worker, "simulate", lambda *given, **more: made.append(given) or simulate(*given, **more))
    assert outcomes(tasks) == outcomes(tasks[::-1])[::-1] == new
    plain = {type(None), int, float, str}
    assert {type(value) for each in new for value in (*each[:-1], *each.provenance)} <= plain  # ready to be stored
    points_made = len({each.point.number for each in tasks})
    assert len(made) == (2 * len(tasks) if "like" in name else points_made)


def test_an_edited_controller_is_set_up_anew_and_neither_failures_nor_too_many_are_kept(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(worker, "_kept", {})
    path = tmp_path / "mine.py"
    path.write_text(with_step("actuators.left_cm_s = 1"))
    tasks = tasks_of({"stop": {"max_time_s": 1}, "robots": [{"count": 2, "controller": str(path)}]}, 2)
    assert all(each.error is None for each in run_chunk(tasks))
    kept = [*worker._kept]
    write_soon_after(path, with_step("1 / 0"))
    assert all("ZeroDivisionError" in str(each.error) for each in run_chunk(tasks_of(tasks[0].point.scenario, 2)))
    assert [*worker._kept] == kept
    monkeypatch.setattr(worker, "KEPT", 1)
    monkeypatch.setattr(worker, "_kept", {})
    run_chunk(tasks_of(SCENARIOS["agents"]))
    assert len(worker._kept) == 1


def test_a_scenario_that_changes_on_disk_while_its_sweep_starts_runs_as_it_was_read(tmp_path) -> None:
    path, folder = tmp_path / "s.yaml", tmp_path / "run"
    path.write_text("{model: particles, trials: 2, stop: {max_cycles: 3}, sweep: {grid: {agents.count: [3, 4]}}}")
    changed = "{model: particles, trials: 9, sweep: {grid: {agents.count: [30]}}}"
    run_sweep(str(path), folder, pool_here, begin=lambda _: path.write_text(changed))
    assert [point.axes for point in read_points(folder)] == [{"agents.count": 3}, {"agents.count": 4}]
    assert load_scenario(folder).trials == 2
    assert path.read_text() == changed


@pytest.fixture(scope="module", autouse=True)
def _compiled() -> None:
    """Have compiled code in the cache: limits here are too short for compiling it."""
    for name in ("pair", "particles"):
        simulate(load_scenario(name), 1)


FATE = """
#define PARAMETERS E_INT(fatal)
#define MEMORY E_INT(fate) E_INT(steps)
#include <epuck.h>

void start(void) {{ memory->fate = e_random_word() % 3; }}

void step(void) {{
    memory->steps++;
    if (parameters->fatal && memory->fate == 0 && memory->steps > 3) {{
        {fatal}
    }}
}}
"""

CRASH, LOOP = "*(volatile int *)parameters->fatal = 1;", "while (memory->fate == 0) *e_swarm->serving += 0;"


@needs_compiler
def test_firmware_that_crashes_or_never_returns_costs_its_own_trials_alone(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.5")
    folder = tmp_path / "run"
    for name, fatal in (("crash", CRASH), ("loop", LOOP)):
        (tmp_path / f"{name}.c").write_text(FATE.format(fatal=fatal))
    (tmp_path / "sweep.yaml").write_text(
        "robots: [{count: 1, parameters: {fatal: 1}}]\nstop: {max_time_s: 1}\ntrials: 3\nseed: 1\n"
        "sweep: {grid: {robots.0.controller: [crash.c, loop.c]}}\n"
    )
    run = begin("sweep.yaml", "--out", folder, "--workers", 2, folder=tmp_path)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 1, err
    assert stored(folder) == 6
    failed = errors(folder)
    assert all("its worker died" in message for message in failed.values())
    assert sorted(trial for _, trial in failed) == [1, 2]  # of each controller one
    assert "robot 0, step 3: its controller has not returned for 0.5 s; its worker is ended\n" in err


def test_a_trial_that_goes_on_may_take_longer_than_a_step(monkeypatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.2")
    ended: list[str] = []
    monkeypatch.setattr(Watchdog, "_end", lambda _, why: ended.append(why))
    steps = count()
    with Watchdog() as dog:
        dog.begin("a trial")
        dog.watch_steps(lambda: (0, next(steps), "controller"))
        began = time.process_time()
        while time.process_time() - began < 0.6:
            pass
    assert ended == []


MEASURE = """
from itertools import count

def fate(simulation):
    for _ in count() if simulation.scenario.agents.count == 6 else ():
        pass
"""

CURVE = """
PARAMETERS = {"fatal": 0}

def phase_shift(phase, coupling, parameters):
    while parameters.fatal and abs(100 * phase - round(100 * phase)) > 1e-6:  # not where it is tried before trials
        coupling += 0
    return coupling * phase
"""

FEW = {"model": "particles", "agents": {"count": 5}, "stop": {"max_cycles": 3}, "trials": 1}


def run_endless(tmp_path, text: str, *options: object, **sections: object) -> tuple[dict, str]:
    """Run trials of agents at two points; return the errors of those that failed, and what was printed as error."""
    (tmp_path / "endless.py").write_text(text)
    (tmp_path / "sweep.yaml").write_text(write_yaml({**FEW, **sections}))
    run = begin("sweep.yaml", "--out", "run", "--workers", 1, *options, folder=tmp_path)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 1, err
    assert stored(tmp_path / "run") == 2
    failed = errors(tmp_path / "run")
    assert len(failed) == 1, err
    return failed, err


def test_a_curve_that_never_returns_is_heard_like_a_controller(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.5")
    axis = {"grid": {"response.parameters.fatal": [0, 1]}}
    failed, err = run_endless(tmp_path, CURVE, response={"curve": "endless.py"}, sweep=axis)
    assert all("its worker died" in message for message in failed.values())
    assert ": a measure or response curve has not returned for 0.5 s; its worker is ended\n" in err


def test_a_measure_that_never_returns_has_failed_when_its_time_is_up_and_status_says_why(tmp_path) -> None:
    axis = {"grid": {"agents.count": [5, 6]}}
    failed, err = run_endless(tmp_path, MEASURE, "--set", "trial_timeout_s=0.5", measures=["endless.py"], sweep=axis)
    assert set(failed.values()) == {out_of_time(0.5)}
    assert "1 trial failed; run again to retry them" in err
    assert called("status", tmp_path / "run").count(out_of_time(0.5)) == 1


def test_a_slow_trial_ends_itself_without_its_worker_and_may_be_run_with_another_limit(tmp_path) -> None:
    slow = load_scenario({"stop": {"max_cycles": 10**6}, "robots": [{"count": 5}], "trials": 1, "trial_timeout_s": 0.1})
    slow = slow.model_copy(update={"stop": slow.stop.model_copy(update={"order_parameter": None})})
    progress = run_sweep(slow, tmp_path / "run", pool_here)
    assert (progress.stored, progress.failed) == (0, 1)
    assert set(errors(tmp_path / "run").values()) == {out_of_time(0.1)}
    run_sweep(slow.model_copy(update={"trial_timeout_s": 0.05}), tmp_path / "run", pool_here)
    assert set(errors(tmp_path / "run").values()) == {out_of_time(0.05)}


def made(*settings: str):
    return points(load_scenario("pair", settings, ["robots.0.parameters.speed_cm_s=1,2,4,8"]))


def test_every_point_is_timed_as_often_if_there_is_time_and_what_compiling_takes_is_not_counted(monkeypatch) -> None:
    timed = time_trials(made("stop.max_cycles=2"), 60)
    assert sorted(each.point for each in timed) == sorted(5 * [0, 1, 2, 3])
    assert [each.point for each in timed[:4]] != [0, 1, 2, 3]
    assert not any(each.is_cut for each in timed)
    assert all(each.wall_s > 0 for each in timed)
    now, budgets = [0.0], []

    def time_trial(point: Point, _: int, budget_s: float) -> demand.TimedTrial:
        budgets.append(budget_s)
        now[0] += 2
        return demand.TimedTrial(point.number, 2, False)

    monkeypatch.setattr(demand.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(demand, "_time_trial", time_trial)
    assert len(time_trials(6 * made(), 5)) == 3  # also of more points than are timed at most
    assert budgets == [0, 5, 3, 1]


@pytest.mark.parametrize("scenario", ["thesis", "particles"])
def test_a_trial_that_takes_longer_is_cut(scenario: str) -> None:
    found = points(load_scenario(scenario, ["coupling=1e-6", "stop.max_cycles=1000000000"]))
    (timed,) = time_trials(found, 0.1)  # the trial itself would take years
    assert timed.is_cut
    assert timed.wall_s >= 0.1
