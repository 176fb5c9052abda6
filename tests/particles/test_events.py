"""The kernel agrees with the naive model, event by event."""

import itertools

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.particles.naive_model import NaiveModel
from tests.particles.simulations import (
    KINDS,
    any_sections,
    as_set,
    compare_events,
    make_resting,
    make_simulation,
    state_of,
)

SEEDS = st.integers(0, 2**32 - 1)
kinds = pytest.mark.parametrize("kind", KINDS)


def compare(kind, data, seed, cycles, **limits):
    swarm = make_simulation(seed, **data.draw(any_sections(kind, **limits)))
    compare_events(swarm, NaiveModel(swarm), cycles=cycles)


@kinds
@given(st.data(), SEEDS)
@settings(max_examples=12)
def test_every_event_is_that_of_the_naive_model(kind, data, seed):
    compare(kind, data, seed, cycles=15)


@kinds
@given(st.data(), SEEDS)
@settings(max_examples=300)
@pytest.mark.slow
def test_every_event_is_that_of_the_naive_model_in_many_more_and_larger_swarms(kind, data, seed):
    compare(kind, data, seed, cycles=50, most_agents=data.draw(st.sampled_from([7, 7, 7, 50])))


@kinds
def test_the_comparison_with_the_naive_model_does_not_end_early(kind):
    rule = {
        "nearest": {"k": 2},
        "range": {"radius_cm": 30},
        "cone_of_vision": {"angle_deg": 80, "radius_cm": 70},
        "cone_of_emission": {"angle_deg": 200},
        "all": {},
        "random": {"k": 2},
    }[kind]
    for dimensions, boundary in itertools.product([1, 2, 3], ["bounded", "cyclic", "mirrored"]):
        swarm = make_simulation(
            space={"dimensions": dimensions, "boundary": boundary},
            agents={"count": 6, "speed_cm_s": 15.0},
            neighbourhood={"kind": kind, **rule},
        )
        twin = NaiveModel(swarm)
        assert compare_events(swarm, twin, cycles=20) >= 120
        assert twin.time >= 20


@kinds
@given(st.data(), SEEDS, st.integers(1, 20))
@settings(max_examples=12)
def test_in_one_go_in_slices_at_stops_looked_at_or_event_by_event_a_swarm_is_the_same(kind, data, seed, cycles):
    sections = data.draw(any_sections(kind, most_agents=12))
    at_once, sliced, by_pulse, looked, by_event, stopped = (make_simulation(seed, **sections) for _ in range(6))
    at_once.run(cycles, 200)  # a reference that others hold back may never get there
    if at_once.period >= 200:
        return
    slices = iter([*data.draw(st.lists(st.integers(1, 5), max_size=5)), *[1, 3] * 200])
    pulses = data.draw(st.integers(1, 30))
    for share in sorted(data.draw(st.lists(st.floats(0, 0.999), max_size=30))):
        stopped.run_to(share * at_once.time_s)
        assert stopped.time_s == pytest.approx(share * at_once.time_s, abs=1e-12 * stopped.scenario.clocks.period_s)
        assert ((stopped.phases() >= -1e-9) & (stopped.phases() <= 1 + 1e-9)).all()
        assert not stopped.is_synchronised  # `at_once` stopped where that is first so
    ways = {
        sliced: lambda: sliced.run(cycles, next(slices)),
        by_pulse: lambda: by_pulse.run(cycles, pulses=pulses),
        looked: lambda: (looked.run(cycles, 1), looked.positions()),
        by_event: lambda: next(by_event),
        stopped: lambda: stopped.run(cycles, 200),
    }
    for other, go_on in ways.items():
        while other.cycles < cycles and not other.is_synchronised:
            go_on()
        assert state_of(other) == state_of(at_once)
        assert other.outcome == at_once.outcome
        assert (other.time_s, other.instants, other.firings) == (at_once.time_s, at_once.instants, at_once.firings)
        assert other.is_synchronised == at_once.is_synchronised


def test_what_happens_at_the_very_time_has_happened():
    swarm = make_resting([0.5, 0.25])
    for _ in range(2):
        swarm.run_to(0.5)
        assert (swarm.instants, swarm.time_s, swarm.phases()[0]) == (1, 0.5, 0)


def test_a_phase_of_exactly_1_fires():
    event = next(make_resting([0.75, 0.25], response={"coupling": 1.0}))
    assert (as_set(event.fired), as_set(event.received)) == ({0, 1}, {1})


@pytest.mark.parametrize("refractory", [0.25, 0.0, 0.4375])
def test_up_to_and_at_the_end_of_the_refractory_period_no_pulse_is_received(refractory):
    just_after = refractory + 2.0**-40
    for phase, is_received in [(refractory, False), (refractory / 2, False), (just_after, True)]:
        # agent 1 is at `phase` when agent 0 fires: all of these are exact in binary
        swarm = make_resting([0.5, 0.0], response={"refractory": refractory})
        swarm._arrays.next_firing[:] = 0.5, 0.5 + (1 - phase)
        event = next(swarm)
        assert as_set(event.received) == ({1} if is_received else set())
        assert swarm.phases()[1] == pytest.approx(1.1 * phase if is_received else phase, abs=1e-15)


@pytest.mark.parametrize(
    ("firings", "first"),
    [
        ([0.5, 0.5, 1.4], {0, 1}),
        ([0.5, 0.5 + 9e-13, 1.4], {0, 1}),
        ([0.5, 0.5 + 1.2e-12, 0.5 + 1.2e-12], {0}),
        ([0.5 + 8e-13, 0.5, 0.5 + 1.6e-12], {0, 1}),  # counted from the earliest, not from one to the next
        ([1.0, 1.0 - 5e-13, 1.5], {0, 1}),  # at the end of a cycle
    ],
)
def test_firings_within_a_trillionth_of_a_cycle_from_the_earliest_on_happen_at_once(firings, first):
    swarm = make_resting([0.5, 0.5, 0.5], response={"coupling": 0})
    swarm._arrays.next_firing[:] = firings
    event = next(swarm)
    assert (as_set(event.fired), as_set(event.received)) == (first, {0, 1, 2} - first)
    assert event.time_s == min(firings)
    assert as_set(next(swarm).fired) == {0, 1, 2} - first
