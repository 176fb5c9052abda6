"""Controllers that are replaced between two steps: what robots keep, what begins anew, and what is refused."""

import os
import re
from pathlib import Path

import numpy as np
import pytest

from epuck_sim import EpuckSimError, Simulation, load_scenario
from epuck_sim.control.loader import find_controller, load_controller
from epuck_sim.embodied.changes import replacement
from epuck_sim.embodied.changes.replacement import SETTLED_S, ControllerFiles
from tests.control.bench import MODES
from tests.embodied.steps import bits

COUNTER = """
from epuck_sim.util.rng import uniform

PARAMETERS = {{"speed_cm_s": {speed}, "left_over": 1.0}}
MEMORY = {{"steps": int, {memory}}}

def start(memory, parameters, random):
    memory.drawn = uniform(random)

def step(sensors, memory, actuators, parameters, random):
    memory.steps += {rise}
    memory.drawn += 0.0 * uniform(random)
    actuators.left_cm_s = parameters.speed_cm_s
    actuators.right_cm_s = {right}
"""


def source(memory='"drawn": float', rise="1", speed="3.0", right="parameters.speed_cm_s") -> str:
    return COUNTER.format(memory=memory, rise=rise, speed=speed, right=right)


def save(path: Path, text: str) -> None:
    """Write a file as if that were some time ago, and at another time than before."""
    before = path.stat().st_mtime_ns if path.exists() else 0
    path.write_text(text)
    then = max(path.stat().st_mtime_ns - round(20 * SETTLED_S * 1e9), before + 1)
    os.utime(path, ns=(then, then))


def simulate(path: Path, interpret: bool, **changes) -> Simulation:
    save(path, source())
    group = {"controller": str(path), "count": 3, **changes}
    return Simulation(load_scenario({"name": "counting", "robots": [group, {"count": 2}]}), 4, interpret=interpret)


def twins(path: Path, interpret: bool, steps: int) -> tuple[Simulation, Simulation]:
    simulation, twin = simulate(path, interpret), simulate(path, interpret)
    for each in (simulation, twin):
        each.advance(steps)
    return simulation, twin


@MODES
def test_robots_go_on_with_the_new_one_and_remember_what_they_did(interpret: bool, tmp_path) -> None:
    path = tmp_path / "mine.py"
    simulation, twin = twins(path, interpret, 10)
    save(path, source(rise="100"))
    replaced = simulation.replace_controller(0, load_controller(path))
    assert (replaced.kept, replaced.started) == (("steps", "drawn"), ())
    step, other = next(simulation), next(twin)
    assert step.memories[0]["steps"].tolist() == [110] * 3
    assert step.memories[0]["drawn"].tobytes() == other.memories[0]["drawn"].tobytes()
    assert step.poses.tobytes() == other.poses.tobytes()  # the robots that were not replaced draw as before, too
    assert step.memories[1].tobytes() == other.memories[1].tobytes()
    save(path, source(memory='"drawn": int, "more": int'))  # of another type, and new: they begin anew
    replaced = simulation.replace_controller(0, load_controller(path))
    assert (replaced.kept, replaced.started) == (("steps",), ("drawn", "more"))
    now = next(simulation).memories[0]
    assert now["steps"].tolist() == [111] * 3
    assert (now["drawn"].dtype, now["drawn"].tolist()) == (np.int64, [0] * 3)
    simulation.reset()
    assert next(simulation).memories[0]["steps"].tolist() == [1] * 3
    with pytest.raises(ValueError, match="a controller was replaced, so no snapshot: scenario and seed make another"):
        simulation.snapshot()
    with pytest.raises(ValueError, match="group is -1; allowed: 0 to 1"):
        simulation.replace_controller(-1, load_controller(str(path)))
    with pytest.raises(ValueError, match="controller is 'firefly'; allowed: what `control"):
        simulation.replace_controller(0, "firefly")
    nobody = simulate(path, interpret, count=0)
    save(path, source(memory='"drawn": float, "more": int'))
    assert nobody.replace_controller(0, load_controller(path)) == (("steps", "drawn"), ("more",))


def test_a_fault_goes_on_in_robots_that_get_another_controller(tmp_path) -> None:
    path, text = tmp_path / "mine.py", find_controller("oscillator").path.read_text()
    save(path, text)
    frozen = {"faults": [{"kind": "oscillator_frozen", "robots": [0]}]}
    simulation = Simulation({"robots": [{"count": 2, "controller": str(path)}], **frozen}, 1, interpret=True)
    simulation.advance(5)
    save(path, text + "\n# a later version\n")
    simulation.replace_controller(0, load_controller(path))
    before = simulation.advance(1).phase_ms.copy()
    assert (simulation.advance(3).phase_ms == before).tolist() == [True, False]


def test_parameters_are_kept_unless_they_are_the_old_defaults(tmp_path) -> None:
    path = tmp_path / "mine.py"
    by_default, given = simulate(path, True), simulate(path, True, parameters={"speed_cm_s": 5, "left_over": 2})
    save(path, source(speed="6.0").replace(', "left_over": 1.0', ', "other": 1.0'))
    for simulation, speed in ((by_default, 6), (given, 5)):
        simulation.advance(3)
        simulation.replace_controller(0, load_controller(path))
        assert next(simulation).wheels_cm_s[:3].tolist() == [[speed, speed]] * 3
        simulation.reset()
        assert next(simulation).wheels_cm_s[:3].tolist() == [[speed, speed]] * 3


