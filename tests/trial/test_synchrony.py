"""Claims about synchrony: the order parameters' closed forms, and what counts as a cycle."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.order_parameter import order_parameter, reference_order_parameter
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.embodied import SynchronyWatch
from tests.embodied.steps import bare_step

TAU = 5000.0


@settings(max_examples=30)
@given(st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.floats(100, 9000)), min_size=1, max_size=30))
def test_order_parameters_are_those_of_angles_by_each_robots_own_period(robots):
    shares, periods = np.array(robots).T
    angles = 2 * np.pi * shares
    assert order_parameter(shares * periods, periods) == pytest.approx(abs(np.exp(1j * angles).mean()), abs=1e-9)
    assert reference_order_parameter(shares * periods, periods) == pytest.approx(np.cos(angles).mean(), abs=1e-9)


def watch(periods, step_s=0.1, **stop):
    """Return a watch on robots with these periods in ms, NaN for no oscillator."""
    robots = [{"count": len(periods)}]
    timing = {"control_hz": round(1 / step_s), "physics_hz": 1000}
    arena = {"width_cm": 200, "height_cm": 200}
    scenario = load_scenario({"robots": robots, "stop": stop, "arena": arena, "timing": timing})
    return SynchronyWatch(SimpleNamespace(scenario=scenario, period_ms=np.array(periods, float), events=[]))


def step(number, rings, phase_ms):
    """Return a step in which these rings are lit and oscillators have these phases."""
    return bare_step(number, 0.0, np.array(rings, bool), phase_ms)


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
    other = watch([TAU, TAU, np.nan], reference_robot=1)
    for number, ring in enumerate(rings):
        other.look(step(number, [not ring, ring, 0], [0, 0, 0]))
    assert other.cycles == cycles[-1]


@pytest.mark.parametrize(("metric", "expected"), [("complex", 1.0), ("reference", math.cos(0.4 * math.pi))])
def test_the_metric_is_the_scenarios(metric, expected):
    watched = watch([2000, np.nan, 8000], metric=metric)  # each has a period of its own, or none
    assert watched.outcome == (0, None)
    watched.look(step(0, [1, 0, 0], [400, np.nan, 1600]))
    assert watched.order_parameter == pytest.approx(expected)
    assert watched.is_synchronised == (expected > 0.95)
    assert watched.outcome == (1, watched.order_parameter)


def test_a_trial_is_censored_after_max_time_rounded_up_to_a_whole_step():
    for control_hz, max_time_s, steps in [
        *[(10, 0.1, 1), (10, 0.3, 3), (10, 0.7, 7), (10, 60, 600), (10, 0.25, 3), (10, 0.01, 1)],
        *[(25, 0.28, 7), (25, 0.56, 14), (50, 0.14, 7), (100, 0.07, 7), (40, 1.1, 44), (200, 0.035, 7)],
    ]:
        watched = watch([TAU, TAU], 1 / control_hz, max_time_s=max_time_s)
        for number in range(steps):
            watched.look(step(number, [0, 0], [0, 2500]))
            assert watched.is_over == (number + 1 == steps)
