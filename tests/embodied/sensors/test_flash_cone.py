"""Claims about the ideal sensor of flashes: its cone, and what hides a ring, against a slow twin."""

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import BoolArray
from epuck_sim.embodied.observers import write_sightings
from epuck_sim.embodied.sensors.flash_cone import perceive_flashes, set_cone
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.robots import ConeSection
from tests.embodied.scenes import (
    ADDRESSES,
    EDGE_CM,
    Block,
    CameraSettings,
    Scene,
    block_of,
    cast_on_discs,
    cast_on_segments,
    scenes,
)

sections = st.builds(
    ConeSection,
    range_cm=st.sampled_from([None, 15.0, 40.0]),
    angle_deg=st.sampled_from([360.0, 180.0]) | st.floats(1, 360),
    of=st.sampled_from(["vision", "emission"]),
)


def with_cone(scene: Scene, section: ConeSection, occlusion: bool, observer: int = 0) -> Block:
    block = block_of(scene, CameraSettings(1, 56.0, 1), observer)
    cone = block.swarm.groups[0].cone
    set_cone(cone, section, scene.body.camera_forward_cm)
    cone.occlusion = occlusion
    return block


def pairs(scene: Scene, section: ConeSection, occlusion: bool) -> BoolArray:
    """Return (robots, robots) whether the first perceives the ring of the second."""
    robots = len(scene.poses)
    found, seen = np.zeros((robots**2, 3), np.int64), np.zeros((robots, robots), bool)
    everybody = np.ones((1, robots), bool)
    block = with_cone(scene, section, occlusion).bytes
    count = write_sightings(block, 0, True, scene.poses[None], everybody, found)
    seen[found[:count, 1], found[:count, 2]] = True
    return seen


def slow_cone(scene: Scene, section: ConeSection) -> tuple[BoolArray, BoolArray]:
    """Return (robots, robots) whether the first receives from the second, and whether rounding may reverse that."""
    offset = scene.poses[None, :, :2] - scene.poses[:, None, :2]
    distance = np.hypot(offset[..., 0], offset[..., 1])
    bearing = np.arctan2(offset[..., 1], offset[..., 0])
    headings = scene.poses[:, 2]
    off = bearing - headings[:, None] if section.of == "vision" else bearing + math.pi - headings[None]
    off = np.degrees(np.abs(np.arctan2(np.sin(off), np.cos(off))))
    reach = math.inf if section.range_cm is None else section.range_cm
    inside = (distance <= reach) & (off <= section.angle_deg / 2)
    on_edge = (np.abs(off - section.angle_deg / 2) < 1e-6) & (section.angle_deg < 360)
    return inside & ~np.eye(len(headings), dtype=bool), on_edge | (np.abs(distance - reach) < EDGE_CM)


def slow_hidden(scene: Scene) -> tuple[BoolArray, BoolArray]:
    """Return (robots, robots) whether something is between the two, and whether rounding may reverse that."""
    robots = len(scene.poses)
    hidden, doubtful = np.zeros((2, robots, robots), bool)
    bodies = np.column_stack([scene.poses[:, :2], scene.radii_cm])
    for one, other in permutations(range(robots), 2):
        way = bodies[other, :2] - bodies[one, :2]
        length = np.hypot(*way)
        ray = bodies[[one], :2], way[None] / length
        discs = np.vstack([np.delete(bodies, [one, other], axis=0), scene.arena.circles])
        to_discs, by_disc = cast_on_discs(*ray, discs)
        to_edges, by_edge = cast_on_segments(*ray, scene.arena.edges)
        depths = np.hstack([to_discs, to_edges])
        hidden[one, other] = (depths < length).any()
        doubtful[one, other] = np.hstack([by_disc, by_edge, np.abs(depths - length) < EDGE_CM]).any()
    return hidden, doubtful


@settings(max_examples=60)
@given(scenes(robots=(1, 2, 3, 10)), sections, st.booleans())
def test_who_perceives_whom_is_as_angles_distances_and_what_is_between_the_centres_say(scene, section, occlusion):
    expected, doubtful = slow_cone(scene, section)
    if occlusion:
        hidden, by_an_edge = slow_hidden(scene)
        expected, doubtful = expected & ~hidden, doubtful | by_an_edge
    found = pairs(scene, section, occlusion)
    assert (found == expected)[~doubtful].all()


@settings(max_examples=40)
@given(scenes(robots=(2, 10, 40)), sections, st.booleans(), st.integers(0, 3))
def test_a_robot_perceives_a_flash_if_it_perceives_any_lit_ring(scene, section, occlusion, observer):
    assume(observer < len(scene.poses))
    block = with_cone(scene, section, occlusion, observer)
    perceive_flashes(block.bytes, ADDRESSES, 0)
    expected = pairs(scene, section, occlusion)[observer:, scene.lit].any(axis=1)
    np.testing.assert_array_equal(block.swarm.pixels, expected)


def lit_pair(signal: dict, apart_cm: float) -> Simulation:
    controller = {"controller": "constant", "parameters": {"ring_on": True}}
    robots = {"poses": [[20, 50, 0], [20 + apart_cm, 50, 0]], "signal": signal, **controller}
    return Simulation({"arena": {"width_cm": 100, "height_cm": 100}, "robots": [robots], "noise": "off"})


@pytest.mark.parametrize(("range_cm", "seen"), [(40, 1), (39.9, 0)])
def test_a_swarm_with_an_ideal_sensor_has_a_picture_of_one_pixel(range_cm, seen):
    simulation = lit_pair({"kind": "cone", "range_cm": range_cm, "angle_deg": 60}, 40)
    assert [simulation.advance(1).camera.tolist() for _ in range(2)] == [[[0], [0]], [[seen], [0]]]
