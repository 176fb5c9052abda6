"""Claims about schedules: what changes when and nothing else, robots that come and go, and walls that move."""

import math
from itertools import islice
from types import SimpleNamespace

import numpy as np
import pytest

from epuck_sim import ScenarioError, Simulation, load_scenario, run_trial
from epuck_sim.control.loader import find_controller, load_controller
from epuck_sim.embodied.cells import set_cells
from epuck_sim.embodied.changes.schedule import displace_phases, put_in, take_out
from epuck_sim.epuck import OUT_OF_RANGE_MM, RADIUS_CM
from epuck_sim.scenario.changes import RobotDisplacement, TrialEvent
from tests.control.bench import controlled_swarm, with_step, write_controller
from tests.embodied.steps import APART, GATE, PILLARS, REBUILT, SCHEDULED, SIGNALS, kept, steps_of, swarm_of

POSES = [[10, 10, 0.3], [20, 20, 2], [30, 12, 3], [45, 45, 1], [12, 40, 4], [40, 20, 5]]
MOVABLES = [{"x_cm": 25, "y_cm": 30, "radius_cm": 3, "mass_kg": 0.05, "friction": 0.1}]
(LIGHT,) = SCHEDULED["faults"]
BEHIND = {"poses": [[20, 50, 0], [20, 18, 1], [22, 33, 2]]}
GATED = {"arena": {"obstacles": GATE}, "robots": [REBUILT["robots"][0], BEHIND]}


def started_swarm(controllers, counts):
    """Return a block with groups of robots in the arena, the swarm, and controllers, which have started."""
    robots = sum(counts)
    rooms = {"cells": 99, "members": robots, "circles": 9, "numbers": 2 * robots}
    block, swarm, runs = controlled_swarm(controllers, counts, 3, **rooms)
    swarm.groups.pixels, swarm.groups.row = 1, swarm.groups.first
    swarm.groups.in_view, swarm.groups.waiting = swarm.groups.row + robots, swarm.groups.row + 2 * robots
    swarm.scene[0].step, swarm.scene[0].step_ms = -1, 100
    for run in runs:
        run.start()
    return block, swarm, runs


def test_changes_act_from_the_first_control_step_that_is_not_before_their_time():
    simulation = Simulation(SCHEDULED, 1)
    steps = kept(simulation, 40)
    speeds, phases = np.array([step.wheels_cm_s.max(axis=1) for step in steps]), [step.phase_ms for step in steps]
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


def test_a_scheduled_restart_happens_once_and_faults_that_begin_and_end_at_once_are_as_the_last_entry_says():
    faults = [{"kind": "restart", "scheduled": True}]
    scenario, schedules = {**APART, "faults": faults}, ([], [{"at_s": 1, "begin": [0]}])
    ideal, anew = (steps_of({**scenario, "schedule": each}, 30, 1)["phase_ms"] for each in schedules)
    assert ideal[:10].tobytes() == anew[:10].tobytes()
    assert (ideal[10] != anew[10]).all()
    assert np.isin(np.diff(anew[10:25], axis=0), [100]).mean() > 0.8
    for before in ([], [{"at_s": 0, "begin": [0]}]):
        for keys, expected in ((["begin", "end"], False), (["end", "begin"], True), (["begin", "end", "begin"], True)):
            entries = [*before, *({"at_s": 1, key: [0]} for key in keys)]
            simulation = Simulation({**APART, "faults": [LIGHT], "schedule": entries}, 1)
            simulation.advance(12)
            assert swarm_of(simulation).affected.is_active.tolist() == [False, expected, False], entries


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


