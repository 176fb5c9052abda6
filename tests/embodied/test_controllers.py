"""Controllers run compiled and interpreted with equal results bit for bit; failures name the file and the robot."""

import importlib
import os
import subprocess
import sys
from bdb import BdbQuit
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from epuck_sim.control.loader import find_controller
from epuck_sim.embodied import user_code
from epuck_sim.embodied.user_code import RobotError
from epuck_sim.errors import ControllerError
from epuck_sim.util import jit
from tests.control.bench import EMPTY, Bench, with_step, write_controller, write_soon_after

MODES = pytest.mark.parametrize("interpret", [True, False], ids=["interpreted", "compiled"])

SIBLING = """
WEIGHTS = (0.5, -0.25, 0.125, 1.0)

def weighed(readings):
    total = 0.0
    for weight, reading in zip(WEIGHTS, readings):
        total += weight * reading
    return halved(total)

def halved(value):
    return value / 2
"""

MINE = """
import math

import numpy as np

import obstacle_avoidance
import sibling
from epuck_sim.util.rng import randint, uniform
from oscillator import is_flash, updated

import oscillator

PARAMETERS = oscillator.PARAMETERS | obstacle_avoidance.PARAMETERS | {"gain": 0.3, "turns": 4, "wild": True}
MEMORY = oscillator.MEMORY | obstacle_avoidance.MEMORY
MEMORY = MEMORY | {"past": (float, 4), "counts": (int, (2, 3)), "level": float, "lit": bool}

SLOTS = 4
TABLE = np.array([0.1, 0.7, 1.3, 2.9])
LIMITS = (-12.8, 12.8)


def start(memory, parameters, random):
    obstacle_avoidance.start(memory, parameters, random)
    oscillator.start(memory, parameters, random)
    memory.level = uniform(random)
    for slot in range(SLOTS):
        memory.past[slot] = TABLE[slot] * uniform(random)


def limited(speed):
    return min(max(speed, LIMITS[0]), LIMITS[1])


def remember(memory, value, random):
    slot = randint(random, SLOTS)
    memory.past[slot] = value
    memory.counts[slot % 2, slot % 3] += 1


def step(sensors, memory, actuators, parameters, random):
    obstacle_avoidance.step(sensors, memory, actuators, parameters, random)
    if is_flash(sensors, parameters):
        phase, fired = updated(memory.phase_ms, parameters)
        memory.phase_ms = phase % 5000
        memory.lit = fired
    remember(memory, sibling.weighed(sensors.infrared), random)
    memory.level = parameters.gain * memory.level + math.atan2(memory.past[0], 1.5) - memory.past.max() / 7
    if parameters.wild and memory.counts[0, 0] % parameters.turns == 1:
        actuators.left_cm_s = limited(actuators.left_cm_s + memory.level)
        actuators.right_cm_s = limited(math.sqrt(abs(memory.level)) * uniform(random))
    actuators.ring_on = memory.lit or sensors.distance_mm[3] < 20
"""


def own_controller(folder):
    (folder / "sibling.py").write_text(SIBLING)
    return write_controller(folder / "mine.py", MINE)


def outcome(controller, interpret=False):
    """Return what a robot has in `memory.x` after one step."""
    bench = Bench(controller, interpret=interpret)
    bench.control.step()
    return bench.memory["x"].tolist()[0]


# --- compiled and interpreted are one --------------------------------------------------------------


def assert_equal_in_both_modes(controller, parameters, steps=300, robots=10, step_ms=100):
    """Run both over the same senses; compare all they remember, command and will draw, after each step."""
    chance = np.random.default_rng(6)
    plain, quick = (
        Bench(controller, parameters, robots=robots, step_ms=step_ms, interpret=interpret)
        for interpret in (True, False)
    )
    states = {plain.state()}
    assert states == {quick.state()}, "start"
    for number in range(steps):
        plain.sense(chance)
        quick.sense_like(plain)
        plain.control.step()
        quick.control.step()
        assert plain.state() == quick.state(), f"step {number}"
        states.add(plain.state())
    return len(states)


