"""Swarms agree with the naive model event by event, depend on their seeds alone, and firing times do not drift."""

import copy
import itertools
import math
import pickle

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from epuck_sim import ParticleSimulation, ScenarioError, run_trial
from epuck_sim.particles import oscillators
from epuck_sim.particles.swarm import SCENE, Oscillators
from tests.particles import simulations
from tests.particles.naive_model import NaiveModel
from tests.particles.simulations import KINDS, any_sections, as_set, make_resting, make_simulation, state_of

SEEDS = st.integers(0, 2**63 - 1)
kinds = pytest.mark.parametrize("kind", KINDS)
OTHERS = [
    {"response": {"curve": "sine", "coupling": 0.3, "refractory": 0.4}},
    {"neighbourhood": {"kind": "cone_of_vision", "angle_deg": 90}},
    {"start": {"phases": "synchronised", "displacement": 0.001}, "neighbourhood": {"kind": "all"}},
    {"clocks": {"jitter": 0.1}, "stop": {"reference": 3, "metric": "reference"}},
]


def compare(kind, data, seed, cycles, **limits):
    swarm = make_simulation(seed, **data.draw(any_sections(kind, **limits)))
    simulations.compare_events(swarm, NaiveModel(swarm), cycles=cycles)


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


VISION, EMISSION = {"angle_deg": 80, "radius_cm": 70}, {"angle_deg": 200}
RULES = [{"k": 2}, {"radius_cm": 30}, VISION, EMISSION, {}, {"k": 2}]


@pytest.mark.parametrize(("kind", "rule"), list(zip(KINDS, RULES, strict=True)))
def test_the_comparison_with_the_naive_model_does_not_end_early(kind, rule):
    for dimensions, boundary in itertools.product([1, 2, 3], ["bounded", "cyclic", "mirrored"]):
        space, agents = {"dimensions": dimensions, "boundary": boundary}, {"count": 6, "speed_cm_s": 15.0}
        swarm = make_simulation(space=space, agents=agents, neighbourhood={"kind": kind, **rule})
        twin = NaiveModel(swarm)
        assert simulations.compare_events(swarm, twin, cycles=20) >= 120
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


def test_what_happens_at_the_very_time_has_happened_and_a_phase_of_exactly_1_fires():
    swarm = make_resting([0.5, 0.25])
    for _ in range(2):
        swarm.run_to(0.5)
        assert (swarm.instants, swarm.time_s, swarm.phases()[0]) == (1, 0.5, 0)
    event = next(make_resting([0.75, 0.25], response={"coupling": 1.0}))
    assert (as_set(event.fired), as_set(event.received)) == ({0, 1}, {1})


@pytest.mark.parametrize("refractory", [0.25, 0.0, 0.4375])
def test_up_to_and_at_the_end_of_the_refractory_period_no_pulse_is_received(refractory):
    just_after = refractory + 2.0**-40
    for phase, is_received in [(refractory, False), (refractory / 2, False), (just_after, True)]:
        # agent 1 is at `phase` when agent 0 fires: all of these are exact in binary
        swarm = make_resting([0.5, 0.0], response={"refractory": refractory})
        swarm._arrays.next_firing[:] = 0.5, 0.5 + (1 - phase)
        assert as_set(next(swarm).received) == ({1} if is_received else set())
        assert swarm.phases()[1] == pytest.approx(1.1 * phase if is_received else phase, abs=1e-15)


def test_firings_within_a_trillionth_of_a_cycle_from_the_earliest_on_happen_at_once():
    for firings, first in (
        ([0.5, 0.5, 1.4], {0, 1}),
        ([0.5, 0.5 + 9e-13, 1.4], {0, 1}),
        ([0.5, 0.5 + 1.2e-12, 0.5 + 1.2e-12], {0}),
        ([0.5 + 8e-13, 0.5, 0.5 + 1.6e-12], {0, 1}),  # counted from the earliest, not from one to the next
        ([1.0, 1.0 - 5e-13, 1.5], {0, 1}),  # at the end of a cycle
    ):
        swarm = make_resting([0.5, 0.5, 0.5], response={"coupling": 0})
        swarm._arrays.next_firing[:] = firings
        event = next(swarm)
        assert (as_set(event.fired), as_set(event.received)) == (first, {0, 1, 2} - first)
        assert event.time_s == min(firings)
        assert as_set(next(swarm).fired) == {0, 1, 2} - first


