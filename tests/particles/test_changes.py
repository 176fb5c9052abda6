"""What schedules and faults change, exactly at their times and nothing else; a trial beside its undisturbed twin."""

import copy
import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import ParticleSimulation, load_scenario, run_trial
from epuck_sim.faults import random_share
from epuck_sim.particles.swarm import FAULT_SEED
from epuck_sim.particles.twin import make_twin, simulate_with_twin
from epuck_sim.util.rng import next_word, uniform
from epuck_sim.util.seeds import robot_streams
from tests.particles import simulations
from tests.particles.naive_model import NaiveEvent, NaiveModel
from tests.particles.simulations import KINDS, any_sections, fault_lists, make_simulation, scenario, state_of

STILL = {"agents": {"count": 4, "speed_cm_s": 0}, "start": {"phases": [0.1, 0.35, 0.6, 0.85]}}
MIDDLES = np.arange(0.5, 30)


class ChangingModel(NaiveModel):
    """The naive model, with a schedule whose entries have times or with faults that begin and end at given ones."""

    def __init__(self, swarm: ParticleSimulation) -> None:
        super().__init__(swarm)
        pace = self.scenario.agents.speed_cm_s
        self.shares = [speed / pace if pace else 0.0 for speed in self.speeds]
        self.active, self.instants, agents = set(), 0, len(self.phases)
        self.nominal, self.free = list(self.periods), list(self.speeds)
        waiting = [(entry.at_s, self.change, entry) for entry in self.scenario.schedule]
        for number, fault in enumerate(self.scenario.faults):
            own, _ = np.random.SeedSequence(swarm.seed, spawn_key=(FAULT_SEED, number)).spawn(2)
            streams = robot_streams(own, agents)
            keys = [np.uint64(next_word(stream)) for stream in streams]
            moments = [at_s for at_s in (fault.at_s or 0.0, fault.until_s) if at_s is not None]
            waiting += [(at_s, self.flip, number, fault, keys, streams) for at_s in moments]
        self.waiting = sorted(waiting, key=lambda waits: waits[0])

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

    def flip(self, number, fault, keys, streams) -> None:
        """Begin or end a fault in all its members."""
        for agent in range(len(self.phases)) if fault.agents is None else fault.agents:
            self.active ^= {(number, agent, keys[agent])} if fault.kind != "restart" else set()
            if fault.kind == "restart":
                self.phases[agent] = uniform(streams[agent])
        for agent in range(len(self.phases)):
            own = [self.scenario.faults[number] for number, who, _ in self.active if who == agent]
            rate = math.prod(each.rate for each in own if each.kind == "clock_drift")
            is_frozen = any(each.kind == "oscillator_frozen" for each in own)
            self.periods[agent] = math.inf if is_frozen else self.nominal[agent] / rate
            if fault.kind == "wheels_dead":
                self.speeds[agent] = 0.0 if any(each.kind == "wheels_dead" for each in own) else self.free[agent]

    def cascade(self, at_once, margins):
        found = super().cascade(at_once, margins)
        self.instants += 1
        return found

    def neighbours(self, firing, margins):
        """Return those to whom the pulse of a firing agent comes through."""
        return {other for other in super().neighbours(firing, margins) if self.is_heard(firing, other, margins)}

    def is_heard(self, firing, other, margins) -> bool:
        side = self.scenario.space.side_cm
        way = np.subtract(self.positions[firing], self.positions[other])
        if self.scenario.space.boundary == "cyclic":
            way = (way + side / 2) % side - side / 2
        for number, agent, key in self.active:
            fault = self.scenario.faults[number]
            if (agent, fault.kind) == (firing, "ring_dead"):
                return False
            if agent == other and fault.kind in ("camera_blind", "oscillator_frozen"):
                return False
            if agent == other and fault.kind == "camera_misses":
                limit, distance = fault.farther_than_cm, float(np.linalg.norm(way))
                margins.append(math.inf if limit is None else abs(distance - limit) / side)
                if (limit is None or distance > limit) and random_share(key, firing, self.instants) < fault.missed:
                    return False
        return True


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
@settings(max_examples=55)
def test_swarms_with_a_schedule_or_faults_agree_with_the_naive_model(data, seed, kind):
    sections = data.draw(any_sections(kind))
    changes = st.fixed_dictionaries({"schedule": entries(sections, kind)})
    faults = st.fixed_dictionaries({"faults": fault_lists(sections)})
    swarm = make_simulation(seed, **sections, **data.draw(changes | faults))
    simulations.compare_events(swarm, ChangingModel(swarm), cycles=8)


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
    return simulate_with_twin(scenario(**sections), seed, times)


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


def fault(kind, **keys):
    return {"faults": [{"kind": kind, **keys}]}


