"""Firing times do not drift, the search in blocks finds the earliest, and order is skipped only where it is too low."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim.particles.oscillators import (
    BRANCHES,
    SIMULTANEITY_CYCLES,
    earliest_firing,
    firing_now,
    max_phase_offset,
    set_next_firing,
)
from epuck_sim.particles.swarm import SCENE, Oscillators
from tests.particles.simulations import make_simulation, max_phase_difference


def start_oscillators(phases, periods, *, has_parts=False):
    sizes = (-(-len(phases) // BRANCHES**level) if has_parts or level == 1 else 0 for level in (1, 2, 3))
    levels = (np.full(size, -math.inf) for size in sizes)
    return Oscillators(np.zeros(1, SCENE)[0], (1 - phases) * periods, periods, *levels)


def check_earliest(oscillators, found):
    """Return the earliest time, and who fires then, after a look at all."""
    earliest = earliest_firing(oscillators)
    assert earliest == oscillators.next_firing.min()
    firing = found[: firing_now(oscillators, earliest, found)].tolist()
    assert firing == np.flatnonzero(oscillators.next_firing <= earliest + SIMULTANEITY_CYCLES).tolist()
    return earliest, firing


@settings(max_examples=60)
@given(st.booleans(), st.integers(1, 3 * BRANCHES), st.integers(0, 2**32 - 1))
@example(True, BRANCHES**2 + 1, 1)
@example(True, BRANCHES**3 - 1, 2)
@example(True, 2 * BRANCHES**3 + 5, 3)
def test_the_earliest_is_the_earliest_of_all_after_any_changes_in_whatever_part_it_is(has_parts, agents, seed):
    random = np.random.default_rng(seed)
    oscillators = start_oscillators(random.random(agents), np.ones(agents), has_parts=has_parts)
    found = np.zeros(agents + 1, np.int64)
    for _ in range(40):
        earliest, firing = check_earliest(oscillators, found)
        for agent in firing if random.random() < 0.5 else ():
            set_next_firing(oscillators, agent, earliest + 1)
        for agent in random.integers(agents, size=random.integers(6)):  # some to the same instant, or to a later one
            now = oscillators.next_firing[agent]
            earlier = earliest + random.random() * (now - earliest)
            instants = earliest, earliest + 3e-13, earliest + 9e-13, earlier, now + random.random()
            set_next_firing(oscillators, agent, random.choice(instants))


CYCLES = 200_000  # whose times added up would be off by ten times more than is allowed


@pytest.mark.parametrize(("jitter", "period_s"), [(0, 0.3), (0.1, 1.0)])
def test_after_very_many_cycles_free_oscillators_are_where_they_should_be(jitter, period_s):
    swarm = make_simulation(
        4,
        agents={"count": 4, "speed_cm_s": 12.0},
        response={"coupling": 0},
        clocks={"jitter": jitter, "period_s": period_s},
    )
    start, periods = swarm.phases(), swarm._arrays.period.copy()
    assert (periods == 1).all() == (not jitter)
    for cycle in (10, 1001, CYCLES):
        swarm.run_to((cycle + 0.375) * period_s)
        turns = start + (cycle + 0.375) / periods
        assert max_phase_difference(swarm.phases(), turns % 1) < 1e-9
        assert swarm.firings == np.floor(turns).sum()
        assert swarm.cycles == math.floor(turns[0])
        assert swarm.time_s == pytest.approx((cycle + 0.375) * period_s, rel=1e-15)


def test_merged_oscillators_stay_merged_and_others_keep_their_distances_to_the_last_digit():
    free = make_simulation(4, agents={"count": 5}, response={"coupling": 0})
    merged = make_simulation(1, agents={"count": 20}, neighbourhood={"kind": "all"})
    free.run(2)
    merged.run(300)
    due = np.sort(free._arrays.next_firing - free._arrays.scene.now)
    instants, firings = merged.instants, merged.firings
    free.run(100_002)
    merged.run(100_300)
    assert (np.sort(free._arrays.next_firing - free._arrays.scene.now) == due).all()
    assert (merged.instants - instants, merged.firings - firings) == (100_000, 2_000_000)
    assert merged.order_parameter == 1


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
