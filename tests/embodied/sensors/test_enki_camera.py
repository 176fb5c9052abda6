"""Claims about what Enki's camera sees, against a slow twin: a fan of rays."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.scenario.robots import EnkiCameraSignal
from tests.embodied.scenes import BODIES, EDGE_CM, Scene, cast_on_segments, scenes
from tests.embodied.sensors.test_flash_cone import lit_pair, pairs

RAYS = 1440
ANGLES = np.arange(RAYS) * 2 * math.pi / RAYS
DIRECTIONS = np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])

sections = st.builds(
    EnkiCameraSignal,
    kind=st.just("enki_camera"),
    range_cm=st.sampled_from([None, 15.0, 40.0]),
    angle_deg=st.sampled_from([360.0, 350.0, 180.0]) | st.floats(1, 360),
)


def offsets(bearing: FloatArray) -> FloatArray:
    """Return (rays, n) rad between 0 and pi from each ray of the fan to each of (n,) directions."""
    return np.abs((ANGLES[:, None] - bearing[None] + math.pi) % (2 * math.pi) - math.pi)


def narrow(each: BoolArray) -> BoolArray:
    """Return (rays, ...) what holds of a ray and both beside it."""
    return each & np.roll(each, 1, axis=0) & np.roll(each, -1, axis=0)


def wide(each: BoolArray) -> BoolArray:
    return ~narrow(~each)


def slow_camera(
    scene: Scene, section: EnkiCameraSignal, occlusion: bool, observers: slice
) -> tuple[BoolArray, BoolArray]:
    """Return (observers, robots) whether each sees each by a ray, and whether it may do so between rays."""
    robots = len(scene.poses)
    looking = range(robots)[observers]
    surely, perhaps = np.zeros((2, len(looking), robots), bool)
    discs = np.vstack([np.column_stack([scene.poses[:, :2], scene.radii_cm]), scene.arena.circles])
    reach = math.inf if section.range_cm is None else section.range_cm
    for row, one in enumerate(looking):
        centre_x, centre_y, heading = scene.poses[one]
        x, y = np.array([centre_x, centre_y]) + scene.body.camera_forward_cm * np.array(
            [math.cos(heading), math.sin(heading)]
        )
        away = np.hypot(discs[:, 0] - x, discs[:, 1] - y)
        covers = offsets(np.arctan2(discs[:, 1] - y, discs[:, 0] - x)) <= np.arctan(discs[:, 2] / away)
        edge_depths, _ = cast_on_segments(np.tile((x, y), (RAYS, 1)), DIRECTIONS, scene.arena.edges)
        view = offsets(np.array([heading])) <= math.radians(section.angle_deg / 2) + 1e-12
        for other in range(robots):
            gap = math.hypot(*(discs[other, :2] - [centre_x, centre_y])) - discs[other, 2]
            if other == one or gap > reach + EDGE_CM:
                continue
            nearer = (away < away[other]) & (np.arange(len(discs)) != one)
            hides = np.column_stack([covers[:, nearer], edge_depths < away[other]]) & occlusion
            shown = covers[:, other] & view[:, 0]
            surely[row, other] = (shown & ~hides.any(axis=1)).any() and gap < reach - EDGE_CM
            shown = wide(covers[:, other]) & wide(view)[:, 0]
            perhaps[row, other] = (shown & ~narrow(hides).any(axis=1)).any()
    return surely, perhaps


@settings(max_examples=25)
@given(scenes(robots=(2, 3, 10, 25), bodies=BODIES), sections, st.booleans())
def test_a_robot_is_seen_if_a_ray_of_a_fan_meets_it_first(scene, section, occlusion):
    observers = slice(0, None, 1 + len(scene.poses) // 4)
    surely, perhaps = slow_camera(scene, section, occlusion, observers)
    found = pairs(scene, section, occlusion)[observers]
    assert (surely <= found).all()
    assert (found <= perhaps).all()


@pytest.mark.parametrize(("apart_cm", "seen"), [(28.69, 1), (28.71, 0)])
def test_the_range_is_that_from_the_robots_centre_to_the_others_rim(apart_cm, seen):
    simulation = lit_pair({"kind": "enki_camera", "range_cm": 25, "angle_deg": 100}, apart_cm)
    assert simulation.advance(2).camera.tolist() == [[seen], [0]]
