"""What the command tells of itself: help, completion, lists, and where it does not run."""

import subprocess
import sys

import pytest
from typer.testing import CliRunner

from epuck_sim.cli.app import app
from epuck_sim.cli.listing import list_measures
from tests.cli.commands import called, read


@pytest.mark.parametrize("words", [(), ("run",), ("new", "controller")])
def test_h_is_short_for_help(words: tuple[str, ...]) -> None:
    assert called(*words, "-h") == called(*words, "--help")


@pytest.mark.parametrize("command", ["run", "summarize", "plot"])
def test_help_of_the_first_commands_fits_a_screen_and_the_rest_is_below_a_fold(command: str) -> None:
    told = called(command, "--help", env={"COLUMNS": "80", "TERMINAL_WIDTH": "80"})
    assert len(told.splitlines()) <= 40
    assert max(map(len, told.splitlines())) <= 80
    assert "…" not in told


def test_help_all_shows_every_option_in_groups_and_shells_complete_them() -> None:
    short, told = called("run", "--help"), called("run", "--help-all")
    places = [told.index(f" {heading} ─") for heading in ("Scenario", "Output", "More output", "Sweeps")]
    assert places == sorted(places)
    assert told.index("--seed") < places[1] < told.index("--record") < places[2] < told.index("--trace") < places[3]
    assert "--trace" not in short
    assert called("run", "--help") == short
    environment = {"_EPUCK_SIM_COMPLETE": "complete_bash", "COMP_WORDS": "epuck-sim run --work", "COMP_CWORD": "2"}
    assert CliRunner().invoke(app, [], prog_name="epuck-sim", env=environment).stdout.split() == ["--workers"]


def test_the_options_of_track_stand_in_groups() -> None:
    told = called("track", "--help")
    places = [told.index(f" {heading} ─") for heading in ("Film", "Geometry", "Decision", "Output")]
    assert places == sorted(places)
    for option, before in (("--camera", 1), ("--end-s", 1), ("--lens", 2), ("--threshold-ms", 3), ("--json", 4)):
        assert ([*places, len(told)][before - 1]) < told.index(option) < ([*places, len(told)][before])


def test_lists_are_also_json() -> None:
    listed = read("list")
    assert list(listed) == ["scenarios", "sweeps", "controllers", "robots"]
    sweeps = list(listed["sweeps"])
    assert sweeps.index("fig-5-9") < sweeps.index("fig-5-10")
    assert listed["scenarios"]["pair"].startswith("two e-pucks")
    assert read("list", "--measures") == list_measures()


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("epuck-sim run the", ["thesis"]),
        ("epuck-sim check fig-4-3", ["fig-4-3a", "fig-4-3b"]),
        ("epuck-sim run thesis --controller reo", ["reorientation", "reorienting_firefly"]),
        ("epuck-sim run thesis --measure spann", ["spanning_time"]),
        ("epuck-sim summ", ["summarize"]),
    ],
)
def test_shells_complete_names(typed: str, completed: list[str]) -> None:
    words = len(typed.split())
    environment = {"_EPUCK_SIM_COMPLETE": "complete_bash", "COMP_WORDS": typed, "COMP_CWORD": str(words - 1)}
    result = CliRunner().invoke(app, [], prog_name="epuck-sim", env=environment)
    assert result.stdout.split() == completed


LOADED = """
import sys
from epuck_sim.cli.app import app
for words, heavy in {table}:
    try:
        app(words.split())
    except SystemExit as end:
        assert not end.code
    print("loaded", sorted(set(heavy) & sys.modules.keys()))
"""


def test_nothing_heavy_is_loaded_that_is_not_needed() -> None:
    """No scipy, where trials begin: it takes a while, and does not end well when it is interrupted."""
    drawing = ["matplotlib", "pandas", "rerun", "rerun_sdk"]
    light = [*drawing, "av", "cv2", "scipy", "numba", "numpy", "pyarrow", "pymunk", "yaml"]
    helps = ("", "run", "replay", "film", "track", "export", "summarize", "plot", "fit", "new")
    table = [*((f"{command} --help", light) for command in helps), ("list", drawing)]
    table += [(f"check {name}", ["numba"]) for name in ("spotlight", "crowded", "physical", "fig-4-2a")]
    begun = "import epuck_sim.cli.trials, epuck_sim.sweep.checks\n" + LOADED.format(table=[("list", ["scipy"])])
    script = LOADED.format(table=table) + begun + LOADED.format(table=[("run pair --json", [*drawing, "scipy.linalg"])])
    result = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    loads = [line for line in result.stdout.splitlines() if line.startswith("loaded")]
    assert loads == ["loaded []"] * (len(table) + 2)
