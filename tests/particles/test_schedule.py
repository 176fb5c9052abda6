"""What a schedule changes, exactly at its time and nothing else; and a trial beside its undisturbed twin."""

import copy
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import ParticleSimulation, load_scenario
from epuck_sim.particles.twin import make_twin, simulate_with_twin
from tests.particles.naive_model import NaiveEvent, NaiveModel
from tests.particles.simulations import (
    KINDS,
    any_sections,
    compare_events,
    fault_lists,
    make_simulation,
    scenario,
    state_of,
)

STILL = {"agents": {"count": 4, "speed_cm_s": 0}, "start": {"phases": [0.1, 0.35, 0.6, 0.85]}}
MIDDLES = np.arange(0.5, 30)


class ChangingModel(NaiveModel):
    """The naive model, which makes the changes of a schedule whose entries have times."""

    def __init__(self, swarm: ParticleSimulation) -> None:
        super().__init__(swarm)
        pace = self.scenario.agents.speed_cm_s
        self.shares = [speed / pace if pace else 0.0 for speed in self.speeds]
        self.waiting = sorted(
            [(entry.at_s, self.change, entry) for entry in self.scenario.schedule], key=lambda each: each[0]
        )

    def step(self) -> NaiveEvent:
        """Simulate up to the next event, or the next change."""
        ahead = copy.copy(self)
        for name in ("positions", "headings", "speeds", "phases", "left_of_runs", "streams", "receiver_streams"):
            setattr(ahead, name, copy.deepcopy(getattr(self, name)))
        event = NaiveModel.step(ahead)
        moment = self.waiting[0][0] / self.scenario.clocks.period_s if self.waiting else np.inf
        if event.time <= moment:
            return super().step()
        self.advance(moment - self.time)
        self.is_synchronised = False
        at_s = self.waiting[0][0]
        while self.waiting and self.waiting[0][0] == at_s:
            _, change, *what = self.waiting.pop(0)
            change(*what)
        return NaiveEvent(self.time, None, frozenset(), frozenset(), event.time - moment)

    def change(self, entry) -> None:
        for key, value in entry.set.items():
            section, name = key.split(".", 1)
            if key == "agents.speed_cm_s":
                self.speeds = [value * share for share in self.shares]
            changed = getattr(self.scenario, section).model_copy(update={name: value})
            self.scenario = self.scenario.model_copy(update={section: changed})
        if entry.displace is not None:
            for agent in range(len(self.phases)) if entry.displace.agents is None else set(entry.displace.agents):
                self.phases[agent] = (self.phases[agent] + entry.displace.by_cycles) % 1


@st.composite
def entries(draw, sections, kind):
    """Return two entries of a schedule that fits the sections."""
    agents, period_s = sections["agents"]["count"], sections["clocks"]["period_s"]
    speed, values = sections["agents"]["speed_cm_s"], [{"response.refractory": 0.2}, {"response.coupling": 0.5}]
    if speed and not sections["agents"].get("speed_per_run"):
        values += [{"agents.speed_cm_s": speed * factor} for factor in (0.0, 0.1, 1.7)]
    if kind in ("nearest", "random"):
        values.append({"neighbourhood.k": 1})
    elif kind != "all":
        values.append({"neighbourhood.radius_cm": sections["space"]["side_cm"] / 3})
    whom = st.none() | st.lists(st.integers(0, agents - 1), min_size=1, unique=True)
    displaced = st.fixed_dictionaries({"by_cycles": st.sampled_from([0.25, -0.1, 3.3]), "agents": whom})
    changes = st.sampled_from([{"set": value} for value in values]) | st.fixed_dictionaries({"displace": displaced})
    moments = st.floats(0, 6).map(lambda cycles: round(cycles, 3) * period_s)
    return [{"at_s": draw(moments), **draw(changes)} for _ in range(2)]


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
@settings(max_examples=15)
def test_swarms_that_a_schedule_changes_agree_with_the_naive_model(data, seed, kind):
    sections = data.draw(any_sections(kind))
    swarm = make_simulation(seed, **sections, schedule=data.draw(entries(sections, kind)))
    compare_events(swarm, ChangingModel(swarm), cycles=8)


def test_what_changes_at_the_start_is_as_if_the_scenario_had_it():
    def swarm(speed, k, changes):
        agents = {"speed_cm_s": speed, "speed_distribution": "uniform", "speed_spread": 0.5}
        schedule = [{"at_s": 0, "set": changes}] if changes else []
        return make_simulation(8, agents=agents, neighbourhood={"kind": "nearest", "k": k}, schedule=schedule)

    scheduled, other = swarm(5.0, 2, {"agents.speed_cm_s": 33, "neighbourhood.k": 3}), swarm(33, 3, {})
    scheduled.adjacency()  # that of the start, which must not be kept
    for each in (scheduled, other):
        each.run(40)
    assert state_of(scheduled) == state_of(other)
    assert (scheduled.speeds_cm_s == other.speeds_cm_s).all()
    assert (scheduled.adjacency() == other.adjacency()).all()