@pytest.mark.parametrize(
    ("name", "parameters", "states"),
    [
        ("constant", {"left_cm_s": 0.1, "right_cm_s": -12.8, "ring_on": True}, 2),
        ("oscillator", {}, 201),
        ("oscillator", {"delay_ms": 62, "flash_pixels": 2, "once_per_sighting": True, "coupling": 0.05}, 201),
        ("obstacle_avoidance", {}, 201),
        ("obstacle_avoidance", {"rotation_speed_cm_s": 12.7, "speed_cm_s": 0.0625, "proximity_threshold": 30}, 201),
        ("firefly", {"speed_cm_s": 3.1}, 201),
    ],
)
def test_a_shipped_controller_does_the_same_compiled_and_interpreted(name, parameters, states):
    assert assert_equal_in_both_modes(name, parameters) >= states


@pytest.mark.parametrize("parameters", [{}, {"gain": -0.9, "turns": 1}, {"wild": False}], ids=str)
def test_a_user_s_own_controller_does_the_same_compiled_and_interpreted(parameters, tmp_path):
    """With helpers, constants, arrays in memory, a sibling file, parts of shipped controllers, and chance."""
    assert assert_equal_in_both_modes(own_controller(tmp_path), parameters) > 200


def test_a_camera_full_of_red_means_the_same_compiled_and_interpreted():
    """300 pixels: more than a byte counts."""
    phases = []
    for interpret in (True, False):
        bench = Bench("oscillator", {"flash_pixels": 200}, pixels=300, interpret=interpret)
        bench.senses.camera[:], bench.memory["phase_ms"] = 1, 1000
        bench.control.step()
        phases.append(bench.memory["phase_ms"].tolist())
    assert phases == [[1210], [1210]]


def test_arrays_of_sensors_are_of_one_type_whatever_their_lengths(tmp_path):
    line = (
        "memory.x = 0\n    for each in [sensors.distance_mm, sensors.camera, sensors.messages]: memory.x += each.sum()"
    )
    assert outcome(write_controller(tmp_path / "mine.py", with_step(line))) == 8 * 65535


@pytest.mark.parametrize(
    "use",
    [
        "GAIN = read()\ndef gain():\n    return GAIN\n",
        "def make(k):\n    def inner():\n        return k\n    return inner\ngain = make(read())\n",
        "def gain(k=read()):\n    return k\n",
    ],
    ids=["constant", "closure", "default"],
)
def test_a_value_read_from_elsewhere_is_never_stale(use, tmp_path):
    file = tmp_path / "gain.txt"
    head = f"from pathlib import Path\ndef read():\n    return float(Path({str(file)!r}).read_text())\n"
    for gain in (1.5, 2.5):
        file.write_text(str(gain))
        assert outcome(write_controller(tmp_path / "mine.py", head + use + with_step("memory.x = gain()"))) == gain


@MODES
def test_actuators_keep_their_values_until_they_are_set_anew(interpret, tmp_path):
    text = with_step("if sensors.step_ms < memory.x: actuators.left_cm_s = memory.x")
    bench = Bench(write_controller(tmp_path / "mine.py", text), robots=2, interpret=interpret)
    bench.actuators["left_cm_s"] = 3.0
    bench.memory["x"] = (0, 101)
    bench.control.step()
    assert bench.actuators["left_cm_s"].tolist() == [3, 101]


@MODES
def test_each_robot_has_its_own_senses_memory_and_stream(interpret, tmp_path):
    line = "memory.x += 2 * sensors.infrared[2] + sensors.camera[59] + uniform(random)"
    line += " + 1000000 * (sensors.step_ms - 100) + 100000 * sensors.new_picture"
    text = "from epuck_sim.util.rng import uniform\n" + with_step(line)
    controller = write_controller(tmp_path / "mine.py", text)
    bench = Bench(controller, robots=3, interpret=interpret)
    bench.senses.infrared[:, 2] = (10, 20, 30)
    bench.senses.camera[1, 59] = 1
    bench.senses.step_ms[:] = (101, 100, 102)
    bench.senses.new_picture[2] = False
    bench.memory["x"] = (1000, 2000, 3000)
    bench.control.step()
    whole, chance = divmod(bench.memory["x"], 1)
    assert whole.tolist() == [1_101_020, 102_041, 2_003_060]
    assert len(set(chance)) == 3


# --- failures --------------------------------------------------------------------------------------

