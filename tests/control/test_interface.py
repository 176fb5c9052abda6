"""A controller's file is found, loaded and checked; what is wrong with it is said in one readable message."""

import sys
from contextlib import nullcontext

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim.control.loader import find_controller, load_controller
from epuck_sim.control.names import check_sensed
from epuck_sim.errors import ControllerError
from epuck_sim.util.builtin import builtin_folder
from tests.control.bench import EMPTY, with_step, write_controller

SHIPPED = ["constant", "external", "external_ring", "external_wheels", "firefly", "obstacle_avoidance", "oscillator"]


def gain(path, value):
    """Write a controller whose parameter `gain` is `value`; return what is found there."""
    path.parent.mkdir(exist_ok=True)
    return write_controller(path, with_step("pass", PARAMETERS=f"{{'gain': {value}}}"))


def test_shipped_controllers_are_found_by_their_names_from_any_folder_whatever_lies_there(here):
    gain(here / "firefly.py", 1.0)
    for name in SHIPPED:
        controller = find_controller(name, here)
        assert (controller.name, controller.path) == (name, builtin_folder("controllers") / f"{name}.py")
        assert controller.is_oscillator == (name in ("external_wheels", "firefly", "oscillator"))
    assert find_controller("firefly.py", here).parameters == {"gain": 1.0}


def test_a_file_is_found_relative_to_the_folder_then_to_the_working_directory_and_not_confused(here):
    """Neither are files of one name in two folders, nor what they import beside them."""
    gain(here / "scenes" / "mine.py", 1.0)
    gain(here / "mine.py", 2.0)
    gain(here / "scenes" / "deep" / "other.py", 3.0)
    for name, folder, found in (
        ("mine.py", here / "scenes", 1.0),
        ("mine.py", None, 2.0),
        ("scenes/mine.py", here / "scenes", 1.0),
        ("deep/other.py", here / "scenes", 3.0),
        (str(here / "mine.py"), here / "scenes", 2.0),
    ):
        assert find_controller(name, folder).parameters == {"gain": found}
    text = "import helper\n" + with_step("pass", PARAMETERS="{'gain': helper.GAIN}")
    for number in (1, 2):
        folder = here / str(number)
        folder.mkdir()
        (folder / "helper.py").write_text(f"GAIN = {number}.0")
        write_controller(folder / "mine.py", text)
    found = [find_controller(f"{number}/mine.py", here) for number in (1, 2, 1)]
    assert [controller.parameters["gain"] for controller in found] == [1.0, 2.0, 1.0]


@pytest.fixture(scope="module")
def typed(tmp_path_factory):
    path = tmp_path_factory.mktemp("typed") / "typed.py"
    return write_controller(path, with_step("pass", PARAMETERS="{'flag': False, 'whole': 5, 'number': 0.5}"))


def test_a_value_that_fits_gets_the_default_s_type_and_one_of_another_is_refused_with_what_is_allowed(typed, tmp_path):
    for name, given_, value in (
        *(("flag", True, True), ("whole", -7, -7), ("whole", 7.0, 7)),
        *(("number", 2, 2.0), ("number", -1e300, -1e300)),
    ):
        resolved = typed.resolve({name: given_})
        assert resolved == {"flag": False, "whole": 5, "number": 0.5} | {name: value}
        assert type(resolved[name]) is type(value)
    nan, inf = float("nan"), float("inf")
    no_numbers = [nan, inf, -inf, True, False, "1", None, [1], 10**400]
    for name, allowed, values in (
        ("flag", "true or false", (0, 1, 1.0, "true", None, nan)),
        ("whole", r"a whole number, like its default, 5(, above .*)?", (5.5, 2**53, *no_numbers)),
        ("number", "a number", no_numbers),
    ):
        for value in values:
            with pytest.raises(ValueError, match=rf"^{name} is .*; allowed: {allowed}$"):
                typed.resolve({name: value})
    # a period whose default is written as a whole number makes an oscillator
    text = with_step("pass", PARAMETERS="{'period_s': 5}", MEMORY="{'phase_ms': float}")
    controller = write_controller(tmp_path / "mine.py", text)
    assert controller.is_oscillator
    assert type(controller.resolve({})["period_s"]) is float


@settings(max_examples=30)
@given(flag=st.booleans(), whole=st.integers(1 - 2**53, 2**53 - 1), number=st.floats(allow_nan=False))
def test_the_record_holds_each_value_as_it_is(typed, flag, whole, number):
    record = typed.parameter_record({"flag": flag, "whole": whole, "number": number})
    assert record.shape == (1,)
    assert record[["flag", "whole", "number"]].tolist() == [(flag, whole, number)]


def test_what_may_have_a_name_is_not_refused(tmp_path):
    lines = "memory.dtype", "memory = sensors; memory.camera", "f = lambda memory: memory.anything"
    for line in (*lines, "sensors._replace(step_ms=1)", "other.anything", "[memory.anything for memory in ()]"):
        check_sensed(write_controller(tmp_path / "mine.py", with_step(line)))


def test_siblings_and_shipped_controllers_can_be_imported_and_are_named_as_sources(tmp_path):
    (tmp_path / "helper.py").write_text("import more\nGAIN = more.GAIN")
    (tmp_path / "more.py").write_text("GAIN = 4.0")
    text = "import helper\nfrom oscillator import PARAMETERS\n" + with_step("pass")
    text += "PARAMETERS = {'gain': helper.GAIN, 'period_s': __import__('oscillator').PARAMETERS['period_s']}"
    controller = write_controller(tmp_path / "mine.py", text)
    assert controller.parameters == {"gain": 4.0, "period_s": 5.0}
    beside = {tmp_path / name for name in ("mine.py", "helper.py", "more.py")}
    assert set(controller.sources) == beside | {builtin_folder("controllers") / "oscillator.py"}
    text = "import constant\nPARAMETERS = constant.PARAMETERS\nMEMORY = constant.MEMORY\n"
    text += "start = constant.start\nstep = constant.step\n"
    assert write_controller(tmp_path / "constant.py", text).parameters["left_cm_s"] == 0.0  # of that very name


@pytest.mark.parametrize("ending", ["", "\nraise RuntimeError"], ids=["loads", "fails"])
def test_imports_leave_the_interpreter_as_it_was(ending, tmp_path, monkeypatch):
    stranger = object()
    monkeypatch.setitem(sys.modules, "helper", stranger)
    (tmp_path / "helper.py").write_text("import met_nowhere_else\nGAIN = met_nowhere_else.GAIN")
    (tmp_path / "met_nowhere_else.py").write_text("GAIN = 4.0")
    modules, path = dict(sys.modules), list(sys.path)
    text = "import helper\nimport oscillator\nassert helper.GAIN == 4.0" + EMPTY + ending
    with pytest.raises(ControllerError, match="RuntimeError") if ending else nullcontext():
        write_controller(tmp_path / "mine.py", text)
    assert sys.modules == modules
    assert sys.modules["helper"] is stranger
    assert sys.path == path


def test_a_file_that_was_mended_loads_once_and_one_without_memory_and_parameters_has_none(tmp_path):
    with pytest.raises(ControllerError):
        write_controller(tmp_path / "mine.py", "def step(:")
    controller = write_controller(tmp_path / "mine.py", with_step("pass", MEMORY="{}"))
    assert load_controller(tmp_path / "mine.py") is controller
    assert controller.resolve({}) == {}
    assert np.zeros(3, controller.memory).shape == (3,)
    with pytest.raises(ValueError, match="mine has none"):
        controller.resolve({"gain": 1.0})