def test_a_curve_of_ones_own_gets_new_parameters(tmp_path):
    path = tmp_path / "own.py"
    text = "PARAMETERS = {'by': 0.0}\n\ndef phase_shift(phase, coupling, parameters):\n    return parameters.by\n"
    path.write_text(text)
    sections = {"neighbourhood": {"kind": "all"}, "response": {"curve": str(path)}}
    swarm = make_simulation(**STILL, **sections, schedule=[{"at_s": 0.5, "set": {"response.parameters.by": 0.05}}])
    swarm.run_to(0.4)  # agents 3 and 2 have fired, at 0.15 and 0.4, in vain
    assert swarm.phases() == pytest.approx([0.5, 0.75, 0, 0.25])
    swarm.run_to(0.65)  # agent 1 shifts the others
    assert swarm.phases() == pytest.approx([0.8, 0, 0.3, 0.55])


def test_those_that_fire_at_the_time_of_a_change_fire_before_it():
    for at_s, cycles in ((3, 3), (2.999, 2)):
        schedule = [{"at_s": at_s, "displace": {"by_cycles": 0.25}}]
        swarm = make_simulation(start={"phases": "synchronised"}, schedule=schedule)
        swarm.run_to(3.0001)
        assert swarm.cycles == cycles
        assert swarm.phases() == pytest.approx((3.0001 - at_s + 0.25 + at_s % 1) % 1)
    assert (1 - 0.7) * 1.0 > 0.3  # rounding puts the firing after the change
    sections = {"agents": {"count": 1}, "start": {"phases": [0.7]}}
    swarm = make_simulation(**sections, schedule=[{"at_s": 0.3, "displace": {"by_cycles": 0.5}}])
    assert [len(next(swarm).fired) for _ in range(2)] == [1, 0]
    assert swarm.phases().tolist() == [0.5]


@pytest.mark.parametrize("first", ["random", 0.25])
def test_changes_at_one_instant_are_made_in_their_order_and_are_one_event(first):
    changes = ["random", 0.25] if first == "random" else [0.25, "random"]
    schedule = [{"at_s": 0.05, "displace": {"by_cycles": change}} for change in changes]
    swarm = make_simulation(3, **STILL, response={"coupling": 0}, schedule=schedule)
    event = next(swarm)
    assert (event.turned, len(event.fired), len(event.received)) == (None, 0, 0)
    assert event.time_s == swarm.time_s == 0.05
    assert [(each.step, each.source) for each in swarm.events] == [(0, "schedule.0"), (0, "schedule.1")]
    sequence = np.random.SeedSequence(3, spawn_key=(4, changes.index("random")))
    drawn = np.random.Generator(np.random.SFC64(sequence)).random(4)
    assert swarm.phases() == pytest.approx((drawn + (0.25 if first == "random" else 0)) % 1)


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS), st.lists(st.floats(0.01, 7), max_size=4))
@settings(max_examples=12)
def test_a_change_is_the_same_to_the_bit_event_by_event_at_once_and_in_pieces(data, seed, kind, stops):
    sections = data.draw(any_sections(kind))
    sections["stop"]["order_parameter"] = None
    sections["schedule"], sections["faults"] = data.draw(entries(sections, kind)), data.draw(fault_lists(sections))
    at_once, pieces, events, limited = swarms = [make_simulation(seed, **sections) for _ in range(4)]
    period_s = sections["clocks"]["period_s"]
    at_once.run_to(7 * period_s)
    for stop in sorted(stops):
        pieces.run_to(stop * period_s)
    while len(events.events) < len(at_once.events) or events.instants < at_once.instants:
        next(events)
    while limited.instants < at_once.instants:
        limited.run(10**6, pulses=3)
        limited.run(limited.cycles + 1, periods=1)
    end_s = max(7 * period_s, events.time_s, limited.time_s) + 0.013 * period_s
    for swarm in swarms:
        swarm.run_to(end_s)
        assert state_of(swarm) == state_of(at_once)
        for event, other in zip(swarm.events, at_once.events, strict=True):
            assert event._replace(time_s=0) == other._replace(time_s=0)


def displaced(by):
    return {"phases": "synchronised", "displacement": by}


def compare(seed=0, times=MIDDLES, **sections):
    return simulate_with_twin(load_scenario(scenario(**sections)), seed, times)


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
@settings(max_examples=15)
def test_undisturbed_nothing_deviates_at_any_time(data, seed, kind):
    sections = data.draw(any_sections(kind))
    sections["clocks"]["jitter"] = 0.0
    times = np.linspace(0, 12 * sections["clocks"]["period_s"], 30)
    assert not compare(seed, times, **sections).deviation.any()


