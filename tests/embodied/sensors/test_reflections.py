"""Claims about lit rings that walls mirror, in closed forms; test_camera.py has a slow twin on random scenes."""

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from tests.embodied.changing import steps_of
from tests.embodied.scenes import RADIUS_CM, CameraSettings, Scene, empty_arena, rows


@pytest.mark.parametrize("beyond_cm", [0.0, 0.03])
@pytest.mark.parametrize("others_are_lit", [False, True])
def test_a_robot_that_presses_its_nose_against_a_wall_sees_its_own_ring_at_most(beyond_cm, others_are_lit):
    poses = np.array([(200 - RADIUS_CM + beyond_cm, 100.0, 0.0), (150.0, 100.0, 0.0), (170.0, 120.0, 0.0)])
    for own in (False, True):
        scene = Scene(poses, np.array([own, others_are_lit, others_are_lit]), empty_arena())
        assert rows(scene, CameraSettings(reflection_range_cm=10_000.0))[0].tolist() == [int(own)] * 60


def facing_a_wall(range_cm=200, **keys):
    """Return a scenario of a robot that faces a wall, and one behind it whose ring is lit from the start for 0.3 s."""
    still = {"speed_cm_s": 0.0, "flash_fraction": 0.075}
    robots = [{"poses": [[45, 30, 0], [20, 42, 0]], "parameters": still, "memory": {"phase_ms": [1000, 4900]}}]
    robots[0]["camera"] = {"reflection_range_cm": range_cm}
    return {"noise": "off", "robots": robots, **keys}


def test_robots_see_what_walls_mirror_where_the_key_is_set_and_see_whom_they_see_directly():
    shown = steps_of(facing_a_wall(), 60, 2)
    camera, lit = shown["camera"], shown["ring_on"]
    assert steps_of(facing_a_wall(0), 60, 2)["camera"][:, 0].sum() == 0
    seen = camera[:, 0].any(axis=1)
    assert 2 < seen.sum() < 30
    np.testing.assert_array_equal(seen[1:], lit[:-1].any(axis=1))  # its own ring, too
    first = np.flatnonzero(seen)[0]
    assert len(Simulation(facing_a_wall(), seed=2).advance(first + 1).sightings) == 0


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "ring_dead", "robots": [1]},
        {"kind": "camera_blind", "robots": [0]},
        {"kind": "camera_misses", "missed": 1, "at_s": 1000},
    ],
)
def test_a_fault_hides_reflections_as_it_hides_rings_once_it_has_begun(fault):
    until_own_flash = 30
    healthy, faulty = (
        steps_of(facing_a_wall(**keys), until_own_flash, 2)["camera"] for keys in ({}, {"faults": [fault]})
    )
    assert healthy[:, 0].any()
    np.testing.assert_array_equal(faulty[:, 0], healthy[:, 0] if "at_s" in fault else 0)