def test_clocks_run_at_their_rate_freeze_and_start_anew_and_go_on_as_before():
    sections = {**STILL, "response": {"coupling": 0}}
    drift = make_simulation(**sections, **fault("clock_drift", rate=1.5, agents=[1], at_s=2, until_s=4))
    drift.run_to(6)
    assert drift.phases() == pytest.approx([0.1, 0.35, 0.6, 0.85])  # one cycle ahead
    assert drift.firings == 25
    frozen = make_simulation(**sections, **fault("oscillator_frozen", agents=[0, 3], at_s=2.5, until_s=10.25))
    frozen.run_to(10)
    assert frozen.phases() == pytest.approx([0.6, 0.35, 0.6, 0.35])
    frozen.run_to(11)
    assert frozen.phases() == pytest.approx([0.35, 0.35, 0.6, 0.1])
    assert (frozen.periods_s == 1).all()
    assert len([*make_simulation(**sections, **fault("oscillator_frozen"))]) == 1  # it begins; then nothing can happen


def test_pulses_are_neither_sent_nor_received_and_links_of_pulses_say_so():
    sections = {**STILL, "neighbourhood": {"kind": "all"}, "response": {"coupling": 0.2}}
    swarm = make_simulation(
        **sections, faults=[{"kind": "ring_dead", "agents": [3]}, {"kind": "camera_blind", "agents": [0]}]
    )
    fired = {}
    while len(fired) < 4:
        event = next(swarm)
        for agent in event.fired.tolist():
            fired.setdefault(agent, (event.received.tolist(), swarm.pulse_links().tolist()))
    assert fired[3] == ([], [])
    assert set(fired[2][0]) == {1, 3}
    assert [link[:2] for link in fired[2][1]] == [[2, 1], [2, 3]]
    assert swarm.adjacency().sum() == 12  # who stands where, whatever is broken


@pytest.mark.parametrize("scheduled", [True, False])
def test_a_fault_by_the_schedule_is_one_at_a_time_and_both_are_events_of_the_trial(scheduled):
    stop = {"max_cycles": 10}
    schedule = [{"at_s": 2, "begin": [0]}, {"at_s": 5.5, "end": [0]}] if scheduled else []
    when = {"scheduled": True} if scheduled else {"at_s": 2, "until_s": 5.5}
    swarm = make_simulation(1, **fault("ring_dead", count=3, **when), schedule=schedule, stop=stop)
    result = run_trial(swarm)
    own = [event for event in result.events if event.source == "faults.0"]
    found = [(event.time_s, event.what, len(event.robots)) for event in own]
    assert found == [(2.0, "ring_dead begins", 3), (5.5, "ring_dead ends", 3)]
    assert len(result.events) == (4 if scheduled else 2)
    assert own[0].robots == own[1].robots
    other = make_simulation(1, **fault("ring_dead", count=3, at_s=2, until_s=5.5), stop=stop)
    assert run_trial(other, [lambda *_: None]).order_parameter == result.order_parameter


@pytest.mark.parametrize("kind", [*simulations.WHOLE, "clock_drift"])
def test_a_fault_changes_nothing_before_it_begins_and_a_trial_can_be_sent_elsewhere_while_it_lasts(kind):
    keys = {"rate": 0.9} if kind == "clock_drift" else {}
    faulty = make_simulation(5, **fault(kind, share=0.5, at_s=7, **keys), agents={"speed_cm_s": 10})
    ideal = make_simulation(5, agents={"speed_cm_s": 10})
    for swarm in (faulty, ideal):
        swarm.run_to(6.9)
    assert state_of(faulty) == state_of(ideal)
    faulty.run_to(8)
    elsewhere = pickle.loads(pickle.dumps(faulty))
    for swarm in (faulty, ideal, elsewhere):
        swarm.run_to(30)
    assert state_of(faulty) == state_of(elsewhere) != state_of(ideal)
    faulty.reset(5)
    faulty.run_to(6.9)
    ideal.reset(5)
    ideal.run_to(6.9)
    assert state_of(faulty) == state_of(ideal)


def test_random_faults_come_as_often_and_last_as_long_as_is_asked():
    swarm = make_simulation(2, **fault("camera_blind", per_hour=360, mean_s=5), agents={"count": 50})
    swarm.run_to(2000)
    changes = [(event.time_s, agent, event.what) for event in swarm.events for agent in event.robots]
    begun, lasted, since = 0, [], {}
    for time_s, agent, what in changes:
        if what.endswith("begins"):
            begun, since[agent] = begun + 1, time_s
        else:
            lasted.append(time_s - since.pop(agent))
    expected = 50 * 2000 / 15  # 10 s without, 5 s with it
    assert abs(begun - expected) < 4 * math.sqrt(expected)
    assert np.mean(lasted) == pytest.approx(5, rel=4 / math.sqrt(len(lasted)))


def test_a_speed_that_the_schedule_sets_holds_for_those_whose_wheels_turn():
    schedule = [{"at_s": 2, "set": {"agents.speed_cm_s": 4}}]
    swarm = make_simulation(3, **fault("wheels_dead", agents=[1], at_s=1, until_s=3), schedule=schedule)
    for time_s, pace in ((0.5, [1, 1]), (1.5, [1, 0]), (2.5, [4, 0]), (3.5, [4, 4])):
        swarm.run_to(time_s)
        assert swarm.speeds_cm_s[:2].tolist() == pace
