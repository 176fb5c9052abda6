"""Response curves: their shapes, their caps, and what they do to the order of two."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.particles.phase_response import CURVES, Response, order_change, phase_shift
from tests.particles.naive_model import shift

MULTIPLICATIVE, MIROLLO_STROGATZ, PIECEWISE_LINEAR = 0, 4, 5
unit = st.floats(0, 1)


def phase_after_pulse(response, phase):
    return phase + float(phase_shift(response, phase))


@pytest.mark.parametrize("curve", range(6))
@given(st.floats(0, 5), st.floats(0, 0.499), unit, st.floats(0.01, 20), unit, st.floats(-3, 3))
def test_a_pulse_shifts_phases_beyond_the_refractory_period_by_the_curve_up_to_0_and_1(
    curve, coupling, refractory, phase, dissipation, knee, early_slope
):
    parameters = {"dissipation": dissipation, "knee": knee, "early_slope": early_slope}
    after = phase + shift(CURVES[curve], coupling, parameters, phase)
    expected = min(max(after, 0), 1) if phase > refractory else phase
    found = phase_after_pulse(Response(curve, coupling, refractory, dissipation, knee, early_slope), phase)
    assert found == pytest.approx(expected, abs=1e-9)
    assert 0 <= found <= 1
    assert phase > refractory or found == phase


@given(st.sampled_from([0, 1, 2]), unit, st.floats(0, 0.499), unit)
def test_the_change_is_that_of_the_complex_order_parameter_of_two(curve, coupling, refractory, phase):
    def order(other):
        return abs(1 + np.exp(2j * math.pi * other)) / 2  # of the one that fires, at 1 or 0, and the other

    response = Response(curve, coupling, refractory)
    assert curve == MULTIPLICATIVE or order_change(response, [phase])[0] >= -1e-12  # delay and advance drive none apart
    expected = order(phase_after_pulse(response, phase)) - order(phase)
    assert order_change(response, [phase])[0] == pytest.approx(expected, abs=1e-12)


def test_shapes_are_kept_whether_or_not_an_array_is_a_block():
    response = Response(MULTIPLICATIVE, 0.1, 0.0)
    for shape in ((), (3, 4), (0,)):
        phases = np.linspace(0.1, 0.9, math.prod(shape)).reshape(shape).T
        assert phase_shift(response, phases) == pytest.approx(0.1 * phases)
        assert order_change(response, phases).shape == phases.shape
