"""Claims about lit rings that walls mirror: closed forms, and a slow twin on random scenes."""

import copy
import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import assume, given, reject, settings
from hypothesis import strategies as st

from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.sensors.camera import add_reflections, look
from epuck_sim.embodied.simulation import Simulation
from tests.embodied.scenes import (
    ADDRESSES,
    BODIES,
    EDGE_CM,
    RADIUS_CM,
    CameraSettings,
    Scene,
    block_of,
    camera_settings,
    cast_on_discs,
    cast_on_segments,
    rows,
    scenes,
)

SIDE = 200.0
FAR = 10_000.0
MIRRORS = CameraSettings(reflection_range_cm=FAR)


def mirrored_rows(scene: Scene, camera: CameraSettings, observer: int = 0) -> IntArray:
    """Return the rows of pixels of the robots from `observer` on."""
    block = block_of(scene, camera, observer)
    look(block.bytes, ADDRESSES, 0)
    add_reflections(block.bytes, ADDRESSES, 0)
    return block.swarm.pixels.reshape(-1, camera.pixels)


def seen_by_first(poses, lit, camera: CameraSettings = MIRRORS, obstacles=((), ()), side: float = SIDE) -> list[int]:
    """Return the row of robot 0."""
    scene = Scene(np.array(poses, float), np.array(lit, bool), make_arena(side, side, *obstacles))
    return mirrored_rows(scene, camera)[0].tolist()


def covered(distance: float, bearing: float, camera: CameraSettings = MIRRORS) -> list[int]:
    """Return the row of a disc that nothing hides: pixels within asin(r / d) of its bearing."""
    off = np.abs(np.remainder(camera.angles() - bearing + math.pi, 2 * math.pi) - math.pi)
    half_width = math.asin(RADIUS_CM / distance)
    if (np.abs(off - half_width) < 1e-9).any():
        reject()
    return (off < half_width).astype(int).tolist()


# --- a slow twin ------------------------------------------------------------------------------------


def mirrored_places(places: FloatArray, wall: int, arena: Arena) -> FloatArray:
    """Return (n, 2) places beyond the left, right, lower or upper wall."""
    mirrored = places.copy()
    axis, is_far = divmod(wall, 2)
    mirrored[:, axis] = 2 * is_far * (arena.width_cm, arena.height_cm)[axis] - mirrored[:, axis]
    return mirrored


