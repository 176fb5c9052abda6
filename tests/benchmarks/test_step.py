"""The cost of a control step, compared with the bare physics of the same world. Run by `make bench`.

Machines are noisy, so that speeds are compared within one run only: two simulations of one seed take turns, one as it
is, the other with bodies moved by pymunk's own methods, which is timed around its ten calls of `Space.step`, too.
"""

import subprocess
import sys
import time

import pymunk.batch
import pytest

from epuck_sim.embodied import rigid_bodies
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

CURVE_TARGET_S = 40
START_TARGET_S = 2

BLOCK = 20


class SteppedByPymunk(rigid_bodies.World):
    """A world that calls pymunk's own methods, and adds up how long its bare physics takes."""

    bare_s: float

    def advance(self, steps: int) -> None:
        space, step, step_s = self._space, self._space.step, self._step_s
        pymunk.batch.set_space_bodies(space, rigid_bodies._VELOCITIES, self._commands)
        began = time.thread_time()
        for _ in range(steps):
            step(step_s)
        self.bare_s += time.thread_time() - began
        self._poses.clear()
        pymunk.batch.get_space_bodies(space, rigid_bodies._POSES, self._poses)


@pytest.fixture(scope="module")
def costs():
    """(robots, side, speed) -> us a step, the same with pymunk's methods, bare physics; printed as a table."""
    found: dict[tuple[int, int, float], tuple[float, float, float]] = {}
    yield found
    print("\n\nCPU time of a control step in us, beside bare physics and beside a step with pymunk's own methods")
    print("robots  side cm   cm/s     step   a robot  bare physics  ratio  with pymunk's methods  ratio")
    for (robots, side, speed), (step, by_pymunk, bare) in found.items():
        print(
            f"{robots:6}  {side:7}  {speed:5}  {step:7.1f}  {step / robots:8.2f}  {bare:12.1f}  {step / bare:5.2f}"
            f"  {by_pymunk:21.1f}  {by_pymunk / step:5.2f}"
        )


@pytest.mark.parametrize(("robots", "side", "speed"), SWARMS)
def test_a_control_step_beside_its_bare_physics(benchmark, costs, robots: int, side: int, speed: float) -> None:
    settings = [f"robots.0.count={robots}", f"arena.width_cm={side}", f"arena.height_cm={side}"]
    scenario = load_scenario("thesis", [*settings, f"robots.0.parameters.speed_cm_s={speed}"])
    plain, by_pymunk = Simulation(scenario, 1), Simulation(scenario, 1)
    by_pymunk._world.__class__ = SteppedByPymunk
    by_pymunk._world.bare_s = 0.0
    spent_s = {plain: 0.0, by_pymunk: 0.0}

    def take_steps(simulation: Simulation) -> None:
        began = time.thread_time()
        for _ in range(BLOCK):
            next(simulation)
        spent_s[simulation] += time.thread_time() - began

    for simulation in spent_s:
        take_steps(simulation)
    by_pymunk._world.bare_s = 0.0
    spent_s.update(dict.fromkeys(spent_s, 0.0))
    rounds = max(10, 4000 // robots)
    benchmark.pedantic(take_steps, (plain,), setup=lambda: take_steps(by_pymunk), rounds=rounds, iterations=1)
    steps = BLOCK * rounds
    found = [seconds / steps * 1e6 for seconds in (*spent_s.values(), by_pymunk._world.bare_s)]
    costs[robots, side, speed] = tuple(found)
    benchmark.extra_info.update(zip(("step_us", "by_pymunk_us", "bare_us"), found, strict=True))


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
