"""The firefly does what thesis Appendix B and Algorithms 1 and 2 say: it is compared with them in C, `firefly.c`."""

from pathlib import Path

import numpy as np
import pytest

from epuck_sim.testing import TestRobot
from tests.control.bench import Bench, random_distances
from tests.tools import needs_compiler

LISTING = str(Path(__file__).with_name("firmware") / "firefly.c")


def test_a_speed_below_1_mm_s_keeps_its_fraction():
    robot = TestRobot("obstacle_avoidance", {"speed_cm_s": 0.03125})
    robot.step()
    assert (robot.left_cm_s, robot.right_cm_s) == (0.03125, 0.03125)


def wandering(steps, robots, seed=3):
    """Return (steps, robots, 8) mm: what is near stays for a while, as walls do."""
    chance = np.random.default_rng(seed)
    distances = random_distances(chance, (steps, robots, 8))
    for step in range(1, steps):
        stays = chance.random((robots, 1)) < 0.6
        distances[step] = np.where(stays, distances[step - 1], distances[step])
    return distances


@needs_compiler
@pytest.mark.parametrize(
    "given",
    [
        {},
        {"speed_cm_s": 0.7, "rotation_speed_cm_s": 12.7},
        {"rotation_speed_cm_s": 0.3},
        {"speed_cm_s": 0.0, "rotation_speed_cm_s": 0.1, "proximity_threshold": 0, "rotation_max": 1},
        {
            "speed_cm_s": 4.3,
            "rotation_speed_cm_s": 5.1,
            "rotation_max": 100,
            "proximity_threshold": 40,
            "proximity_count_threshold": 0,
        },
        {"proximity_threshold": 85, "proximity_count_threshold": 2},
        {"delay_ms": 62, "flash_pixels": 2, "once_per_sighting": True, "coupling": 0.37},
    ],
    ids=str,
)
def test_long_drives_and_flashes_are_the_thesis_s(given):
    benches = in_c, in_python = [Bench(name, given, robots=20, interpret=False) for name in (LISTING, "firefly")]
    streams, chance, lit = in_python.streams.copy(), np.random.default_rng(4), 0
    for number, distances in enumerate(wandering(500, 20)):
        in_python.sense(chance)
        in_c.sense_like(in_python)
        for bench in benches:
            bench.senses.distance_mm[:] = distances
            bench.control.step()
        for name in ("left_cm_s", "right_cm_s"):
            np.testing.assert_array_equal(in_c.actuators[name], in_python.actuators[name], f"step {number}")
        rings = in_python.actuators["ring_on"] > 0
        np.testing.assert_array_equal(in_c.actuators["ring_on"] > 0, rings, f"step {number}")
        assert in_c.memory.tobytes() == in_python.memory.tobytes(), f"step {number}"
        lit += rings.sum()
    assert (in_c.streams == in_python.streams).all(), "both drew as often"
    assert (streams != in_python.streams).any(), "walls were met"
    assert 0 < lit < 20 * 500
