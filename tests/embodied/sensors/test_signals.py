"""Claims about signals other than the camera's: the ideal cone and Enki's camera, against slow twins, and radio."""

import math
from itertools import permutations

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from epuck_sim import Simulation
from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.observers import write_perceived
from epuck_sim.embodied.sensors.signals import perceive_flashes, set_signal
from epuck_sim.scenario.robots import ConeSection, EnkiCameraSignal
from tests.control.bench import with_step, write_controller
from tests.embodied import scenes
from tests.embodied.steps import constant

ranges, angles = st.sampled_from([None, 15.0, 40.0]), st.sampled_from([360.0, 180.0]) | st.floats(1, 360)
cones = st.builds(ConeSection, range_cm=ranges, angle_deg=angles, of=st.sampled_from(["vision", "emission"]))
RAYS = 1440
ANGLES = np.arange(RAYS) * 2 * math.pi / RAYS
SEND, LISTEN = {}, {"first": 10**6}


def with_cone(scene: scenes.Scene, section: ConeSection, occlusion: bool, observer: int = 0):
    block = scenes.block_of(scene, scenes.CameraSettings(1, 56.0, 1), observer)
    set_signal(block.swarm.groups[0], section, scene.body.camera_forward_cm, 100)
    block.swarm.groups[0].cone.occlusion = occlusion
    return block


def pairs(scene: scenes.Scene, section: ConeSection, occlusion: bool) -> BoolArray:
    """Return (robots, robots) whether the first perceives the ring of the second."""
    robots = len(scene.poses)
    found, seen = np.zeros((robots**2, 3), np.int64), np.zeros((robots, robots), bool)
    everybody = np.ones((1, robots), bool)
    block = with_cone(scene, section, occlusion).bytes
    count = write_perceived(block, 0, scene.poses[None], everybody, found.ravel())
    seen[found[:count, 1], found[:count, 2]] = True
    return seen


def slow_cone(scene: scenes.Scene, section: ConeSection) -> tuple[BoolArray, BoolArray]:
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
    return inside & ~np.eye(len(headings), dtype=bool), on_edge | (np.abs(distance - reach) < scenes.EDGE_CM)


def slow_hidden(scene: scenes.Scene) -> tuple[BoolArray, BoolArray]:
    """Return (robots, robots) whether something is between the two, and whether rounding may reverse that."""
    robots = len(scene.poses)
    hidden, doubtful = np.zeros((2, robots, robots), bool)
    bodies = scene.discs
    for one, other in permutations(range(robots), 2):
        way = bodies[other, :2] - bodies[one, :2]
        length = np.hypot(*way)
        ray = bodies[[one], :2], way[None] / length
        discs = np.vstack([np.delete(bodies, [one, other], axis=0), scene.arena.circles])
        to_discs, by_disc = scenes.cast_on_discs(*ray, discs)
        to_edges, by_edge = scenes.cast_on_segments(*ray, scene.arena.edges)
        depths = np.hstack([to_discs, to_edges])
        hidden[one, other] = (depths < length).any()
        doubtful[one, other] = np.hstack([by_disc, by_edge, np.abs(depths - length) < scenes.EDGE_CM]).any()
    return hidden, doubtful


@settings(max_examples=60)
@given(scenes.any_scenes(robots=(1, 2, 3, 10)), cones, st.booleans())
def test_who_perceives_whom_is_as_angles_distances_and_what_is_between_the_centres_say(scene, section, occlusion):
    expected, doubtful = slow_cone(scene, section)
    if occlusion:
        hidden, by_an_edge = slow_hidden(scene)
        expected, doubtful = expected & ~hidden, doubtful | by_an_edge
    assert (pairs(scene, section, occlusion) == expected)[~doubtful].all()


@settings(max_examples=40)
@given(scenes.any_scenes(robots=(2, 10, 40)), cones, st.booleans(), st.integers(0, 3))
def test_a_robot_perceives_a_flash_if_it_perceives_any_lit_ring(scene, section, occlusion, observer):
    assume(observer < len(scene.poses))
    block = with_cone(scene, section, occlusion, observer)
    perceive_flashes(block.bytes, scenes.ADDRESSES, 0)
    expected = pairs(scene, section, occlusion)[observer:, scene.lit].any(axis=1)
    np.testing.assert_array_equal(block.swarm.pixels, expected)