@pytest.mark.parametrize("obstacle", [[], [(20, 30, 7.5)]])
def test_who_comes_is_placed_as_numpy_draws_and_starts_with_what_the_scenario_says(obstacle):
    memory = {"phase_ms": [100, 200, 300, 400]}
    groups = [{"count": 3, "controller": "firefly"}, {"count": 4, "controller": "firefly", "memory": memory}]
    scenario = load_scenario({"robots": groups})
    controller = find_controller("firefly")
    block, swarm, runs = started_swarm([controller, controller], [3, 4])
    robots, sequence = swarm.robots, np.random.SeedSequence(7, spawn_key=(7, 2, 0))

    def move(robot, pose):
        robots.x[robot], robots.y[robot], robots.heading[robot] = pose

    bodies, robots.radius_cm = SimpleNamespace(move=move), RADIUS_CM
    set_cells(swarm, 40, 50, 8)
    swarm.scene[0].circles = len(obstacle)
    for number, circle in enumerate(obstacle):
        swarm.circles[number] = circle
    robots.x[[0, 2, 4]], robots.y[[0, 2, 4]] = [5, 15, 30], [6, 14, 20]
    robots.actuators.send = 3
    take_out([1, 3, 5, 6], swarm, bodies, runs)
    forgotten = [*runs[0].memory[[1]], *runs[1].memory[[0, 2, 3]], *robots.actuators[[1, 3, 5, 6]]]
    assert not any(each.tobytes().strip(b"\0") for each in forgotten)
    random, taken, expected = np.random.default_rng(sequence), [(5, 6), (15, 14), (30, 20)], []
    while len(expected) < 3:
        x, y = (RADIUS_CM + (side - 2 * RADIUS_CM) * random.random() for side in (40, 50))
        is_clear = all(math.dist((x, y), (cx, cy)) - radius >= RADIUS_CM for cx, cy, radius in obstacle)
        if is_clear and all(math.dist((x, y), other) >= 2 * RADIUS_CM for other in taken):
            taken.append((x, y))
            expected.append((x, y, 2 * math.pi * random.random()))
    kept = runs[1].memory[1].copy()
    put_in([6, 1, 4, 3], None, scenario, block, bodies, runs, sequence, "here")
    poses = np.column_stack([robots.x, robots.y, robots.heading])
    assert poses[[6, 1, 3]].tolist() == [list(pose) for pose in expected]
    assert robots.present.tolist() == [True, True, True, True, True, False, True]
    assert runs[1].memory["phase_ms"][[0, 3]].tolist() == [100, 400]
    assert runs[1].memory[1] == kept
    x, y = poses[6, :2]
    for place in ((x + 2 * RADIUS_CM - 1e-5, y, 0), (RADIUS_CM - 1e-5, 25, 0), (50, 5, 0)):
        with pytest.raises(ScenarioError, match=r"here: robot 5 cannot come to \["):
            put_in([5], [place], scenario, block, bodies, runs, sequence, "here")
    free = (40 - RADIUS_CM, 50 - RADIUS_CM, 1)
    assert min(math.dist(free[:2], pose[:2]) for pose in poses[robots.present]) > 2 * RADIUS_CM
    put_in([5], [free], scenario, block, bodies, runs, sequence, "here")
    assert (robots.x[5], robots.y[5], robots.heading[5]) == free


@pytest.mark.parametrize("number", range(4))
def test_who_is_out_is_as_if_it_did_not_exist(number):
    signal, movables = SIGNALS[number], MOVABLES if number < 2 else []
    faults = [] if number % 2 else [{"kind": "infrared_dead", "robots": [0]}]

    def shown(groups, schedule=()):
        robots = []
        for group, (first, end) in enumerate(groups):
            memory = {"phase_ms": [*range(700 * first, 700 * end, 700)]}
            robots.append({"poses": POSES[first:end], "memory": memory, "signal": signal, "present": group < 2})
        given = {"robots": robots, "noise": "off", "arena": {"movables": movables}, "faults": faults}
        return steps_of({**given, "schedule": schedule}, 60, 1)  # more than a period, in which each ring flashes

    expected = shown([(0, 3), (3, 4)])
    removed, absent = shown([(0, 3), (3, 6)], [{"at_s": 0, "remove": [4, 5]}]), shown([(0, 3), (3, 4), (4, 6)])
    for found in (removed, absent):
        for name, values in expected.items():
            assert found[name][:, :4].tobytes() == values.tobytes(), name
        assert np.isnan(found["poses"][:, 4:]).all()
        assert np.isnan(found["phase_ms"][:, 4:]).all()
        assert not any(found[name][:, 4:].any() for name in ("ring_on", "ring_commands", "infrared", "camera"))
        assert (found["distance_mm"][:, 4:] == OUT_OF_RANGE_MM).all()
    assert expected["camera"].any()


