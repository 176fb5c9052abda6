"""The three regimes of thesis Fig. 4.2: T_sync falls from near stop, rises at intermediate speed, and falls again."""

import numpy as np
import pytest

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.util.seeds import trial_seed


def synchronisation_times(speed_cm_s: float, trials: int) -> np.ndarray:
    scenario = load_scenario("thesis", [f"robots.0.parameters.speed_cm_s={speed_cm_s}"])
    results = [run_trial(Simulation(scenario, trial_seed(0, trial))) for trial in range(trials)]
    assert not any(result.censored for result in results)
    return np.array([result.t_sync_cycles for result in results])


def gap_in_standard_errors(longer: np.ndarray, shorter: np.ndarray) -> float:
    error = (longer.var(ddof=1) / len(longer) + shorter.var(ddof=1) / len(shorter)) ** 0.5
    return (longer.mean() - shorter.mean()) / error


def test_slow_robots_take_longer_than_medium_ones_and_those_longer_than_fast_ones() -> None:
    slow, medium, fast = (synchronisation_times(speed, 30) for speed in (0.05, 0.376, 12.8))
    assert gap_in_standard_errors(slow, medium) > 2
    assert gap_in_standard_errors(medium, fast) > 2


@pytest.mark.slow
def test_at_intermediate_speed_they_take_longer_than_at_a_lower_and_at_a_higher_one() -> None:
    lower, intermediate, higher = (synchronisation_times(speed, 1000) for speed in (0.376, 1.029, 2.821))
    assert gap_in_standard_errors(intermediate, lower) > 2
    assert gap_in_standard_errors(intermediate, higher) > 2
