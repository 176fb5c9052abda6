"""Point agents on the command line: what it prints of a trial, and how a long one ends."""

import signal
import sys
from pathlib import Path

from epuck_sim.cli import progress
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from tests.cli.commands import call, called, cells, read, set_to, trials
from tests.processes import start, wait_until


def test_json_holds_what_the_library_gives() -> None:
    (row,) = trials(called("run", "particles", "--seed", 5, "--json"))
    expected = run_trial(ParticleSimulation("particles", 5))._asdict()
    del row["versions"]
    assert row == {**expected, "wall_s": 0, "events": []}


def test_a_trial_in_which_the_reference_never_fires_has_no_order_parameter() -> None:
    settings = [
        "agents={count: 2, speed_cm_s: 0}",
        "response={curve: sawtooth, coupling: 1}",
        "clocks.jitter=0.2",
        "stop.max_cycles=3",
    ]
    scenario = load_scenario("particles", settings)
    seed = next(seed for seed in range(500) if run_trial(ParticleSimulation(scenario, seed)).order_parameter is None)
    command = ["run", "particles", "--seed", seed, *set_to(*settings)]
    row = read(*command)
    assert (row["order_parameter"], row["cycles"], row["censored"]) == (None, 0, True)
    ((_, t_sync, censored, order, *_),) = cells(called(*command))
    assert (t_sync, censored, order) == ("-", "yes, at 0", "-")


def test_a_trial_of_robots_is_refused_in_a_folder_of_particles_that_is_no_sweep(tmp_path, sweeps_run_here) -> None:  # noqa: ARG001
    called_sweep = call("run", "particles", "--set", "stop.max_cycles=2", "--out", tmp_path / "run")
    assert called_sweep.exit_code == 0
    result = call("run", "pair", "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "  model: 'particles' in the folder, 'embodied' now\n" in result.stderr


LOUD = """
import runpy, sys
from epuck_sim.cli import progress
progress.LINE_S = 0.05
sys.argv[0] = "epuck-sim"
runpy.run_module("epuck_sim", run_name="__main__")
"""
"""The command, that tells more often how far it is."""


def test_ctrl_c_ends_a_long_trial_soon(tmp_path) -> None:
    options = set_to("agents.speed_cm_s=0", "response.coupling=0", "stop.max_cycles=1000000000")
    errors = tmp_path / "stderr"
    with errors.open("w") as stderr:
        path = {"PYTHONPATH": str(Path(progress.__file__).parents[2])}
        process = start([sys.executable, "-c", LOUD, "run", "particles", *options], env=path, stderr=stderr)
    wait_until(lambda: errors.read_text().count("x real time") > 3)
    process.send_signal(signal.SIGINT)
    stdout, _ = process.communicate(timeout=300)  # the trial itself would take hours
    assert (process.returncode, stdout) == (130, "")
    lines = errors.read_text().splitlines()
    assert lines[-1] == "interrupted"
    told = [line for line in lines[:-1] if not line.startswith("trial 1 of 1: ")]
    assert set(told) <= {"Ctrl-C is not heard in here; press it again to end at once"}  # a busy machine
