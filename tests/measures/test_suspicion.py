"""Suspicions: closed forms with robots that stand still, and a slow twin with robots that move."""

import numpy as np
import pytest

from epuck_sim import Simulation, load_scenario, run_trial
from epuck_sim.embodied.observers import find_sightings, make_scene

PERIOD_S = 5.0
FACE_TO_FACE = [[20.0, 30.0, 0.0], [40.0, 30.0, np.pi]]
SWARM = {"robots": [{"count": 8, "camera": {"field_of_view_deg": 90}}]}


def value(measure, seconds, faults=(), robots=None, seed=5, observers=()):
    """Return a measure of robots that stand face to face, or of others, after so many seconds."""
    robots = robots or [{"poses": FACE_TO_FACE, "controller": "oscillator"}]
    stop = {"order_parameter": None, "max_time_s": seconds}
    loaded = load_scenario({"robots": robots, "faults": list(faults), "stop": stop, "measures": [measure]})
    (found,) = run_trial(Simulation(loaded, seed), observers).measures.values()
    return found


def test_a_robot_is_suspected_after_the_patience_since_its_last_flash_or_since_the_start():
    patient, dead = {"detection_delay": {"cycles": 3}}, {"kind": "ring_dead", "robots": [1]}
    assert 3 - 1 < value(patient, 60, [{**dead, "at_s": 20}]) < 3  # up to a period before the fault counts
    assert value(patient, 60, [dead]) == pytest.approx(3, abs=0.041)  # two steps of 0.1 s


@pytest.mark.parametrize("at_s", [20, 21.3, 22.6, 23.9])
def test_a_fault_amid_many_steps_is_noticed_as_in_steps_one_by_one(at_s):
    """Some are suspected already when it begins."""
    given = {"detection_delay": {"cycles": 0.5}}, 60, [{"kind": "ring_dead", "robots": [1], "at_s": at_s}]
    assert value(*given) == value(*given, observers=[lambda *_: None])


def test_all_that_fail_must_be_found():
    three = [{"poses": [*FACE_TO_FACE, [50.0, 30.0, 0.0]], "controller": "oscillator"}]
    assert value("detection_delay", 60, [{"kind": "ring_dead", "robots": [1]}], three) is not None
    assert value("detection_delay", 60, [{"kind": "ring_dead", "robots": [1, 2]}], three) is None


def test_without_faults_there_is_no_delay_and_who_is_always_in_view_gives_no_alarm():
    assert value("detection_delay", 60) is None
    assert value({"false_alarms": {"cycles": 1.1}}, 600) == 0


def test_impatient_robots_suspect_each_other_once_a_cycle():
    alarms = value({"false_alarms": {"cycles": 0.5}}, 600)
    assert alarms == pytest.approx(3600 / PERIOD_S, rel=0.12)  # coupling shortens cycles


def slow_alarms(cycles, seconds, dead, seed):
    """Count by going through all pairs of robots in each step."""
    loaded = load_scenario({**SWARM, "faults": [{"kind": "ring_dead", "robots": [dead]}]})
    simulation, robots = Simulation(loaded, seed), 8
    scene = make_scene(loaded.robots, loaded.group_kinds, loaded.arena.build())
    dark = {(i, j): 0.0 for i in range(robots) for j in range(robots)}
    suspects: set[tuple[int, int]] = set()
    alarms = 0
    for step in (simulation.advance(1) for _ in range(int(10 * seconds))):
        seen = {(i, j) for _, i, j in find_sightings(scene, step.poses.copy()[None]).tolist()}
        flashes = set(map(tuple, step.sightings.tolist()))
        dark = {pair: 0.0 if pair in flashes else dark[pair] + 0.1 * (pair in seen) for pair in dark}
        suspected = {pair for pair, dark_s in dark.items() if dark_s > cycles * PERIOD_S - 0.001}
        alarms += sum(pair[1] != dead for pair in suspected - suspects)
        suspects = suspected
    return alarms / robots / (seconds / 3600)


def test_false_alarms_are_those_of_a_slow_twin():
    faults = [{"kind": "ring_dead", "robots": [2]}]
    found = value({"false_alarms": {"cycles": 0.7}}, 120, faults, SWARM["robots"])
    assert found == pytest.approx(slow_alarms(0.7, 120, 2, 5))
    assert found > 0