enki_angles = st.just(350.0) | angles
enki_cameras = st.builds(EnkiCameraSignal, kind=st.just("enki_camera"), range_cm=ranges, angle_deg=enki_angles)


def offsets(bearing: FloatArray) -> FloatArray:
    """Return (rays, n) rad between 0 and pi from each ray of the fan to each of (n,) directions."""
    return np.abs((ANGLES[:, None] - bearing[None] + math.pi) % (2 * math.pi) - math.pi)


def narrow(each: BoolArray) -> BoolArray:
    """Return (rays, ...) what holds of a ray and both beside it."""
    return each & np.roll(each, 1, axis=0) & np.roll(each, -1, axis=0)


def wide(each: BoolArray) -> BoolArray:
    return ~narrow(~each)


def slow_camera(scene, section, occlusion, observers) -> tuple[BoolArray, BoolArray]:
    """Return (observers, robots) whether each sees each by a ray, and whether it may do so between rays."""
    robots = len(scene.poses)
    looking = range(robots)[observers]
    surely, perhaps = np.zeros((2, len(looking), robots), bool)
    discs = np.vstack([scene.discs, scene.arena.circles])
    reach = math.inf if section.range_cm is None else section.range_cm
    for row, one in enumerate(looking):
        centre, heading = scene.poses[one, :2], scene.poses[one, 2]
        x, y = centre + scene.body.camera_forward_cm * scenes.directions_of(heading)
        away = np.hypot(discs[:, 0] - x, discs[:, 1] - y)
        covers = offsets(np.arctan2(discs[:, 1] - y, discs[:, 0] - x)) <= np.arctan(discs[:, 2] / away)
        rays = np.tile((x, y), (RAYS, 1)), scenes.directions_of(ANGLES)
        edge_depths, _ = scenes.cast_on_segments(*rays, scene.arena.edges)
        view = offsets(np.array([heading])) <= math.radians(section.angle_deg / 2) + 1e-12
        for other in range(robots):
            gap = math.hypot(*(discs[other, :2] - centre)) - discs[other, 2]
            if other == one or gap > reach + scenes.EDGE_CM:
                continue
            nearer = (away < away[other]) & (np.arange(len(discs)) != one)
            hides = np.column_stack([covers[:, nearer], edge_depths < away[other]]) & occlusion
            shown = covers[:, other] & view[:, 0]
            surely[row, other] = (shown & ~hides.any(axis=1)).any() and gap < reach - scenes.EDGE_CM
            shown = wide(covers[:, other]) & wide(view)[:, 0]
            perhaps[row, other] = (shown & ~narrow(hides).any(axis=1)).any()
    return surely, perhaps


