"""Claims about the infrared sensors: closed forms, and a slow twin on random scenes."""

import math
from collections import Counter

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim import epuck
from epuck_sim.embodied.sensors import infrared
from epuck_sim.embodied.swarm import INFRARED
from epuck_sim.scenario.robot_kind import EPUCK
from epuck_sim.scenario.robots import InfraredSection
from tests.embodied import scenes

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