RAISES = """
PARAMETERS = {}
MEMORY = {}

def start(memory, parameters, random):
    if random[0] == 7:
        raise RuntimeError("born ill")

def step(sensors, memory, actuators, parameters, random):
    if sensors.infrared[0] > 5:
        raise ValueError("too near")
"""


@MODES
@pytest.mark.parametrize("robot", [0, 2, 3])
def test_a_controller_that_raises_is_named_with_what_it_raised_and_the_robot(robot, interpret, tmp_path):
    bench = Bench(write_controller(tmp_path / "mine.py", RAISES), robots=4, interpret=interpret)
    bench.control.step()
    bench.senses.infrared[robot:, 0] = 6
    with pytest.raises(RobotError, match=rf"{tmp_path}/mine\.py:11: ValueError: too near") as raised:
        bench.control.step()
    assert raised.value.robot == robot
    assert isinstance(raised.value, ControllerError)


@MODES
def test_a_controller_that_raises_in_start_is_named_likewise(interpret, tmp_path):
    controller = write_controller(tmp_path / "mine.py", RAISES)
    bench = Bench(controller, robots=3, interpret=interpret, start=False)
    bench.streams[2, 0] = 7
    with pytest.raises(RobotError, match=r"mine\.py:7: RuntimeError: born ill") as raised:
        bench.control.start()
    assert raised.value.robot == 2


FAILING = """
import sibling

PARAMETERS = {"way": 0, "whole": 0}
MEMORY = {"x": float, "row": (float, 4)}

def start(memory, parameters, random):
    pass

def fail(memory, way):
    if way == 1:
        raise ValueError("x")
    if way == 2:
        return memory.row[way + 7]
    if way == 3:
        return 1 / (way - 3)
    if way == 4:
        return 7 // (
            way - 4
        )
    if way == 5:
        return memory.row.reshape(way - 2)[0]
    if way == 6:
        raise ValueError(way)
    return sibling.fail(memory.row, way)

def step(sensors, memory, actuators, parameters, random):
    if parameters.way == 8:
        try:
            memory.x = fail(memory, 3)
        except Exception:
            memory.x = 5.0
        memory.row[int(memory.x)] = 7
    if parameters.way == 9:
        memory.x = 0.0 / sensors.infrared[0]
    if parameters.way == 10:
        memory.x = sensors.step_ms % parameters.whole
    if parameters.way == 11:
        memory.x = sensors.camera[99]
    memory.x = fail(memory, parameters.way)
"""


@MODES
@pytest.mark.parametrize(
    ("way", "said"),
    [
        (1, r"mine\.py:12: ValueError: x$"),
        (2, r"mine\.py:14: IndexError: index .*$"),
        (3, r"mine\.py:16: (ZeroDivision|FloatingPoint)Error: .*$"),
        (4, r"mine\.py:18: (ZeroDivision|FloatingPoint)Error: .*$"),
        (5, r"mine\.py:22: ValueError: .*$"),
        (6, r"mine\.py:24: ValueError: 6$"),
        (7, r"sibling\.py:2: (ZeroDivision|FloatingPoint)Error: .* \(in the controller .*/mine\.py\)$"),
        (8, r"mine\.py:33: IndexError: index .*$"),
        (9, r"mine\.py:35: (ZeroDivision|FloatingPoint)Error: .*$"),
        (10, r"mine\.py:37: (ZeroDivision|FloatingPoint)Error: .*$"),
        (11, r"mine\.py:39: IndexError: index .*$"),
    ],
)
def test_every_error_names_file_and_line(way, said, interpret, tmp_path):
    """Of `raise`, of what numba checks, of numpy, in another file, and after one that was caught."""
    (tmp_path / "sibling.py").write_text("def fail(row, way):\n    return row[0] / (way - 7)\n")
    controller = write_controller(tmp_path / "mine.py", FAILING)
    for _ in range(2):  # what was said of one error is not said of the next
        bench = Bench(controller, {"way": way}, interpret=interpret)
        with pytest.raises(RobotError, match=rf"^{tmp_path}/{said}"):
            bench.control.step()