def test_what_a_pulse_brings_to_1_but_for_a_rounding_fires_as_in_fractions():
    sections = {"model": "particles", "agents": {"count": 10, "speed_cm_s": 0}, "stop": {"max_cycles": 300}}
    sections |= {"response": {"curve": "additive", "coupling": 0.1}, "neighbourhood": {"kind": "nearest", "k": 2}}
    exact = {14: 20, 32: 93, 47: 39, 55: None}  # without tolerance: 171, None, None, 181
    assert {seed: run_trial(ParticleSimulation(sections, seed)).t_sync_cycles for seed in exact} == exact


@given(st.data(), SEEDS, SEEDS, st.sampled_from(KINDS))
@settings(max_examples=15)
def test_a_reset_simulation_is_a_new_one_and_a_copy_goes_on_alike(data, seed, before, kind):
    sections = data.draw(any_sections(kind))
    sections["schedule"] = data.draw(st.sampled_from([[], [{"at_s": 0.7, "set": {"response.refractory": 0.3}}]]))
    new, used = make_simulation(seed, **sections), make_simulation(before, **sections)
    used.run(data.draw(st.integers(0, 5)), 20)
    used.reset(seed)
    for _ in range(20):
        assert state_of(used) == state_of(new)
        mine, yours = next(used), next(new)
        assert (mine.time_s, mine.turned, *mine.fired) == (yours.time_s, yours.turned, *yours.fired)
    copies = [copy.copy(used), copy.deepcopy(used), pickle.loads(pickle.dumps(used))]
    for swarm in (new, *copies, used):  # a copy's time does not touch that of the original
        swarm.run(10, 20)
        assert state_of(swarm) == state_of(new)
        assert (swarm.events, swarm.outcome) == (new.events, new.outcome)


def test_a_reset_without_a_seed_keeps_that_of_the_trial_which_is_the_scenario_s_unless_it_is_given():
    swarm, new = (ParticleSimulation(simulations.scenario(seed=3), seed) for seed in (5, None))
    assert state_of(new) == state_of(ParticleSimulation(simulations.scenario(), 3)) != state_of(swarm)
    new = ParticleSimulation(simulations.scenario(), 5)
    swarm.record()
    swarm.run(1)
    swarm.reset()
    assert swarm.recorded == 0  # the cycle was one of the trial before
    assert (swarm.seed, state_of(swarm)) == (5, state_of(new))
    with pytest.raises(ScenarioError, match="seed is -1"):
        swarm.reset(-1)
    assert (swarm.seed, state_of(swarm)) == (5, state_of(new))


@pytest.mark.parametrize("other", OTHERS, ids=str)
@pytest.mark.parametrize(("dimensions", "boundary"), [(1, "bounded"), (2, "cyclic"), (3, "bounded")])
def test_swarms_of_one_seed_move_alike_whatever_their_oscillators_do(other, dimensions, boundary):
    speeds = {"speed_cm_s": 60.0, "speed_distribution": "uniform", "speed_spread": 0.5}
    agents = {"count": 8, **speeds, "walk": {"kind": "levy", "run_s": 0.3, "exponent": 2.2}}
    scene = {"space": {"dimensions": dimensions, "boundary": boundary}, "agents": agents}
    one, two = make_simulation(9, **scene), make_simulation(9, **scene, **other)
    assert (one.positions() == two.positions()).all()
    for time_s in (0.9, 3.3, 12.6):
        one.run_to(time_s)
        two.run_to(time_s)
        # positions differ in the last digit, because `now` may be counted from one cycle or the next
        assert one.positions() == pytest.approx(two.positions(), abs=1e-11)
        for name in simulations.MOTION:
            assert (getattr(one._arrays, name) == getattr(two._arrays, name)).all()


