"""Claims about schedules of simulations: what changes when, and that nothing else does."""

import numpy as np
import pytest

from epuck_sim.control.loader import find_controller, load_controller
from epuck_sim.embodied.changes.schedule import displace_phases
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.changes import RobotDisplacement, TrialEvent
from tests.embodied.changes.blocks import started_swarm
from tests.embodied.changing import SCHEDULED, steps_of, swarm_of

APART = {key: SCHEDULED[key] for key in ("robots", "noise", "arena")}
(LIGHT,) = SCHEDULED["faults"]


def test_changes_act_from_the_first_control_step_that_is_not_before_their_time():
    simulation = Simulation(SCHEDULED, 1)
    speeds, phases = [], []
    for _ in range(40):
        step = next(simulation)
        speeds.append(step.wheels_cm_s.max(axis=1).copy())
        phases.append(step.phase_ms.copy())
    speeds = np.array(speeds)
    assert (speeds[:30, 0] == 12.8).all()
    assert (speeds[30:, 0] == 0).all()
    assert (speeds[:10, 1:] == 12.8).all()
    assert (speeds[10:, 1:] == 1.5).all()
    gained = (np.diff(phases, axis=0) - 100)[23] % 5000  # 2.35 s is before step 24
    assert gained.tolist() == [1250, 0, 1250]
    assert [(event.step, event.source) for event in simulation.events] == [
        *((5, "schedule.2"), (5, "faults.0"), (10, "schedule.0")),
        *((15, "schedule.3"), (15, "faults.0"), (24, "schedule.1"), (30, "schedule.4")),
    ]
    assert simulation.events[1] == TrialEvent(5, 0.5, "faults.0", "ring_dead begins", (1,))
    assert [event.what for event in simulation.events if event.source != "faults.0"] == [
        "faults.0 begins",
        "robots.1.parameters.speed_cm_s: 1.5; robots.1.parameters.coupling: 0.3",
        "faults.0 ends",
        "phases of 0, 2 by 0.25 cycles",
        "robots.0.parameters.speed_cm_s: 0; all phases random",
    ]


@pytest.mark.parametrize("begun", [False, True])
def test_faults_that_entries_begin_and_end_at_once_are_as_the_last_entry_says(begun):
    schedule = [{"at_s": 0, "begin": [0]}] * begun
    for keys, expected in ((["begin", "end"], False), (["end", "begin"], True), (["begin", "end", "begin"], True)):
        simulation = Simulation(
            {**APART, "faults": [LIGHT], "schedule": [*schedule, *({"at_s": 1, key: [0]} for key in keys)]}, 1
        )
        simulation.advance(12)
        assert swarm_of(simulation).affected.is_active.tolist() == [False, expected, False]


def test_a_scheduled_restart_happens_once():
    faults = [{"kind": "restart", "scheduled": True}]
    ideal, anew = (
        steps_of({**APART, "faults": faults, "schedule": schedule}, 30, 1)["phase_ms"]
        for schedule in ([], [{"at_s": 1, "begin": [0]}])
    )
    assert ideal[:10].tobytes() == anew[:10].tobytes()
    assert (ideal[10] != anew[10]).all()
    assert np.isin(np.diff(anew[10:25], axis=0), [100]).mean() > 0.8


@pytest.mark.parametrize("robots", [None, (1, 2, 5)])
@pytest.mark.parametrize("by_cycles", [0.29, -0.5, 3.25, "random"])
def test_whole_and_broken_phases_are_displaced_as_a_slow_twin_says(by_cycles, robots, tmp_path):
    path = tmp_path / "broken.py"
    path.write_text(find_controller("oscillator").path.read_text().replace('"phase_ms": int', '"phase_ms": float'))
    controllers = [find_controller("firefly"), find_controller("random_walk"), load_controller(path)]
    assert [each.is_oscillator for each in controllers] == [True, False, True]
    _, swarm, runs = started_swarm(controllers, [3, 1, 2])
    swarm.robots.actuators.ring_on = 1
    for run, phases in zip(runs[::2], ([0, 1449, 4999], [3.5, 77.25]), strict=True):
        run.memory["phase_ms"] = phases
    displaced = range(6) if robots is None else robots
    drawn = np.random.Generator(np.random.SFC64(np.random.SeedSequence(7))).random(6)
    expected = [0, 1449, 4999, None, 3.5, 77.25]
    for robot in displaced:
        if robot != 3:
            ahead = round(by_cycles * 5000, 6) if by_cycles != "random" else None
            phase = drawn[robot] * 5000 if ahead is None else (expected[robot] + ahead) % 5000
            expected[robot] = int(phase) if robot < 3 else phase
    displacement = RobotDisplacement(by_cycles=by_cycles, robots=robots)
    displace_phases(swarm, runs, displacement, np.random.SeedSequence(7))
    assert [*runs[0].memory["phase_ms"], None, *runs[2].memory["phase_ms"]] == expected
    assert swarm.robots.actuators.ring_on.tolist() == [int(each == 3 or each not in displaced) for each in range(6)]