@pytest.mark.parametrize(
    "lines",
    [
        "k = 2**62\n    k = k * 4\n    memory.x = 1 // k",
        "k = 0\n    for i in range(100_000_000):\n        k += i & 5\n    memory.x = k + memory.row[9]",
    ],
    ids=["raises nothing", "takes too long"],
)
def test_an_error_that_is_not_met_again_names_the_file_alone(lines, tmp_path, monkeypatch):
    """Run again to find the line, the step goes another way, as compiled whole numbers have 64 bits, or is stopped."""
    monkeypatch.setattr(user_code, "AGAIN_S", 0.1)
    text = with_step(lines, MEMORY="{'x': float, 'row': (float, 4)}")
    bench = Bench(write_controller(tmp_path / "mine.py", text), interpret=False)
    with pytest.raises(RobotError, match=r"mine\.py: (ZeroDivision|Index)Error: "):
        bench.control.step()


@MODES
def test_an_error_late_in_a_trial_leaves_the_swarm_as_it_found_it(interpret, tmp_path):
    """To find its line, only what failed runs again, on a copy, and from what the robot remembered before."""
    text = "from epuck_sim.util.rng import uniform\n" + with_step(
        "memory.x += 1\n    actuators.left_cm_s = uniform(random)\n    if memory.x == 10_000: memory.x /= 0"
    )
    bench = Bench(write_controller(tmp_path / "mine.py", text), robots=3, interpret=interpret)
    bench.memory["x"] = 0, 9_000, 0
    for _ in range(999):
        bench.control.step()
    with pytest.raises(RobotError, match=r"mine\.py:12: ") as raised:
        bench.control.step()
    assert raised.value.robot == 1
    assert bench.memory["x"].tolist() == [1000, 10_000, 999]
    left, streams = bench.actuators.left_cm_s.copy(), bench.streams.copy()
    assert bench.control.fault(ValueError()) is None, "it is told once"
    bench.memory["x"] = 0
    bench.control.step()
    assert (bench.actuators.left_cm_s != left).all()
    assert (bench.streams != streams).any(axis=1).all()


@MODES
def test_controllers_of_absent_robots_do_not_run_and_robots_can_start_alone(interpret, tmp_path):
    text = EMPTY.replace("    pass", "    memory.x += 1", 2).replace("float", "float, 'y': float")
    bench = Bench(write_controller(tmp_path / "mine.py", text), robots=3, interpret=interpret)
    bench.swarm.robots.present[1] = False
    for _ in range(4):
        bench.control.step()
    assert bench.memory["x"].tolist() == [5, 1, 5]
    bench.actuators.send = 7
    bench.control.start([1, 2])
    assert bench.memory["x"].tolist() == [5, 1, 1]
    assert bench.actuators.send.tolist() == [7, 0, 0]


def test_what_numba_cannot_compile_runs_interpreted(tmp_path):
    text = with_step("memory.x = len({'any': object()})")
    assert outcome(write_controller(tmp_path / "mine.py", text), interpret=True) == 1


# --- edits: no stale code --------------------------------------------------------------------------


@pytest.fixture
def _caches(tmp_path, monkeypatch):
    """A cache of compiled code, and one of bytecode, that begin empty."""
    monkeypatch.setattr(jit, "cache_root", lambda **_: tmp_path / "cache")
    monkeypatch.setattr(sys, "dont_write_bytecode", False)


SIBLING_CALLED = "import sibling\n" + with_step("memory.x = sibling.value(sensors.step_ms)")
ELSEWHERE = """
import sys
from pathlib import Path
sys.path[:0] = {path!r}
from tests.control.bench import Bench
from epuck_sim.control.loader import find_controller
bench = Bench(find_controller({file!r}), interpret=False)
bench.control.step()
print(bench.memory["x"].tolist()[0])
"""


def outcome_elsewhere(file, cache):
    """Return what a fresh process makes of the controller's file."""
    path = [str(Path(__file__).parents[2]), str(Path(jit.__file__).parents[2])]
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    program = ELSEWHERE.format(path=path, file=str(file))
    run = subprocess.run(
        [sys.executable, "-c", program],
        env=environment | {"NUMBA_CACHE_DIR": str(cache)},
        capture_output=True,
        text=True,
        check=True,
        timeout=120,
    )
    return float(run.stdout.splitlines()[-1])


def write_version(folder, edited, number):
    """Write a controller whose outcome is `number`: in its own file, or in one beside it."""
    if edited == "mine":
        write_soon_after(folder / "mine.py", with_step(f"memory.x = {number}"))
    else:
        write_soon_after(folder / "mine.py", SIBLING_CALLED)
        write_soon_after(folder / "sibling.py", f"SHIFT = {number}\n\ndef value(ms):\n    return ms - 100 + SHIFT\n")
    return folder / "mine.py"