@pytest.mark.parametrize(("displacement", "deviation"), [(2**-10, 2**-10), (0.25, 0.25), (0.5, 0.5), (0.875, 0.125)])
def test_an_uncoupled_displaced_agent_deviates_by_the_displacement_for_ever(displacement, deviation):
    times = np.concatenate([MIDDLES, np.arange(1000.03125, 20_000, 7_777)])
    found = compare(times=times, start=displaced(displacement), response={"coupling": 0})
    assert found.deviation[:, 0].tolist() == [deviation] * len(times)
    assert not found.deviation[:, 1:].any()


def test_the_deviation_spreads_to_agents_that_were_not_displaced():
    everybody = compare(times=np.arange(0.5, 20), start=displaced(2**-10), neighbourhood={"kind": "all"})
    assert everybody.deviation[0].tolist() == [2**-10] + [0] * 19
    np.testing.assert_allclose(everybody.deviation[1:], 2**-10, rtol=1e-11)  # all are early from the first firing on
    np.testing.assert_allclose(everybody.order_parameter[1:], 1, atol=1e-12)
    found = compare(times=np.arange(0.5, 200), start=displaced(0.01), agents={"count": 20, "speed_cm_s": 30}, seed=3)
    deviate = np.count_nonzero(found.deviation > 1e-9, axis=1)
    assert deviate[0] == 1
    assert deviate.max() > 10


def test_with_jitter_deviations_grow_with_the_error_of_the_periods_and_wrap_at_half_a_cycle():
    clocks = {"jitter": 1e-3, "period_s": 2.0}
    given = {"clocks": clocks, "response": {"coupling": 0}, "start": {"phases": "synchronised"}}
    times = np.linspace(0, 8000, 400)
    found = compare(7, times, **given)
    apart = np.abs(times[:, None] / make_simulation(7, **given).periods_s - times[:, None] / 2.0) % 1
    np.testing.assert_allclose(found.deviation, np.minimum(apart, 1 - apart), atol=1e-8)
    early = times < 200
    slopes = found.deviation[early][1:] / times[early][1:, None]
    np.testing.assert_allclose(slopes, np.broadcast_to(slopes[0], slopes.shape), rtol=1e-6)
    assert found.deviation.max() > 0.49


def test_the_order_parameter_is_that_of_all_phases_at_each_time():
    given = {"clocks": {"jitter": 0.01}, "stop": {"metric": "reference"}, "agents": {"count": 7, "speed_cm_s": 20}}
    found = compare(5, (MIDDLES + 0.123).tolist(), **given)
    swarm = make_simulation(5, **given)
    for time, order in zip(MIDDLES + 0.123, found.order_parameter, strict=True):
        swarm.run_to(time)
        assert order == pytest.approx(abs(np.exp(2j * math.pi * swarm.phases()).mean()), abs=1e-12)


def test_a_twin_of_ones_own_displacement_is_ahead_by_it_or_by_what_is_left_until_it_fires_and_may_change():
    given = load_scenario(scenario(agents={"count": 3}, start={"phases": [0.7, 0.4, 0.1]}))
    for ahead, phase in ((0.25, 0.95), (0.4, 1.0)):
        assert make_twin(given, 1, ahead).phases() == pytest.approx([phase, 0.4, 0.1])


@pytest.mark.parametrize(("reorient_on", "moves_alike"), [([], True), (["receiving"], False)])
def test_the_twin_has_nominal_periods_no_displaced_agent_and_moves_alike_unless_pulses_turn(reorient_on, moves_alike):
    speeds = {"speed_cm_s": 30, "speed_distribution": "uniform", "speed_spread": 0.5}
    agents, clocks = {"count": 6, **speeds, "reorient_on": reorient_on}, {"jitter": 0.1, "period_s": 3.0}
    given = scenario(start=displaced(0.1), clocks=clocks, agents=agents)
    disturbed, twin = ParticleSimulation(given, 9), make_twin(load_scenario(given), 9)
    assert (twin.seed, set(twin.periods_s.tolist()), len(set(disturbed.periods_s.tolist()))) == (9, {3.0}, 6)
    assert disturbed.phases().tolist() == [pytest.approx(0.1)] + [0.0] * 5
    assert not twin.phases().any()
    for swarm in (disturbed, twin):
        swarm.run_to(60)
    for moving in ("positions", "headings"):
        apart = np.abs(getattr(disturbed, moving)() - getattr(twin, moving)()).max()
        assert (apart < 1e-9) == moves_alike
