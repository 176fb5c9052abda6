"""Controllers run compiled and interpreted with equal results bit for bit; failures name the file and the robot."""

import importlib
import os
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from epuck_sim.control.loader import find_controller
from epuck_sim.embodied import user_code
from epuck_sim.embodied.user_code import RobotError
from epuck_sim.errors import ControllerError
from epuck_sim.util import jit
from tests.control.bench import EMPTY, MODES, Bench, with_step, write_controller, write_soon_after

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

import oscillator
import obstacle_avoidance
import sibling
from epuck_sim.util.rng import randint, uniform
from oscillator import is_flash, updated

PARAMETERS = oscillator.PARAMETERS | obstacle_avoidance.PARAMETERS | {"gain": 0.3, "turns": 4, "gains": [1, -0.5]}
MEMORY = oscillator.MEMORY | obstacle_avoidance.MEMORY
MEMORY = MEMORY | {"past": (float, 4), "counts": (int, (2, 3)), "level": float, "lit": bool}

TABLE = np.array([0.1, 0.7, 1.3, 2.9])

def start(memory, parameters, random):
    obstacle_avoidance.start(memory, parameters, random)
    oscillator.start(memory, parameters, random)
    for slot in range(4):
        memory.past[slot] = TABLE[slot] * uniform(random)

def remember(memory, value, random):
    slot = randint(random, 4)
    memory.past[slot] = value
    memory.counts[slot % 2, slot % 3] += 1

def step(sensors, memory, actuators, parameters, random):
    obstacle_avoidance.step(sensors, memory, actuators, parameters, random)
    if is_flash(sensors, parameters):
        phase, memory.lit = updated(memory.phase_ms, parameters)
        memory.phase_ms = phase % 5000
    remember(memory, sibling.weighed(sensors.infrared), random)
    for each in [sensors.distance_mm, sensors.camera, sensors.messages]:  # of one type, whatever their lengths
        memory.counts[1, 2] += each.sum()
    memory.level *= parameters.gains[memory.counts[0, 0] % 2]
    memory.level = parameters.gain * memory.level + math.atan2(memory.past[0], 1.5) - memory.past.max() / 7
    if memory.counts[0, 0] % parameters.turns == 1:
        actuators.left_cm_s = min(actuators.left_cm_s + memory.level, 12.8)
        actuators.right_cm_s = math.sqrt(abs(memory.level)) * uniform(random)
    actuators.ring_on = memory.lit or sensors.distance_mm[3] < 20
"""


def outcome(controller, interpret=False):
    """Return what a robot has in `memory.x` after one step."""
    bench = Bench(controller, interpret=interpret)
    bench.control.step()
    return bench.memory["x"].tolist()[0]


def test_a_user_s_own_controller_does_the_same_compiled_and_interpreted_and_stays_as_it_was(tmp_path):
    """With helpers, constants, arrays in memory, a sibling file, parts of shipped controllers, and chance."""
    (tmp_path / "sibling.py").write_text(SIBLING)
    controller, chance = write_controller(tmp_path / "mine.py", MINE), np.random.default_rng(6)
    before = {path: dict(vars(module)) for path, module in controller.modules.items()}
    for parameters in ({}, {"gain": -0.9, "turns": 1, "gains": np.array([2, 3])}):
        plain, quick = (Bench(controller, parameters, robots=10, interpret=interpret) for interpret in (True, False))
        states = {plain.state()}
        assert states == {quick.state()}, "start"
        for number in range(120):
            plain.sense(chance)
            quick.sense_like(plain)
            plain.control.step()
            quick.control.step()
            assert plain.state() == quick.state(), f"step {number}"
            states.add(plain.state())
        assert len(states) > 100
    assert {path: dict(vars(module)) for path, module in controller.modules.items()} == before


READ = """
from pathlib import Path

def read(name):
    return float(Path(__file__).with_name(name).read_text())

GAIN = read("gain")

def make(k):
    def inner():
        return k
    return inner