def test_a_simulation_cannot_go_back_nor_to_a_time_that_is_not_finite_and_limits_are_whole_numbers():
    swarm = make_simulation(1)
    swarm.run_to(4.0)
    for time_s in (3.9, -1.0, math.nan, math.inf):
        finite = r"the simulation is at 4\.0 s and cannot go back"
        with pytest.raises(ValueError, match=finite if math.isfinite(time_s) else "allowed: a finite number"):
            swarm.run_to(time_s)
        swarm.run_to(4.0)
        assert swarm.time_s == 4.0
    limits = [("cycles", -1), ("cycles", 1.5), ("cycles", "3"), ("periods", "x"), ("pulses", 0), ("share", 1)]
    for name, wrong in limits:
        with pytest.raises(ValueError, match=f"{name} is {wrong!r}; allowed: (whole numbers )?from [01]"):
            swarm.run(**{"cycles": 3, name: wrong})


@settings(max_examples=60)
@given(st.booleans(), st.integers(1, 3 * oscillators.BRANCHES), st.integers(0, 2**32 - 1))
@example(True, oscillators.BRANCHES**2 + 1, 1)
@example(True, oscillators.BRANCHES**3 - 1, 2)
@example(True, 2 * oscillators.BRANCHES**3 + 5, 3)
def test_the_earliest_is_the_earliest_of_all_after_any_changes_in_whatever_part_it_is(has_parts, agents, seed):
    random = np.random.default_rng(seed)
    sizes = (-(-agents // oscillators.BRANCHES**level) if has_parts or level == 1 else 0 for level in (1, 2, 3))
    levels = (np.full(size, -math.inf) for size in sizes)
    swarm = Oscillators(np.zeros(1, SCENE)[0], 1 - random.random(agents), np.ones(agents), *levels)
    found = np.zeros(agents + 1, np.int64)
    for _ in range(40):
        earliest = oscillators.earliest_firing(swarm)
        assert earliest == swarm.next_firing.min()
        firing = found[: oscillators.firing_now(swarm, earliest, found)].tolist()
        assert firing == np.flatnonzero(swarm.next_firing <= earliest + oscillators.SIMULTANEITY_CYCLES).tolist()
        for agent in firing if random.random() < 0.5 else ():
            oscillators.set_next_firing(swarm, agent, earliest + 1)
        for agent in random.integers(agents, size=random.integers(6)):  # some to the same instant, or to a later one
            now = swarm.next_firing[agent]
            earlier = earliest + random.random() * (now - earliest)
            instants = earliest, earliest + 3e-13, earliest + 9e-13, earlier, now + random.random()
            oscillators.set_next_firing(swarm, agent, random.choice(instants))


@pytest.mark.parametrize(("jitter", "period_s"), [(0, 0.3), (0.1, 1.0)])
def test_after_very_many_cycles_free_oscillators_are_where_they_should_be(jitter, period_s):
    agents, clocks = {"count": 4, "speed_cm_s": 12.0}, {"jitter": jitter, "period_s": period_s}
    swarm = make_simulation(4, agents=agents, response={"coupling": 0}, clocks=clocks)
    start, periods = swarm.phases(), swarm._arrays.period.copy()
    assert (periods == 1).all() == (not jitter)
    for cycle in (10, 1001, 200_000):  # whose times added up would be off by ten times more than is allowed
        swarm.run_to((cycle + 0.375) * period_s)
        turns = start + (cycle + 0.375) / periods
        assert simulations.max_phase_difference(swarm.phases(), turns % 1) < 1e-9
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
            assert farthest <= oscillators.max_phase_offset(len(phases), float(reached))


@given(st.integers(2, 50), st.floats(-12, -0.01), st.floats(0, 1))
def test_a_phase_beyond_max_phase_offset_keeps_the_order_below_the_threshold(agents, exponent, share):
    threshold = 1 - 10**exponent
    near = oscillators.max_phase_offset(agents, threshold)
    if near < 0.5:
        phases = np.zeros(agents)
        phases[-1] = near + 2e-7 + share * (0.5 - near)
        phases[1:-1] = phases[-1] / 2  # which is best
        assert abs(np.exp(2j * np.pi * phases).mean()) < threshold