def slow_rows(scene: Scene, camera: CameraSettings) -> tuple[BoolArray, BoolArray]:
    """Return (robots, pixels) whether red, and for which of them two answers lie within rounding.

    Everything is mirrored in each wall, and each ray is cast on everything: on what stands in the arena up to the wall,
    and on what is mirrored from there on.
    """
    arena, lit = scene.arena, scene.lit
    robots = len(scene.poses)
    red, doubtful = np.zeros((2, robots, camera.pixels), bool)
    bodies = np.column_stack([scene.poses[:, :2], scene.radii_cm])
    right, top = arena.width_cm, arena.height_cm
    walls = np.array([(0, 0, 0, top), (right, 0, right, top), (0, 0, right, 0), (0, top, right, top)])
    outside = (camera.pixels - camera.central_pixels) // 2
    window = slice(outside, camera.pixels - outside)
    for robot, (x, y, heading) in enumerate(scene.poses):
        angles = heading + camera.angles()[window]
        forward_cm = scene.body.forward_cm
        nose = x + forward_cm * math.cos(heading), y + forward_cm * math.sin(heading)
        rays = np.tile(nose, (len(angles), 1)), np.column_stack([np.cos(angles), np.sin(angles)])
        others = np.arange(robots) != robot
        to_bodies, by_body = cast_on_discs(*rays, np.vstack([bodies[others], arena.circles]))
        to_edges, by_edge = cast_on_segments(*rays, arena.edges)
        to_walls, by_wall = cast_on_segments(*rays, walls)
        reach = np.hstack([to_bodies, to_edges]).min(axis=1, initial=np.inf)
        red_reach = to_bodies[:, : robots - 1][:, lit[others]].min(axis=1, initial=np.inf)
        red[robot, window] = (red_reach <= reach) & (red_reach <= camera.range_cm) & (red_reach < np.inf)
        doubt = np.hstack([by_body, by_edge, by_wall]).any(axis=1)
        doubt |= np.abs(np.where(red_reach < np.inf, red_reach, -1) - camera.range_cm) < EDGE_CM
        for wall in range(4):
            towards = to_walls[:, wall] < np.inf
            first_leg_is_free = reach > to_walls[:, wall]
            doubt |= np.abs(np.where(towards, to_walls[:, wall], -1) - reach) < EDGE_CM
            discs = np.vstack([bodies, arena.circles])
            discs[:, :2] = mirrored_places(discs[:, :2], wall, arena)
            ends = [mirrored_places(arena.edges[:, two], wall, arena) for two in (slice(0, 2), slice(2, 4))]
            to_discs, by_disc = cast_on_discs(*rays, discs)
            to_images, by_image = cast_on_segments(*rays, np.hstack(ends))
            image = to_discs[:, :robots][:, lit].min(axis=1, initial=np.inf)
            hidden_by = np.hstack([to_discs[:, :robots][:, ~lit], to_discs[:, robots:], to_images])
            is_first = image <= hidden_by.min(axis=1, initial=np.inf)
            near = (image <= camera.reflection_range_cm) & (image < np.inf)
            red[robot, window] |= towards & first_leg_is_free & is_first & near
            found = np.where(image < np.inf, image, -1)[:, None]
            doubt |= towards & np.hstack([by_disc, by_image, np.abs(found - hidden_by) < EDGE_CM]).any(axis=1)
            doubt |= towards & (np.abs(found[:, 0] - camera.reflection_range_cm) < EDGE_CM)
        doubtful[robot, window] = doubt
    return red, doubtful


def test_rows_are_those_of_the_slow_twin() -> None:
    tally = Counter()

    @settings(max_examples=40)
    @given(scenes(robots=(1, 2, 3, 10, 60), bodies=BODIES), camera_settings(), st.sampled_from([FAR, 15.0, 40.0]))
    def compare(scene: Scene, camera: CameraSettings, range_cm: float) -> None:
        camera = camera._replace(reflection_range_cm=range_cm)
        expected, doubtful = slow_rows(scene, camera)
        found = mirrored_rows(scene, camera)
        np.testing.assert_array_equal(found[~doubtful], expected[~doubtful])
        direct = rows(scene, camera)
        assert (found >= direct).all()
        tally.update(pixels=doubtful.size, doubtful=doubtful.sum(), mirrored=(found > direct).sum())

    compare()
    assert tally["pixels"] > 5000
    assert tally["mirrored"] > 0.01 * tally["pixels"]
    assert tally["doubtful"] < 0.02 * tally["pixels"]


# --- closed forms -----------------------------------------------------------------------------------


@given(st.floats(8, 90), st.floats(-150, -10), st.floats(-90, 90), st.integers(0, 3))
def test_the_image_of_a_ring_behind_is_as_far_beyond_the_wall_as_the_ring_before_it(wall_cm, back, aside, quarter):
    # a robot whose nose is `wall_cm` before the wall that it faces; the ring is `back` from the nose and `aside`
    assume(abs(aside) > 2 * RADIUS_CM + 1)
    ahead = 2 * wall_cm - back
    robots = np.array([(SIDE - wall_cm - RADIUS_CM, 100.0), (SIDE - wall_cm + back, 100.0 + aside)])
    assume(robots[1, 0] > RADIUS_CM)
    for _ in range(quarter):
        robots = np.column_stack([SIDE - robots[:, 1], robots[:, 0]])
    bearing, half_width = math.atan2(aside, ahead), math.asin(RADIUS_CM / math.hypot(ahead, aside))
    in_own_shadow = math.asin(RADIUS_CM / (2 * wall_cm + RADIUS_CM))
    assume(abs(bearing) > half_width + in_own_shadow)
    poses = np.column_stack([robots, np.full(2, quarter * math.pi / 2)])
    assert seen_by_first(poses, [False, True]) == covered(math.hypot(ahead, aside), bearing)