shift = make(read("shift"))
"""


def test_a_value_read_from_elsewhere_is_never_stale_as_a_constant_or_in_a_closure(tmp_path):
    for gain, shift in ((1, 2), (3, 2), (3, 4)):
        (tmp_path / "gain").write_text(str(gain))
        (tmp_path / "shift").write_text(str(shift))
        controller = write_controller(tmp_path / "mine.py", READ + with_step("memory.x = 10 * GAIN + shift()"))
        assert outcome(controller) == 10 * gain + shift


@MODES
def test_each_robot_has_its_own_senses_memory_stream_and_actuators_which_keep_their_values(interpret, tmp_path):
    line = "if sensors.new_picture: actuators.left_cm_s = memory.x\n"
    line += "    memory.x += 2 * sensors.infrared[2] + sensors.camera[59] + uniform(random)"
    line += " + 1000000 * (sensors.step_ms - 100) + 100000 * sensors.new_picture"
    text = "from epuck_sim.util.rng import uniform\n" + with_step(line)
    controller = write_controller(tmp_path / "mine.py", text)
    bench = Bench(controller, robots=3, interpret=interpret)
    bench.senses.infrared[:, 2] = (10, 20, 30)
    bench.senses.camera[1, 59] = 1
    bench.senses.step_ms[:] = (101, 100, 102)
    bench.senses.new_picture[2] = False
    bench.memory["x"], bench.actuators["left_cm_s"] = (1000, 2000, 3000), 7
    bench.control.step()
    assert bench.actuators["left_cm_s"].tolist() == [1000, 2000, 7]
    whole, chance = divmod(bench.memory["x"], 1)
    assert whole.tolist() == [1_101_020, 102_041, 2_003_060]
    assert len(set(chance)) == 3


@pytest.mark.parametrize("way", [0, 1], ids=["raises nothing", "takes too long"])
def test_an_error_that_is_not_met_again_names_the_file_alone(way, tmp_path, monkeypatch):
    """Run again to find the line, the step goes another way, as compiled whole numbers have 64 bits, or is stopped."""
    monkeypatch.setattr(user_code, "AGAIN_S", 0.1)
    lines = """k = 0
    if parameters.way:
        for i in range(100_000_000):
            k += i & 5
        memory.x = k + memory.row[9]
    else:
        k = 2**62
        k = k * 4
        memory.x = 1 // k"""
    text = with_step(lines, PARAMETERS="{'way': 0}", MEMORY="{'x': float, 'row': (float, 4)}")
    bench = Bench(write_controller(tmp_path / "mine.py", text), {"way": way}, interpret=False)
    with pytest.raises(RobotError, match=r"mine\.py: (ZeroDivision|Index)Error: "):
        bench.control.step()


def test_an_interpreted_controller_catches_a_division_by_0(tmp_path):
    lines = "try:\n        memory.x = 1 / memory.x\n    except ZeroDivisionError:\n        memory.x = -1.0"
    bench = Bench(write_controller(tmp_path / "mine.py", with_step(lines)), interpret=True)
    bench.control.step()
    assert bench.control.memory["x"][0] == -1


@MODES
def test_an_error_late_in_a_trial_leaves_the_swarm_as_it_found_it(interpret, tmp_path):
    """To find its line, only what failed runs again, on a copy, and from what the robot remembered before."""
    lines = "memory.x += 1\n    actuators.left_cm_s = uniform(random)\n    if memory.x == 10_000: memory.x /= 0"
    text = "from epuck_sim.util.rng import uniform\n" + with_step(lines)
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


ELSEWHERE = """
import sys
sys.path[:0] = {path!r}
from tests.control.bench import Bench
for file in {files!r}:
    bench = Bench(file, interpret=False)
    bench.control.step()
    print(bench.memory["x"].tolist()[0])
"""


def write_version(folder, edited, number):
    """Write a controller whose outcome is `number`: in its own file, or in one beside it."""
    called = "import sibling\n" + with_step("memory.x = sibling.value(sensors.step_ms)")
    write_soon_after(folder / "mine.py", with_step(f"memory.x = {number}") if edited == "mine" else called)
    write_soon_after(folder / "sibling.py", f"def value(ms):\n    return ms - 100 + {number}\n")
    return folder / "mine.py"


LOOKED_UP = """
def calls(n):
    return 1 if n < 2 else n * calls(n - 1)

def prints(n):
    print("so many:", n)
    return n
"""


