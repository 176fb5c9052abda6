"""Claims about docs/examples: the response begins as the thesis's, evolution finds one that synchronises sooner, and
the policies that are shipped do what their table says."""

from concurrent.futures import ThreadPoolExecutor
from importlib import import_module
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import Simulation, load_scenario
from epuck_sim.statistics.comparison import Samples, compare
from epuck_sim.testing import TestRobot

EXAMPLES = Path(__file__).parent.parent / "docs" / "examples"
RESPONSIVE = EXAMPLES / "responsive_firefly.py"


@pytest.fixture
def examples(monkeypatch):
    monkeypatch.syspath_prepend(EXAMPLES)
    return import_module


@pytest.mark.parametrize("period_s", [5.0, 1.7])
def test_as_it_stands_the_response_is_the_thesiss_to_the_bit(period_s):
    robots = {"count": 10, "parameters": {"speed_cm_s": 4.0, "period_s": period_s}}
    group = [{**robots, "controller": controller} for controller in (str(RESPONSIVE), "firefly")]
    runs = [islice(Simulation(load_scenario({"robots": [each]}), 3), 1000) for each in group]
    moved = 0
    for step, expected in zip(*runs, strict=True):
        assert step.poses.tobytes() == expected.poses.tobytes()
        assert step.phase_ms.tobytes() == expected.phase_ms.tobytes()
        moved += step.camera.any(axis=1).sum()
    assert moved > 100


@given(st.lists(st.floats(-0.1, 0.1), min_size=8, max_size=8), st.integers(0, 4999), st.booleans())
@settings(max_examples=30)
def test_a_flash_moves_the_phase_by_the_response_in_between_its_nodes(response, phase_ms, sees):
    nodes = {f"response_{node}": value for node, value in enumerate(response, 1)}
    robot = TestRobot(RESPONSIVE, nodes)
    robot.memory.phase_ms = phase_ms
    robot.camera[20:30] = sees
    robot.step()
    phase = phase_ms + 100
    beyond = 2 * response[-1] - response[-2]  # past the period the last line goes on
    if sees and phase > 750:
        phase = max(0.0, phase + 5000 * np.interp(phase, np.arange(10) * 625, [0, *response, beyond]))
    if abs(phase - 5000) > 1:  # it may fire there or not, as phases are truncated to whole ms
        assert robot.memory.phase_ms == pytest.approx(0 if phase >= 5000 else phase, abs=1.001)


def test_it_learns_from_trials_that_neither_measure_progress_nor_are_held_out(examples):
    """Of each generation the seeds differ, and all that is learnt stays within what is allowed."""
    learn_response, used = examples("learn_response"), []

    class Executor:
        def map(self, _, responses, seeds, **__):
            used.append(set(seeds))
            assert (np.abs(responses) <= learn_response.STRONGEST).all()
            return [type("Result", (), {"simulated_s": float(np.ptp(each))}) for each in responses]

    course = list(learn_response.evolve(Executor(), 3))
    checks, *learning = used[0], *used[1::2]
    assert all(each == checks for each in used[2::2])
    assert [len(each) for each in learning] == [learn_response.TRIALS] * 3
    assert len(set.union(checks, *learning)) == learn_response.CHECKS + 3 * learn_response.TRIALS
    assert [each.trials for each in course] == [0, 256, 512, 768]


@pytest.mark.slow
def test_it_learns_to_synchronise_sooner_than_the_thesis(examples):
    learn_response = examples("learn_response")
    with ThreadPoolExecutor(1) as executor:  # all trials take place in one simulation
        *_, last = learn_response.evolve(executor, generations=2)
        both, speed = (learn_response.THESIS, last.response), learn_response.SPEED_CM_S
        thesis, learnt = (learn_response.held_out(executor, each, speed, 60) for each in both)
    (comparison,) = compare(Samples(["thesis", "learnt"], [({}, [thesis, learnt])]))
    (point,) = comparison.points
    assert point.ratio.high < 0.5
    assert point.p_value < 0.001


@pytest.mark.parametrize("name", ["aggregation", "covering"])
def test_the_shipped_policies_are_worth_more_than_the_baselines(examples, name):
    random, thesis, learnt = (rewards for _, rewards in examples("learnt_policy").baselines(name, 4))
    assert learnt.min() > max(random.mean(), thesis.mean())


def test_the_policy_is_worth_as_much_as_a_controller(examples):
    learnt_policy = examples("learnt_policy")
    robots = [{"controller": str(EXAMPLES / "gathering.py"), "count": 10}]
    simulation = Simulation({"robots": robots}, interpret=True)
    (reward,) = learnt_policy.rewards_of_robots(learnt_policy.TASKS["aggregation"], simulation, 1)
    assert 0.45 < reward < 0.75  # 0.59 in figures/policy.txt, 0.15 by chance


def test_the_table_is_of_the_shipped_policies(examples):
    learnt_policy = examples("learnt_policy")
    rows = [line.split() for line in (EXAMPLES.parent / "figures/policy.txt").read_text().splitlines()[1:]]
    (mean,) = (float(row[2]) for row in rows if row[:2] == ["aggregation", "learnt"])
    policy = learnt_policy.learnt("aggregation", np.random.default_rng(1))
    few = learnt_policy.rewards_of(learnt_policy.TASKS["aggregation"], policy, 8)
    assert few.mean() == pytest.approx(mean, abs=4 * few.std() / np.sqrt(7))
