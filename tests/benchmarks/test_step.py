"""The cost of a control step, compared with the bare physics of the same world. Run by `make bench`.

Machines are noisy, so that speeds are compared within one run only: two simulations of one seed take turns, one timed
as a whole, the other around its ten calls of `Space.step`.
"""

import subprocess
import sys
import time
from itertools import islice

import pymunk.batch
import pytest

from epuck_sim.embodied import rigid_bodies
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from epuck_sim.util.seeds import trial_seed

pytestmark = pytest.mark.benchmark

SWARMS = {10: 60, 20: 60, 100: 221, 1000: 700}
"""Robots and the side of their arena in cm; from 100 on, as dense as 1,000 in 7 x 7 m."""

TARGETS = {10: 2.0, 1000: 6.0}
CURVE_TARGET_S = 40
START_TARGET_S = 2

BLOCK = 20


class TimedWorld(rigid_bodies.World):
    """A world that adds up how long its bare physics takes."""

    bare_s: float

    def advance(self, steps: int) -> None:
        space, step, step_s = self._space, self._space.step, self._step_s
        pymunk.batch.set_space_bodies(space, rigid_bodies._VELOCITIES, self._commands)
        began = time.perf_counter()
        for _ in range(steps):
            step(step_s)
        self.bare_s += time.perf_counter() - began
        self._poses.clear()
        pymunk.batch.get_space_bodies(space, rigid_bodies._POSES, self._poses)


@pytest.fixture(scope="module")
def costs():
    """Robots -> (us a step, us of bare physics); printed as a table at the end."""
    found: dict[int, tuple[float, float]] = {}
    yield found
    print("\n\nrobots  us a step  bare physics  ratio  us a robot  target")
    for robots, (step_us, bare_us) in found.items():
        target = f"<= {TARGETS[robots]} x bare" if robots in TARGETS else ""
        print(
            f"{robots:6}  {step_us:9.1f}  {bare_us:12.1f}  {step_us / bare_us:5.2f}  {step_us / robots:10.2f}  {target}"
        )
    if {100, 1000} <= found.keys():
        growth = (found[1000][0] / 1000) / (found[100][0] / 100)
        print(f"a robot among 1000 costs {growth:.2f} x one among 100 (target <= 2)")


@pytest.mark.parametrize("robots", SWARMS)
def test_a_control_step_beside_its_bare_physics(benchmark, costs, robots: int) -> None:
    side = SWARMS[robots]
    scenario = load_scenario(
        "thesis", [f"robots.0.count={robots}", f"arena.width_cm={side}", f"arena.height_cm={side}"]
    )
    plain, timed = Simulation(scenario, 1), Simulation(scenario, 1)
    timed._world.__class__ = TimedWorld
    timed._world.bare_s = 0.0
    for simulation in (plain, timed):
        list(islice(simulation, BLOCK))
    timed._world.bare_s = 0.0

    def block() -> None:
        for _ in range(BLOCK):
            next(plain)

    def beside() -> None:
        for _ in range(BLOCK):
            next(timed)

    benchmark.pedantic(block, setup=beside, rounds=max(10, 4000 // robots), iterations=1)
    steps = BLOCK * benchmark.stats.stats.rounds
    step_us = benchmark.stats.stats.total / steps * 1e6
    bare_us = timed._world.bare_s / steps * 1e6
    costs[robots] = (step_us, bare_us)
    benchmark.extra_info.update(step_us=step_us, bare_us=bare_us, ratio=step_us / bare_us)


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
