"""Claims about robots that come and go: who is out is as if it did not exist, and who comes starts anew."""

import math

import numpy as np
import pytest

from epuck_sim.control.loader import find_controller
from epuck_sim.embodied.cells import set_cells
from epuck_sim.embodied.changes.attendance import put_in, take_out
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.epuck import OUT_OF_RANGE_MM, RADIUS_CM
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from tests.control.bench import with_step
from tests.embodied.changes.blocks import started_swarm
from tests.embodied.changing import SIGNALS, steps_of

POSES = [[10, 10, 0.3], [20, 20, 2], [30, 12, 3], [45, 45, 1], [12, 40, 4], [40, 20, 5]]
MOVABLES = [{"x_cm": 25, "y_cm": 30, "radius_cm": 3, "mass_kg": 0.05, "friction": 0.1}]


class Bodies:
    def __init__(self, swarm):
        self.robots = swarm.robots

    def move(self, robot, pose):
        self.robots.x[robot], self.robots.y[robot], self.robots.heading[robot] = pose


@pytest.mark.parametrize("obstacle", [[], [(20, 30, 7.5)]])
def test_who_comes_is_placed_as_numpy_draws_and_starts_with_what_the_scenario_says(obstacle):
    """The slow twin draws from numpy's generator until a place is free."""
    memory = {"phase_ms": [100, 200, 300, 400]}
    groups = [{"count": 3, "controller": "firefly"}, {"count": 4, "controller": "firefly", "memory": memory}]
    scenario = load_scenario({"robots": groups})
    controller = find_controller("firefly")
    block, swarm, runs = started_swarm([controller, controller], [3, 4])
    bodies, robots, sequence = Bodies(swarm), swarm.robots, np.random.SeedSequence(7, spawn_key=(7, 2, 0))
    robots.radius_cm = RADIUS_CM
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


def quiet(groups, **others):
    """Return a scenario without noise, and groups of robots with these numbers among `POSES`."""
    robots = [
        {"poses": [POSES[robot] for robot in group], "memory": {"phase_ms": [700 * robot for robot in group]}}
        for group in groups
    ]
    return {"robots": robots, "noise": "off", **others}


@pytest.mark.parametrize(
    ("signal", "faults", "movables"),
    [
        (SIGNALS[0], [{"kind": "infrared_dead", "robots": [0]}], MOVABLES),
        (SIGNALS[1], [], MOVABLES),
        (SIGNALS[2], [{"kind": "infrared_dead", "robots": [0]}], []),
        (SIGNALS[3], [], []),
    ],
)
def test_who_is_out_is_as_if_it_did_not_exist(signal, faults, movables):
    def shown(groups, schedule=()):
        given = quiet(groups, faults=faults, arena={"movables": movables}, schedule=schedule)
        for number, group in enumerate(given["robots"]):
            group |= {"signal": signal, "present": number < 2}
        return steps_of(given, 60, 1)  # more than a period, in which each ring flashes

    expected = shown([[0, 1, 2], [3]])
    removed, absent = shown([[0, 1, 2], [3, 4, 5]], [{"at_s": 0, "remove": [4, 5]}]), shown([[0, 1, 2], [3], [4, 5]])
    for found in (removed, absent):
        for name, values in expected.items():
            assert found[name][:, :4].tobytes() == values.tobytes(), name
        assert np.isnan(found["poses"][:, 4:]).all()
        assert np.isnan(found["phase_ms"][:, 4:]).all()
        assert not any(found[name][:, 4:].any() for name in ("ring_on", "ring_commands", "infrared", "camera"))
        assert (found["distance_mm"][:, 4:] == OUT_OF_RANGE_MM).all()
    assert expected["camera"].any()


def test_order_counts_those_present():
    given = quiet([[0, 1, 2, 3, 4, 5]], stop={"order_parameter": 0.95, "max_cycles": 5})
    given["robots"][0]["memory"] = {"phase_ms": [0, 0, 2500, 2500, 1250, 3750]}
    given["robots"][0]["parameters"] = {"speed_cm_s": 0, "coupling": 1e-6}

    def after(*removed):
        return run_trial(Simulation({**given, "schedule": [{"at_s": 1, "remove": removed}] if removed else []}, 1))

    assert after().order_parameter == pytest.approx(0, abs=0.02)
    assert after(1, 2, 3, 5).order_parameter == pytest.approx(math.sqrt(0.5), abs=0.03)  # within a control step
    assert after(2, 3, 4, 5).t_sync_cycles == 1
    alone = after(1, 2, 3, 4, 5)  # a single robot runs on
    assert (alone.order_parameter, alone.t_sync_cycles) == (1, None)


@pytest.mark.parametrize(
    ("second", "entry", "message"),
    [
        ([10, 30], {"poses": [[12, 10, 0]]}, r"schedule\.1, at 2 s, seed 1: robot 1 cannot come to \[12, 10\]"),
        ([10, 30], {"poses": [[59, 10, 0]]}, r"robot 1 cannot come to \[59, 10\]"),
        ([30, 10], {"set": {"arena.width_cm": 17, "arena.height_cm": 17}}, r"no free place was found for robot 1"),
    ],
)
def test_who_finds_no_place_ends_the_trial(second, entry, message):
    robots = [{"poses": [[8.5, 8.5, 0], [*second, 0]], "parameters": {"speed_cm_s": 0}}]
    schedule = [{"at_s": 1, "remove": [1]}, {"at_s": 2, "add": [1], **entry}]
    simulation = Simulation({"robots": robots, "schedule": schedule}, 1)
    with pytest.raises(ScenarioError, match=message):
        simulation.advance(25)


def test_a_robot_that_leaves_sends_no_more(tmp_path):
    sender = with_step("actuators.send = 5\n    memory.x = sensors.pulses")
    (tmp_path / "sender.py").write_text(sender)
    group = {"count": 2, "controller": str(tmp_path / "sender.py"), "signal": {"kind": "radio"}}
    simulation = Simulation({"robots": [group], "schedule": [{"at_s": 1, "remove": [1]}]}, 1, interpret=True)
    assert [simulation.advance(steps).memories[0]["x"][0] for steps in (5, 7)] == [1, 0]
