"""The cost of a control step, compared with ten bare steps of pymunk with as many bodies. Run by `make bench`.

Machines are noisy, so that speeds are compared within one run only: simulations and the space take turns.
"""

import statistics
import subprocess
import sys
import time

import pymunk
import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from epuck_sim.util.seeds import trial_seed

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
    """(robots, side, speed) -> us a step taken at once, one by one, and of a bare space; printed as a table."""
    found: dict[tuple[int, int, float], tuple[float, ...]] = {}
    yield found
    print("\n\nCPU time of a control step in us, median of blocks that took turns")
    print("robots  side cm   cm/s  at once   a robot  one by one  ten bare physics steps  ratio")
    for (robots, side, speed), (at_once, one_by_one, bare, ratio) in found.items():
        print(
            f"{robots:6}  {side:7}  {speed:5}  {at_once:7.1f}  {at_once / robots:8.2f}  {one_by_one:10.1f}"
            f"  {bare:22.1f}  {ratio:5.2f}"
        )


def bare_space(poses: list[list[float]]) -> pymunk.Space:
    """Return a space with as many discs as robots, which stand still."""
    space = pymunk.Space()
    for x, y, _ in poses:
        body = pymunk.Body(150, pymunk.moment_for_circle(150, 0, 3.7))
        body.position = x, y
        space.add(body, pymunk.Circle(body, 3.7))
    return space


@pytest.mark.parametrize(("robots", "side", "speed"), SWARMS)
def test_a_control_step_beside_ten_bare_steps_of_pymunk(benchmark, costs, robots: int, side: int, speed: float) -> None:
    settings = [f"robots.0.count={robots}", f"arena.width_cm={side}", f"arena.height_cm={side}"]
    scenario = load_scenario("thesis", [*settings, f"robots.0.parameters.speed_cm_s={speed}"])
    at_once, one_by_one = Simulation(scenario, 1), Simulation(scenario, 1)
    space = bare_space(at_once.last_step.poses.tolist())
    ways = {
        "at_once": lambda: at_once.advance(BLOCK),
        "one_by_one": lambda: [next(one_by_one) for _ in range(BLOCK)],
        "bare": lambda: [space.step(0.01) for _ in range(10 * BLOCK)],
    }
    spent_us: dict[str, list[float]] = {name: [] for name in ways}

    def take_turns() -> None:
        for name, take_steps in ways.items():
            began = time.thread_time()
            take_steps()
            spent_us[name].append((time.thread_time() - began) / BLOCK * 1e6)

    benchmark.pedantic(take_turns, rounds=max(6, 2000 // robots), warmup_rounds=1)
    found = [statistics.median(spent) for spent in spent_us.values()]
    ratio = statistics.median(a / b for a, b in zip(spent_us["at_once"], spent_us["bare"], strict=True))
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
