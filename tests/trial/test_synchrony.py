"""Claims about synchrony: the order parameters' closed forms, and what counts as a cycle."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.embodied.step import Step
from epuck_sim.order_parameter import order_parameter, reference_order_parameter
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.embodied import SynchronyWatch

TAU = 5000.0

phases = st.lists(st.floats(0, TAU, exclude_max=True), min_size=1, max_size=30).map(np.array)
both = pytest.mark.parametrize("metric", [order_parameter, reference_order_parameter])


# --- order parameters -------------------------------------------------------------------------------


@pytest.mark.parametrize("phase", [0, 100, 1250, 4999])
def test_only_the_reference_metric_asks_where_equal_phases_are(phase):
    equal = np.full(7, float(phase))
    assert order_parameter(equal, TAU) == pytest.approx(1)
    assert reference_order_parameter(equal, TAU) == pytest.approx(math.cos(2 * math.pi * phase / TAU))


@both
@pytest.mark.parametrize("robots", [2, 3, 4, 10, 99])
def test_evenly_spaced_phases_are_in_no_order(metric, robots):
    assert metric(TAU * np.arange(robots) / robots, TAU) == pytest.approx(0, abs=1e-12)


@both
@pytest.mark.parametrize("seconds", [0, 0.25, 0.5, 1.0, 1.25])
def test_half_early_and_half_late_gives_equation_c2(metric, seconds):
    spread = np.array([seconds, seconds, -seconds, -seconds]) % 5
    assert metric(spread, 5.0) == pytest.approx(math.cos(2 * math.pi * seconds / 5), abs=1e-12)


def test_a_quarter_second_of_spread_at_a_period_of_5_s_is_the_threshold_of_the_thesis():
    assert order_parameter(np.array([0.25, 4.75]), 5.0) == pytest.approx(0.95, abs=0.002)


@given(phases)
def test_order_parameters_lie_between_their_bounds(given_phases):
    assert 0 <= order_parameter(given_phases, TAU) <= 1 + 1e-12
    assert -1 - 1e-12 <= reference_order_parameter(given_phases, TAU) <= order_parameter(given_phases, TAU) + 1e-12


@given(phases, st.floats(0, TAU))
def test_the_complex_metric_does_not_ask_when_cycles_began(given_phases, shift):
    turned = order_parameter((given_phases + shift) % TAU, TAU)
    assert turned == pytest.approx(order_parameter(given_phases, TAU), abs=1e-9)


@both
def test_each_robots_phase_is_measured_by_its_own_period(metric):
    periods = np.array([2000.0, 5000.0, 8000.0])
    assert metric(0.1 * periods, periods) == pytest.approx(metric(np.full(3, 500.0), TAU))
    assert metric(np.array([500.0, 500.0, 500.0]), periods) < metric(np.full(3, 500.0), TAU)


# --- the watch --------------------------------------------------------------------------------------


def watch(periods, step_s=0.1, **stop):
    """Return a watch on robots with these periods in ms, NaN for no oscillator."""
    robots = [{"count": len(periods)}]
    timing = {"control_hz": round(1 / step_s), "physics_hz": 1000}
    arena = {"width_cm": 200, "height_cm": 200}
    scenario = load_scenario({"robots": robots, "stop": stop, "arena": arena, "timing": timing})
    return SynchronyWatch(SimpleNamespace(scenario=scenario, period_ms=np.array(periods, float), events=[]))


def step(number, rings, phase_ms):
    """Return a step in which these rings are lit and oscillators have these phases."""
    memory = np.array([(phase,) for phase in phase_ms], [("phase_ms", float)])
    nothing, lit = np.empty(0), np.array(rings, bool)
    return Step(number, 0.0, *[nothing] * 5, lit, lit, nothing, np.ones(len(lit), bool), None, (memory,), (), None)


def shown(watched, rings, phase_ms=(0, 0)):
    """Show a watch the reference's ring, step by step, and return its cycles after each."""
    cycles = []
    for number, ring in enumerate(rings):
        watched.look(step(number, [ring, not ring], phase_ms))
        cycles.append(watched.cycles)
    return cycles


@pytest.mark.parametrize(
    ("rings", "cycles"),
    [
        ([0, 1, 0, 1, 0], [0, 1, 1, 2, 2]),
        ([0, 0, 1, 1, 1, 0, 1], [0, 0, 1, 1, 1, 1, 2]),
        ([1, 1, 0, 0, 1], [1, 1, 1, 1, 2]),
        ([0, 0, 0], [0, 0, 0]),
    ],
)
def test_a_cycle_is_counted_when_the_references_ring_lights_up(rings, cycles):
    assert shown(watch([TAU, TAU]), rings) == cycles


