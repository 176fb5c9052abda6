"""Claims about trials that look hopeless: who is told of them, when, and who is not."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from epuck_sim import load_scenario, run_trial
from epuck_sim.order_parameter import METRICS
from epuck_sim.trial.hopelessness import CYCLES, HopelessnessWatch, _of_random_phases, is_hopeless
from epuck_sim.trial.model import simulate


@pytest.mark.parametrize("metric", METRICS)
@pytest.mark.parametrize("oscillators", [2, 3, 10, 200])
def test_the_order_of_random_phases_is_that_of_phases_drawn_at_random(metric: str, oscillators: int) -> None:
    phases = np.random.default_rng(1).uniform(size=(20_000, oscillators))
    phases[:, 0] = 0.0  # the reference fires
    orders = METRICS[metric](phases, 1.0)
    mean, deviation = _of_random_phases(oscillators, metric)
    assert mean == pytest.approx(orders.mean(), abs=0.02 * orders.std() + 0.016 * mean)
    assert deviation == pytest.approx(orders.std(), rel=0.08)


def test_what_comes_closer_to_synchrony_is_not_hopeless_and_what_stands_still_is() -> None:
    nearer = 1 - 0.5 * 0.99 ** np.arange(CYCLES)
    assert not is_hopeless(nearer, 10)
    assert not is_hopeless(1 - 1e-7 * (1 - nearer), 10)  # however near it is
    assert is_hopeless(np.full(CYCLES, 0.7), 10)
    assert is_hopeless(np.ones(CYCLES), 1)  # one oscillator alone
    threshold, deviation = _of_random_phases(10, "complex")
    threshold += 3.0902 * deviation / math.sqrt(CYCLES)
    swing = 0.1 * (-1.0) ** np.arange(CYCLES)
    assert is_hopeless(threshold - 0.001 + swing, 10)
    assert not is_hopeless(threshold + 0.001 + swing, 10)


def told(orders: list[float], **state: object) -> list[tuple[int, float]]:
    found: list[tuple[int, float]] = []
    now = SimpleNamespace(cycles=0, is_synchronised=False, oscillators=10, **state)
    watch = HopelessnessWatch("complex", lambda mean: found.append((now.cycles, mean)))
    for now.order_parameter in orders:
        now.cycles += 1
        watch(now)
        watch(now)  # between two cycles it may be shown the same one again
    return found


def test_a_hopeless_trial_is_told_of_once_from_cycles_on_that_are_enough() -> None:
    assert told([0.2] * (CYCLES - 1)) == []
    assert told([0.2] * 5 * CYCLES) == [(CYCLES, pytest.approx(0.2))]
    assert told([0.9, 0.7] * CYCLES + [0.2] * 5 * CYCLES) == [(3 * CYCLES, pytest.approx(0.2))]
    assert told([None] * 5 + [0.2] * CYCLES) == [(CYCLES + 5, pytest.approx(0.2))]


def test_robots_that_are_hardly_coupled_are_hopeless() -> None:
    found: list[float] = []
    simulation = simulate(load_scenario("thesis", ["coupling=1e-6", "max_cycles=201"]), 3)
    run_trial(simulation, progress=HopelessnessWatch("complex", found.append))
    assert len(found) == 1


def test_whoever_watches_the_progress_of_point_agents_sees_order_parameters_and_changes_nothing() -> None:
    seen: list[float | None] = []
    scenario = load_scenario("particles", ["coupling=1e-6", "max_cycles=30000"])
    watched = run_trial(simulate(scenario, 3), progress=lambda state: seen.append(state.order_parameter))
    assert 2 * sum(order is not None for order in seen) >= len(seen) > 2
    assert watched._replace(wall_s=0) == run_trial(simulate(scenario, 3))._replace(wall_s=0)