def test_order_counts_those_present():
    memory, still = {"phase_ms": [0, 0, 2500, 2500, 1250, 3750]}, {"speed_cm_s": 0, "coupling": 1e-6}
    robots, stop = {"poses": POSES, "memory": memory, "parameters": still}, {"order_parameter": 0.95, "max_cycles": 5}
    given = {"robots": [robots], "noise": "off", "stop": stop}

    def after(*removed):
        return run_trial(Simulation({**given, "schedule": [{"at_s": 1, "remove": removed}] if removed else []}, 1))

    assert after().order_parameter == pytest.approx(0, abs=0.02)
    assert after(1, 2, 3, 5).order_parameter == pytest.approx(math.sqrt(0.5), abs=0.03)  # within a control step
    assert after(2, 3, 4, 5).t_sync_cycles == 1
    alone = after(1, 2, 3, 4, 5)  # a single robot runs on
    assert (alone.order_parameter, alone.t_sync_cycles) == (1, None)


def test_a_robot_that_leaves_sends_no_more(tmp_path):
    sender = write_controller(tmp_path / "sender.py", with_step("actuators.send = 5\n    memory.x = sensors.pulses"))
    group = {"count": 2, "controller": str(sender.path), "signal": {"kind": "radio"}}
    simulation = Simulation({"robots": [group], "schedule": [{"at_s": 1, "remove": [1]}]}, 1, interpret=True)
    assert [simulation.advance(steps).memories[0]["x"][0] for steps in (5, 7)] == [1, 0]


@pytest.mark.parametrize("signal", [{"kind": "camera"}, {"kind": "cone", "angle_deg": 360}])
@pytest.mark.parametrize("faults", [[], [{"kind": "infrared_dead", "robots": [1]}]])
def test_an_arena_that_is_changed_at_once_is_as_one_that_was_so_from_the_start(signal, faults):
    arena = {"width_cm": 90, "height_cm": 70, "obstacles": PILLARS}
    robots = [{**group, "signal": signal} for group in GATED["robots"]]
    given = {**GATED, "robots": robots, "faults": faults}
    expected = steps_of({**given, "arena": arena}, 120, 1)
    values = {f"arena.{key}": value for key, value in arena.items()}
    found = steps_of({**given, "schedule": [{"at_s": 0, "set": values}]}, 120, 1)
    for name, steps in expected.items():
        assert found[name].tobytes() == steps.tobytes(), name
    assert expected["poses"][..., 0].max() > 70


def test_robots_pass_a_wall_once_it_is_lifted_and_stay_within_walls_that_come():
    lifted = {"at_s": 10, "set": {"arena.width_cm": 90, "arena.obstacles": []}}
    simulation = Simulation({**GATED, "schedule": [lifted]}, 1)
    farthest = []
    for number, step in enumerate(islice(simulation, 600)):
        x, y = step.poses[:, 0], step.poses[:, 1]
        farthest.append(x.max())
        gaps = np.column_stack([x, y, (60 if number < 100 else 90) - x, 60 - y]).min(axis=1)
        if number < 100:
            gaps = np.minimum(gaps, np.abs(29 - x))
        touching = {robot for robot, other in step.contacts.tolist() if other == -1}
        assert touching == set(np.flatnonzero(gaps <= 3.7 + 0.16).tolist())
    assert max(farthest[:100]) < 26
    assert max(farthest[100:]) > 70


def test_a_step_shows_the_arena_of_its_time_with_movables_where_they_are_which_may_touch_a_wall_that_comes():
    simulation = Simulation(REBUILT, 1)
    assert [simulation.advance(10).arena.width_cm for _ in range(6)] == [60, 60, 60, 65, 65, 90]
    step = simulation.last_step
    assert step.arena.circles[:, :2].tobytes() == step.movables.tobytes()
    simulation.reset()
    assert simulation.last_step.arena.width_cm == 60
    scene = {"arena": {"movables": [MOVABLES[0] | {"x_cm": 50, "y_cm": 50}]}, "robots": [{"poses": [[10, 10, 0]]}]}
    Simulation({**scene, "schedule": [{"at_s": 1, "set": {"arena.width_cm": 53}}]}, 3).advance(12)
