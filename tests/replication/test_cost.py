"""What the full version of a sweep costs, by hand."""

import numpy as np
import pytest

from epuck_sim import load_scenario
from epuck_sim.replication.sweeps import estimate_cost
from epuck_sim.runs.reader import PointTrials

FULL = load_scenario("particles", ["stop.max_cycles=1000", "trials=50"], ["agents.speed_cm_s=1,10,100"])


def point(times, limit: int = 100, has_t_sync: bool = True) -> PointTrials:
    cycles = np.array(times, float)
    seeds = tuple(range(len(times)))
    return PointTrials(0, "", {}, FULL, cycles, cycles < limit, seeds, has_t_sync=has_t_sync)


def test_trials_that_end_cost_as_much_each_in_both_versions() -> None:
    cost = estimate_cost([point([10, 30]), point([20, 20])], 8.0, FULL)
    assert cost == pytest.approx((300, 300))  # 2 s each, of 3 points with 50 trials


def test_censored_trials_may_take_as_long_as_the_limit_is_longer() -> None:
    cost = estimate_cost([point([100, 100])], 4.0, FULL)
    assert cost == pytest.approx((300, 3000))


def test_trials_without_t_sync_go_on_to_the_limit() -> None:
    cost = estimate_cost([point([100, 100], has_t_sync=False)], 4.0, FULL)
    assert cost == pytest.approx((3000, 3000))
