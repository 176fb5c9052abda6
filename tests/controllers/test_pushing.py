"""`pushing` drives straight ahead while its ring is lit and stands else: what is heavy, only robots in step move."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.testing import TestRobot
from epuck_sim.trial.model import run_trial, simulate

CYCLES_PER_HOUR = 720
LIT_S = 0.4  # of the steps at phases 0, 100, 200 and 300 ms


@pytest.fixture(params=[True, False], ids=["interpreted", "compiled"])
def robot(request) -> TestRobot:
    return TestRobot("pushing", speed_cm_s=3, interpret=request.param)


def test_it_drives_while_it_is_lit_and_stands_else(robot):
    robot.memory.phase_ms = 4800
    lit = []
    for _ in range(60):
        robot.step()
        assert (robot.left_cm_s, robot.right_cm_s) == ((3, 3) if robot.ring_on else (0, 0))
        lit.append(bool(robot.ring_on))
    assert sum(lit) == 8
    assert lit[1:5] == [True] * 4


def test_it_flashes_as_an_oscillator(robot):
    oscillator = TestRobot("oscillator")
    for each in (robot, oscillator):
        each.memory.phase_ms = 2000
        each.camera[7] = 1
    for _ in range(100):
        robot.step()
        oscillator.step()
        assert (robot.ring_on, robot.memory.phase_ms) == (oscillator.ring_on, oscillator.memory.phase_ms)


def test_wheels_have_a_limit():
    with pytest.raises(ScenarioError, match="speed_cm_s is 13"):
        load_scenario("pushing", ["robots.0.parameters.speed_cm_s=13"])


def moved(phases_ms, friction):
    """Return how far the disc comes in an hour, cm, of robots with these phases, which nothing changes."""
    changes = {"robots.0.memory": {"phase_ms": phases_ms}, "arena.movables.0.friction": friction}
    settings = [f"{key}={value}" for key, value in changes.items()]
    settings += ["robots.0.parameters.coupling=0.000001", "noise=off", "stop.max_cycles=30"]
    return run_trial(simulate(load_scenario("pushing", settings), 1)).measures["moved"]


@pytest.mark.parametrize("needed", [1, 2, 3, 4])
def test_a_disc_moves_at_the_flashes_of_as_many_as_it_takes(needed):
    """The claim of docs/open_questions.md: who flashes at once adds forces, who flashes at other times does not."""
    friction = (needed - 0.5) * 0.5 / 9.81  # times 1 kg
    for together in (1, 2, 3, 4):
        phases_ms = [2500] * together + [1500, 500, 3500][: 4 - together]
        found = moved(phases_ms, friction)
        if together < needed:
            assert found < 0.01 * CYCLES_PER_HOUR * LIT_S * 2
        else:
            # of 30 cycles, up to 14 are over before all have come as far as the disc
            assert 0.4 < found / (CYCLES_PER_HOUR * LIT_S * 2) < 1