def test_an_edit_takes_effect_at_once_here_and_in_the_next_process_and_what_numba_must_look_up(tmp_path, monkeypatch):
    monkeypatch.setattr(jit, "cache_root", lambda **_: tmp_path / "cache")
    files = []
    for edited, numbers in (("mine", (1,)), ("sibling", (3, 1, 3))):
        folder = tmp_path / edited
        folder.mkdir()
        old = find_controller(str(write_version(folder, edited, 7)))
        for number in numbers:
            file = write_version(folder, edited, number)
            assert [outcome(find_controller(str(file)), interpret) for interpret in (True, False)] == [number, number]
        files.append(file)
    assert outcome(old) == 7  # what was loaded before it was compiled runs
    write_version(folder, edited, 4)  # the other process meets what this one has cached
    looked_up = write_controller(tmp_path / "mine.py", LOOKED_UP + with_step("memory.x = prints(calls(5))"))
    assert outcome(looked_up) == 120
    path = [str(Path(__file__).parents[2]), str(Path(jit.__file__).parents[2])]
    command = [sys.executable, "-c", ELSEWHERE.format(path=path, files=list(map(str, [*files, looked_up.path])))]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=120)
    assert [float(line) for line in run.stdout.splitlines() if not line.startswith("so many")] == [1, 4, 120]
    assert [outcome(find_controller(str(file))) for file in files] == [1, 4]


HELPERS = """
from collections import namedtuple

LIMITS, K, THINGS = namedtuple("Limits", "low high")(1, 2), 3, (print, object())

def factorial(n):
    if n < 2:
        return 1
    return n * factorial(n - 1)

def make(k):
    def inner(n):
        return n * k
    return inner

tripled = make(3)

def by_default(n, k=K):
    return n * k

def twice(n):
    return 2 * n

def in_a_list(n):
    return sum([twice(i) for i in range(n)])

doubled = lambda n: 2 * n
"""
USES = "factorial(5), tripled(5), by_default(5), in_a_list(5), doubled(5), LIMITS.high"


def test_helpers_of_many_kinds_mean_the_same_compiled_and_interpreted(tmp_path):
    lines = "\n    ".join(f"memory.row[{place}] = {use}" for place, use in enumerate(USES.split(", ")))
    controller = write_controller(tmp_path / "mine.py", HELPERS + with_step(lines, MEMORY="{'row': (float, 6)}"))
    for interpret in (True, False):
        bench = Bench(controller, interpret=interpret)
        bench.control.step()
        assert bench.memory["row"].tolist() == [[120, 15, 15, 20, 10, 2]]


HELPER = """
import numpy as np

GAIN = 1.0
TABLE = {"a": [1, 2]}
ROW = np.arange(3)
ODD = np.array([print], object)

def scale(x):
    return 2 * x
"""


@pytest.fixture
def helped(tmp_path, monkeypatch):
    """A controller whose outcome is 2 * helper.GAIN, and the module `helper` as this program imports it."""
    (tmp_path / "helper.py").write_text(HELPER)
    text = "import helper\n" + with_step("memory.x = helper.scale(helper.GAIN)")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "helper", raising=False)
    yield write_controller(tmp_path / "mine.py", text), importlib.import_module("helper")
    sys.modules.pop("helper", None)


@pytest.mark.parametrize(
    "change", ["GAIN = 3.0", "TABLE['a'][1] = 5", "ROW[1] = 5", "def scale(x): return x", "FURTHER = 1"]
)
def test_what_a_program_sets_in_its_own_copy_of_a_helper_in_vain_is_refused(helped, change):
    controller, helper = helped
    exec(change, vars(helper))
    with pytest.raises(ControllerError, match=r"helper\.py: \w+ is .* in the module 'helper' of this program, which"):
        outcome(controller)


@MODES
def test_a_program_can_set_a_value_in_the_controller_s_own_copy(helped, interpret, tmp_path, monkeypatch):
    controller, _ = helped
    copies = {path.stem: module for path, module in controller.modules.items()}
    assert outcome(controller, interpret) == 2
    for gain in (3.0, 1.0, 3.0):
        copies["helper"].GAIN = gain
        assert outcome(controller, interpret) == 2 * gain
    other = ModuleType("helper")  # of the same name, but from elsewhere
    other.__file__, other.GAIN = str(tmp_path / "elsewhere" / "helper.py"), 7.0
    monkeypatch.setitem(sys.modules, "helper", other)
    assert outcome(controller, interpret) == 6
    copies["helper"].scale = lambda x: 5 * x
    with pytest.raises(ControllerError, match=r"helper\.py: scale was replaced by the program; "):
        outcome(controller, interpret=False)
    assert outcome(controller, interpret=True) == 15
