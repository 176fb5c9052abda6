"""What tests of controllers are made with: a robot set by hand, scenes, and the plugin of pytest."""

import copy
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

from epuck_sim.testing import TestRobot, facing_robot, facing_wall
from tests.control.bench import MODES, with_step, write_controller


@pytest.fixture
def mine(tmp_path):
    lines = """memory.x = sensors.infrared[2] + sensors.distance_mm[3] + sensors.camera[59] + sensors.step_ms
    memory.row[1] = parameters.gain
    memory.seen = sensors.new_picture
    actuators.left_cm_s += 1
    actuators.ring_on = sensors.camera.any()
    actuators.send = sensors.pulses + sensors.messages[1]
    actuators.turn_rad = 0.5 * sensors.pulses"""
    memory = "{'x': float, 'row': (float, 4), 'seen': bool}"
    text = with_step(lines, PARAMETERS="{'gain': 1.5, 'seed': 3}", MEMORY=memory)
    return write_controller(tmp_path / "mine.py", text).path


@MODES
def test_what_is_set_by_hand_reaches_the_controller_and_comes_back(mine, interpret):
    robot = TestRobot(mine, {"seed": 9}, gain=2.5, interpret=interpret)
    robot.step()
    assert (robot.memory.x, robot.ring_on, robot.left_cm_s) == (65535 + 100, False, 1.0)
    assert (robot.memory.seen, robot.new_picture, robot.step_ms) == (1, True, 100)
    assert (robot.parameters.gain, robot.parameters.seed) == (2.5, 9)
    robot.infrared[2], robot.distance_mm[3], robot.step_ms, robot.new_picture = 7, 20, 99, False
    robot.camera[20:30] = 1
    robot.camera[59] = 1
    robot.left_cm_s, robot.right_cm_s = 5, -1
    robot.parameters.gain = 0.5
    robot.memory.row[0] = 8
    robot.step(2)
    assert robot.memory.x == 7 + 20 + 1 + 99
    assert (robot.ring_on, robot.left_cm_s, robot.right_cm_s) == (True, 7.0, -1.0)
    assert robot.memory.row.tolist() == [8, 0.5, 0, 0]
    assert robot.memory.seen == 0
    robot.camera = robot.infrared = 0
    robot.distance_mm = np.arange(8)
    robot.ring_on = True
    robot.pulses, robot.messages = 2, [0, 40, 0, 0, 0, 0, 0, 0]
    robot.step()
    assert (robot.memory.x, robot.ring_on) == (3 + 99, False)
    assert (robot.send, robot.turn_rad) == (42, 1.0)


def test_names_that_there_are_not_are_refused_with_the_nearest_and_copies_as_records_lie_in_one_block(mine):
    robot = TestRobot(mine)
    with pytest.raises(AttributeError, match="memory has no 'seenn'; did you mean 'seen'"):
        robot.memory.seenn = 1
    with pytest.raises(AttributeError, match="parameters have no 'gian'; did you mean 'gain'"):
        _ = robot.parameters.gian
    for name in ("memory", "parameters", "readings"):
        with pytest.raises(AttributeError, match="cannot be 3 as a whole; allowed: one of its values"):
            setattr(robot, name, 3)
    with pytest.raises(AttributeError, match="cammera"):
        robot.cammera = 1
    with pytest.raises(ValueError, match="unknown 'gian', did you mean 'gain'"):
        TestRobot(mine, gian=1)
    assert dir(robot.memory) == ["row", "seen", "x"]
    assert repr(robot.parameters) == "parameters(gain=1.5, seed=3)"
    with pytest.raises(TypeError, match="sensors of a robot cannot be copied; make another TestRobot"):
        copy.deepcopy(robot._senses)
    with pytest.raises(TypeError, match="cannot be copied; make another TestRobot"):
        copy.deepcopy(robot)