DIVIDES = source(right="1 / (memory.steps - memory.steps)")
OSCILLATES = source('"phase_ms": float, "drawn": float').replace("left_over", "period_s")


@pytest.mark.parametrize(
    ("interpret", "text", "message"),
    [
        (True, "PARAMETERS = {\n", "mine.py:1: cannot be loaded: SyntaxError"),
        (False, source(rise="wiat"), "mine.py:11: cannot be compiled"),
        (False, DIVIDES, "mine.py:14: ZeroDivisionError"),
        (True, DIVIDES, "mine.py:14: ZeroDivisionError: division by zero"),
        (True, source(right="float('nan')"), "mine.py: sets right_cm_s to a value that is not a number"),
        (True, OSCILLATES, "has become an oscillator"),
        (True, source() + 'EXTERNAL = ("ring",)\n', "EXTERNAL has changed from () to ('ring',)"),
        (True, source() + "def check(parameters):\n    raise ValueError('never')\n", "robots.0.parameters: never"),
    ],
)
def test_a_new_one_that_is_wrong_is_refused_and_the_old_one_goes_on_to_the_bit(interpret, text, message, tmp_path):
    path = tmp_path / "mine.py"
    simulation, twin = twins(path, interpret, 10)
    save(path, text)
    with pytest.raises(EpuckSimError, match=re.escape(message)):
        simulation.replace_controller(0, load_controller(path))
    for _ in range(10):
        assert bits(next(simulation)) == bits(next(twin))


def watched(path: Path) -> tuple[Simulation, ControllerFiles, list[str]]:
    simulation, said = simulate(path, True), []
    return simulation, ControllerFiles(simulation, said.append), said


def look(files: ControllerFiles) -> None:
    files._next_s = 0.0
    files()


def test_a_file_that_is_saved_is_taken_at_the_next_look_and_told_in_a_line(tmp_path) -> None:
    path = tmp_path / "mine.py"
    simulation, files, said = watched(path)
    simulation.advance(10)
    look(files)
    assert said == []
    save(path, source(rise="100"))
    files()  # it is not yet time to look again
    assert said == []
    look(files)
    look(files)
    assert said == ["mine.py: robots go on with the new one from step 10; memory is kept"]
    assert next(simulation).memories[0]["steps"].tolist() == [110] * 3
    save(path, source(memory='"drawn": int'))
    look(files)
    assert said[1:] == ["mine.py: robots go on with the new one from step 11; memory: drawn started anew, steps kept"]
    save(path, source(right="memory.wiat"))
    look(files)
    look(files)
    assert said[2:] == [f"{path}:14: memory has no 'wiat'; known: steps, drawn; the old one goes on"]
    assert next(simulation).memories[0]["steps"].tolist() == [111] * 3


def test_a_file_that_one_of_its_groups_refuses_is_taken_by_none(tmp_path) -> None:
    path, said = tmp_path / "mine.py", []
    save(path, source())
    groups = [{"count": 2, "controller": str(path), "parameters": {"speed_cm_s": speed}} for speed in (5.0, 1.0)]
    simulation, twin = (Simulation(load_scenario({"robots": groups}), seed=1) for _ in range(2))
    files = ControllerFiles(simulation, said.append)
    simulation.advance(10)
    twin.advance(10)
    slow = "def check(parameters):\n    if parameters.speed_cm_s < 2:\n        raise ValueError('too slow')\n"
    save(path, source(rise="100") + slow)
    look(files)
    assert len(said) == 1
    assert said[0].endswith("robots.1.parameters: too slow; the old one goes on")
    for _ in range(5):
        assert bits(next(simulation)) == bits(next(twin))
    assert simulation.snapshot().steps == 15


def test_files_that_are_imported_are_watched_too_even_new_ones(tmp_path) -> None:
    path = tmp_path / "mine.py"
    simulation, files, said = watched(path)
    save(path, "import how_fast\n" + source(rise="how_fast.RISE"))
    look(files)
    assert "No module named 'how_fast'" in said[0]
    for rise in (5, 7):
        save(tmp_path / "how_fast.py", f"RISE = {rise}\n")
        look(files)
    assert len(said) == 3
    assert next(simulation).memories[0]["steps"].tolist() == [7] * 3


def test_a_file_in_the_middle_of_being_saved_and_one_that_is_only_touched_change_nothing(tmp_path, monkeypatch) -> None:
    path = tmp_path / "mine.py"
    simulation, files, said = watched(path)
    controllers = simulation.controllers
    with monkeypatch.context() as slow:
        slow.setattr(replacement, "SETTLED_S", 60)
        path.write_text("PARAM")
        look(files)
    path.unlink()
    look(files)
    save(path, source())
    os.utime(path, ns=(0, 12345))
    look(files)
    assert (said, simulation.controllers) == ([], controllers)
