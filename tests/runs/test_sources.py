"""Run folders are complete: users' files lie in them, with digests, and `verify` looks at all of it."""

import shutil
from pathlib import Path

import pytest
import yaml

from epuck_sim.runs.reader import verify
from epuck_sim.runs.share import merge_folders
from epuck_sim.runs.sources import is_trusted
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from tests.cli.commands import call, refused
from tests.control.bench import write_soon_after
from tests.runs.made_folders import COUNT, MINE, fill, scenario_of, stored

MEASURE = "def coverage(simulation):\n    return 1.0\n"


@pytest.fixture
def made(tmp_path: Path) -> Path:
    """Return the run folder of a sweep with two controllers of one name, a helper, and a measure."""
    own = tmp_path / "own"
    for name in ("here", "there"):
        (own / name).mkdir(parents=True)
        (own / name / "mine.py").write_text(MINE.replace("PARAMETERS", "from helper import PACE\nPARAMETERS"))
        (own / name / "helper.py").write_text(f"PACE = {len(name)}\n")
    (own / "coverage.py").write_text(MEASURE)
    axis = {"robots.0.controller": [str(own / name / "mine.py") for name in ("here", "there")], COUNT: [2, 3]}
    measures = [str(own / "coverage.py:coverage")]
    scenario = scenario_of({"grid": axis}, measures=measures, stop={"max_time_s": 2})
    fill(tmp_path / "run", scenario, measures={"coverage": 1.0}, t_sync_cycles=9, cycles=9)
    return tmp_path / "run"


def test_a_folder_has_users_files_and_names_them_relative_to_itself(made: Path) -> None:
    names = {f"sources/{name}/{file}.py" for name in ("here", "there") for file in ("mine", "helper")}
    assert {path.relative_to(made).as_posix() for path in made.rglob("*.py")} == {*names, "sources/coverage.py"}
    scenario = yaml.safe_load((made / "scenario.yaml").read_text())
    assert scenario["sweep"]["grid"]["robots.0.controller"] == ["sources/here/mine.py", "sources/there/mine.py"]
    assert [*scenario["measures"][0]] == ["sources/coverage.py:coverage"]
    assert str(made.parent) not in (made / "scenario.yaml").read_text()


def test_a_folder_that_was_sent_to_somebody_goes_on_there(made: Path, tmp_path: Path) -> None:
    before = stored(made)
    there = tmp_path / "elsewhere" / "sent"
    shutil.copytree(made, there)
    shutil.rmtree(tmp_path / "own")
    shutil.rmtree(made)
    loaded = load_scenario(there)
    with Store(there, loaded, points(loaded)) as store:
        assert len(set(store.finished())) == len(before) == 12
    assert stored(there) == before
    assert all(each.is_whole for each in verify(there))


def test_files_of_the_same_name_that_come_later_lie_beside_the_first(made: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "coverage.py").write_text(MEASURE.replace("coverage", "other"))
    more = load_scenario(made, measures=[str(tmp_path / "other" / "coverage.py")])
    with Store(made, more, points(more)):
        pass
    assert (made / "sources" / "coverage.py").read_text() == MEASURE
    assert "other" in (made / "sources-2" / "coverage.py").read_text()
    names = [each.measure.rpartition("/")[2] for each in load_scenario(made).measures]
    assert names == ["coverage.py:coverage", "coverage.py:other"]


def test_what_a_run_has_put_into_its_folder_is_trusted_and_a_merged_one_is_complete(made: Path, tmp_path: Path) -> None:
    assert is_trusted(made)
    merge_folders([made], tmp_path / "whole")
    shutil.rmtree(made)
    assert all(each.is_whole for each in verify(tmp_path / "whole"))
    assert len(points(load_scenario(tmp_path / "whole"))) == 4


def flip(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)


