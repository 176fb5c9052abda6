"""What a sensor in a file costs, beside the same code as a shipped kernel. Run by `make bench`."""

import math
from functools import partial

import numpy as np
import pytest

from epuck_sim import load_scenario
from epuck_sim.control.interface import World
from epuck_sim.control.loader import find_controller, find_sensor
from epuck_sim.embodied.layout import make_swarm_block
from epuck_sim.embodied.placement import Placement
from epuck_sim.embodied.sensing import brightness_at, distance_cm
from epuck_sim.embodied.sensors.own import OwnSensor
from epuck_sim.embodied.start import draw_start
from epuck_sim.embodied.swarm import swarm_at
from epuck_sim.util.jit import jit, jit_no_alloc
from epuck_sim.util.native import address_of, call
from epuck_sim.util.rng import uniform
from tests.benchmarks.measuring import take_turns

MOST = 1.2
"""Largest time of a sensor in a file, relative to that of a shipped kernel."""

ROBOTS, ROUNDS, CALLS = 100, 31, 200

COLUMNS = "sensor", "ns a robot, in a file", "as a kernel", "ratio"

FLOOR = {
    "brightness": 0.8,
    "patches": [{"shape": "circle", "x_cm": 60, "y_cm": 60, "radius_cm": 40, "brightness": 0.2}],
}

FILE = """
import math
from epuck_sim.embodied.sensing import brightness_at, distance_cm
from epuck_sim.util.rng import uniform

PARAMETERS = {{"ahead_cm": 3.0, "noise": 0.05}}
READINGS = {{"seen": float}}


def sense(world, robot, readings, parameters, random):
    {0}
"""

SENSORS = {
    "ground": (
        "x = robot.x + parameters.ahead_cm * math.cos(robot.heading)\n"
        "    y = robot.y + parameters.ahead_cm * math.sin(robot.heading)\n"
        "    readings.seen = brightness_at(world, x, y) + parameters.noise * (2 * uniform(random) - 1)"
    ),
    "ray": "readings.seen = distance_cm(world, robot.x, robot.y, robot.heading, 50.0, robot.number)",
}


@jit_no_alloc
def ground(block, _addresses, number):
    swarm = swarm_at(block)
    world, group = _world(swarm), swarm.groups[number]
    for place in range(group.count):
        robot = swarm.robots[group.first + place]
        x, y = robot.x + 3.0 * math.cos(robot.heading), robot.y + 3.0 * math.sin(robot.heading)
        noise = 0.05 * (2 * uniform(robot.signal_random) - 1)
        robot.sensors.infrared[7] = brightness_at(world, x, y) + noise


@jit_no_alloc
def ray(block, _addresses, number):
    swarm = swarm_at(block)
    world, group = _world(swarm), swarm.groups[number]
    for place in range(group.count):
        robot = swarm.robots[group.first + place]
        robot.sensors.infrared[7] = distance_cm(world, robot.x, robot.y, robot.heading, 50.0, robot.number)


@jit_no_alloc
def _world(swarm):
    scene = swarm.scene[0]
    circles, edges = swarm.circles[: scene.circles], swarm.edges[: scene.edges]
    return World(
        float(scene.step * scene.step_s),
        float(scene.width_cm),
        float(scene.height_cm),
        float(scene.largest_cm),
        swarm.robots,
        circles,
        edges,
        swarm,
    )


@jit
def repeat(block, addresses, address, times):
    for _ in range(times):
        call(address, block, addresses, 0)


@pytest.mark.parametrize("name", SENSORS)
def test_a_sensor_in_a_file_costs_hardly_more_than_a_kernel_of_the_same_code(benchmark, show, tmp_path, name):
    path = tmp_path / f"{name}.py"
    path.write_text(FILE.format(SENSORS[name]))
    sensor, controller = find_sensor(str(path)), find_controller("firefly")
    arena = {"width_cm": 200, "height_cm": 200, "floor": FLOOR}
    scenario = load_scenario({"arena": arena, "robots": [{"count": ROBOTS, "sensors": [str(path)]}]})
    block, swarm = make_swarm_block(scenario, [scenario.arena.build()], [controller], [[sensor]])
    draw_start(block, 1)
    Placement(swarm, scenario).place(block)
    own = OwnSensor(block, swarm, 0, name, sensor)
    own.parameters[:] = sensor.parameter_record(sensor.parameters)
    both = {"file": own.address, "kernel": address_of({"ground": ground, "ray": ray}[name])}
    works = {name: partial(repeat, block, np.zeros(3, np.int64), each, CALLS) for name, each in both.items()}
    found = take_turns(benchmark, works, ROUNDS)
    np.testing.assert_allclose(own.readings["seen"], swarm.robots.sensors.infrared[:, 7], rtol=0, atol=0.1)  # noise
    ratio = np.median(found["file"] / found["kernel"])
    show(COLUMNS, name, *(np.median(found[each]) * 1e3 / CALLS / ROBOTS for each in both), ratio)
    assert ratio <= MOST
