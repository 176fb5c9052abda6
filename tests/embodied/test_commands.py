"""Claims about commands from outside: robots do at once what is commanded, exactly as a controller would have them."""

import numpy as np
import pytest

from epuck_sim.control.loader import find_controller
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ControllerError
from epuck_sim.scenario.loader import load_scenario
from tests.control.bench import EMPTY, with_step
from tests.embodied.steps import kept

POLICY = with_step(
    """actuators.left_cm_s = 12.8 - sensors.infrared[7] / 50.0
    actuators.right_cm_s = -3.0 if sensors.camera.sum() > 0 else 40.0
    actuators.ring_on = sensors.distance_mm.min() < 60 or memory.steps % 17 == 0
    memory.steps += 1""",
    MEMORY="{'steps': int}",
)


def act(simulation, step):
    robots = simulation.external_wheels
    seen = step.camera[robots].sum(axis=1) > 0
    near = step.distance_mm[robots].min(axis=1) < 60
    left = 12.8 - step.infrared[robots, 7] / 50.0
    simulation.command(left, np.where(seen, -3.0, 40.0), near | (step.number % 17 == 0))


@pytest.mark.parametrize("interpret", [False, True])
def test_robots_commanded_from_outside_move_and_flash_as_with_a_controller_to_the_bit(interpret, tmp_path):
    path, others = tmp_path / "policy.py", [{"count": 3}, {"count": 2, "controller": "oscillator"}]
    path.write_text(POLICY)
    imperfect = {"spread": {"wheel_speed": 0.2, "infrared_gain": 0.1}, "stuck": {"per_hour": 900, "mean_s": 2}}
    ruled, free = (
        load_scenario({"robots": [*others, {"count": 6, "controller": name}], **imperfect})
        for name in (str(path), "external")
    )
    commanded = Simulation(free, 3, interpret=interpret)
    for theirs in kept(Simulation(ruled, 3, interpret=True), 100):
        step = next(commanded)
        act(commanded, step)
        for name in ("poses", "infrared", "distance_mm", "camera", "wheels_cm_s", "ring_on"):
            np.testing.assert_array_equal(getattr(step, name), getattr(theirs, name), err_msg=name)
    assert step.ring_on.any()


def test_a_command_holds_until_the_next_what_is_left_out_stays_and_parts_are_commanded_apart():
    robots = [{"controller": "external_wheels", "count": 3}, {"controller": "external_ring", "count": 2}]
    simulation = Simulation({"robots": robots}, 1, interpret=True)
    assert simulation.external_wheels.tolist() == [0, 1, 2]
    assert simulation.external_rings.tolist() == [3, 4]
    simulation.command(left_cm_s=-5.0, right_cm_s=[5.0, 6.0, -20.0], ring_on=[False, True])
    simulation.command(left_cm_s=-6.0)
    steps = kept(simulation, 100)
    rings = np.array([step.ring_on for step in steps])
    assert rings[:, :3].any(axis=0).all()  # oscillators with commanded wheels flash by themselves
    assert not rings[:, 3].any()
    assert rings[:, 4].all()
    assert all(step.wheels_cm_s[:3].tolist() == [[-6, 5], [-6, 6], [-6, -12.8]] for step in steps)
    assert (steps[-1].wheels_cm_s[3:] > 0).any()


def test_faults_and_absence_come_after_commands():
    robots = [{"controller": "external", "count": 3, "placement": "grid"}]
    faults, schedule = [{"kind": "ring_dead", "robots": [0]}], [{"at_s": 0, "remove": [1]}]
    simulation = Simulation({"robots": robots, "faults": faults, "schedule": schedule}, 1, interpret=True)
    next(simulation)
    simulation.command(5, 5, ring_on=True)
    assert simulation.last_step.ring_on.tolist() == [False, False, True]
    assert simulation.last_step.wheels_cm_s.tolist() == [[5, 5], [0, 0], [5, 5]]


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"left_cm_s": np.zeros(3)}, r"left_cm_s has the shape \(3,\); allowed: \(2,\)"),
        ({"left_cm_s": [1.0, np.nan]}, "left_cm_s is nan for robot 9; allowed: numbers"),
        ({"left_cm_s": ["fast", "slow"]}, "left_cm_s is fast for robot 8; allowed: numbers"),
        ({"right_cm_s": 1.0, "ring_on": [True, 2]}, "ring_on is 2 for robot 9; allowed: true and false"),
        ({"right_cm_s": 1.0, "ring_on": [True]}, r"ring_on has the shape \(1,\)"),
    ],
)
def test_commands_that_do_not_fit_are_refused_and_nothing_is_commanded(given, message):
    simulation = Simulation({"robots": [{"count": 8}, {"count": 2, "controller": "external"}]}, 1, interpret=True)
    with pytest.raises(ValueError, match=message):
        simulation.command(**given)
    step = next(simulation)
    assert not step.wheels_cm_s[8:].any()
    assert not step.ring_on[8:].any()


@pytest.mark.parametrize(
    ("controller", "command", "message"),
    [
        ("firefly", {"left_cm_s": 0}, "no robot has its wheels commanded from outside; give a group `controller: e"),
        ("external_wheels", {"ring_on": True}, "no robot has its ring commanded"),
        ("external", {}, "nothing is commanded; give left_cm_s, right_cm_s or ring_on"),
    ],
)
def test_robots_that_have_controllers_are_not_commanded_and_nothing_is_no_command(controller, command, message):
    with pytest.raises(ValueError, match=message):
        Simulation({"robots": [{"controller": controller}]}, 1, interpret=True).command(**command)


def test_a_file_says_what_is_external(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(EMPTY + "\nEXTERNAL = ('ring',)\n")
    assert find_controller(str(path)).external == ("ring",)
    path.write_text(EMPTY + "\nEXTERNAL = ('camera',)  # no actuator\n")
    with pytest.raises(ControllerError, match=r"EXTERNAL is \('camera',\); allowed: a tuple of wheels, ring"):
        find_controller(str(path))