def test_arrays_of_the_wrong_shape_and_what_is_no_number_are_refused(mine):
    robot = TestRobot(mine, pixels=10)
    with pytest.raises(ValueError, match="broadcast"):
        robot.camera = np.zeros(11)
    with pytest.raises(ValueError, match="NaN"):
        robot.distance_mm[0] = np.nan
    for name, wrong, right in (("infrared", np.nan, 0), ("distance_mm", 65536, 65535), ("camera", 2, 1)):
        getattr(robot, name)[3] = wrong
        with pytest.raises(ValueError, match=rf"{name}\[3\] is {wrong}; allowed: .*"):
            robot.step()
        getattr(robot, name)[3] = right
    robot.pulses = -1
    with pytest.raises(ValueError, match="pulses is -1; allowed: 0 to"):
        robot.step()
    robot.pulses = 0
    for name, cut in (("pulses", 1.5), ("new_picture", "no")):
        with pytest.raises(ValueError, match=f"{name} is {cut!r}; allowed: "):
            setattr(robot, name, cut)
    with pytest.raises(ValueError, match=r"steps is 1\.5; allowed: whole numbers from 0"):
        robot.step(1.5)
    for name in ("step_ms", "pixels"):
        with pytest.raises(ValueError, match=f"{name} is 0; allowed: whole numbers from 1"):
            TestRobot(mine, **{name: 0})
    for seed in (None, -1):
        with pytest.raises(ValueError, match=f"seed is {seed}; allowed: whole numbers from 0"):
            TestRobot(mine, seed=seed)


def test_random_numbers_follow_from_the_seed_and_firmware_in_c_is_tested_likewise():
    phases = [TestRobot("oscillator", seed=seed).memory.phase_ms for seed in (1, 1, 2)]
    assert phases[0] == phases[1] != phases[2]
    robot = TestRobot(Path(__file__).parents[1] / "controllers" / "firmware" / "firefly.c", speed_cm_s=3)
    robot.memory.phase_ms = 4950
    robot.step()
    assert (robot.ring_on, robot.memory.phase_ms, robot.left_cm_s) == (True, 0, 3.0)


def test_a_robot_faces_a_wall_or_a_robot_that_is_lit_or_dark_at_the_given_distance_with_sensors_of_its_own(tmp_path):
    near, far = (facing_wall("constant", gap_cm=gap).advance(1) for gap in (2.0, 50.0))
    assert near.distance_mm[0, [0, 7]].max() < 40
    assert (far.distance_mm == 65535).all()
    assert near.poses[0].tolist() == [100 - 3.7 - 2, 50, 0]
    lit, dark = (facing_robot("constant", gap_cm=20, lit=lit).advance(2) for lit in (True, False))
    assert lit.camera[0, 29:31].all()
    assert not dark.camera.any()
    assert lit.poses[1, 0] - lit.poses[0, 0] == pytest.approx(20 + 2 * 3.7)
    sensor = tmp_path / "place.py"
    sensor.write_text("READINGS = {'place': float}\ndef sense(w, robot, readings, p, r): readings.place = robot.x\n")
    wall = facing_wall("constant", 2, sensors=[sensor]).advance(1)
    other = facing_robot("constant", sensors=(sensor,), interpret=False, left_cm_s=0).advance(1)
    for step in (wall, other):
        assert step.readings["place"].tolist() == step.poses[:, 0].tolist()


def test_the_plugin_is_in_the_package_loads_nothing_heavy_and_finds_controllers_and_sensors_beside_a_test(make_robot):
    robot = make_robot("../controllers/firmware/firefly.c", sensors=["../plugins/darkness/darkness/ground.py"])
    assert dir(robot.readings) == ["darkness"]
    with pytest.raises(ValueError, match="allowed: a list of files, without parameters"):
        make_robot("firefly", sensors=[{"ground.py": {"noise": 0}}])
    project = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]
    name = project["entry-points"]["pytest11"]["epuck_sim.pytest_plugin"]
    assert hasattr(import_module(name), "make_robot")
    program = f"import sys, {name}; print({{'numba', 'numpy', 'pymunk', 'scipy'}} & set(sys.modules))"
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert run.stdout == "set()\n"
