"""Which robots see which, beside a slow twin on random scenes."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.observers import find_sightings, make_scene
from epuck_sim.scenario.robot_kind import EPUCK
from epuck_sim.scenario.robots import RobotGroup
from tests.embodied.scenes import (
    EDGE_CM,
    RADIUS_CM,
    CameraSettings,
    Scene,
    camera_settings,
    cast_on_discs,
    cast_on_segments,
    rows,
    scenes,
)

ME = (100.0, 100.0, 0.0)
ALL_ROUND = CameraSettings(60, 360.0, 60)


def sightings(
    poses: FloatArray, arena: Arena, camera: CameraSettings, first: int = 0, observers: int | None = None
) -> list[list[int]]:
    """Return what `find_sightings` does of (steps, robots, 3) poses; of all robots from `first` on by default."""
    robots = poses.shape[1]
    number = robots - first if observers is None else observers
    counts = (first, number, robots - first - number)
    groups = [RobotGroup(count=count, camera=camera.section()) for count in counts if count]
    return find_sightings(make_scene(groups, [EPUCK] * len(groups), arena), poses, min(first, 1)).tolist()


def by_observer(found: list[list[int]], observers: int) -> list[list[int]]:
    """Return the robots that each observer sees in the only step."""
    assert all(step == 0 for step, _, _ in found)
    assert [observer for _, observer, _ in found] == sorted(observer for _, observer, _ in found)
    return [[seen for _, observer, seen in found if observer == robot] for robot in range(observers)]


def at(distance: float, bearing_deg: float = 0.0) -> tuple[float, float, float]:
    """Return the pose of a robot at a distance and bearing (left) from the camera of ME, which looks along x."""
    bearing = math.radians(bearing_deg)
    return ME[0] + RADIUS_CM + distance * math.cos(bearing), ME[1] + distance * math.sin(bearing), 1.0


# --- a slow twin ------------------------------------------------------------------------------------


def slow_pixels(scene: Scene, camera: CameraSettings) -> tuple[list[list[int]], BoolArray]:
    """Return the robot that each pixel of each robot's central window shows, -1 if none, and whose row is doubtful."""
    arena, robots = scene.arena, len(scene.poses)
    bodies = np.column_stack([scene.poses[:, :2], np.full(robots, RADIUS_CM)])
    outside = (camera.pixels - camera.central_pixels) // 2
    shown, doubtful = [], np.zeros(robots, bool)
    for robot, (x, y, heading) in enumerate(scene.poses):
        angles = heading + camera.angles()[outside : camera.pixels - outside]
        nose = x + RADIUS_CM * math.cos(heading), y + RADIUS_CM * math.sin(heading)
        rays = np.tile(nose, (len(angles), 1)), np.column_stack([np.cos(angles), np.sin(angles)])
        to_bodies, by_body = cast_on_discs(*rays, bodies)
        to_bodies[:, robot], by_body[:, robot] = np.inf, False
        to_circles, by_circle = cast_on_discs(*rays, arena.circles)
        to_edges, by_edge = cast_on_segments(*rays, arena.edges)
        limit = np.full((len(angles), 1), camera.range_cm)
        reach = np.hstack([to_bodies, to_circles, to_edges, limit])
        nearest = reach.argmin(axis=1)
        shown.append(np.where((nearest < robots) & (reach.min(axis=1) < np.inf), nearest, -1).tolist())
        first, second = np.sort(reach, axis=1)[:, :2].T
        doubtful[robot] = np.hstack([by_body, by_circle, by_edge]).any() or (second < first + EDGE_CM).any()
    return shown, doubtful


def from_left_to_right(pixels: list[int]) -> list[int]:
    """Return the robots that a row of pixels shows, each where it first appears."""
    return list(dict.fromkeys(robot for robot in pixels if robot >= 0))


def test_sightings_are_those_of_the_slow_twin() -> None:
    tally = Counter()

    @settings(max_examples=60)
    @given(scenes(robots=(2, 3, 10, 60)), camera_settings())
    def compare(scene: Scene, camera: CameraSettings) -> None:
        shown, doubtful = slow_pixels(scene, camera)
        found = by_observer(sightings(scene.poses[None], scene.arena, camera), len(scene.poses))
        for robot in np.flatnonzero(~doubtful):
            expected = from_left_to_right(shown[robot])
            assert found[robot] == expected
            tally.update(compared=1, several=len(expected) > 1)
        tally.update(robots=len(scene.poses))

    compare()
    assert tally["compared"] > 0.95 * tally["robots"]
    assert tally["several"] > 0.02 * tally["robots"]


def test_a_camera_sees_red_where_a_robot_in_view_is_lit() -> None:
    tally = Counter()

    @settings(max_examples=50)
    @given(scenes(robots=(2, 10, 60)), camera_settings(), st.integers(0, 2**32 - 1))
    def compare(scene: Scene, camera: CameraSettings, seed: int) -> None:
        lit = np.random.default_rng(seed).random(len(scene.poses)) < 0.3
        red = rows(Scene(scene.poses, lit, scene.arena), camera).any(axis=1)
        seen = by_observer(sightings(scene.poses[None], scene.arena, camera), len(scene.poses))
        _, doubtful = slow_pixels(scene, camera)
        for robot in np.flatnonzero(~doubtful):
            assert red[robot] == lit[seen[robot]].any()
            tally.update(compared=1, red=int(red[robot]), dark=bool(seen[robot]) and not red[robot])
        tally.update(robots=len(scene.poses))

    compare()
    assert tally["compared"] > 0.95 * tally["robots"]
    assert min(tally["red"], tally["dark"]) > 0.02 * tally["robots"]


# --- several steps, some observers, many sightings --------------------------------------------------


@settings(max_examples=40)
@given(scenes(robots=(2, 10, 60)), camera_settings(), st.integers(0, 2**32 - 1))
def test_several_steps_at_once_are_one_after_the_other(scene: Scene, camera: CameraSettings, seed: int) -> None:
    random = np.random.default_rng(seed)
    poses = np.array([random.permutation(scene.poses) for _ in range(5)])
    one_by_one = [
        [step, observer, seen]
        for step in range(5)
        for _, observer, seen in sightings(poses[step : step + 1], scene.arena, camera)
    ]
    assert sightings(poses, scene.arena, camera) == one_by_one


@settings(max_examples=40)
@given(scenes(robots=(2, 10, 60)), camera_settings(), st.integers(0, 2**32 - 1))
def test_only_the_observers_that_are_asked_for_are_listed(scene: Scene, camera: CameraSettings, seed: int) -> None:
    random = np.random.default_rng(seed)
    first = int(random.integers(len(scene.poses)))
    observers = int(random.integers(1, len(scene.poses) - first + 1))
    poses = np.array([random.permutation(scene.poses) for _ in range(2)])
    everybody = sightings(poses, scene.arena, camera)
    wanted = [sighting for sighting in everybody if first <= sighting[1] < first + observers]
    assert sightings(poses, scene.arena, camera, first, observers) == wanted


@pytest.mark.parametrize("steps", [1, 3])
def test_there_is_room_for_any_number_of_sightings(steps: int) -> None:
    bearings = [160 - 40 * robot for robot in range(9)]
    poses = np.array([[ME, *(at(30, bearing) for bearing in bearings)]] * steps)
    found = sightings(poses, make_arena(200, 200, [], []), ALL_ROUND, 0, 1)
    assert found == [[step, 0, robot] for step in range(steps) for robot in range(1, 10)]
