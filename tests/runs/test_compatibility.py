"""A run folder that is older than some keys of scenarios still belongs to its sweep."""

import json
import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs.compatibility import StoredPoint, check_same_sweep, stored_point
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from tests.control.bench import with_step
from tests.tools import needs_compiler

FOLDER = Path("runs/old")


def described(*settings: str, scenario: str = "thesis") -> StoredPoint:
    return stored_point(points(load_scenario(scenario, settings))[0])._replace(trials=1)


def without(point: StoredPoint, *keys: str) -> StoredPoint:
    """Return a stored point as it was before there were these dotted keys."""
    scenario = json.loads(point.scenario)
    for key in keys:
        *path, last = key.split(".")
        section = scenario
        for part in path:
            section = section[int(part) if part.isdigit() else part]
        del section[last]
    return point._replace(scenario=json.dumps(scenario))


NEW = ("spread", "stuck", "stop.further_cycles", "robots.0.camera.frames_per_s", "robots.0.camera.latency_ms")


def test_a_folder_that_lacks_newer_keys_belongs_to_the_scenario_with_their_defaults():
    old = without(described(), *NEW, "overhead")
    check_same_sweep(FOLDER, [old], [described()])


def test_a_folder_of_particles_does_so_too():
    now = described(scenario="particles")
    check_same_sweep(FOLDER, [without(now, "clocks.jitter")], [now])


@pytest.mark.parametrize(
    ("setting", "difference"),
    [
        ("spread.clock_rate=0.01", "spread.clock_rate: 0.0 in the folder, 0.01 now"),
        ("stuck.per_hour=2", "stuck.per_hour: 0.0 in the folder, 2.0 now"),
        ("robots.0.camera.frames_per_s=8", "robots.0.camera.frames_per_s: None in the folder, 8.0 now"),
        ("arena.width_cm=70", "arena.width_cm: 60.0 in the folder, 70.0 now"),
    ],
)
def test_it_is_refused_to_a_scenario_in_which_they_differ_with_that_alone(setting, difference):
    with pytest.raises(StoreError) as caught:
        check_same_sweep(FOLDER, [without(described(), *NEW)], [described(setting)])
    assert str(caught.value).splitlines()[1:] == [f"  {difference}"]


def test_a_stored_scenario_that_today_s_keys_do_not_fit_is_compared_as_it_is():
    scenario = json.loads(described().scenario)
    scenario["contact"]["bounce"] = 0.5
    old = described()._replace(scenario=json.dumps(scenario))
    with pytest.raises(StoreError) as caught:
        check_same_sweep(FOLDER, [old], [described()])
    assert str(caught.value).splitlines()[1:] == ["  contact.bounce: 0.5 in the folder, 'nothing' now"]


EYE = "READINGS = {'eye': float}\ndef sense(w, robot, readings, p, r): readings.eye = NUMBER\n"
CURVE = "def phase_shift(phase, coupling, parameters):\n    return NUMBER * coupling\n"
FIRMWARE = "#define PARAMETERS\n#define MEMORY\n#include <epuck.h>\nvoid start(void) {}\nvoid step(void) { NUMBER; }\n"
OWN = {
    "eye.py": ("robots.0.sensors=[{}]", EYE),
    "mine.py": ("robots=[{{count: 2, controller: {}}}]", with_step("actuators.left_cm_s = NUMBER")),
    "mine.c": ("robots=[{{count: 2, controller: {}}}]", FIRMWARE),
    "curve.py": ("response.curve={}", CURVE),
    "ground.png": ("arena.floor.picture={}", ""),
}
"""The key that names each file of a user's, and what is in it."""


@pytest.mark.parametrize("name", [pytest.param(name, marks=[needs_compiler] * (name == "mine.c")) for name in OWN])
def test_trials_with_another_version_of_a_file_are_refused_wherever_it_lies(tmp_path, name):
    key, text = OWN[name]

    def write(path: Path, number: int) -> None:
        if text:
            path.write_text(text.replace("NUMBER", str(number)))
        else:
            cv2.imwrite(str(path), np.full((2, 2), number, np.uint8))

    versions = []
    for folder, number in (("here", 0), ("there", 0), ("edited", 255)):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder / name, number)
        scenario = "particles" if name == "curve.py" else "thesis"
        versions.append(described(key.format(tmp_path / folder / name), scenario=scenario))
    here, there, edited = versions
    check_same_sweep(FOLDER, [here], [there])
    with pytest.raises(StoreError, match=rf"'{re.escape(name)} with digest .* in the folder, '{re.escape(name)} with"):
        check_same_sweep(FOLDER, [here], [edited])