@pytest.mark.usefixtures("_caches")
@pytest.mark.parametrize("edited", ["mine", "sibling"])
def test_an_edit_takes_effect_at_once_in_this_process_and_in_others(edited, tmp_path):
    for number in (1, 20, 3, 1):
        file = write_version(tmp_path, edited, number)
        assert [outcome(find_controller(str(file)), interpret) for interpret in (True, False)] == [number, number]
    # the other process meets what this one has cached
    for number in (1, 4):
        file = write_version(tmp_path, edited, number)
        assert outcome_elsewhere(file, tmp_path / "cache") == number
    assert outcome(find_controller(str(file))) == 4


@pytest.mark.usefixtures("_caches")
def test_an_edit_between_loading_and_compiling_leaves_nothing_stale(tmp_path):
    """What was loaded runs, and what was written later is not taken for it."""
    old = find_controller(str(write_version(tmp_path, "mine", 1)))
    file = write_version(tmp_path, "mine", 20)
    assert outcome(old) == 1
    assert outcome(find_controller(str(file))) == 20


@pytest.mark.usefixtures("_caches")
@pytest.mark.parametrize(
    "helper",
    [
        "def helper(n):\n    return 1 if n < 2 else n * helper(n - 1)\n",
        "def helper(n):\n    print('so many:', n)\n    return n * 24\n",
    ],
    ids=["calls itself", "prints"],
)
def test_a_helper_that_numba_must_look_up_runs_in_this_process_and_in_the_next(helper, tmp_path):
    file = write_controller(tmp_path / "mine.py", helper + with_step("memory.x = helper(5)")).path
    assert [outcome_elsewhere(file, tmp_path / "cache") for _ in range(2)] == [120, 120]


# --- compiling leaves the controller as it is ----------------------------------------------------------


@pytest.mark.parametrize(
    ("helper", "value"),
    [
        ("def helper(n):\n    if n < 2:\n        return 1\n    return n * helper(n - 1)\n", 120),
        ("def make(k):\n    def inner(n):\n        return n * k\n    return inner\nhelper = make(3)\n", 15),
        ("K = 3\ndef helper(n, k=K):\n    return n * k\n", 15),
        ("helper = lambda n: 2 * n\n", 10),
        ("def twice(n):\n    return 2 * n\ndef helper(n):\n    return twice(n) + twice(1)\n", 12),
        ("from collections import namedtuple\nLimits = namedtuple('Limits', 'low high')\nL = Limits(1, 2)\n"
         "def helper(n):\n    return n + L.high\n", 7),
        ("def twice(n):\n    return 2 * n\ndef helper(n):\n    return sum([twice(i) for i in range(n)])\n", 20),
        ("THINGS = (print, object())\ndef helper(n):\n    return n\n", 5),
    ],
    ids=["recursion", "closure", "default", "lambda", "chain", "namedtuple", "comprehension", "unused oddities"],
)  # fmt: skip
def test_helpers_of_many_kinds_mean_the_same_compiled_and_interpreted(helper, value, tmp_path):
    controller = write_controller(tmp_path / "mine.py", helper + with_step("memory.x = helper(5)"))
    assert [outcome(controller, interpret) for interpret in (True, False)] == [value, value]


def test_a_compiled_controller_s_own_functions_and_modules_stay_as_they_were(tmp_path):
    controller = own_controller(tmp_path)
    before = {path: dict(vars(module)) for path, module in controller.modules.items()}
    names = {function: function.__module__ for function in (controller.start, controller.step)}
    Bench(controller, interpret=False).control.step()
    assert {path: dict(vars(module)) for path, module in controller.modules.items()} == before
    assert {function: function.__module__ for function in names} == names