@settings(max_examples=25)
@given(scenes.any_scenes(robots=(2, 3, 10, 25), bodies=scenes.BODIES), enki_cameras, st.booleans())
def test_a_robot_is_seen_if_a_ray_of_a_fan_meets_it_first(scene, section, occlusion):
    observers = slice(0, None, 1 + len(scene.poses) // 4)
    surely, perhaps = slow_camera(scene, section, occlusion, observers)
    found = pairs(scene, section, occlusion)[observers]
    assert (surely <= found).all()
    assert (found <= perhaps).all()


def test_a_swarm_with_an_ideal_sensor_has_a_picture_of_one_pixel_up_to_its_range():
    for signal, apart_cm, seen in (
        *(({"kind": "cone", "range_cm": reach, "angle_deg": 60}, 40, reach == 40) for reach in (40, 39.9)),
        # the range is that from the robot's centre to the other's rim
        *(({"kind": "enki_camera", "range_cm": 25, "angle_deg": 100}, apart, apart < 28.7) for apart in (28.69, 28.71)),
    ):
        group = constant([[20, 50, 0], [20 + apart_cm, 50, 0]], ring_on=True) | {"signal": signal}
        simulation = Simulation({"arena": {"width_cm": 100, "height_cm": 100}, "robots": [group], "noise": "off"})
        assert [simulation.advance(1).camera.tolist() for _ in range(2)] == [[[0], [0]], [[seen], [0]]]


SENDER = with_step(
    """due = memory.steps >= parameters.first and (memory.steps - parameters.first) % parameters.every == 0
    actuators.ring_on = due and parameters.message == 0
    actuators.send = parameters.message if due else 0
    memory.pulses = sensors.pulses
    memory.total += sensors.pulses
    memory.heard[:] = sensors.messages
    memory.steps += 1""",
    PARAMETERS="{'first': 3, 'every': 1000, 'message': 0}",
    MEMORY="{'steps': int, 'pulses': int, 'heard': (int, 8), 'total': int}",
)


def swarm(folder, *parameters, **signal):
    """Return a simulation of groups of one robot each, on a line 20 cm apart."""
    sender = write_controller(folder / "sender.py", SENDER)
    robot, groups = {"controller": str(sender.path), "signal": {"kind": "radio", **signal}}, []
    for place, own in enumerate(parameters):
        groups.append(robot | {"poses": [[10 + 20 * place, 20, 0]], "parameters": own})
    arena = {"width_cm": 20 * len(parameters) + 20, "height_cm": 40}
    return Simulation({"arena": arena, "robots": groups}, 1, interpret=True)


def pulses(simulation, steps):
    return [[int(memory["pulses"][0]) for memory in simulation.advance(1).memories] for _ in range(steps)]


def test_a_pulse_arrives_once_in_the_step_after_it_was_sent_or_later_by_the_latency_with_its_message(tmp_path):
    """A flash comes without one."""
    for latency_ms, late in ((0, 1), (1, 2), (100, 2), (250, 4)):
        heard = pulses(swarm(tmp_path, SEND, LISTEN, latency_ms=latency_ms), 10)
        assert heard == [[0, int(step == 3 + late)] for step in range(10)]
    simulation = swarm(tmp_path, {"message": 77}, SEND, LISTEN)
    simulation.advance(4)
    step = simulation.advance(1)
    heard = step.memories[2]
    assert heard["pulses"][0] == 2
    assert heard["heard"][0].tolist() == [77, 0, 0, 0, 0, 0, 0, 0]
    assert step.camera[:, 0].tolist() == [1, 1, 1]
    assert simulation.advance(1).memories[2]["heard"][0].tolist() == [0] * 8


@pytest.mark.parametrize(
    ("robots", "signal", "heard"),
    [
        # pulses pass through bodies, and end at the range
        ([SEND, LISTEN, LISTEN, LISTEN], {"range_cm": 40}, [0, 1, 1, 0]),
        ([LISTEN, SEND, LISTEN], {"angle_deg": 90, "of": "emission"}, [0, 0, 1]),
        ([LISTEN, SEND, LISTEN], {"angle_deg": 90}, [1, 0, 0]),
        *(([SEND, SEND, LISTEN], {"collisions": collide}, [1, 1, 0 if collide else 2]) for collide in (False, True)),
        *(([SEND, SEND, LISTEN], {"half_duplex": deaf}, [0, 0, 2] if deaf else [1, 1, 2]) for deaf in (False, True)),
        *(([SEND, LISTEN], {"loss": loss}, [0, 1 - loss]) for loss in (0, 1)),
    ],
)
def test_who_hears_a_pulse_of_the_step_before(tmp_path, robots, signal, heard):
    assert pulses(swarm(tmp_path, *robots, **signal), 5)[4] == heard


def test_pulses_are_lost_one_by_one_with_the_given_probability(tmp_path):
    steps = 2000
    step = swarm(tmp_path, {"every": 2}, LISTEN, LISTEN, loss=0.3).advance(steps)
    sent = (steps - 4 + 1) // 2
    totals = np.array([int(memory["total"][0]) for memory in step.memories])
    assert totals[0] == 0
    assert (np.abs(totals[1:] - 0.7 * sent) < 4 * np.sqrt(0.21 * sent)).all()
    assert totals[1] != totals[2]
