"""Claims about who sees and touches whom, as observers find it: slow twins on random scenes, and bodies that push."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim import Simulation, load_scenario
from epuck_sim.arena import Arena, clearance_cm, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied import loop
from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.embodied.observers import find_contacts, find_sightings, make_scene
from epuck_sim.scenario.robot_kind import EPUCK
from epuck_sim.scenario.robots import RobotGroup
from tests.embodied import scenes

GAP_CM = 2 * MARGIN_CM


def sightings(poses, arena, camera, first=0, observers=None) -> list[list[int]]:
    """Return what `find_sightings` does of (steps, robots, 3) poses; `observers` from `first` on are a group apart."""
    robots = poses.shape[1]
    number = robots - first if observers is None else observers
    counts = (first, number, robots - first - number)
    groups = [RobotGroup(count=count, camera=camera.section()) for count in counts if count]
    return find_sightings(make_scene(groups, [EPUCK] * len(groups), arena), poses).tolist()


def test_sightings_are_those_of_the_slow_twin_and_a_camera_sees_red_where_one_of_them_is_lit() -> None:
    tally = Counter()

    @settings(max_examples=25)
    @given(scenes.any_scenes(robots=(2, 3, 10, 40)), scenes.camera_settings(), scenes.SEEDS)
    def compare(scene: scenes.Scene, camera: scenes.CameraSettings, seed: int) -> None:
        lit = np.random.default_rng(seed).random(len(scene.poses)) < 0.3
        red = scenes.rows(scenes.Scene(scene.poses, lit, scene.arena), camera).any(axis=1)
        found = sightings(scene.poses[None], scene.arena, camera)
        assert all(step == 0 for step, _, _ in found)
        assert [observer for _, observer, _ in found] == sorted(observer for _, observer, _ in found)
        for robot in range(len(scene.poses)):
            _, shown, _, doubtful = scenes.slow_pixels(scene, camera, robot)
            if doubtful.any():
                continue
            expected = list(dict.fromkeys(shown[shown >= 0].tolist()))  # each where it first appears
            assert [seen for _, observer, seen in found if observer == robot] == expected
            assert red[robot] == lit[expected].any()
            dark = bool(expected) and not red[robot]
            tally.update(compared=1, several=len(expected) > 1, red=int(red[robot]), dark=dark)
        tally.update(robots=len(scene.poses))

    compare()
    assert tally["compared"] > 0.95 * tally["robots"]
    assert min(tally["several"], tally["red"], tally["dark"]) > 0.02 * tally["robots"]


@settings(max_examples=20)
@given(scenes.any_scenes(robots=(2, 10, 60)), scenes.camera_settings(), scenes.SEEDS)
def test_steps_at_once_are_one_after_the_other_and_groups_see_what_one_of_all_robots_would(scene, camera, seed) -> None:
    random = np.random.default_rng(seed)
    poses = np.array([random.permutation(scene.poses) for _ in range(5)])
    everybody = sightings(poses, scene.arena, camera)
    alone = [sightings(poses[step : step + 1], scene.arena, camera) for step in range(5)]
    assert everybody == [[step, looks, seen] for step in range(5) for _, looks, seen in alone[step]]
    first = int(random.integers(len(scene.poses)))
    observers = int(random.integers(1, len(scene.poses) - first + 1))
    assert sightings(poses, scene.arena, camera, first, observers) == everybody


def contacts(poses: FloatArray, arena: Arena) -> FloatArray:
    """Return (contacts, 3) step, x, y that `find_contacts` finds at (steps, robots, 3) poses."""
    scene = make_scene([RobotGroup(count=poses.shape[1])], [EPUCK], arena)
    found, points = find_contacts(scene, poses)
    steps = found[:, 0]
    assert steps.tolist() == sorted(steps)
    assert points.shape == (len(steps), 2)
    return np.column_stack([steps, points])


def slow_contacts(poses: FloatArray, arena: Arena) -> tuple[FloatArray, BoolArray]:
    """Return (n, 3) step, x, y of everything that touches or nearly does, and which of them are doubtful."""
    found = []
    for step, places in enumerate(poses[..., :2]):
        for robot, place in enumerate(places):
            for other in places[:robot]:
                gap = np.hypot(*(other - place)) - 2 * scenes.RADIUS_CM
                found.append((gap, step, *(place + other) / 2))
            near = [(0, place[1]), (arena.width_cm, place[1]), (place[0], 0), (place[0], arena.height_cm)]
            for x, y, radius in arena.circles:
                away = math.atan2(place[1] - y, place[0] - x)
                near.append((x + radius * math.cos(away), y + radius * math.sin(away)))
            near += [nearest_on_outline(corners, place) for corners in arena.polygons]
            found += [(math.hypot(x - place[0], y - place[1]) - scenes.RADIUS_CM, step, x, y) for x, y in near]
    gaps, points = np.split(np.array(found), [1], axis=1)
    close = gaps[:, 0] < GAP_CM + scenes.EDGE_CM
    return points[close], gaps[close, 0] > GAP_CM - scenes.EDGE_CM


def nearest_on_outline(corners: FloatArray, place: FloatArray) -> tuple[float, float]:
    """Return the point of a convex polygon's outline that is nearest to a place outside it."""
    feet = list(corners)
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = (end - start) / np.hypot(*(end - start))
        if 0 < (place - start) @ along < np.hypot(*(end - start)):
            feet.append(start + ((place - start) @ along) * along)
    x, y = min(feet, key=lambda foot: float(np.hypot(*(foot - place))))
    return x, y