@pytest.mark.parametrize(
    ("spoil", "name", "says", "code"),
    [
        (flip, "scenario.yaml", "scenario.yaml: is damaged, or was changed", 1),
        (Path.unlink, "scenario.yaml", "scenario.yaml: cannot be read: No such file", 1),
        (flip, "sources/here/mine.py", "sources/here/mine.py: is damaged, or was changed", 1),
        (Path.unlink, "sources/here/helper.py", "sources/here/helper.py: cannot be read: No such file", 1),
        (flip, "results.sqlite", "results.sqlite: is damaged: ", 1),
        (Path.unlink, "results.sqlite", "is not a run folder", 2),
        (lambda p: p.write_text("0" * 64 + p.read_text()[64:]), "SHA256SUMS", ": is damaged, or was changed", 1),
        (lambda path: path.write_text("a"), "SHA256SUMS", "SHA256SUMS: is damaged: 'a' is no digest", 1),
        (Path.unlink, "SHA256SUMS", "scenario.yaml: has no digest: an earlier version has written it", 0),
    ],
)
def test_verify_names_what_is_not_as_it_was_written(made: Path, spoil, name: str, says: str, code: int) -> None:
    whole = call("verify", made)
    assert whole.exit_code == 0
    assert "results.sqlite: 12 of 12 trials of demo, each with its checksum\n" in whole.stdout
    assert "sources/here/helper.py: is as it was written\n" in whole.stdout
    spoil(made / name)
    found = call("verify", made)
    assert (found.exit_code, says in found.stdout + found.stderr) == (code, True), found.stdout


@pytest.fixture
def foreign(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a run folder that somebody else has made, whose code leaves a trace where it is run."""
    mark = f"open({str(tmp_path / 'was-run')!r}, 'w').close()\n"
    for path in made.rglob("*.py"):
        write_soon_after(path, mark + path.read_text())
    shutil.rmtree(tmp_path / "own")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return made


SHOWING = ["plot --form curves --x robots.0.count", "export --to x.csv"]


@pytest.mark.parametrize("command", ["check", "status", "report", "verify", "summarize", "list", *SHOWING])
def test_what_shows_a_folder_runs_none_of_its_code(foreign: Path, tmp_path: Path, monkeypatch, command: str) -> None:
    monkeypatch.chdir(tmp_path)
    name, *options = command.split()
    found = call(name, *([foreign] * (name != "list")), *options)
    assert not (tmp_path / "was-run").exists(), found.stdout
    assert name == "verify" or found.exit_code == 0, found.stderr


@pytest.mark.parametrize("command", ["page --to x.html", "play", "predict", "compare-film"])
def test_what_takes_a_folder_as_a_scenario_runs_no_code_that_is_not_trusted(foreign, tmp_path, command: str) -> None:
    name, *options = command.split()
    film = [tmp_path / "film.mp4"] if name == "compare-film" else []
    assert "brings code that you have not run" in refused(name, *film, foreign, *options)
    assert not (tmp_path / "was-run").exists()


@pytest.mark.parametrize("command", ["run", "plan", "replay --point 0 --trial 0 --interpret"])
def test_what_runs_a_folder_asks_for_trust_once(foreign: Path, tmp_path: Path, monkeypatch, command: str) -> None:
    monkeypatch.chdir(tmp_path)
    name, *options = command.split()
    refusal = call(name, foreign, *options)
    assert refusal.exit_code == 2
    assert "brings code that you have not run: sources/coverage.py, sources/here/helper.py" in refusal.stderr
    assert not (tmp_path / "was-run").exists()
    call(name, foreign, *options, "--trust")
    assert (tmp_path / "was-run").exists()
    monkeypatch.setattr("epuck_sim.runs.sources._trusted", set())  # another process
    assert is_trusted(foreign)
    (foreign / "sources" / "more.py").touch()
    assert not is_trusted(foreign)


def test_a_merged_folder_is_trusted_as_its_parts(foreign: Path, tmp_path: Path) -> None:
    merge_folders([foreign], tmp_path / "whole")
    assert not is_trusted(tmp_path / "whole")
