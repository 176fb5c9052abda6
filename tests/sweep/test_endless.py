"""Users' code that crashes, never returns or takes too long costs a sweep its own trial alone; edits are noticed."""

import time
from itertools import count

import pytest

from epuck_sim.scenario.loader import load_scenario
from epuck_sim.sweep.run import run_sweep
from epuck_sim.sweep.worker import LIMIT_VARIABLE, Watchdog, out_of_time, watchdog
from epuck_sim.trial.model import simulate
from tests.cli.commands import called
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import begin, errors, stored
from tests.tools import needs_compiler


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


def write_sweep(folder, **fatal):
    """Write a sweep of 3 trials with each controller, by its name, one of which does what is fatal."""
    for name, what in fatal.items():
        (folder / f"{name}.c").write_text(FATE.format(fatal=what))
    files = ", ".join(f"{name}.c" for name in fatal)
    path = folder / "sweep.yaml"
    path.write_text(
        "robots: [{count: 1, parameters: {fatal: 1}}]\nstop: {max_time_s: 1}\ntrials: 3\nseed: 1\n"
        f"sweep: {{grid: {{robots.0.controller: [{files}]}}}}\n"
    )
    return path


@needs_compiler
def test_firmware_that_crashes_or_never_returns_costs_its_own_trials_alone(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.5")
    folder = tmp_path / "run"
    path = write_sweep(tmp_path, crash=CRASH, loop=LOOP)
    run = begin(path, "--out", folder, "--workers", 2, folder=tmp_path)
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
    with watchdog() as dog:
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

AGENTS = "{model: particles, agents: {count: 5}, stop: {max_cycles: 3}, trials: 1, KEY: VALUE, sweep: {grid: {AXIS}}}"

ENDLESS = {MEASURE: ("measures", "[endless.py]", "agents.count: [5, 6]")}
ENDLESS[CURVE] = ("response", "{curve: endless.py}", "response.parameters.fatal: [0, 1]")


def run_endless(tmp_path, text: str, *options: object) -> tuple[dict, str]:
    """Run trials of agents at two points; return the errors of those that failed, and what was printed as error."""
    (tmp_path / "endless.py").write_text(text)
    scenario = AGENTS
    for name, value in zip(("KEY", "VALUE", "AXIS"), ENDLESS[text], strict=True):
        scenario = scenario.replace(name, value)
    (tmp_path / "sweep.yaml").write_text(scenario)
    run = begin("sweep.yaml", "--out", "run", "--workers", 1, *options, folder=tmp_path)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 1, err
    assert stored(tmp_path / "run") == 2
    failed = errors(tmp_path / "run")
    assert len(failed) == 1, err
    return failed, err


def test_a_curve_that_never_returns_is_heard_like_a_controller(tmp_path, monkeypatch) -> None:
    monkeypatch.setenv(LIMIT_VARIABLE, "0.5")
    failed, err = run_endless(tmp_path, CURVE)
    assert all("its worker died" in message for message in failed.values())
    assert ": a measure or response curve has not returned for 0.5 s; its worker is ended\n" in err


def test_a_measure_that_never_returns_has_failed_when_its_time_is_up_and_status_says_why(tmp_path) -> None:
    failed, err = run_endless(tmp_path, MEASURE, "--trial-timeout", 0.5)
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
