"""Claims about what sensors in files of their own are told of floor, lamps, robots and walls: slow twins agree."""

import cv2
import numpy as np
import pytest

from epuck_sim import Simulation
from epuck_sim.arena import brightness_at, clearance_cm, light_at
from tests.embodied.scenes import cast_on_discs, cast_on_segments, walls_of

LOOKS = """
import math

from epuck_sim.embodied import sensing

PARAMETERS = {"range_cm": 20.0}
READINGS = {
    "brightness": float, "light": float, "clearance": float, "distance": float,
    "nearest": int, "alone": int, "anywhere": int,
}


def sense(world, robot, readings, parameters, random):
    readings.brightness = sensing.brightness_at(world, robot.x, robot.y)
    readings.light = sensing.light_at(world, robot.x, robot.y)
    readings.clearance = sensing.clearance_cm(world, robot.x, robot.y)
    readings.nearest = sensing.nearest_robot(world, robot.x, robot.y, parameters.range_cm, robot.number)
    readings.anywhere = sensing.nearest_robot(world, robot.x, robot.y, math.inf, robot.number)
    readings.alone = sensing.nearest_robot(world, robot.x, robot.y, parameters.range_cm)
    readings.distance = sensing.distance_cm(
        world, robot.x, robot.y, robot.heading, parameters.range_cm, robot.number
    )
"""

SQUARE = [[100, 20], [130, 25], [120, 60]]

ARENA = {
    "width_cm": 150,
    "height_cm": 120,
    "obstacles": [
        {"shape": "circle", "x_cm": 40, "y_cm": 40, "radius_cm": 8},
        {"shape": "box", "x_cm": 90, "y_cm": 90, "width_cm": 20, "height_cm": 10, "heading_rad": 0.4},
    ],
    "lamps": [{"x_cm": 20, "y_cm": 100}, {"x_cm": 120, "y_cm": 10, "height_cm": 12, "strength": 3.0}],
}

PATCHES = [
    {"shape": "circle", "x_cm": 70, "y_cm": 50, "radius_cm": 40, "brightness": 0.25},
    {"shape": "polygon", "corners_cm": SQUARE, "brightness": 0.5},
    {"shape": "circle", "x_cm": 110, "y_cm": 40, "radius_cm": 12, "brightness": 0.75},
]


def distance_ahead(step, number, range_cm):
    """Return the distance from a robot's centre, straight ahead, to the first body or wall."""
    x, y, heading = step.poses[number]
    ray = np.array([[x, y]]), np.array([[np.cos(heading), np.sin(heading)]])
    others = np.insert(np.delete(step.poses[:, :2], number, axis=0), 2, 3.7, axis=1)
    discs, _ = cast_on_discs(*ray, np.vstack([others, step.arena.circles]))
    flats, _ = cast_on_segments(*ray, np.vstack([walls_of(step.arena), step.arena.edges]))
    nearest = min(discs.min(), flats.min())
    return nearest if nearest <= range_cm else np.inf


@pytest.mark.parametrize("has_picture", [True, False])
def test_slow_twins_see_the_same(tmp_path, monkeypatch, has_picture):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "looks.py").write_text(LOOKS)
    picture = np.random.default_rng(1).integers(0, 256, (13, 31), np.uint8)
    cv2.imwrite("floor.png", picture)
    floor = {"patches": PATCHES, **({"picture": "floor.png"} if has_picture else {"brightness": 0.9})}
    robots = [{"count": 30, "controller": "obstacle_avoidance", "sensors": ["looks.py"]}]
    simulation = Simulation({"arena": {**ARENA, "floor": floor}, "robots": robots}, 4)
    levels = set()
    for _ in range(3):
        step = simulation.advance(6)
        x, y = step.poses[:, :2].T
        seen = step.readings
        np.testing.assert_array_equal(seen["brightness"], brightness_at(simulation.last_step.arena, x, y))
        np.testing.assert_allclose(seen["light"], light_at(simulation.last_step.arena, x, y), rtol=1e-12)
        apart = np.hypot(x[:, None] - x, y[:, None] - y) + np.diag(np.full(30, np.inf))
        nearest = np.where(apart.min(axis=1) < 20, apart.argmin(axis=1), -1)
        np.testing.assert_array_equal(seen["nearest"], nearest)
        np.testing.assert_array_equal(seen["alone"], np.arange(30))
        np.testing.assert_array_equal(seen["anywhere"], apart.argmin(axis=1))
        np.testing.assert_allclose(
            seen["clearance"], [clearance_cm(step.arena, *each) for each in zip(x, y, strict=True)]
        )
        for robot in range(30):
            np.testing.assert_allclose(seen["distance"][robot], distance_ahead(step, robot, 20))
        levels |= set(seen["brightness"])
    assert {0.25, 0.5} <= levels
    assert len(levels) > 3
