"""Claims about cameras with a pace and a latency of their own: which picture a controller has, and since when."""

import math

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.sensors.camera import begin_pictures, take_pictures
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.swarm import make_block, open_block
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.util.rng import uniform
from epuck_sim.util.seeds import robot_streams


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
