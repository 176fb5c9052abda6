"""One table of mistakes that users make, `mistakes.yaml`: what is typed or written, and what is said of it.

A row has `says`, parts of the message with ... between them, and what is wrong:

- `scenario`: keys of a scenario, which `check` reads from a file, `s.yaml`; or `text`, the file itself
- `command`: words after `epuck-sim`; that of a row with a scenario is `check s.yaml`
- `files`: further files by their names, beside the scenario; `folders`, `pipes`: names of what is there and no file;
  `links`: what links lead to, by their names
- `beside`: recordings and run folders, by their names in `MAKERS`; `environment`: variables
- `code`: the exit code, if it is not 2; 0, if it is only noted
- `late`: true, if trials must run for it to be met; `lacks`: what the message does not say
"""

import os
import re
import shlex
import shutil
import sys
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import yaml

from epuck_sim.runs.folder import DATABASE
from epuck_sim.util import yaml_io
from tests.cli.commands import call, called, contents
from tests.runs.made_folders import COUNT, SPEED, SPEEDS, WIDTH, Law, edit, ended, store, store_measured, sweep, weibull
from tests.tools import needs_compiler

AGENTS = {
    "agents.reorient_on": [[], ["emitting"], ["emitting", "receiving"]],
    "neighbourhood.radius_cm": [None, 50],
    "agents.speed_cm_s": [3, 30],
}


def stored(law: Law, *sweep_of: Any, **changes: Any) -> Callable[[Path], object]:
    """Return what makes a run folder of a sweep whose trials a law draws; see `made_folders.sweep`."""
    return lambda folder: store(folder, sweep(*sweep_of, **changes), law)


def drawn(**figure: str) -> Callable[[Path], object]:
    """Return what makes a run folder of three axes with a section `figure`."""
    grid = {COUNT: [3, 5], WIDTH: [40, 60, 80], SPEED: [1, 2, 4]}
    return stored(partial(weibull, mean=30), grid, 5, "forms", figure=figure)


def never(_: object) -> Any:
    return ended([5000] * 3, [False] * 3)


def measured(folder: Path, values: Sequence[Any] = (1.0, 2.0)) -> None:
    path = folder.with_name("mine.py")
    path.write_text("def number(simulation): return 0\n")
    store_measured(folder, sweep({SPEED: SPEEDS, COUNT: [2, 6]}, measures=[str(path)]), lambda _: values)


def half_a_recording(path: Path) -> None:
    whole = path.with_name("whole.rrd")
    called("run", "pair", "--record", whole)
    path.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])


def without_database(folder: Path, contents_of_it: str = "") -> None:
    folder.mkdir()
    (folder / "scenario.yaml").write_text("name: short")
    if contents_of_it:
        (folder / DATABASE).write_text(contents_of_it)


