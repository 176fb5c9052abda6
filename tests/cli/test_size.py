"""Claims about what `check`, and the start of a sweep, say of its size, and what is said of what takes long."""

import json
import time

import pytest

from epuck_sim.cli import errors
from epuck_sim.cli.errors import word_if_slow
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.yaml_io import parse_yaml
from tests.cli.commands import call, called, refused, set_to

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

SWEEP = ("particles", "--sweep", "agents.speed_cm_s=1,2,3", "--set", "trials=400", "--set", "stop.max_cycles=3")


LARGE = ("arena.width_cm=5000", "arena.height_cm=5000", "robots.0.count=20000", "robots.0.camera.pixels=900")


def test_check_says_how_many_points_and_trials_there_are_and_what_they_take() -> None:
    printed = called("check", *SWEEP)
    assert printed.endswith("\n# 3 points, 1200 trials: about 174 kB on disk\n")
    assert load_scenario(parse_yaml(printed, "stdout")).trials == 400


def test_check_says_what_measures_and_large_swarms_take() -> None:
    last = called("check", "thesis", *set_to(*LARGE, "measures=[order_parameter]")).splitlines()[-1]
    assert last == (
        "# 1 point, 1 trial: about 0.14 kB on disk, besides its measures; up to 240 MB of memory for a trial"
    )


def test_a_sweep_begins_with_its_size(tmp_path) -> None:
    result = call("run", *SWEEP, "--trials", "2", "--out", tmp_path / "run", "--json", "--workers", "1")
    assert result.exit_code == 0
    assert result.stderr.startswith("particles: 3 points, 6 trials: about 0.87 kB on disk\n")
    assert json.loads(result.stdout)["stored"] == 6


def test_a_sweep_that_needs_too_much_memory_is_refused_and_leaves_nothing(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr("epuck_sim.util.machine.available_bytes", lambda: 1000)
    monkeypatch.setattr("epuck_sim.sweep.checks.available_bytes", lambda: 1000)
    message = refused("run", "thesis", *set_to(*LARGE[:3]), "--out", tmp_path / "run", "--workers", "2")
    assert "on each of 2 workers needs about 211 MB of memory, and 1 kB are available here" in message
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("lasts_s", "is_said"), [(0.0, False), (0.3, True)])
def test_what_takes_long_is_named_once(monkeypatch, capsys, lasts_s: float, is_said: bool) -> None:
    monkeypatch.setattr(errors, "SLOW_S", 0.05)
    with word_if_slow("reading big.yaml"):
        time.sleep(lasts_s)
    assert capsys.readouterr().err == ("reading big.yaml takes a while; Ctrl-C ends it\n" if is_said else "")
