"""Far-fetched mistakes: what only an attacker, or a bad day, comes up with ends in a message, too."""

import os
import resource
import sys
from io import StringIO
from pathlib import Path
from unittest.mock import Mock

import pytest

from epuck_sim.cli.app import app
from epuck_sim.runs.reader import read_status
from epuck_sim.util.messages import describe_error
from tests.cli.commands import call, called, refused
from tests.control.bench import with_step
from tests.runs.made_folders import SPEED, SPEEDS, ended, store, sweep

STRANGE = """
class Strange(BaseException):
    def __str__(self):
        raise self
"""


def scene(folder: Path, line: str) -> Path:
    """Write a scenario of one robot whose controller does `line` in each step."""
    (folder / "mine.py").write_text(f"import sys\n{with_step(line)}{STRANGE}")
    path = folder / "scene.yaml"
    path.write_text("robots: [{controller: mine.py, count: 1}]\nstop: {max_time_s: 0.3}\n")
    return path


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("raise BaseException('mine')", "BaseException: mine"),
        ("raise GeneratorExit", "GeneratorExit: "),
        ("raise Strange", "Strange: its message cannot be shown: Strange"),
        ("raise ValueError('\\ud800')", "ValueError: \\ud800"),
    ],
)
def test_whatever_a_controller_raises_is_named_with_its_line(tmp_path, line: str, message: str) -> None:
    stderr = refused("run", scene(tmp_path, line), "--interpret")
    assert f"{tmp_path}/mine.py:10: {message}" in stderr


def test_an_error_whose_message_is_interrupted_stays_interrupted() -> None:
    with pytest.raises(KeyboardInterrupt):
        describe_error(type("Slow", (Exception,), {"__str__": Mock(side_effect=KeyboardInterrupt)})())


@pytest.mark.parametrize("line", ["sys.stdout.close()", "sys.stdout = None"])
def test_a_controller_that_closes_the_output_is_no_traceback(tmp_path, monkeypatch, capsys, line: str) -> None:
    monkeypatch.setattr(sys, "stdout", StringIO())
    with pytest.raises(SystemExit) as ended:
        app(["run", str(scene(tmp_path, line)), "--interpret"])
    assert ended.value.code == 2
    assert capsys.readouterr().err == "error: the output cannot be written: it was closed\n"


def test_more_workers_than_the_system_allows_files_are_refused_at_once(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(resource, "getrlimit", lambda _: (64, 64))
    result = call("run", "thesis", "--trials", "99", "--workers", "64", "--out", tmp_path / "run")
    said = "error: 64 workers need 152 open files; allowed: 64, enough for 20 workers; ulimit -n raises it"
    assert (result.exit_code, result.stderr.splitlines()[-1]) == (2, said)


def test_a_message_that_is_no_unicode_costs_a_sweep_its_own_trial_alone(tmp_path) -> None:
    line = "raise ValueError('\\ud800')"
    result = call("run", scene(tmp_path, line), "--interpret", "--out", tmp_path / "run", "--trials", "2")
    assert result.exit_code == 1
    assert "--trial 1: " in result.stdout
    errors = [failure.error.rpartition("ValueError: ")[2] for failure in read_status(tmp_path / "run").failed]
    assert errors == ["\\ud800"] * 2


def test_results_and_traces_may_have_names_that_are_not_utf_8(tmp_path) -> None:
    folder = store(tmp_path / "run", sweep({SPEED: SPEEDS}, trials=2), lambda _: ended([5, 6]))
    exported, traced = ("export", folder, "--to"), ("run", "pair", "--set", "stop.max_time_s=0.3", "--trace")
    for words, ending in ((exported, ".csv"), (exported, ".parquet"), (traced, ".parquet")):
        odd, even = (tmp_path / f"{name}{ending}" for name in (os.fsdecode(b"b\xffd"), "same"))
        for path in (odd, even):
            called(*words, path)
        assert odd.read_bytes() == even.read_bytes()
