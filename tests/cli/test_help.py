"""What the command tells of itself: help, completion, lists, and where it does not run."""

import json

import pytest
from typer.testing import CliRunner

from epuck_sim import __main__
from epuck_sim.cli.app import app
from epuck_sim.cli.listing import list_measures
from tests.cli.commands import called


@pytest.mark.parametrize("words", [(), ("run",), ("new", "controller")])
def test_h_is_short_for_help(words: tuple[str, ...]) -> None:
    assert called(*words, "-h") == called(*words, "--help")


def test_the_options_of_run_stand_in_groups() -> None:
    told = called("run", "--help")
    headings = ["Scenario", "Output", "Live view", "Controllers", "Sweeps"]
    places = [told.index(f" {heading} ─") for heading in headings]
    assert places == sorted(places)
    assert told.index("--seed") < places[1] < told.index("--trace") < places[2] < told.index("--port")


def test_the_options_of_track_stand_in_groups() -> None:
    told = called("track", "--help")
    places = [told.index(f" {heading} ─") for heading in ("Film", "Geometry", "Decision", "Output")]
    assert places == sorted(places)
    for option, before in (("--camera", 1), ("--end-s", 1), ("--lens", 2), ("--threshold-ms", 3), ("--json", 4)):
        assert ([*places, len(told)][before - 1]) < told.index(option) < ([*places, len(told)][before])


def test_no_example_in_the_help_of_run_is_cut_off() -> None:
    assert "…" not in called("run", "--help")


def test_lists_are_also_json() -> None:
    listed = json.loads(called("list", "--json"))
    assert list(listed) == ["scenarios", "sweeps", "controllers", "robots"]
    sweeps = list(listed["sweeps"])
    assert sweeps.index("fig-5-9") < sweeps.index("fig-5-10")
    assert listed["scenarios"]["pair"].startswith("two e-pucks")
    assert json.loads(called("list", "--measures", "--json")) == list_measures()


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


def test_windows_gets_a_word_at_once(monkeypatch) -> None:
    monkeypatch.setattr(__main__.sys, "platform", "win32")
    with pytest.raises(SystemExit, match=r"^error: epuck-sim does not run on Windows itself; .*Linux"):
        __main__.main()
