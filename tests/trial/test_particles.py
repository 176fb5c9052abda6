"""Trials of particles: what is measured, what counts as synchronised, when they end, and that they can be repeated."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.trial import particles
from epuck_sim.trial.model import run_trial
from tests.particles.simulations import KINDS, any_sections, make_resting, make_simulation
from tests.trial import without_wall

THRESHOLD = 1 - 1e-9


def test_t_sync_counts_the_references_firings_from_1_the_last_one_too():
    natural = make_resting([0.9, 0.85], stop={"order_parameter": THRESHOLD})  # it makes the other one fire
    elicited = make_resting([0.85, 0.9], stop={"order_parameter": THRESHOLD})  # the other one makes it fire
    for swarm in (natural, elicited):
        result = run_trial(swarm)
        assert (result.t_sync_cycles, result.cycles, result.steps, result.censored) == (1, 1, 1, False)
        assert result.simulated_s == pytest.approx(0.1)
        assert result.order_parameter == 1


@pytest.mark.parametrize(("threshold", "synchronised"), [(0.8, True), (0.82, False)])
def test_synchronised_is_the_threshold_reached(threshold, synchronised):
    swarm = make_resting([0.9, 0.7], response={"coupling": 0}, stop={"order_parameter": threshold, "max_cycles": 3})
    result = run_trial(swarm)  # cos(0.2 pi) = 0.809
    assert result.censored != synchronised
    assert result.t_sync_cycles == (1 if synchronised else None)
    assert result.cycles == (1 if synchronised else 3)


def test_many_whose_order_parameter_is_1_are_synchronised_at_a_threshold_of_1():
    swarm = make_resting(
        [0.9] * 9_999 + [0.9 - 1.5e-7],
        response={"coupling": 0},
        neighbourhood={"kind": "nearest"},
        stop={"order_parameter": 1.0},
    )
    swarm.run(1)
    assert swarm.is_synchronised == (swarm.order_parameter >= 1.0)


@pytest.mark.parametrize("max_cycles", [1, 7, 1000])
def test_a_trial_is_censored_once_the_reference_has_fired_max_cycles_times(max_cycles):
    swarm = make_simulation(response={"coupling": 0}, stop={"order_parameter": THRESHOLD, "max_cycles": max_cycles})
    first = 1 - swarm.phases()[0]
    result = run_trial(swarm)
    assert (result.censored, result.t_sync_cycles, result.cycles) == (True, None, max_cycles)
    assert result.simulated_s == pytest.approx(first + max_cycles - 1)
    assert result.order_parameter < THRESHOLD
    assert result.steps == swarm.instants


def silenced(**stop):
    """Return a swarm whose reference, in the middle, is set back to 0 by three others and never fires.

    They are nearest to nobody, and a third of a cycle apart.
    """
    round_it = [[50 + 10 * math.cos(a), 50 + 10 * math.sin(a)] for a in (0, 2 * math.pi / 3, 4 * math.pi / 3)]
    return make_resting(
        [0.1, 0.9, 0.9 - 1 / 3, 0.9 - 2 / 3],
        [[50.0, 50.0], *round_it],
        response={"curve": "sawtooth", "coupling": 1.0},
        neighbourhood={"kind": "nearest"},
        stop={"order_parameter": THRESHOLD, **stop},
    )


def test_a_trial_whose_reference_never_fires_lasts_twice_max_cycles_observed_or_not_at_any_pace(monkeypatch):
    alone = run_trial(silenced(max_cycles=20))
    assert (alone.censored, alone.cycles, alone.order_parameter) == (True, 0, None)
    assert alone.simulated_s == pytest.approx(40, abs=1.01)
    watched = run_trial(silenced(max_cycles=20), [lambda _event, _swarm: None])
    monkeypatch.setattr(particles, "SLICE_S", 0.0)
    slowly = run_trial(silenced(max_cycles=20))
    assert without_wall(alone) == without_wall(watched) == without_wall(slowly)


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
@settings(max_examples=12)
def test_a_trial_is_the_same_with_observers_and_at_any_pace(data, seed, kind):
    sections = data.draw(any_sections(kind, most_agents=8))
    sections["stop"] |= {"max_cycles": 15}
    plain = make_simulation(seed, **sections)
    alone = run_trial(plain)
    if alone.cycles < 15 and alone.censored:
        return  # see above
    seen = []
    watched = run_trial(
        make_simulation(seed, **sections), [lambda event, swarm: seen.append((swarm.cycles, len(event.fired)))]
    )
    shown = []
    followed = run_trial(make_simulation(seed, **sections), progress=lambda swarm: shown.append(swarm.cycles))
    assert without_wall(watched) == without_wall(followed) == without_wall(alone)
    assert sum(fired > 0 for _, fired in seen) == alone.steps
    assert seen[-1][0] == shown[-1] == alone.cycles
    assert sum(fired for _, fired in seen) == plain.firings


@pytest.mark.parametrize("more", [{"clocks": {"jitter": 0.1}}, {"start": {"phases": "synchronised"}}])
def test_slices_of_a_large_swarm_are_few_pulses_even_where_all_fire_at_once(more):
    """A cycle of 20,000 agents, each of which reaches 10,000, takes many seconds; Ctrl-C is heard between slices."""
    agents, neighbourhood = {"count": 20_000, "speed_cm_s": 1.0}, {"kind": "nearest", "k": 10_000}
    swarm, instants = make_simulation(1, agents=agents, neighbourhood=neighbourhood, **more), []

    def interrupt(state):
        instants.append(state.instants)
        if len(instants) == 3:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_trial(swarm, progress=interrupt)
    assert instants[-1] < 100