def test_the_reference_is_the_robot_that_the_scenario_names():
    other = watch([TAU, TAU], reference_robot=1)
    assert shown(other, [0, 1, 0, 1, 0, 0]) == [1, 1, 2, 2, 3, 3]  # the other ring is lit where the first is not


@pytest.mark.parametrize(("metric", "expected"), [("complex", 1.0), ("reference", math.cos(0.4 * math.pi))])
def test_the_metric_is_the_scenarios(metric, expected):
    watched = watch([TAU, TAU], metric=metric)
    shown(watched, [0, 1], [1000, 1000])
    assert watched.order_parameter == pytest.approx(expected)
    assert watched.is_synchronised == (expected > 0.95)


def test_the_order_parameter_is_measured_at_firings_alone():
    watched = watch([TAU, TAU])
    watched.look(step(0, [0, 0], [0, 0]))
    assert (watched.order_parameter, watched.is_synchronised) == (None, False)
    watched.look(step(1, [1, 0], [0, 2500]))
    assert watched.order_parameter == pytest.approx(0, abs=1e-12)
    watched.look(step(2, [1, 0], [100, 100]))
    assert not watched.is_synchronised
    watched.look(step(3, [0, 0], [100, 100]))
    assert not watched.is_synchronised
    watched.look(step(4, [1, 1], [100, 100]))
    assert watched.is_synchronised


@pytest.mark.parametrize(("threshold", "synchronised"), [(0.8, True), (0.82, False)])
def test_synchronised_is_the_threshold_reached(threshold, synchronised):
    watched = watch([TAU, TAU], order_parameter=threshold)
    shown(watched, [1], [0, 1000])  # cos(0.2 pi) = 0.809
    assert watched.is_synchronised == synchronised


def test_a_swarm_that_was_synchronised_counts_as_such_whatever_it_does_later():
    watched = watch([TAU, TAU], further_cycles=3)
    seen = []
    for number, phase in enumerate([2500, 100, 2500, 0, 2500]):
        watched.look(step(2 * number, [1, 1], [0, phase]))
        watched.look(step(2 * number + 1, [0, 0], [100, 100]))
        seen.append((watched.cycles, watched.outcome.cycles, watched.is_synchronised, watched.is_over))
    assert seen == [(1, 1, False, False), *((cycles, 2, True, False) for cycles in (2, 3, 4)), (5, 2, True, True)]
    assert watched.order_parameter == pytest.approx(0, abs=1e-12)
    assert watched.outcome.order_parameter == pytest.approx(math.cos(math.pi * 100 / TAU))


def test_before_synchrony_the_outcome_is_that_of_the_last_firing():
    watched = watch([TAU, TAU])
    assert watched.outcome == (0, None)
    shown(watched, [0, 1, 0, 1], [0, 1000])
    assert watched.outcome == (2, watched.order_parameter)
    assert not watched.is_over


def test_robots_that_are_no_oscillators_do_not_count_and_periods_are_each_robots_own():
    watched = watch([2000, np.nan, 8000])
    watched.look(step(0, [1, 0, 0], [500, np.nan, 2000]))
    assert watched.order_parameter == pytest.approx(1)


@pytest.mark.parametrize(
    ("control_hz", "max_time_s", "steps"),
    [
        *[(10, 0.1, 1), (10, 0.3, 3), (10, 0.7, 7), (10, 60, 600), (10, 0.25, 3), (10, 0.01, 1)],
        *[(25, 0.28, 7), (25, 0.56, 14), (50, 0.14, 7), (100, 0.07, 7), (40, 1.1, 44), (200, 0.035, 7)],
    ],
)
def test_a_trial_is_censored_after_max_time_rounded_up_to_a_whole_step(control_hz, max_time_s, steps):
    watched = watch([TAU, TAU], 1 / control_hz, max_time_s=max_time_s)
    for number in range(steps):
        watched.look(step(number, [0, 0], [0, 2500]))
        assert watched.is_over == (number + 1 == steps)


@pytest.mark.parametrize("control_hz", [1, 8, 10, 25, 40, 1000])
def test_without_an_oscillator_every_5_s_count_as_a_cycle_and_nothing_is_measured(control_hz):
    watched = watch([np.nan, TAU], 1 / control_hz)
    for number in range(5 * control_hz * 2 + 1):
        watched.look(step(number, [number % 2, 1], [0, 0]))
        assert watched.cycles == (number + 1) // (5 * control_hz)
    assert (watched.cycles, watched.order_parameter, watched.is_synchronised) == (2, None, False)
