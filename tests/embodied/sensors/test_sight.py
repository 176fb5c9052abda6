"""Claims about sight: rays and views, closed forms, slow twins of infrared sensors and line cameras, and pictures."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

from epuck_sim import Simulation, epuck, load_scenario
from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.cells import count_cells, set_cells
from epuck_sim.embodied.sensors import infrared, sight
from epuck_sim.embodied.sensors.camera import begin_pictures, look, take_pictures
from epuck_sim.embodied.swarm import HIDE, INFRARED, make_block, open_block, swarm_at
from epuck_sim.scenario.robot_kind import EPUCK, cell_cm
from epuck_sim.scenario.robots import InfraredSection
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.native import INTP, address_of
from epuck_sim.util.rng import uniform
from epuck_sim.util.seeds import robot_streams
from tests.embodied import scenes
from tests.embodied.steps import steps_of

headings = st.floats(-math.pi, math.pi) | st.integers(-4, 4).map(lambda eighths: eighths * math.pi / 4)
INFRARED_CM = math.hypot(3.35, 1.05) + 12 + 3.7
"""Distance of two e-pucks at which an infrared ray of one can meet the other: sensors 0 and 7 are farthest out."""
sizes = st.floats(7.4, 1000)


def test_a_ray_ends_at_a_disc_and_at_a_segment():
    for disc, distance in [
        ((10, 3, 3), 10),  # grazed, it is met where it touches
        *(((10, side * (3 + 1e-9), 3), math.inf) for side in (-1, 1)),
        *(((10, side * (3 - 1e-9), 3), pytest.approx(10, abs=1e-4)) for side in (-1, 1)),
        ((3, 0, 3), 0),  # where it begins, towards its centre alone
        ((-3, 0, 3), math.inf),
    ]:
        assert sight.to_disc(0.0, 0.0, 1.0, 0.0, *map(float, disc)) == distance
    for ends, distance in [
        *(((5, low, 5, low + 2), 5) for low in (0, -2)),  # met at its very end
        ((0, -1, 0, 1), 0),
        *((ends, math.inf) for y in (0, 1) for ends in ((3, y, 9, y), (9, y, 3, y))),  # parallel to the ray
        *((ends, math.inf) for ends in ((-5, -1, -5, 1), (5, 1, 5, 2), (5, -2, 5, -1))),
    ]:
        assert sight.to_segment(0.0, 0.0, 1.0, 0.0, *map(float, ends)) == distance


def view_of(x: float, y: float, heading: float, width: float) -> sight.FieldOfView:
    left, right = heading + width / 2, heading - width / 2
    edges = math.cos(left), math.sin(left), math.cos(right), math.sin(right)
    return sight.FieldOfView(x, y, *edges, width >= math.pi, scenes.RADIUS_CM + sight.SLACK_CM)


@pytest.mark.parametrize("heading", [0.3, 1.4, -2.0, -0.9])
def test_a_search_visits_a_part_of_the_cells_about_one_for_a_robot_and_ends_where_all_is_met(heading):
    assert math.prod(count_cells(700.0, 700.0, 1000, cell_cm([EPUCK]))) == pytest.approx(1000, rel=0.1)
    swarm, view = open_block(make_block({"robots": 1000})), view_of(350.0, 350.0, heading, 0.5)
    set_cells(swarm, 700, 700, cell_cm([EPUCK]))
    scene = swarm.scene[0]
    strips = sight.make_strips(view, scene)
    wedge = sight.make_wedge(view, strips)
    found, strip = [], strips.first
    while 0 <= strip < strips.total:
        cell, spans, length = sight.cells_in_strip(view, wedge, strips, strip, scene)
        found += [cell + span * scene.columns + place for span in range(spans) for place in range(length)]
        strip += strips.step
    assert len(set(found)) == len(found) < 0.25 * scene.columns * scene.rows
    fifth = sight.distance_beyond(wedge, strips, strips.first + 5 * strips.step)
    assert 5 * strips.width_cm - 2 * scenes.RADIUS_CM < fifth < 6 * strips.width_cm * math.sqrt(2)


@given(headings, st.floats(0.01, 3), st.floats(-math.pi, math.pi), st.floats(4, 300))
def test_a_robot_well_beside_a_view_is_ruled_out(heading: float, width: float, bearing: float, distance: float) -> None:
    off = abs(math.remainder(bearing - heading, 2 * math.pi)) - width / 2
    view = view_of(0.0, 0.0, heading, width)
    dx, dy = distance * math.cos(bearing), distance * math.sin(bearing)
    if 0 < off < math.pi / 2 and math.sin(off) * distance > scenes.RADIUS_CM + 1e-5:
        assert not sight.may_contain_robot(view, dx, dy)
    assert sight.may_contain_robot(view_of(0.0, 0.0, heading, 3.2), dx, dy)


@given(st.floats(-100, 100).filter(bool), st.floats(-100, 100), st.floats(3.7, 1000))
def test_the_fast_angle_is_as_good_as_it_says_and_the_bound_of_the_radius_above_and_near_it(ahead, aside, distance):
    off = sight.fast_atan2(ahead, aside) - math.atan2(aside, ahead)
    assert abs(math.remainder(off, 2 * math.pi)) <= sight.ATAN2_ERROR_RAD
    exact = math.asin(min(scenes.RADIUS_CM / distance, 1.0))
    assert exact - 1e-15 <= sight.angular_radius_bound(distance, scenes.RADIUS_CM)
    assert distance < 2 * scenes.RADIUS_CM or sight.angular_radius_bound(distance, scenes.RADIUS_CM) < 1.1 * exact


@settings(max_examples=30)
@given(sizes, sizes, st.integers(1, 500))
def test_cells_share_the_floor_and_are_no_narrower_than_infrared_reaches(width, height, robots):
    swarm = open_block(make_block({"robots": robots}))
    set_cells(swarm, width, height, cell_cm([EPUCK]))
    scene = swarm.scene[0]
    assert scene.columns * scene.cell_width_cm == pytest.approx(width)
    assert scene.rows * scene.cell_height_cm == pytest.approx(height)
    assert scene.columns == 1 or scene.cell_width_cm >= INFRARED_CM - 1e-9
    assert scene.rows == 1 or scene.cell_height_cm >= INFRARED_CM - 1e-9


NOTHING_MM = 65535
E_PUCKS = np.zeros(1, INFRARED).view(np.recarray)[0]  # the e-puck's sensors

infrared.set_infrared(E_PUCKS, EPUCK, InfraredSection(), 0.0)


def sensed(poses, arena, by_table=False, noise_counts=0.0, noise=0.0, gain=1.0):
    scene = scenes.Scene(np.array(poses), np.zeros(len(poses), bool), arena)
    section = InfraredSection(distance="firmware_table" if by_table else "inverse_response")
    block = scenes.block_of(scene, infrared=section, noise_counts=noise_counts)
    robots = block.swarm.robots
    robots.infrared_noise, robots.infrared_gain = noise, gain
    infrared.sense_infrared(block.bytes, scenes.ADDRESSES, 0)
    return robots.sensors.infrared, robots.sensors.distance_mm


def response(distance):
    return infrared.reading_at(distance, E_PUCKS)


def distance_mm(reading):
    return infrared.inverse_response_mm(reading, E_PUCKS)


@given(st.floats(0.3, 12))
@example(0.3)
@example(12.0)
def test_the_response_is_that_of_the_facts_and_a_distance_comes_back_from_it_in_whole_mm(distance):
    facts = 3731 * (0.7 - 0.3**2) / (distance**2 - 2 * 0.3 * distance + 0.7)
    assert response(distance) == pytest.approx(facts, rel=1e-12)
    assert distance_mm(response(distance)) in {int(10 * distance - 1e-6), int(10 * distance + 1e-6)}


def test_the_response_peaks_nearer_than_3_mm_and_ends_after_12_cm_the_table_at_29_counts_and_constants_are_the_facts():
    assert response(0.0) == response(0.3) == 3731.0
    assert response(math.nextafter(12.0, 13.0)) == response(math.inf) == 0.0
    assert distance_mm(5000.0) == 3
    assert infrared.firmware_table_mm(math.nextafter(29.0, 0.0)) == infrared.firmware_table_mm(0.0) == NOTHING_MM
    assert infrared.firmware_table_mm(5000.0) == 0
    np.testing.assert_array_equal(epuck.INFRARED_SENSORS, scenes.SENSORS)
    assert epuck.INFRARED_RANGE_CM == 12


@given(st.floats(29, 4095) | st.sampled_from([29.0, 58.0, 133.0, 558.0, 3591.0, 3756.0, 4095.0]))
def test_the_firmware_s_table_is_linear_between_its_entries(reading):
    counts, mm = [29, 58, 133, 558, 3591, 3756, 4095], [100, 75, 50, 25, 10, 3, 0]
    between = np.interp(reading, counts, mm)
    assert infrared.firmware_table_mm(reading) in {int(between - 1e-6), int(between + 1e-6)}
    assert reading not in counts or infrared.firmware_table_mm(reading) == between


@pytest.mark.parametrize("by_table", [False, True])
def test_a_wall_at_exactly_12_cm_is_in_range_and_a_hair_further_is_not(by_table):
    at_range, beyond = (sensed([(50.0, y, 0.0)], scenes.empty_arena(100, 30.6), by_table) for y in (15.3, 15.3 - 1e-9))
    assert at_range[0][0, 5] == response(12.0) > 16
    assert at_range[1][0, 5] in ({NOTHING_MM} if by_table else {119, 120})
    assert (beyond[0][0, 5], beyond[1][0, 5]) == (0.0, NOTHING_MM)


@settings(max_examples=25)
@given(scenes.any_scenes(robots=(2, 10)), scenes.SEEDS, st.sampled_from([0.0, 10.0, 3000.0]), st.booleans())
def test_readings_are_amplified_and_noisy_within_0_and_the_peak_and_distances_are_theirs(scene, seed, noise, by_table):
    random = np.random.default_rng(seed)
    gain, normal = random.uniform(0.5, 1.5, (len(scene.poses), 8)), random.standard_normal((len(scene.poses), 8))
    counts, mm = sensed(scene.poses, scene.arena, by_table, noise, normal, gain)
    np.testing.assert_array_equal(counts, np.clip(scenes.readings(scene) * gain + noise * normal, 0, 3731))
    for reading, found in zip(counts.ravel(), mm.ravel(), strict=True):
        if by_table or reading >= response(12.0):
            assert found == (infrared.firmware_table_mm(reading) if by_table else distance_mm(reading))
        else:
            assert found == NOTHING_MM


def test_readings_are_those_of_the_slow_twin():
    tally = Counter()

    @settings(max_examples=15)
    @given(scenes.any_scenes(robots=(1, 2, 3, 10, 60, 300), bodies=scenes.BODIES))
    def compare(scene):
        expected, doubtful = scenes.slow_readings(scene)
        fast = scenes.readings(scene)
        np.testing.assert_allclose(fast[~doubtful], expected[~doubtful], rtol=1e-9, atol=1e-9 * 4500)
        tally.update(sensors=doubtful.size, doubtful=doubtful.sum(), reading=(expected > 0).sum())

    compare()
    assert tally["sensors"] > 500
    assert tally["reading"] > 0.1 * tally["sensors"]
    assert tally["doubtful"] < 1e-3 * tally["sensors"]


MIRRORS = st.sampled_from([0.0, 10_000.0, 10_000.0, 15.0, 40.0])
ONE_PIXEL = scenes.CameraSettings(1, 56.0, 1)


def test_of_two_robots_as_near_the_lit_one_is_seen():
    # either side of the middle pixel's ray, and overlapping by a hair, as robots that push each other do
    robots = [(100, 100, 0.0), (130, 100 + 3.6875, 0.0), (130, 100 - 3.6875, 0.0)]
    behind = [(10.0 + 8 * place, 10.0, 0.0) for place in range(10)]  # where many are lit, all are looked at alike
    for lit in ([False, True, False], [False, False, True]):
        for others in ([], behind):
            poses, rings = np.array([*robots, *others]), np.array([*lit, *[True] * len(others)])
            scene = scenes.Scene(poses, rings, scenes.empty_arena())
            assert scenes.rows(scene, ONE_PIXEL)[0] == [1]


@pytest.mark.parametrize("quarter", range(4))
def test_a_robot_in_a_farther_row_of_cells_may_hide_one_in_a_nearer(quarter):
    # the one pixel's ray has the far robot on its right side, and the near one, beyond the next border, on its left
    nose, ahead, right = np.array([(110, 119), (0.5, 0.75**0.5), (0.75**0.5, -0.5)])
    far, near = nose + 25.15 * ahead + 3.6 * right, nose + 23.35 * ahead - 3.6 * right
    places = np.array([nose - scenes.RADIUS_CM * ahead, far, near])
    for _ in range(quarter):
        places = np.column_stack([200 - places[:, 1], places[:, 0]])
    poses = np.column_stack([places, np.full(3, math.radians(60 + 90 * quarter))])
    parked = np.repeat([(-5e5, -5e5, 0.0)], 97, axis=0)
    for near_is_lit in (False, True):
        lit = np.array([False, not near_is_lit, near_is_lit])
        scene = scenes.Scene(np.vstack([poses, parked]), np.append(lit, np.zeros(97, bool)), scenes.empty_arena())
        block = scenes.block_of(scene, ONE_PIXEL)
        assert block.swarm.scene[0].columns == block.swarm.scene[0].rows == 10  # cells are 20 cm wide
        look(block.bytes, scenes.ADDRESSES, 0)
        assert block.swarm.pixels[0] == near_is_lit


def test_rows_are_those_of_the_slow_twin_with_and_without_what_walls_mirror():
    tally = Counter()

    @settings(max_examples=40)
    @given(scenes.any_scenes((1, 2, 3, 10, 60, 200), scenes.BODIES), scenes.camera_settings(), MIRRORS, scenes.SEEDS)
    def compare(scene, camera, mirrored_cm, seed):
        random = np.random.default_rng(seed)
        if random.random() < 0.5 and not mirrored_cm:  # robots that push each other overlap
            scene = scene._replace(poses=scene.poses + random.uniform(-0.05, 0.05, scene.poses.shape))
        every = 1 + len(scene.poses) // 16  # of 60 robots the twin does 15
        direct, camera = scenes.rows(scene, camera), camera._replace(reflection_range_cm=mirrored_cm)
        expected, doubtful = scenes.slow_rows(scene, camera, every)
        found = scenes.rows(scene, camera)
        np.testing.assert_array_equal(found[::every][~doubtful], expected[~doubtful])
        assert (found >= direct).all()
        mirrored = (found > direct)[::every]
        tally.update(pixels=doubtful.size, doubtful=doubtful.sum(), red=direct[::every].sum(), mirrored=mirrored.sum())

    compare()
    assert tally["pixels"] > 4000
    assert min(tally["red"], tally["mirrored"]) > 0.005 * tally["pixels"]
    assert tally["doubtful"] < 0.02 * tally["pixels"]


@jit_no_alloc
def hide_every_third(block: ByteArray, addresses: IntArray, robot: int) -> None:  # noqa: ARG001
    swarm = swarm_at(block)
    robots = len(swarm.robots)
    for sender in range(robots):
        swarm.numbers[robots + sender] = 1 if swarm.robots[sender].ring_on and (robot + sender) % 3 else 0


@settings(max_examples=12)
@given(scenes.any_scenes(robots=(3, 10, 30)), scenes.camera_settings())
def test_rings_that_faults_hide_from_a_robot_are_dark_to_it_alone(scene, camera):
    addresses = scenes.ADDRESSES.copy()
    addresses[HIDE] = address_of(hide_every_third, INTP)
    block = scenes.block_of(scene, camera)
    block.swarm.scene[0].hides_flashes = True
    look(block.bytes, addresses, 0)
    numbers = np.arange(len(scene.poses))
    for robot in range(0, len(scene.poses), 7):
        visible = scene._replace(lit=scene.lit & ((robot + numbers) % 3 > 0))
        found = block.swarm.pixels.reshape(-1, camera.pixels)[robot]
        np.testing.assert_array_equal(found, scenes.rows(visible, camera)[robot])


@pytest.mark.parametrize("beyond_cm", [0.0, 0.03])
@pytest.mark.parametrize("others_are_lit", [False, True])
def test_a_robot_that_presses_its_nose_against_a_wall_sees_its_own_ring_at_most(beyond_cm, others_are_lit):
    poses = np.array([(200 - scenes.RADIUS_CM + beyond_cm, 100.0, 0.0), (150.0, 100.0, 0.0), (170.0, 120.0, 0.0)])
    for own in (False, True):
        scene = scenes.Scene(poses, np.array([own, others_are_lit, others_are_lit]), scenes.empty_arena())
        assert scenes.rows(scene, scenes.CameraSettings(reflection_range_cm=10_000.0))[0].tolist() == [int(own)] * 60


def facing_a_wall(range_cm=200, **keys):
    """Return a scenario of a robot that faces a wall, and one behind it whose ring is lit from the start for 0.3 s."""
    still = {"speed_cm_s": 0.0, "flash_fraction": 0.075}
    robots = [{"poses": [[45, 30, 0], [20, 42, 0]], "parameters": still, "memory": {"phase_ms": [1000, 4900]}}]
    robots[0]["camera"] = {"reflection_range_cm": range_cm}
    return {"noise": "off", "robots": robots, **keys}


def test_robots_see_what_walls_mirror_where_the_key_is_set_and_faults_hide_it_as_they_hide_rings():
    shown = steps_of(facing_a_wall(), 60, 2)
    camera, lit = shown["camera"], shown["ring_on"]
    assert steps_of(facing_a_wall(0), 60, 2)["camera"][:, 0].sum() == 0
    seen = camera[:, 0].any(axis=1)
    assert 2 < seen.sum() < 30
    np.testing.assert_array_equal(seen[1:], lit[:-1].any(axis=1))  # its own ring, too
    first = np.flatnonzero(seen)[0]
    assert len(Simulation(facing_a_wall(), seed=2).advance(first + 1).sightings) == 0  # whom it sees directly
    healthy = camera[:30, 0]  # until its own flash
    assert healthy.any()
    dead, blind = {"kind": "ring_dead", "robots": [1]}, {"kind": "camera_blind", "robots": [0]}
    not_yet = {"kind": "camera_misses", "missed": 1, "at_s": 1000}
    for fault, expected in ((dead, 0), (blind, 0), (not_yet, healthy)):
        faulty = steps_of(facing_a_wall(faults=[fault]), 30, 2)["camera"]
        np.testing.assert_array_equal(faulty[:, 0], expected)


@st.composite
def paces(draw):
    interval = draw(st.sampled_from([1.0, 1.5, 40 / 15, 5.0, 12.5, 40.0]) | st.floats(1, 50))
    return interval, interval * draw(st.sampled_from([0.0, 0.4, 1.0]) | st.floats(0, 1))


def filmed(interval, latency, steps, robots, seed):
    """Return (steps, robots) the step whose picture each controller has, -1 for none, and whether it is new."""
    pixels = 3 * robots
    block, addresses = make_block({"robots": robots, "groups": 1, "pixels": 3 * pixels}), np.zeros(3, np.int64)
    swarm = open_block(block)
    swarm.robots.signal_random = robot_streams(np.random.SeedSequence(seed), robots)
    group = swarm.groups[0]
    group.count, group.pixels, group.in_view, group.waiting = robots, 3, pixels, 2 * pixels
    group.camera.interval, group.camera.latency = interval, latency
    begin_pictures(block, 0)
    camera, in_view = swarm.pixels[:pixels].reshape(robots, 3), swarm.pixels[pixels : 2 * pixels]
    shown, is_new = np.empty((steps, robots), np.int64), np.empty((steps, robots), bool)
    for step in range(steps):
        swarm.scene[0].step, in_view[:] = step, step + 1
        take_pictures(block, addresses, 0)
        assert (camera == camera[:, :1]).all()
        shown[step], is_new[step] = camera[:, 0] - 1, swarm.robots.sensors.new_picture
    return shown, is_new


def slow_twin(interval, latency, steps, stream):
    """Return what `filmed` does of a robot, from the list of all its pictures: when taken, when there."""
    first = interval * uniform(stream)
    instants = [first + number * interval for number in range(steps + 1)]
    pictures = [(math.floor(instant), math.floor(instant + latency * uniform(stream))) for instant in instants]
    shown = [max((taken for taken, there in pictures if there <= step), default=-1) for step in range(steps)]
    arrivals = {there for _, there in pictures}
    return shown, [step in arrivals for step in range(steps)]


@settings(max_examples=20)
@given(paces(), st.integers(0, 2**32 - 1))
@example((1.0, 0.0), 1)
@example((1.0, 1.0), 2)
def test_each_step_shows_the_last_picture_that_has_arrived(pace, seed):
    shown, is_new = filmed(*pace, 200, 3, seed)
    for robot, stream in enumerate(robot_streams(np.random.SeedSequence(seed), 3)):
        assert (shown[:, robot].tolist(), is_new[:, robot].tolist()) == slow_twin(*pace, 200, stream)


def test_a_picture_in_every_step_is_as_good_as_no_pace():
    plain, paced = Simulation("thesis", 3), Simulation(load_scenario("thesis", ["robots.0.camera.frames_per_s=10"]), 3)
    for one, other, _ in zip(plain, paced, range(100), strict=False):
        assert one.poses.tobytes() == other.poses.tobytes()
        assert one.memories[0].tobytes() == other.memories[0].tobytes()
        assert one.camera.tobytes() == other.camera.tobytes()