def damaged(folder: Path) -> None:
    stored(lambda _: ended([5]), {COUNT: [2, 3]})(folder)
    os.truncate(folder / DATABASE, (folder / DATABASE).stat().st_size // 2)


SHORT = {"arena": {"width_cm": 40, "height_cm": 40}, "robots": [{"count": 3}], "stop": {"max_cycles": 6}}
CONE = {"neighbourhood": {"kind": "cone_of_vision", "angle_deg": 90}}

TIED = {"agents.speed_cm_s": [1, 10], "agents.count": [5, 9]}
WAITING = [{"at_cycle": 1, "displace": {"by_cycles": 0.1}}]

MAKERS: dict[str, Callable[[Path], object]] = {
    "pair.rrd": lambda path: called("run", "pair", "--record", path),
    "summary.rrd": lambda path: called("run", "pair", "--record", path, "--record-level", "summary"),
    "pair.mp4": lambda path: called("run", "pair", "--film", path, "--set", "stop.max_time_s=1"),
    "half.rrd": half_a_recording,
    "swept": stored(partial(weibull, mean=4), {SPEED: [1, 4, 8]}, 3, "short", **SHORT),
    "share": lambda path: call("run", "pair", "--trials", "20", "--share", "1/20", "--out", path),
    "one": lambda path: call("run", "particles", "--set", "stop.max_cycles=2", "--out", path),
    "damaged": damaged,
    "without": without_database,
    "foreign": partial(without_database, contents_of_it="mine"),
    "forms": drawn(),
    "violins": drawn(form="violins"),
    "map": drawn(form="map"),
    "odd-y": drawn(form="map", y="arena.width"),
    "odd-x": drawn(x="speed"),
    "course": drawn(form="course"),
    "small": stored(partial(weibull, mean=30), {SPEED: SPEEDS}, 5),
    "flat": stored(lambda _: ended([5]), {COUNT: [2, 3]}),
    "empty": stored(lambda _: ended([]), {SPEED: SPEEDS}),
    "later": lambda path: (MAKERS["flat"](path), edit(path, "UPDATE points SET scenario = '{\"mine\": 1}'")),
    "censored": stored(never, {WIDTH: [40, 60], SPEED: [1, 2]}, 3),
    "timeless": stored(never, {"contact.robots": [False], SPEED: [1, 2]}, 3, stop={"order_parameter": None}),
    "panels": stored(lambda _: ended([5]), {WIDTH: range(60, 125), SPEED: [1, 2]}, 1),
    "agents": stored(partial(weibull, mean=30), AGENTS, 3, "tiny", model="particles", agents={"count": 6}, **CONE),
    "tied": stored(partial(weibull, mean=30), None, 3, "tied", model="particles", sweep={"zip": TIED}),
    "waits": stored(never, {"agents.speed_cm_s": [3, 30]}, 3, "tiny", model="particles", schedule=WAITING),
    "measured": measured,
    "truths": partial(measured, values=(True, False)),
    "series": partial(measured, values=([1.0], [2.0, 3.0])),
}
"""What makes each recording and run folder that rows have beside them, from its path."""


@pytest.fixture(scope="session")
def shelf(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of what has been made, each when it is first needed."""
    return tmp_path_factory.mktemp("shelf")


class FastLoader(yaml.CSafeLoader):
    """Reads YAML as scenarios are read, but in C."""

    yaml_implicit_resolvers = yaml_io._Loader.yaml_implicit_resolvers


def marked(row: dict[str, Any]) -> Any:
    """Return a row as a parameter; firmware in C is compiled where there is a compiler."""
    in_c = any(name.endswith(".c") for name in row.get("files", ()))
    return pytest.param(row, marks=needs_compiler if in_c else (), id=row["says"][:70])


ROWS = yaml.load(Path(__file__).with_name("mistakes.yaml").read_text(encoding="utf-8"), FastLoader)


@pytest.mark.parametrize("row", list(map(marked, ROWS)))
def test_a_mistake_ends_the_command_with_one_message_before_any_trial(row, shelf, here, monkeypatch) -> None:
    for name in row.get("beside", ()):
        if not (shelf / name).exists():
            MAKERS[name](shelf / name)
        copy = shutil.copytree if (shelf / name).is_dir() else shutil.copy
        copy(shelf / name, here / name)
    for name in row.get("folders", ()):
        Path(name).mkdir()
    for name, text in row.get("files", {}).items():
        Path(name).write_text(text, encoding="latin-1" if "latin-1" in text else "utf-8")
    for name in row.get("pipes", ()):
        os.mkfifo(name)
    for name, target in row.get("links", {}).items():
        Path(name).symlink_to(target)
    if "scenario" in row or "text" in row:
        text = row["text"] if "text" in row else yaml_io.write_yaml(row["scenario"])
        Path("s.yaml").write_text(text, encoding="utf-8")
    before = contents(here)
    for name, value in row.get("environment", {}).items():
        monkeypatch.setenv(name, value)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    if not row.get("late"):
        monkeypatch.setattr("epuck_sim.cli.trials.run_trial", lambda *_, **__: pytest.fail("a trial was simulated"))
    result = call(*shlex.split(row.get("command", "check s.yaml")))
    assert result.exit_code == row.get("code", 2), result.output
    said = " ".join(result.stderr.replace("│", " ").split())
    parts = (re.escape(" ".join(part.split())) for part in row["says"].split("..."))
    assert re.search(".*".join(parts), said), said
    assert row.get("lacks", "Traceback") not in said
    assert "Traceback" not in result.stderr
    assert (result.stdout == "") == bool(result.exit_code)  # `check` prints a scenario, beside what it notes of it
    assert contents(here) == before


def test_what_has_a_name_lies_beside_a_row() -> None:
    assert {name for row in ROWS for name in row.get("beside", ())} == MAKERS.keys()
