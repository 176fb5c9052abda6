"""Claims about the shipped rewards: closed forms, and the same for one swarm as in a batch."""

import numpy as np
import pytest

from epuck_sim.environments.rewards import Situation, aggregation, coverage, synchrony


def situation(poses, phase=None, side=60.0):
    poses = np.asarray(poses, float)
    shape = poses.shape[:-1]
    phases = np.full(shape, np.nan) if phase is None else np.asarray(phase, float)
    return Situation(np.zeros(shape[:-1]), poses, np.zeros((*shape, 2)), np.zeros(shape, bool), phases, side, side)


def test_synchrony_is_the_order_parameter_of_those_that_are_oscillators():
    poses = np.zeros((3, 4, 3))
    phases = [[0.2, 0.2, 0.2, np.nan], [0, 1 / 3, 2 / 3, np.nan], [0, 0.5, 0, np.nan]]
    np.testing.assert_allclose(synchrony(situation(poses, phases)), [1, 0, 1 / 3], atol=1e-12)


def test_aggregation_is_the_share_of_others_that_are_near():
    poses = [[10, 10, 0], [20, 10, 0], [34, 10, 0], [60, 60, 0]]
    np.testing.assert_allclose(aggregation(situation(poses)), [1 / 3, 2 / 3, 1 / 3, 0])
    assert aggregation(situation([[10, 10, 0]])).tolist() == [0]


def test_coverage_is_the_share_of_the_floor_near_robots():
    assert coverage(situation([[30, 30, 0]])) == pytest.approx(np.pi * 100 / 3600, rel=0.2)
    grid = [[x, y, 0] for x in (5, 15, 25, 35, 45, 55) for y in (5, 15, 25, 35, 45, 55)]
    assert coverage(situation(grid)) == 1


def test_batches_are_rewarded_as_one_by_one():
    random = np.random.default_rng(1)
    poses, phases = random.uniform(0, 60, (5, 7, 3)), random.random((5, 7))
    for reward in (synchrony, aggregation, coverage):
        alone = [reward(situation(p, q)) for p, q in zip(poses, phases, strict=True)]
        np.testing.assert_allclose(reward(situation(poses, phases)), alone)