@pytest.mark.parametrize("beyond_cm", [0.0, 0.03])
@pytest.mark.parametrize("others_are_lit", [False, True])
def test_a_robot_that_presses_its_nose_against_a_wall_sees_its_own_ring_at_most(beyond_cm, others_are_lit):
    poses = [(SIDE - RADIUS_CM + beyond_cm, 100.0, 0.0), (150.0, 100.0, 0.0), (170.0, 120.0, 0.0)]
    for own in (False, True):
        assert seen_by_first(poses, [own, others_are_lit, others_are_lit]) == [int(own)] * 60


# --- what hides an image, and how far it is seen ------------------------------------------------------


# --- in a simulation ----------------------------------------------------------------------------------


def facing_a_wall(**keys):
    """Return a scenario of a robot that faces a wall, and one behind it whose ring is lit from the start for 0.3 s."""
    camera = {"reflection_range_cm": 200, **keys.pop("camera", {})}
    still = {"speed_cm_s": 0.0, "flash_fraction": 0.075}
    robots = [{"poses": [[45, 30, 0], [20, 42, 0]], "parameters": still, "memory": {"phase_ms": [1000, 4900]}}]
    robots[0]["camera"] = camera
    return {"noise": "off", "robots": robots, **keys}


def pictures(scenario, steps=60, **keys):
    """Return (steps, robots, pixels) pictures, and (steps, robots) lit rings."""
    simulation = Simulation(scenario, seed=2, **keys)
    shown = [(step.camera.copy(), step.ring_on.copy()) for step in (next(simulation) for _ in range(steps))]
    return tuple(np.array(each) for each in zip(*shown, strict=True))


def test_robots_see_what_walls_mirror_where_the_key_is_set():
    camera, lit = pictures(facing_a_wall())
    none, _ = pictures(facing_a_wall(camera={"reflection_range_cm": 0}))
    assert none[:, 0].sum() == 0
    seen = camera[:, 0].any(axis=1)
    assert 2 < seen.sum() < 30
    np.testing.assert_array_equal(seen[1:], lit[:-1].any(axis=1))  # its own ring, too
    nose, image = (45 + RADIUS_CM, 30), (100, 42)
    first = camera[np.flatnonzero(seen)[0], 0].tolist()
    assert first == covered(math.dist(nose, image), math.atan2(12, image[0] - nose[0]))


def test_interpreted_reset_and_alone_steps_are_the_same():
    scenario = {"robots": [{"camera": {"reflection_range_cm": 60, "frames_per_s": 8, "latency_ms": 50}}]}
    camera, lit = pictures(scenario, 150)
    for other in (pictures(scenario, 150, interpret=True), pictures(copy.deepcopy(scenario), 150)):
        np.testing.assert_array_equal(other[0], camera)
        np.testing.assert_array_equal(other[1], lit)
    assert camera.sum() > pictures({"robots": [{"camera": {"frames_per_s": 8, "latency_ms": 50}}]}, 150)[0].sum()


@pytest.mark.parametrize("fault", [{"kind": "ring_dead", "robots": [1]}, {"kind": "camera_blind", "robots": [0]}])
def test_a_fault_hides_reflections_as_it_hides_rings(fault):
    until_own_flash = 30
    camera, _ = pictures(facing_a_wall(faults=[fault]), until_own_flash)
    assert camera[:, 0].sum() == 0
    healthy, _ = pictures(facing_a_wall(), until_own_flash)
    assert healthy[:, 0].sum() > 0


def test_faults_that_have_not_begun_change_nothing():
    later = [{"kind": "camera_misses", "missed": 1, "at_s": 1000}]
    for with_faults, without in zip(pictures(facing_a_wall(faults=later)), pictures(facing_a_wall()), strict=True):
        np.testing.assert_array_equal(with_faults, without)


def test_who_sees_whom_is_told_by_direct_sight():
    simulation = Simulation(facing_a_wall(), seed=2)
    for _ in range(4):
        step = next(simulation)
        assert len(step.sightings) == 0
    assert step.camera[0].any()