@pytest.mark.parametrize(
    ("head", "line", "said"),
    [
        ("", "memory.x = len({'any': object()})", r"mine\.py:9: cannot be compiled; --interpret "),
        ("", "m = memory; m.wiat = 1", r"mine\.py:9: .*: KeyError: 'wiat'\n    m = memory; m\.wiat = 1"),
        ("def helper(s):\n    return nowhere\n", "memory.x = helper(sensors)", r"mine\.py:2: .*: NameError: .*\n    r"),
        ("import json\n", "memory.x = len(json.dumps(1))", r"mine\.py:10: .*: Unknown attribute 'dumps'.*\n    m"),
        ("def helper(a, b):\n    return a\n", "memory.x = helper(1)", r"mine\.py:11: .*argument: 'b'.*\n    m"),
        (
            "import sibling\n",
            "memory.x = sibling.gone(1)",
            r"mine\.py:10: .*module 'sibling' has no attribute 'gone'\n",
        ),
        ("import sibling\n", "memory.x = sibling.bad(1)", r"sibling\.py:4: .*\n    return len\(\{1: object\(\)\}\)"),
    ],
)
def test_what_cannot_be_compiled_is_said_with_its_line(head, line, said, tmp_path):
    (tmp_path / "sibling.py").write_text("GAIN = 2\n\ndef bad(x):\n    return len({1: object()})\n")
    controller = write_controller(tmp_path / "mine.py", head + with_step(line))
    with pytest.raises(ControllerError, match=rf"{tmp_path}/{said}") as raised:
        outcome(controller)
    assert not isinstance(raised.value, RobotError)


# --- values that a program sets from outside -----------------------------------------------------------

HELPER = """
import numpy as np

GAIN = 1.0
TABLE = {"a": [1, 2]}
ROW = np.arange(3)
ODD = np.array([print], object)
MODEL = None

def scale(x):
    return 2 * x
"""


@pytest.fixture
def helped(tmp_path, monkeypatch):
    """A controller whose outcome is 2 * helper.GAIN, and the module `helper` as this program imports it."""
    (tmp_path / "helper.py").write_text(HELPER)
    controller = write_controller(
        tmp_path / "mine.py", "import helper\n" + with_step("memory.x = helper.scale(helper.GAIN)")
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "helper", raising=False)
    yield controller, importlib.import_module("helper")
    sys.modules.pop("helper", None)


@MODES
@pytest.mark.parametrize(
    "change",
    [
        *("GAIN = 3.0", "TABLE['a'][1] = 5", "ROW[1] = 5", "MODEL = object()"),
        *("def scale(x):\n    return x", "FURTHER = 1"),
    ],
)
def test_what_a_program_sets_in_its_own_copy_of_a_helper_in_vain_is_refused(helped, change, interpret):
    controller, helper = helped
    exec(change, vars(helper))
    with pytest.raises(ControllerError, match=r"helper\.py: \w+ is .* in the module 'helper' of this program, which"):
        outcome(controller, interpret)


@MODES
def test_a_program_can_set_a_value_in_the_controller_s_own_copy(helped, interpret):
    controller, _ = helped
    copies = {path.stem: module for path, module in controller.modules.items()}
    assert outcome(controller, interpret) == 2
    for gain in (3.0, 5.0, 3.0):
        copies["helper"].GAIN = gain
        assert outcome(controller, interpret) == 2 * gain


@MODES
def test_a_module_of_the_same_name_from_elsewhere_is_not_taken_for_it(helped, interpret, tmp_path, monkeypatch):
    controller, _ = helped
    other = ModuleType("helper")
    other.__file__ = str(tmp_path / "elsewhere" / "helper.py")
    other.GAIN = 7.0
    monkeypatch.setitem(sys.modules, "helper", other)
    assert outcome(controller, interpret) == 2


@pytest.mark.usefixtures("helped")
def test_what_an_interpreted_controller_changes_in_its_modules_is_its_own_business(tmp_path):
    text = "import helper\n" + with_step("helper.GAIN += 1; helper.TABLE['a'].append(3); memory.x = helper.GAIN")
    controller = write_controller(tmp_path / "mine.py", text)
    assert [outcome(controller, interpret=True) for _ in range(2)] == [2, 3]


# --- the debugger ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("part", ["start", "step"])
def test_leaving_the_debugger_is_no_error_of_the_controller(part, tmp_path):
    text = f"import bdb\n{EMPTY}".replace(f"def {part}", f"def {part}(*_):\n    raise bdb.BdbQuit\n\ndef _{part}")
    controller = write_controller(tmp_path / "mine.py", text)
    with pytest.raises(BdbQuit):
        outcome(controller, interpret=True)
