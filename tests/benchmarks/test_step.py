"""The cost of setting up a trial, of the base curve, and of a command. Run by `make bench`."""

import subprocess
import sys
import time

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.util.seeds import trial_seed

CURVE_TARGET_S = 14
START_TARGET_S = 2
SETUP_TARGET_MS = 0.4


def test_the_time_to_set_up_a_trial(benchmark) -> None:
    """Of a scenario that was seen before."""
    scenario = load_scenario("thesis")
    benchmark.pedantic(Simulation, (scenario, 1), rounds=200, warmup_rounds=5)
    print(f"\nsetting up a trial: {benchmark.stats.stats.median * 1e3:.2f} ms (target <= {SETUP_TARGET_MS})")


def test_the_base_curve_in_cpu_seconds(benchmark) -> None:
    """12 speeds x 30 trials of 10 robots, as in docs/figures/base_curve.py."""
    speeds = (0.05, 0.083, 0.137, 0.227, 0.376, 0.622, 1.029, 1.704, 2.821, 4.67, 7.732, 12.8)
    Simulation("thesis")

    def curve() -> None:
        for speed in speeds:
            scenario = load_scenario("thesis", [f"robots.0.parameters.speed_cm_s={speed}"])
            for trial in range(30):
                run_trial(Simulation(scenario, trial_seed(0, trial)))

    began = time.process_time()
    benchmark.pedantic(curve, rounds=1)
    print(f"\nbase curve, 360 trials: {time.process_time() - began:.1f} CPU s (target <= {CURVE_TARGET_S})")


def test_the_time_to_the_first_step(benchmark) -> None:
    """A new process with compiled code in the cache."""
    script = "from epuck_sim.cli.app import app; app(['run', 'pair', '--json'])"
    command = [sys.executable, "-c", script]
    subprocess.run(command, check=True, capture_output=True)
    benchmark.pedantic(subprocess.run, (command,), {"check": True, "capture_output": True}, rounds=5)
    print(f"\nstart to end of a trial of 34 steps: {benchmark.stats.stats.min:.2f} s (target <= {START_TARGET_S})")