def beside(corners: FloatArray, random: np.random.Generator) -> FloatArray:
    """Return a place where a robot stands close to a corner or an edge of a convex polygon."""
    corner = random.integers(len(corners))
    before, here, after = corners[[corner - 1, corner, (corner + 1) % len(corners)]]
    normals = np.array([(along[1], -along[0]) / np.hypot(*along) for along in (here - before, after - here)])
    share, mixture = random.choice([(0.0, random.random()), (random.random(), 0.0)])
    outward = mixture * normals[0] + (1 - mixture) * normals[1]
    apart = scenes.RADIUS_CM + random.uniform(-0.1, 0.3)
    return here + share * (after - here) + apart * outward / np.hypot(*outward)


def number_at(places: FloatArray, points: FloatArray) -> IntArray:
    """Return how many of the points lie at each place: robots at a box's corner may share one."""
    return (np.abs(places[:, None] - points[None]) < 1e-9).all(axis=2).sum(axis=1)


@st.composite
def crowds(draw: st.DrawFn) -> tuple[FloatArray, Arena]:
    """Several steps of robots of which many stand at the brink of touching each other, a wall or an obstacle."""
    scene: scenes.Scene = draw(scenes.any_scenes(robots=(1, 2, 10, 30)))
    steps = draw(st.integers(1, 3))
    random = np.random.default_rng(draw(scenes.SEEDS))
    poses = np.array([random.permutation(scene.poses) for _ in range(steps)])
    poses[..., :2] += random.choice([0.0, 0.02, 0.15]) * random.uniform(-1, 1, poses[..., :2].shape)
    for pose in poses.reshape(-1, 3)[:: random.integers(1, 5)]:
        if scene.arena.polygons:
            place = beside(scene.arena.polygons[random.integers(len(scene.arena.polygons))], random)
            if clearance_cm(scene.arena, *place) > 0.9 * scenes.RADIUS_CM:
                pose[:2] = place
    return poses, scene.arena


def test_contacts_are_those_of_the_slow_twin() -> None:
    tally = Counter()

    @settings(max_examples=40)
    @given(crowds())
    def compare(crowd: tuple[FloatArray, Arena]) -> None:
        found = contacts(*crowd)
        expected, doubtful = slow_contacts(*crowd)
        everywhere = np.vstack([found, expected])
        number = number_at(everywhere, found)
        assert (number >= number_at(everywhere, expected[~doubtful])).all()
        assert (number <= number_at(everywhere, expected)).all()
        tally.update(contacts=len(expected), doubtful=int(doubtful.sum()))

    compare()
    assert tally["contacts"] > 100
    assert tally["doubtful"] < 0.01 * tally["contacts"]


def test_there_is_room_for_any_number_of_contacts() -> None:
    lines = 3.7 + 7.4 * np.arange(5)
    crowd = np.array([(x, y, 0.0) for x in lines for y in lines])
    found = contacts(np.repeat(crowd[None], 3, axis=0), make_arena(37.0, 37.0, [], []))
    between = [(x, y) for x in (0, *lines + 3.7) for y in lines]
    expected = [(step, *point) for step in range(3) for x, y in between for point in ((x, y), (y, x))]
    assert len(found) == len(expected) == 60 * 3
    assert np.abs(found[:, None] - np.array(expected)[None]).max(axis=2).min(axis=0).max() < 1e-9


LOOKING = [
    {"count": 12},
    {"count": 8, "camera": {"frames_per_s": 7, "latency_ms": 90, "reflection_range_cm": 60}},
    {"count": 3, "signal": {"kind": "radio"}},
]
COLUMN = {"shape": "circle", "x_cm": 60, "y_cm": 60, "radius_cm": 1}  # robots show on both sides of it
DISC = {"x_cm": 30, "y_cm": 60, "radius_cm": 5, "mass_kg": 0.05, "friction": 0.1}
HALL = {"width_cm": 120, "height_cm": 120, "obstacles": [COLUMN]}
CROWD = {
    "robots": LOOKING,
    "arena": HALL,
    "schedule": [{"at_s": 4, "remove": [3, 15]}, {"at_s": 8, "set": {"arena.height_cm": 130}}],
}


@pytest.mark.parametrize(
    ("changed", "are_kept", "interpret", "room"),
    [
        ({}, True, False, 16),
        ({}, True, True, 16),
        ({}, False, False, 0),
        ({"arena": HALL | {"movables": [DISC]}, "schedule": []}, True, False, 16),
        ({"robots": [*LOOKING, {"count": 2, "signal": {"kind": "cone"}}]}, False, False, 16),
        ({"faults": [{"kind": "camera_blind", "robots": [0, 12]}]}, False, False, 16),
    ],
)
def test_stretches_have_the_sightings_of_their_steps_kept_by_cameras_or_not(
    monkeypatch, changed, are_kept, interpret, room
) -> None:
    monkeypatch.setattr(loop, "MANY_SEEN", room)
    scenario, total = load_scenario(CROWD | changed), 0
    simulation, twin = (Simulation(scenario, 1, interpret=interpret) for _ in range(2))
    while simulation.steps < 150:
        stretch = simulation.stretch(20)
        twins = [[step, *pair] for step in range(len(stretch.poses)) for pair in twin.advance(1).sightings.tolist()]
        assert stretch.sightings.tolist() == twins
        assert (stretch.kept is not None) == (are_kept and stretch.first > 0) or not twins
        total += len(twins)
        np.testing.assert_array_equal(simulation.last_step.camera, twin.last_step.camera)
        for each in (simulation, twin):
            each.advance(3)
    assert total > 30
