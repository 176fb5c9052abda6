"""The order parameter is skipped only where no phase difference allows it to reach the threshold."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.particles.oscillators import max_phase_offset


@given(st.lists(st.floats(-0.5, 0.5), min_size=1, max_size=30), st.floats(0, 0.5), st.floats(0, 1))
def test_max_phase_offset_never_rejects_phases_whose_order_reaches_the_threshold(offsets, width, share):
    phases = np.array([0.0, *offsets]) * 2 * width  # of the reference, and of others around it
    order = abs(np.exp(2j * np.pi * phases).mean())
    threshold = share * order
    if not threshold:
        return
    for reached in (threshold, order, np.nextafter(order, 0)):
        if 0 < reached <= 1:
            farthest = np.abs((phases + 0.5) % 1 - 0.5).max()
            assert farthest <= max_phase_offset(len(phases), float(reached))


@given(st.integers(2, 50), st.floats(-12, -0.01), st.floats(0, 1))
def test_a_phase_beyond_max_phase_offset_keeps_the_order_below_the_threshold(agents, exponent, share):
    threshold = 1 - 10**exponent
    near = max_phase_offset(agents, threshold)
    if near < 0.5:
        phases = np.zeros(agents)
        phases[-1] = near + 2e-7 + share * (0.5 - near)
        phases[1:-1] = phases[-1] / 2  # which is best
        assert abs(np.exp(2j * np.pi * phases).mean()) < threshold


def test_max_phase_offset_rejects_no_phase_where_all_may_pass():
    assert max_phase_offset(10, 0.5) == 1.0
    assert max_phase_offset(2, 1e-9) > 0.4999
    assert max_phase_offset(100_000, 0.9) == 1.0
