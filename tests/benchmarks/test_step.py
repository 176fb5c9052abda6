"""The cost of a control step, compared with a loop that has Python between its parts. Run by `make bench`.

Machines are noisy, so that speeds are compared within one run only: simulations of one seed take turns. Sensors and
controllers are the same in all of them.
"""

import statistics
import subprocess
import sys
import time

import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from epuck_sim.util.seeds import trial_seed
from tests.benchmarks.python_steps import PythonSteps

pytestmark = pytest.mark.benchmark

SWARMS = [
    (10, 60, 3.0),
    (10, 60, 12.8),
    (20, 100, 3.0),
    (100, 200, 3.0),
    (300, 400, 3.0),
    (1000, 700, 3.0),
]
"""Robots, the side of their arena in cm, and their speed in cm/s."""

CURVE_TARGET_S = 14
START_TARGET_S = 2
SETUP_TARGET_MS = 0.4

BLOCK = 50


@pytest.fixture(scope="module")
def costs():
    """(robots, side, speed) -> us a step taken at once, one by one, and with Python in between; printed as a table."""
    found: dict[tuple[int, int, float], tuple[float, ...]] = {}
    yield found
    print("\n\nCPU time of a control step in us, median of blocks that took turns")
    print("robots  side cm   cm/s  at once   a robot  one by one  in Python  ratio")
    for (robots, side, speed), (at_once, one_by_one, in_python, ratio) in found.items():
        print(
            f"{robots:6}  {side:7}  {speed:5}  {at_once:7.1f}  {at_once / robots:8.2f}  {one_by_one:10.1f}"
            f"  {in_python:9.1f}  {ratio:5.2f}"
        )


@pytest.mark.parametrize(("robots", "side", "speed"), SWARMS)
def test_a_control_step_beside_one_with_python_in_between(
    benchmark, costs, robots: int, side: int, speed: float
) -> None:
    settings = [f"robots.0.count={robots}", f"arena.width_cm={side}", f"arena.height_cm={side}"]
    scenario = load_scenario("thesis", [*settings, f"robots.0.parameters.speed_cm_s={speed}"])
    at_once, one_by_one = Simulation(scenario, 1), Simulation(scenario, 1)
    in_python = PythonSteps(Simulation(scenario, 1))
    ways = {
        "at_once": lambda: at_once.advance(BLOCK),
        "one_by_one": lambda: [next(one_by_one) for _ in range(BLOCK)],
        "in_python": lambda: in_python.advance(BLOCK),
    }
    spent_us: dict[str, list[float]] = {name: [] for name in ways}

    def take_turns() -> None:
        for name, take_steps in ways.items():
            began = time.thread_time()
            take_steps()
            spent_us[name].append((time.thread_time() - began) / BLOCK * 1e6)

    benchmark.pedantic(take_turns, rounds=max(6, 2000 // robots), warmup_rounds=1)
    found = [statistics.median(spent) for spent in spent_us.values()]
    ratio = statistics.median(a / b for a, b in zip(spent_us["in_python"], spent_us["at_once"], strict=True))
    costs[robots, side, speed] = (*found, ratio)
    benchmark.extra_info.update(zip((*ways, "ratio"), (*found, ratio), strict=True))


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
