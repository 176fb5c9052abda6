"""Claims about faults of robots: who has them and when, what they do, and that they change nothing else."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.embodied import start
from epuck_sim.embodied.changes import faults as robot_faults
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.faults import random_share, set_faults
from epuck_sim.scenario.changes import TrialEvent
from epuck_sim.util.rng import next_word, uniform
from epuck_sim.util.seeds import robot_streams
from tests.embodied.steps import EVERYTHING, FAULTY, NOWHERE, steps_of, swarm_of

STEP_MS = 100


def with_fault(kind, **keys):
    return {"faults": [{"kind": kind, **keys}]}


def faulty_block(faults, robots, seed):
    size = {"width_cm": 500, "height_cm": 500}
    scenario = load_scenario({"faults": faults, "robots": [{"count": robots}], "arena": size})
    lengths = {"robots": robots, "faults": len(faults), "affected": len(faults) * robots, "numbers": 2 * robots}
    block = make_block({**lengths, "log": robot_faults.LOGGED_STEPS * len(scenario.faults) * scenario.population})
    swarm = open_block(block)
    swarm.scene[0].step_ms = STEP_MS
    set_faults(swarm.faults, scenario.faults)
    robot_faults.begin_faults(block, scenario, seed)
    return block


def active_over(fault, steps, robots=10, seed=3):
    block = faulty_block([fault], robots, seed)
    swarm, found = open_block(block), np.empty((steps, robots), bool)
    for step in range(steps):
        swarm.scene[0].step, swarm.scene[0].changes = step, 0
        robot_faults.change_faults(block, NOWHERE, 0)
        found[step] = swarm.affected.is_active
    return found


@settings(max_examples=30)
@given(st.integers(0, 200), st.integers(1, 200), st.sets(st.integers(0, 9), min_size=1))
def test_a_fault_at_a_time_is_there_in_the_control_steps_from_then_on_until_its_end(begin, steps, robots):
    fault = {"kind": "ring_dead", "robots": sorted(robots), "at_s": begin / 10, "until_s": (begin + steps) / 10}
    expected = np.zeros((420, 10), bool)
    expected[begin : begin + steps, sorted(robots)] = True
    np.testing.assert_array_equal(active_over(fault, 420), expected)


AMONG_FEW = {"robots": [*range(5, 25)], "share": 0.2}
SHARES = [({"share": 0.25}, 10), ({"share": 0.06}, 2), ({"share": 0}, 0), (AMONG_FEW, 4)]


@pytest.mark.parametrize(("whom", "count"), [*SHARES, ({"count": 3}, 3), ({"count": 0}, 0), ({}, 40)])
def test_a_share_or_a_number_of_robots_is_drawn_in_each_trial(whom, count):
    drawn = [active_over({"kind": "ring_dead", **whom}, 1, 40, seed)[0] for seed in range(30)]
    assert {row.sum() for row in drawn} == {count}
    assert set(np.flatnonzero(np.any(drawn, axis=0))) <= set(whom.get("robots", range(40)))
    if 0 < count < 40:
        assert len({row.tobytes() for row in drawn}) > 25
        assert (np.sum(drawn, axis=0) < 25).all()


LASTING, UNTIL_8_S = {"per_hour": 360, "mean_s": 5}, {"per_hour": 3600, "at_s": 5, "until_s": 8}
BOTH = {"per_hour": 900, "mean_s": 1, "at_s": 3, "until_s": 500}


@pytest.mark.parametrize("when", [LASTING, UNTIL_8_S, BOTH], ids=str)
def test_random_faults_last_and_stay_away_for_exponential_times_as_a_slow_twin_draws(when):
    steps, robots, changes = 5_000, 12, []
    begin_s, end_s, free_s = when.get("at_s", 0), when.get("until_s", math.inf), 3600 / when["per_hour"]
    own, _ = np.random.SeedSequence(3, spawn_key=(start.FAULTS, 0)).spawn(2)
    for stream in robot_streams(own, robots):
        next_word(stream)  # decides on flashes
        times, time_s = [], begin_s
        while time_s < end_s and time_s < steps / 10:
            time_s -= free_s * math.log(1 - uniform(stream))
            if time_s < end_s:
                lasts_s = -when["mean_s"] * math.log(1 - uniform(stream)) if "mean_s" in when else math.inf
                times += [time_s, min(time_s + lasts_s, end_s)]
                time_s = times[-1]
        changes.append(np.searchsorted(times, np.arange(steps) / 10, side="right"))
    found = active_over({"kind": "wheels_dead", **when}, steps, robots)
    np.testing.assert_array_equal(found, np.transpose(changes) % 2 == 1)
    assert found.any(axis=0).sum() > robots / 2


def test_a_fault_changes_nothing_before_it_begins():
    ideal = steps_of("thesis", 120)
    for kind, keys in (("wheels_dead", {}), ("restart", {}), ("clock_drift", {"rate": 1.1})):
        faulty = steps_of(with_fault(kind, robots=[3], at_s=6.0, **keys), 120)
        assert all(faulty[name][:60].tobytes() == values[:60].tobytes() for name, values in ideal.items())
        assert any(faulty[name].tobytes() != values.tobytes() for name, values in ideal.items())


def test_dead_and_stuck_rings_do_not_do_what_is_commanded_nobody_sees_dead_ones_and_dead_sensors_read_nothing():
    rings = [{"kind": "ring_dead", "robots": [0, 2], "at_s": 1}, {"kind": "ring_stuck_on", "robots": [1, 2]}]
    blind = {"kind": "camera_blind", "robots": [0, 1, 2, 3, 4], "at_s": 5}
    shown = steps_of({"faults": [*rings, blind, {"kind": "infrared_dead", "robots": [0], "at_s": 1}]}, 200)
    assert shown["ring_commands"].any(axis=0).all()
    assert not shown["ring_on"][10:, [0, 2]].any()
    assert shown["ring_on"][:, 1].all()
    assert shown["ring_on"][:10, 2].all()
    np.testing.assert_array_equal(shown["ring_on"][:, 3:], shown["ring_commands"][:, 3:])
    assert not steps_of(with_fault("ring_dead"), 150)["camera"].any()
    assert not shown["camera"][50:, :5].any()
    assert shown["camera"][50:, 5:].any()
    assert shown["camera"][:50, :5].any()
    assert (shown["infrared"][10:, 0] == 0).all()
    assert (shown["distance_mm"][10:, 0] == OUT_OF_RANGE_MM).all()
    assert shown["infrared"][10:, 1:].any()


def test_cycles_are_counted_by_what_the_reference_commands():
    stop = {"max_cycles": 5, "order_parameter": None}
    for dark in ({"kind": "ring_dead"}, {"kind": "ring_stuck_on", "robots": [0]}):
        result = run_trial(Simulation({"faults": [dark], "stop": stop}, 1))
        assert result.cycles == 5
    seen = run_trial(Simulation({"faults": [dark], "stop": stop}, 1), [lambda *_: None])
    assert seen._replace(wall_s=0) == result._replace(wall_s=0)


def test_frozen_oscillators_keep_phase_and_ring_while_robots_move_which_stand_still_while_their_wheels_are_dead():
    apart, wheels = [[15, 15, 0], [15, 45, 0]], {"kind": "wheels_dead", "robots": [0], "at_s": 1, "until_s": 2}
    faults = [{"kind": "oscillator_frozen", "at_s": 2, "until_s": 8}, wheels]
    shown = steps_of({"robots": [{"poses": apart}], "faults": faults}, 120)
    frozen = slice(19, 80)
    assert np.ptp(shown["phase_ms"][frozen], axis=0).max() == 0
    assert (shown["ring_on"][frozen] == shown["ring_on"][19]).all()
    assert (np.diff(shown["phase_ms"][80:82], axis=0) != 0).all()
    moved = np.abs(np.diff(shown["poses"], axis=0)).sum(axis=2) > 0
    np.testing.assert_array_equal(moved[:, 0], [not 10 <= step < 20 for step in range(119)])
    assert moved[:, 1:].all()


@pytest.mark.parametrize("rate", [0.97, 1.034])
def test_a_clock_that_drifts_counts_its_own_milliseconds(rate):
    alone = {"robots": [{"count": 1, "controller": "oscillator"}], "noise": "off"}
    both = alone, {**alone, **with_fault("clock_drift", rate=rate)}
    ideal, faulty = (steps_of(each, 30, 5)["phase_ms"][:, 0] for each in both)
    expected = ideal[0] - STEP_MS + np.floor(np.arange(1, 31) * STEP_MS * rate + 1e-9)
    in_first_cycle = np.minimum.accumulate(np.diff(faulty, prepend=-1.0) > 0)
    assert in_first_cycle.sum() > 5
    assert np.abs(faulty - expected)[in_first_cycle].max() <= 1


def test_a_clock_with_jitter_is_right_on_average_and_uneven():
    alone = {"robots": [{"count": 40, "controller": "oscillator"}], "arena": {"width_cm": 200, "height_cm": 200}}
    dark = [{"kind": "ring_dead"}, {"kind": "clock_jitter", "jitter": 0.2, "at_s": 0, "until_s": 20}]
    ticks = np.diff(steps_of({**alone, "faults": dark}, 260)["phase_ms"], axis=0)
    uneven, even = (each[each > 0] for each in (ticks[:198], ticks[201:]))
    assert ((uneven >= 80) & (uneven <= 120)).all()
    assert uneven.mean() == pytest.approx(100, abs=4 * 11.6 / math.sqrt(uneven.size))
    assert uneven.std() == pytest.approx(20 / math.sqrt(3), rel=0.05)
    assert (even == 100).all()


@pytest.mark.parametrize("signal", [{"kind": "camera"}, {"kind": "cone", "angle_deg": 30}], ids=["camera", "cone"])
def test_a_flash_is_missed_as_a_whole_and_independently_of_others(signal):
    """The slow twin draws for each flash whether the one robot that looks at the flasher misses it."""
    group = {"poses": [[10, 10, 0], [30, 10, 0]], "controller": "external", "signal": signal}
    simulation = Simulation({"robots": [group], "noise": "off", **with_fault("camera_misses", missed=0.3)}, 7)
    key, is_seen = swarm_of(simulation).affected.key[0], []
    next(simulation)
    for flash in range(1, 151):
        is_seen.append(random_share(key, 1, flash) >= 0.3)
        for lit in (True, True, True, False):
            simulation.command(ring_on=[False, lit])
            assert next(simulation).camera[0].any() == (lit and is_seen[-1])
    assert np.mean(is_seen) == pytest.approx(0.7, abs=4 * math.sqrt(0.21 / 150))


def test_who_sees_which_flashes_is_as_a_slow_twin_says():
    faults = [
        {"kind": "camera_misses", "missed": 0.6, "nearer_than_cm": 20, "share": 0.7},
        {"kind": "camera_misses", "missed": 0.5, "farther_than_cm": 30},
        {"kind": "camera_misses", "missed": 0.2, "nearer_than_cm": 10, "farther_than_cm": 40},
        {"kind": "camera_blind", "robots": [3]},
    ]
    block = faulty_block(faults, 20, 3)
    swarm, random = open_block(block), np.random.default_rng(1)
    swarm.robots.x, swarm.robots.y = random.random((2, 20)) * 60
    swarm.robots.ring_on, swarm.robots.flash_number = random.random(20) < 0.7, random.integers(0, 99, 20)
    robot_faults.change_faults(block, NOWHERE, 0)
    affected, robots = swarm.affected.reshape(4, 20), swarm.robots

    def is_missed(robot, other, fault):
        section, distance = faults[fault], math.dist(*((robots.x[each], robots.y[each]) for each in (robot, other)))
        if not affected.is_member[fault, robot] or section["kind"] == "camera_blind":
            return section["kind"] == "camera_blind" and robot == 3
        share = random_share(affected.key[fault, robot], other, robots.flash_number[other])
        near, far = section.get("nearer_than_cm", 0), section.get("farther_than_cm", math.inf)
        return (distance < near or distance > far) and share < section["missed"]

    seen = []
    for robot in range(20):
        robot_faults.hide_flashes(block, NOWHERE, robot)
        seen.append(swarm.numbers[20:].tolist())
        hidden = [any(is_missed(robot, other, fault) for fault in range(4)) for other in range(20)]
        assert seen[-1] == (robots.ring_on & ~np.array(hidden)).astype(int).tolist()
    assert 100 < np.sum(seen) < 20 * robots.ring_on.sum() - 50


def test_random_shares_are_uniform_and_do_not_depend_on_each_other():
    drawn, flashes = random_share, [(sender, flash) for sender in range(10) for flash in range(50)]
    shares = np.array([[drawn(np.uint64(key), *flash) for flash in flashes] for key in range(8)])
    assert ((np.histogram(shares, 20, (0, 1))[0] - 200) ** 2 / 200).sum() < 43.8
    assert len(np.unique(shares)) == shares.size
    assert np.abs(np.corrcoef(shares)[np.triu_indices(8, 1)]).max() < 5 / math.sqrt(500)
    assert abs(np.corrcoef(shares[:, 1:].ravel(), shares[:, :-1].ravel())[0, 1]) < 4 / math.sqrt(4000)


def test_oscillators_start_anew_at_uniform_phases_with_dark_rings():
    group = {"count": 60, "controller": "oscillator"}
    dark, anew = {"kind": "ring_dead"}, {"kind": "restart", "at_s": 2}
    scenario = {"robots": [group], "arena": {"width_cm": 200, "height_cm": 200}, "faults": [dark, anew]}
    ideal, faulty = (steps_of(each, 22) for each in ({**scenario, "faults": [dark]}, scenario))
    assert ideal["phase_ms"][:20].tobytes() == faulty["phase_ms"][:20].tobytes()
    phases = np.concatenate([steps_of(scenario, 21, seed)["phase_ms"][20] for seed in range(5)])
    counts, _ = np.histogram(phases, 10, (0, 5000))
    assert ((counts - 30) ** 2 / 30).sum() < 27.9
    assert abs(np.corrcoef(ideal["phase_ms"][20], faulty["phase_ms"][20])[0, 1]) < 0.5


def test_events_are_the_beginnings_and_ends_of_faults_in_whom_they_began_and_ended():
    """The slow twin looks at who has which fault in each step."""
    simulation = Simulation(FAULTY, 3)
    swarm = swarm_of(simulation)
    active, expected = np.zeros((len(EVERYTHING), 8), bool), []
    for number in range(100):
        next(simulation)
        now = swarm.affected.is_active.reshape(-1, 8)
        for fault, change in np.ndindex(len(EVERYTHING), 2):
            robots = np.flatnonzero((now[fault] != active[fault]) & (now[fault] == change))
            if len(robots):
                what = f"{EVERYTHING[fault]['kind']} {('ends', 'begins')[change]}"
                expected.append((number, f"faults.{fault}", what, tuple(robots.tolist())))
        restarted = np.flatnonzero(swarm.robots.starts_anew_at >= 0)
        if len(restarted):
            expected.append((number, f"faults.{len(EVERYTHING) - 1}", "restart", tuple(restarted.tolist())))
        active = now.copy()
    assert [(event.step, event.source, event.what, event.robots) for event in simulation.events] == expected
    assert len(expected) > 25
    unseen = Simulation(FAULTY, 3)
    unseen.advance(100)
    assert unseen.events == simulation.events


def test_changes_are_told_once_by_their_times_and_the_log_has_room_for_all():
    faults = [
        {"kind": "restart", "per_hour": 360_000},
        {"kind": "ring_dead", "robots": [2, 5], "at_s": 0.3, "until_s": 0.5},
        {"kind": "infrared_dead", "per_hour": 360_000, "mean_s": 0.01},
    ]
    block = faulty_block(faults, 6, 3)
    swarm = open_block(block)
    for step in range(robot_faults.LOGGED_STEPS):
        swarm.scene[0].step = step
        robot_faults.change_faults(block, NOWHERE, 0)
    events = robot_faults.take_events(swarm)
    begun, ended = [event for event in events if event.source == "faults.1"]
    assert begun == TrialEvent(3, 0.3, "faults.1", "ring_dead begins", (2, 5))
    assert ended == begun._replace(step=5, time_s=0.5, what="ring_dead ends")
    assert [event.step for event in events] == sorted(event.step for event in events)
    assert robot_faults.take_events(swarm) == []
