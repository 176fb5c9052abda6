"""Contacts: their reach, a slow twin on random scenes, and the bodies that push."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.arena import Arena, clearance_cm, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.bodies.contacts import MARGIN_CM
from epuck_sim.embodied.observers import find_contacts, make_scene
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.geometry import box_corners
from epuck_sim.scenario.robot_kind import EPUCK
from epuck_sim.scenario.robots import RobotGroup
from tests.embodied.scenes import RADIUS_CM, Scene, scenes

GAP_CM = 2 * MARGIN_CM
EDGE_CM = 1e-9


def contacts(poses: FloatArray, arena: Arena) -> FloatArray:
    """Return (contacts, 3) step, x, y that `find_contacts` finds at (steps, robots, 3) poses."""
    scene = make_scene([RobotGroup(count=poses.shape[1])], [EPUCK], arena)
    found, points = find_contacts(scene, poses)
    steps = found[:, 0]
    assert steps.tolist() == sorted(steps)
    assert points.shape == (len(steps), 2)
    return np.column_stack([steps, points])


def touching(places: list[tuple[float, float]], obstacles=((), ()), width: float = 100.0) -> list[tuple[float, float]]:
    """Return the points where robots at these places touch something in 100 cm high arena, sorted."""
    poses = np.array([[(x, y, 1.0) for x, y in places]])
    return sorted((x, y) for _, x, y in contacts(poses, make_arena(width, 100.0, *obstacles)).tolist())


# --- a slow twin ------------------------------------------------------------------------------------


def slow_contacts(poses: FloatArray, arena: Arena) -> tuple[FloatArray, BoolArray]:
    """Return (n, 3) step, x, y of everything that touches or nearly does, and which of them are doubtful."""
    found = []
    for step, places in enumerate(poses[..., :2]):
        for robot, place in enumerate(places):
            for other in places[:robot]:
                gap = np.hypot(*(other - place)) - 2 * RADIUS_CM
                found.append((gap, step, *(place + other) / 2))
            near = [(0, place[1]), (arena.width_cm, place[1]), (place[0], 0), (place[0], arena.height_cm)]
            for x, y, radius in arena.circles:
                away = math.atan2(place[1] - y, place[0] - x)
                near.append((x + radius * math.cos(away), y + radius * math.sin(away)))
            near += [nearest_on_outline(corners, place) for corners in arena.polygons]
            found += [(math.hypot(x - place[0], y - place[1]) - RADIUS_CM, step, x, y) for x, y in near]
    gaps, points = np.split(np.array(found), [1], axis=1)
    close = gaps[:, 0] < GAP_CM + EDGE_CM
    return points[close], gaps[close, 0] > GAP_CM - EDGE_CM


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
    apart = RADIUS_CM + random.uniform(-0.1, 0.3)
    return here + share * (after - here) + apart * outward / np.hypot(*outward)


def number_at(places: FloatArray, points: FloatArray) -> IntArray:
    """Return how many of the points lie at each place: robots at a box's corner may share one."""
    return (np.abs(places[:, None] - points[None]) < 1e-9).all(axis=2).sum(axis=1)


@st.composite
def crowds(draw: st.DrawFn) -> tuple[FloatArray, Arena]:
    """Several steps of robots of which many stand at the brink of touching each other, a wall or an obstacle."""
    scene: Scene = draw(scenes(robots=(1, 2, 10, 30, 60)))
    steps = draw(st.integers(1, 4))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    poses = np.array([random.permutation(scene.poses) for _ in range(steps)])
    poses[..., :2] += random.choice([0.0, 0.02, 0.15]) * random.uniform(-1, 1, poses[..., :2].shape)
    for pose in poses.reshape(-1, 3)[:: random.integers(1, 5)]:
        if scene.arena.polygons:
            place = beside(scene.arena.polygons[random.integers(len(scene.arena.polygons))], random)
            if clearance_cm(scene.arena, *place) > 0.9 * RADIUS_CM:
                pose[:2] = place
    return poses, scene.arena


def test_contacts_are_those_of_the_slow_twin() -> None:
    tally = Counter()

    @settings(max_examples=200)
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
    assert tally["contacts"] > 500
    assert tally["doubtful"] < 0.01 * tally["contacts"]


# --- robots -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("gap", "number"), [(-0.05, 1), (0.0, 1), (0.15, 1), (0.17, 0), (5.0, 0)])
def test_surfaces_touch_where_they_are_no_farther_apart_than_1_6_mm(gap: float, number: int) -> None:
    place = 3.7 + gap
    assert len(touching([(50, 50), (50 + 3.7 + place, 50)])) == number
    assert len(touching([(place, 50)])) == len(touching([(100 - place, 50)])) == number
    assert len(touching([(50, place)])) == len(touching([(50, 100 - place)])) == number
    assert len(touching([(50, 60 + place)], ([(50, 50, 10)], ()))) == number
    assert len(touching([(50, 60 + place)], ((), [box_corners(50, 50, 30, 20, 0)]))) == number


# --- many contacts, and none ------------------------------------------------------------------------


@pytest.mark.parametrize("steps", [1, 3])
def test_there_is_room_for_any_number_of_contacts(steps: int) -> None:
    lines = 3.7 + 7.4 * np.arange(5)
    crowd = np.array([(x, y, 0.0) for x in lines for y in lines])
    found = contacts(np.repeat(crowd[None], steps, axis=0), make_arena(37.0, 37.0, [], []))
    between = [(x, y) for x in (0, *lines + 3.7) for y in lines]
    expected = [(step, *point) for step in range(steps) for x, y in between for point in ((x, y), (y, x))]
    assert len(found) == len(expected) == 60 * steps
    apart = np.abs(found[:, None] - np.array(expected)[None]).max(axis=2)
    assert apart.min(axis=0).max() < 1e-9


def test_robots_move_what_they_touch_and_nothing_before() -> None:
    simulation = Simulation("push")
    poses = np.array([step.poses.copy() for step, _ in zip(simulation, range(30), strict=False)])
    touches = np.isin(np.arange(30), contacts(poses, simulation.scenario.arena.build())[:, 0])
    moved = np.diff(poses[:, 1, 0]) > 1e-9
    assert 1 < np.argmax(moved) < 10
    assert (touches[1:][moved]).all()
    assert (moved[touches[:-1]]).all()
