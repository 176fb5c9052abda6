"""Robots of other kinds than the e-puck: how they turn, touch, sense and hide each other, in closed forms."""

import math
from itertools import islice

import numpy as np
import pytest

from epuck_sim.embodied.observers import find_contacts, make_scene
from epuck_sim.embodied.simulation import Simulation

RADIO = {"kind": "radio"}
NOTHING_MM = 65535
FLOOR = {"width_cm": 50, "height_cm": 50}


def drive(poses, left_cm_s, right_cm_s, robot="kilobot", signal=RADIO, **sections) -> Simulation:
    """Return a simulation of robots whose wheels turn all the time."""
    parameters = {"left_cm_s": left_cm_s, "right_cm_s": right_cm_s}
    group = {"poses": poses, "controller": "constant", "parameters": parameters, "signal": signal}
    return Simulation({"arena": FLOOR, "noise": "off", "robot": robot, "robots": [group], **sections}, 1)


@pytest.mark.parametrize(
    ("robot", "limit", "base"),
    [
        ("epuck", 12.8, 5.1),
        ("kilobot", 1.0, 2.5),
        ({"kind": "kilobot", "wheel_limit_cm_s": 3, "wheel_base_cm": 2}, 3, 2),
    ],
)
def test_a_robot_turns_on_the_spot_by_its_wheels_limit_and_distance(robot, limit, base):
    step = drive([[25, 25, 0]], -12.8, 12.8, robot).advance(11)
    assert step.wheels_cm_s.tolist() == [[-limit, limit]]
    np.testing.assert_allclose(step.poses[0], [25, 25, 2 * limit / base], rtol=0, atol=1e-9)  # in a second


def mixed(*groups, interpret=False, **sections) -> Simulation:
    """Return a simulation of robots of some kinds; groups: kind, poses, speed of both wheels, and further keys."""
    robots = [
        {
            "kind": kind,
            "poses": poses,
            "controller": "constant",
            "parameters": {"left_cm_s": speed, "right_cm_s": speed, "ring_on": True},
            "signal": RADIO,
            **further,
        }
        for kind, poses, speed, further in groups
    ]
    return Simulation({"arena": FLOOR, "noise": "off", "robots": robots, **sections}, 1, interpret=interpret)


def test_each_robot_drives_with_its_own_wheels_and_stops_where_the_two_bodies_touch():
    step = mixed(("epuck", [[15, 25, 0]], 12.8, {}), ("kilobot", [[40, 25, math.pi]], 12.8, {})).advance(200)
    assert step.wheels_cm_s.tolist() == [[12.8, 12.8], [1, 1]]
    assert step.poses[1, 0] - step.poses[0, 0] == pytest.approx(3.7 + 1.65, abs=0.17)  # both are pressed
    assert [0, 1] in step.contacts.tolist()
    # the faster one has pushed the other one to the wall, where pymunk leaves it up to 0.2 mm short of a contact
    assert step.poses[1, 0] == pytest.approx(50 - 1.65, abs=0.2)
    around = {"parameters": {"left_cm_s": -1, "right_cm_s": 1}}
    turned = mixed(("epuck", [[25, 25, 0]], 0, around), ("kilobot", [[10, 10, 0]], 0, around))
    assert turned.advance(11).poses[:, 2].tolist() == pytest.approx([2 / 5.1, 2 / 2.5])


def test_heavy_robots_push_light_ones():
    """Equal speeds meet at the share of the momentum: 152 and 24 g."""
    simulation = mixed(("epuck", [[20, 25, 0]], 1, {}), ("kilobot", [[30, 25, math.pi]], 1, {}))
    before, after = (simulation.advance(100).poses[:, 0].copy() for _ in range(2))
    speed = (152 - 24) / (152 + 24)
    assert (after - before) / 10 == pytest.approx([speed, speed], abs=0.01)


def test_the_contact_of_two_kinds_lies_between_their_surfaces():
    simulation = mixed(("epuck", [[20, 25, 0]], 0, {}), ("kilobot", [[20 + 3.7 + 1.65 + 0.01, 25, 0]], 0, {}))
    poses = simulation.advance(1).poses[None].copy()
    scenario = simulation.scenario
    found, points = find_contacts(make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build()), poses)
    assert found.tolist() == [[0, 0, 1]]
    assert points[0] == pytest.approx([23.7, 25], abs=0.01)


def test_own_sensors_know_the_radius_of_the_robot_that_senses_and_of_others(tmp_path):
    (tmp_path / "sizes.py").write_text(
        "from epuck_sim.embodied.sensing import distance_cm\n\nREADINGS = {'sizes': (float, 3)}\n\n\n"
        "def sense(world, robot, readings, parameters, random):\n"
        "    other = world.robots[1 - robot.number]\n"
        "    readings.sizes[0], readings.sizes[1] = robot.radius_cm, other.radius_cm\n"
        "    readings.sizes[2] = distance_cm(world, robot.x, robot.y, robot.heading, 30.0, robot.number)\n"
    )
    sensors = {"sensors": [str(tmp_path / "sizes.py")]}
    groups = ("epuck", [[10, 25, 0]], 0, sensors), ("kilobot", [[30, 25, math.pi]], 0, sensors)
    sizes = mixed(*groups, interpret=True).advance(1).readings["sizes"]
    assert sizes == pytest.approx(np.array([[3.7, 1.65, 20 - 1.65], [1.65, 3.7, 20 - 3.7]]))


def test_a_robot_without_infrared_sensors_reads_nothing_in_range_from_all():
    group = {"count": 40, "controller": "constant", "signal": RADIO}
    simulation = Simulation({"arena": FLOOR, "robot": "kilobot", "robots": [group]}, 1)
    for step in islice(simulation, 10):  # the noise of readings is on
        assert (step.infrared == 0).all()
        assert (step.distance_mm == NOTHING_MM).all()
