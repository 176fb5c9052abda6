"""What faults do to point agents, exactly at their times and nothing else."""

import math
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim import ParticleSimulation, run_trial
from epuck_sim.faults import random_share
from epuck_sim.particles.swarm import FAULT_SEED
from epuck_sim.util.rng import next_word, uniform
from epuck_sim.util.seeds import robot_streams
from tests.particles.simulations import (
    KINDS,
    WHOLE,
    any_sections,
    compare_events,
    fault_lists,
    make_simulation,
    state_of,
)
from tests.particles.test_schedule import STILL, ChangingModel


class FaultyModel(ChangingModel):
    """The naive model with faults that begin and end at given times."""

    def __init__(self, swarm: ParticleSimulation) -> None:
        super().__init__(swarm)
        self.active, self.instants, agents = set(), 0, len(self.phases)
        self.nominal, self.free = list(self.periods), list(self.speeds)
        for number, fault in enumerate(self.scenario.faults):
            own, _ = np.random.SeedSequence(swarm.seed, spawn_key=(FAULT_SEED, number)).spawn(2)
            streams = robot_streams(own, agents)
            keys = [np.uint64(next_word(stream)) for stream in streams]
            for at_s in (fault.at_s or 0.0, fault.until_s):
                if at_s is not None:
                    self.waiting.append((at_s, self.flip, number, fault, keys, streams))
        self.waiting.sort(key=lambda waits: waits[0])

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


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
@settings(max_examples=40)
def test_swarms_with_faults_agree_with_the_naive_model(data, seed, kind):
    sections = data.draw(any_sections(kind))
    swarm = make_simulation(seed, **sections, faults=data.draw(fault_lists(sections)))
    compare_events(swarm, FaultyModel(swarm), cycles=8)


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
    assert [(event.time_s, event.what, len(event.robots)) for event in own] == [
        (2.0, "ring_dead begins", 3),
        (5.5, "ring_dead ends", 3),
    ]
    assert len(result.events) == (4 if scheduled else 2)
    assert own[0].robots == own[1].robots
    other = make_simulation(1, **fault("ring_dead", count=3, at_s=2, until_s=5.5), stop=stop)
    assert run_trial(other, [lambda *_: None]).order_parameter == result.order_parameter


@pytest.mark.parametrize("kind", [*WHOLE, "clock_drift"])
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
