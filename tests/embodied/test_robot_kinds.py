"""Robots of other kinds than the e-puck: how they turn, touch, sense and hide each other, in closed forms."""

import math
from itertools import islice

import numpy as np
import pytest

from epuck_sim.arena import make_arena
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
from tests.embodied.bodies.worlds import FullSpaceWorld, MovedWorld

KILOBOT = load_scenario("kilobots").robot
RADIO = {"kind": "radio"}
NOTHING_MM = 65535
FLOOR = {"width_cm": 50, "height_cm": 50}


def drive(poses, left_cm_s, right_cm_s, robot="kilobot", signal=RADIO, **sections) -> Simulation:
    """Return a simulation of robots whose wheels turn all the time."""
    parameters = {"left_cm_s": left_cm_s, "right_cm_s": right_cm_s}
    group = {"poses": poses, "controller": "constant", "parameters": parameters, "signal": signal}
    return Simulation({"arena": FLOOR, "noise": "off", "robot": robot, "robots": [group], **sections}, 1)


# --- wheels -----------------------------------------------------------------------------------------


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


def test_a_kilobot_drives_on_the_circle_of_its_wheels():
    step = drive([[25, 25, 0]], 0.5, 1.0).advance(101)
    radius, angle = 2.5 / 2 * 1.5 / 0.5, 0.5 / 2.5 * 10
    expected = 25 + radius * math.sin(angle), 25 + radius * (1 - math.cos(angle)), angle
    np.testing.assert_allclose(step.poses[0], expected, rtol=0, atol=1e-9)


# --- bodies -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("robot", "apart"), [("epuck", 7.4), ("kilobot", 3.3), ({"radius_cm": 5}, 10)])
def test_two_robots_that_meet_head_on_stop_a_diameter_apart(robot, apart):
    step = drive([[15, 25, 0], [35, 25, math.pi]], 1, 1, robot).advance(300)
    assert step.poses[1, 0] - step.poses[0, 0] == pytest.approx(apart, abs=0.02)
    assert step.contacts.tolist() == [[0, 1]]
    assert step.poses[0, 0] + step.poses[1, 0] == pytest.approx(50)


def test_a_kilobot_stops_with_its_body_at_the_wall_and_touches_it():
    simulation = drive([[45, 25, 0]], 1, 1)
    assert len(simulation.advance(1).contacts) == 0
    step = simulation.advance(100)
    assert step.poses[0, 0] == pytest.approx(50 - 1.65, abs=0.02)
    assert step.contacts.tolist() == [[0, -1]]


def test_a_crowd_of_kilobots_moves_as_if_all_of_them_took_every_physics_step():
    random = np.random.default_rng(3)
    grid = np.array([(x, y) for x in range(2, 30, 4) for y in range(2, 30, 4)], float)
    poses = np.column_stack([grid, np.zeros(len(grid))])
    arena = make_arena(31, 31, [], [])
    fast = MovedWorld(arena, poses, 0.0, 100, KILOBOT)
    slow = FullSpaceWorld(arena, poses, 0.0, 100, KILOBOT)
    shares = []
    for _ in range(60):
        speeds = random.uniform(-1, 1, (len(poses), 3))
        for world in (fast, slow):
            world.velocities[:] = speeds
            world.advance(10)
        np.testing.assert_allclose(fast.poses, slow.poses, rtol=0, atol=1e-9)
        shares.append(fast.swarm.robots.may_touch.mean())
    assert min(shares) < 1
    assert max(shares) > 0.2


def test_random_places_are_as_near_as_the_bodies_allow():
    simulation = Simulation({"arena": FLOOR, "robot": "kilobot", "robots": [{"count": 100, "signal": RADIO}]}, 1)
    places = next(simulation).poses[:, :2]
    apart = np.hypot(*(places[:, None] - places[None]).T) + 100 * np.eye(100)
    assert 3.3 - 1e-6 <= apart.min() < 7.4
    assert places.min() >= 1.65 - 1e-6
    assert places.max() <= 50 - 1.65 + 1e-6


def test_a_large_body_hides_a_ring_that_a_small_one_beside_the_line_does_not():
    def sees(robot) -> int:
        cone = {"kind": "cone", "range_cm": 40}
        dark = {"poses": [[5, 25, 0], [22, 28, 0]], "controller": "constant", "signal": cone}
        lit = {"poses": [[40, 25, 0]], "controller": "constant", "parameters": {"ring_on": True}, "signal": cone}
        scenario = {"arena": FLOOR, "robot": robot, "robots": [dark, lit]}
        return int(Simulation(scenario, 1).advance(2).camera[0, 0])

    assert (sees("kilobot"), sees("epuck")) == (1, 0)


# --- sensors ----------------------------------------------------------------------------------------


def test_a_robot_without_infrared_sensors_reads_nothing_in_range_from_all():
    group = {"count": 40, "controller": "constant", "signal": RADIO}
    simulation = Simulation({"arena": FLOOR, "robot": "kilobot", "robots": [group]}, 1)
    for step in islice(simulation, 40):  # the noise of readings is on
        assert (step.infrared == 0).all()
        assert (step.distance_mm == NOTHING_MM).all()


@pytest.mark.parametrize("noise", ["off", "on"])
def test_the_sensors_that_a_robot_has_read_by_their_place_and_the_others_nothing(noise):
    infrared = {"sensors": [[1.0, 0.5, 0], [-1.5, 0, 180]], "range_cm": 8, "peak_counts": 1000}
    robot = {"kind": "kilobot", "infrared": infrared}
    step = drive([[42, 25, 0]], 0, 0, robot, noise=noise).advance(3)
    distance = 50 - 42 - 1.0
    reading = 1000 * (0.7 - 0.3**2) / (distance**2 - 2 * 0.3 * distance + 0.7)
    assert step.infrared[0, 0] == pytest.approx(reading, rel=1e-9 if noise == "off" else None, abs=60)
    if noise == "off":
        assert step.distance_mm[0, 0] in (69, 70)
        assert step.infrared[0, 1] == 0
    assert step.infrared[0, 2:].tolist() == [0] * 6
    assert step.distance_mm[0, 2:].tolist() == [NOTHING_MM] * 6


def test_a_camera_looks_from_where_it_is_mounted():
    """A ring covers the pixels within asin(radius / distance) of its direction, seen from the camera."""

    def width(forward_cm: float) -> int:
        robot = {"kind": "kilobot", "camera": {"forward_cm": forward_cm}}
        camera = {"pixels": 560, "field_of_view_deg": 56}
        watching = {"poses": [[10, 25, 0]], "controller": "constant", "camera": camera}
        lit = {"poses": [[16, 25, 0]], "controller": "constant", "parameters": {"ring_on": True}, "camera": camera}
        scenario = {"arena": FLOOR, "robot": robot, "robots": [watching, lit]}
        return int(Simulation(scenario, 1).advance(2).camera[0].sum())

    for forward_cm in (0.0, 0.7):
        degrees = 2 * math.degrees(math.asin(1.65 / (6 - forward_cm)))
        assert width(forward_cm) == pytest.approx(10 * degrees, abs=2)
