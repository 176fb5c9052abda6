"""Two oscillators behave as closed forms predict.

Two coupled oscillators, with the multiplicative curve and no refractory period: let y be the phase of the other one
when one fires. The pulse makes it (1 + e) y. If that is 1 or more both fire, and are one from then on. Else the other
one fires 1 - (1 + e) y later, and that is the phase of the first one by then: y' = 1 - (1 + e) y. This map has the
fixed point y* = 1 / (2 + e), which repels: y(n) - y* = (-(1 + e))^(n - 1) (y(1) - y*), and they are one from the first
firing n at which y(n) >= 1 / (1 + e). As y* < 1 / 2 < 1 / (1 + e), for e < 1, that takes a deviation upwards: of odd n
if y(1) > y*, of even n if below.

Two by the sawtooth curve: a receiver of a pulse comes nearer to it by a factor of 1 - kappa, so that after n firings,
one by turns, they are (1 - kappa)^n times as far apart as in the beginning. By the sine curve,
d' = d - kappa sin(2 pi d).
"""

import math

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from tests.particles.simulations import as_set, make_resting

inner = st.floats(0.001, 0.999)


def firings_until_one(first, epsilon):
    """Return at which firing two become one, if the other's phase is `first` at the first one."""
    fixed = 1 / (2 + epsilon)
    reach = 1 / (1 + epsilon) - fixed
    deviation = first - fixed
    if first >= 1 / (1 + epsilon):
        return 1
    # the smallest n, odd or even as above, with (1 + e)^(n - 1) |deviation| >= reach
    steps = math.log(reach / abs(deviation)) / math.log(1 + epsilon)
    assume(abs(steps - round(steps)) > 1e-6)
    steps = math.ceil(steps)
    return steps + 1 + ((steps % 2 == 1) if deviation > 0 else (steps % 2 == 0))


@given(inner, inner, st.sampled_from([0.02, 0.1, 0.3, 0.9]))
@settings(max_examples=60)
def test_two_oscillators_follow_the_return_map_and_become_one_when_it_says(one, other, epsilon):
    leader = int(other > one)
    first = 1 - abs(one - other)
    assume(abs(first - 1 / (2 + epsilon)) > 1e-3)
    assume(abs(one - other) > 1e-6)
    swarm = make_resting([one, other], response={"coupling": epsilon})
    until = firings_until_one(first, epsilon)
    phase, time_s = first, 1 - max(one, other)
    for firing in range(1, until + 1):
        event = next(swarm)
        turn = (leader + firing - 1) % 2
        assert event.time_s == pytest.approx(time_s, abs=1e-9)
        assert event.fired[0] == turn
        assert as_set(event.received) == {1 - turn}
        assert len(event.fired) == 1 + (firing == until)
        phase = 1 - (1 + epsilon) * phase
        time_s += phase
    assert swarm.phases() == pytest.approx([0, 0], abs=1e-15)


@given(inner, inner, st.sampled_from(["sawtooth", "sine"]), st.sampled_from([0.05, 0.1, 0.15]))
@settings(max_examples=60)
def test_by_delay_and_advance_two_come_nearer_at_each_firing_as_the_curve_says(one, other, curve, kappa):
    apart = min(abs(one - other), 1 - abs(one - other))
    assume(1e-3 < apart < 0.499)
    swarm = make_resting([one, other], response={"curve": curve, "coupling": kappa})
    for _ in range(40):
        if apart < 1e-9:
            break
        event = next(swarm)
        apart -= kappa * (apart if curve == "sawtooth" else math.sin(2 * math.pi * apart))
        phase = abs(swarm.phases()[1 - event.fired[0]])
        assert min(phase, 1 - phase) == pytest.approx(apart, abs=1e-11)
        assert len(event.fired) == 1
