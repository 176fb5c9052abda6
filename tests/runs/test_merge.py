"""Run folders that go elsewhere: shares become the table of one run, and users' files, with digests, come along."""

import shutil
from pathlib import Path
from random import Random

import pytest
import yaml
from hypothesis import given, settings, strategies as st

from epuck_sim.errors import StoreError
from epuck_sim.runs.compatibility import Share, merge_folders
from epuck_sim.runs.export import export
from epuck_sim.runs.reader import FinishedTrials, read_status, verify
from epuck_sim.runs.sources import is_trusted, with_trials
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.run import run_sweep
from tests.cli.commands import call, called, contents, refused
from tests.control.bench import write_soon_after
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, DATABASE, DEMO, MINE, edit, fill, outcome, scenario_of, stored
from tests.sweep.pool_here import pool_here

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

MANY = scenario_of({"grid": {COUNT: [2, 3, 4, 5, 6, 7]}}, trials=7)


def fill_share(folder: Path, share: Share, scenario: Scenario = MANY, part: float = 1.0, **changes) -> Path:
    """Store a part of the trials of a share, by chance."""
    random = Random(share.number)
    found = points(scenario)
    with Store(folder, scenario, found, share) as store:
        for point in found:
            for trial in share.trials(point.number, scenario.trials):
                if random.random() < part:
                    store.add([outcome(point, trial, **changes)])
    return folder


def shares(tmp_path: Path, count: int, **changes) -> list[Path]:
    return [fill_share(tmp_path / f"{number}", Share(number, count), **changes) for number in range(1, count + 1)]


@pytest.mark.parametrize("count", [1, 5])
def test_all_shares_together_are_one_run_bit_for_bit(tmp_path, monkeypatch, count: int) -> None:
    folders = shares(tmp_path, count)
    before = [contents(folder) for folder in folders]
    monkeypatch.setattr("epuck_sim.runs.compatibility.validate", None)  # not of points that are the same: it takes long
    assert "42 of 42 trials" in called("merge", *reversed(folders), "--out", tmp_path / "merged")
    fill(tmp_path / "one", MANY)
    assert stored(tmp_path / "merged") == stored(tmp_path / "one")
    for name in ("merged", "one"):
        export(tmp_path / name, tmp_path / f"{name}.parquet")
    assert (tmp_path / "merged.parquet").read_bytes() == (tmp_path / "one.parquet").read_bytes()
    assert load_scenario(tmp_path / "merged") == MANY
    assert [contents(folder) for folder in folders] == before


def test_any_set_of_unfinished_shares_is_put_together_and_goes_on_as_the_whole(tmp_path) -> None:
    folders = shares(tmp_path, 4, part=0.5)[:3]
    merge_folders(folders, tmp_path / "merged")
    rows = [row for folder in folders for row in stored(folder)]
    assert stored(tmp_path / "merged") == sorted(rows, key=lambda row: (row["number"], row["trial"]))
    status = read_status(tmp_path / "merged")
    assert (status.share, status.trials, status.stored) == (None, 42, len(rows))
    fill(tmp_path / "merged", MANY)
    fill(tmp_path / "one", MANY)
    assert stored(tmp_path / "merged") == stored(tmp_path / "one")


def test_shares_that_get_points_between_their_own_miss_none(tmp_path) -> None:
    small, large = (scenario_of({"grid": {COUNT: counts}}, trials=10) for counts in ([2, 4], [2, 3, 4]))
    folders = [tmp_path / f"{number}" for number in (1, 2, 3)]
    for number, folder in enumerate(folders, start=1):
        for scenario in (small, large):
            progress = run_sweep(scenario, folder, pool_here, lambda _: None, share=Share(number, 3))
        status = read_status(folder)
        assert progress.stored == progress.trials == status.stored == status.trials
    merge_folders(folders, tmp_path / "merged")
    run_sweep(large, tmp_path / "one", pool_here, lambda _: None)
    assert len(stored(tmp_path / "one")) == 30
    fields = ("number", "trial", "seed", "t_sync_cycles", "censored", "order_parameter", "cycles")
    merged, one = ([[row[field] for field in fields] for row in stored(tmp_path / name)] for name in ("merged", "one"))
    assert merged == one


def test_a_folder_without_its_scenario_is_named_and_nothing_is_written(tmp_path) -> None:
    folders = shares(tmp_path, 2)
    (folders[0] / "scenario.yaml").unlink()
    with pytest.raises(StoreError, match=r"1/scenario\.yaml: cannot be read: No such file or directory; copy it, too"):
        merge_folders(folders, tmp_path / "merged")
    assert not (tmp_path / "merged" / DATABASE).exists()
    merge_folders([folders[1]], tmp_path / "merged")


def test_trials_in_several_folders_are_stored_once_and_results_replace_failures(tmp_path) -> None:
    failed = fill_share(tmp_path / "failed", Share(1, 2), error="gone")
    again = fill_share(tmp_path / "again", Share(1, 2))
    others = fill_share(tmp_path / "others", Share(1, 3))
    for number, folders in enumerate(([failed, again, others], [others, again, failed])):
        merge_folders(folders, tmp_path / f"merged{number}")
        found = {(row["number"], row["trial"]) for row in stored(tmp_path / f"merged{number}")}
        assert found == {(row["number"], row["trial"]) for folder in folders for row in stored(folder)}
        assert read_status(tmp_path / f"merged{number}").failed == []


def test_a_sweep_that_has_grown_meanwhile_is_as_large_as_its_largest_share_of_each_point(tmp_path) -> None:
    large = fill_share(tmp_path / "large", Share(2, 2), MANY.model_copy(update={"trials": 9}))
    merge_folders([fill_share(tmp_path / "small", Share(1, 2)), large], tmp_path / "merged")
    assert read_status(tmp_path / "merged").trials == 6 * 9
    assert load_scenario(tmp_path / "merged").trials == 9
    edited = {"scenario.yaml": b"trials: many"}
    assert with_trials(edited, 9) == edited
    measured = load_scenario(MANY.model_copy(update={"trials": 7}), measures=["near_walls"])
    more = fill_share(tmp_path / "more", Share(1, 2), MANY.model_copy(update={"trials": 9}))
    merge_folders([more, fill_share(tmp_path / "measured", Share(2, 2), measured)], tmp_path / "both")
    both = load_scenario(tmp_path / "both")
    assert ([section.name for section in both.measures], both.trials) == (["near_walls"], 9)
    assert all(each.is_whole for each in verify(tmp_path / "both"))
    counts = {"a": [7, 2, 2, 2, 2, 2], "b": [4] * 6}
    for name, trials in counts.items():
        found = points(MANY)
        with Store(tmp_path / name, MANY, found) as store:
            store.add([outcome(point, trial) for point in found for trial in range(trials[point.number])])
            store.plan({point.key: trials[point.number] for point in found})
    merge_folders([tmp_path / name for name in counts], tmp_path / "planned")
    assert read_status(tmp_path / "planned")[2:4] == (27, 27)


def test_folders_of_another_scenario_or_version_or_with_other_results_are_refused(tmp_path) -> None:
    share = fill_share(tmp_path / "share", Share(1, 2))
    noisy = fill_share(tmp_path / "noisy", Share(2, 2), MANY.model_copy(update={"seed": 5}))
    axes = fill_share(tmp_path / "axes", Share(2, 2), DEMO)
    version = fill_share(tmp_path / "version", Share(2, 2))
    edit(version, "UPDATE trials SET numba = '0.1' WHERE trial = 1")
    double = fill_share(tmp_path / "double", Share(1, 2), cycles=5)
    measured = load_scenario(MANY, measures=["near_walls"])
    first, second = (
        fill_share(tmp_path / name, Share(1, 2), measured, measures={"near_walls": value})
        for name, value in (("first", 0.1), ("second", 0.2))
    )
    for one, other, message in (
        (share, noisy, "seed: 5 in the folder, 0 in|seed: 0 in the folder, 5 in"),
        (share, axes, "holds another sweep; axes in the folder and in"),
        (share, version, "holds trials made by .*numba 0.1.*; merge folders of the same versions"),
        *((*pair, "trial . at .* differs from that of another folder") for pair in ((share, double), (first, second))),
    ):
        for folders in ([one, other], [other, one]):
            with pytest.raises(StoreError, match=message):
                merge_folders(folders, tmp_path / "merged")
            assert not (tmp_path / "merged" / DATABASE).exists()


def test_a_folder_stays_with_its_share_and_the_status_of_many_shares_says_what_is_missing(tmp_path) -> None:
    folders = shares(tmp_path, 4, part=0.5)[:3]
    with Store(folders[0], MANY, points(MANY)) as store:
        assert store.share == Share(1, 4)
    lines = called("status", *folders).splitlines()
    counts = [len(stored(folder)) for folder in folders]
    trials = [read_status(folder).trials for folder in folders]
    assert lines == [
        *(f"{tmp_path}/{k + 1} (share {k + 1}/4): {counts[k]} of {trials[k]}" for k in range(3)),
        f"together: {sum(counts)} of {sum(trials)} trials have a result; failed: 0",
        "shares without a folder here: 4/4",
    ]
    assert f"demo: share 1/4, 6 points, {counts[0]} of {trials[0]} trials" in called("status", folders[0])
    assert called("status", *folders, "--json").count('"folder"') == 3
    speeds = made_folders.sweep({made_folders.SPEED: [2]})
    stored_in = [tmp_path / "a", tmp_path / "b"]
    other, twin = (made_folders.store(each, speeds, lambda _: made_folders.ended([5])) for each in stored_in)
    assert "together" not in called("status", other, twin)  # each is a sweep of its own
    assert len(called("status", *folders, other).splitlines()) == 4  # no sum of several sweeps
    merge_folders(folders, tmp_path / "merged")
    assert len(called("status", *folders, tmp_path / "merged").splitlines()) == 4  # which has all shares


@settings(max_examples=30)
@given(st.integers(1, 50), st.integers(0, 10_000), st.integers(0, 200), st.integers(0, 100))
def test_every_trial_is_in_one_share_for_ever_and_shares_of_a_point_differ_by_one(count, point, trials, more) -> None:
    parts = [Share(number, count).trials(point, trials) for number in range(1, count + 1)]
    assert sorted(trial for part in parts for trial in part) == [*range(trials)]
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
    assert [*parts[-1]] == [trial for trial in Share(count, count).trials(point, trials + more) if trial < trials]


@settings(max_examples=6)
@given(*map(st.sampled_from, ([5, 8, 10, 13, 20, 21, 32], [4, 10, 20, 40, 64], [1, 7, 30])))
def test_shares_take_about_as_long_even_if_one_speed_takes_a_hundred_times_another(speeds, count, trials) -> None:
    points = range(40 * speeds)
    weights = [100 ** (point % speeds / (speeds - 1)) for point in points]
    costs = [
        sum(len(Share(number, count).trials(point, trials)) * weights[point] for point in points)
        for number in range(1, count + 1)
    ]
    # a point's trials cannot be divided among shares better than by one trial of 100
    assert max(costs) < 1.1 * sum(costs) / count + 300


@settings(max_examples=40)
@given(
    st.dictionaries(st.integers(0, 2), st.sets(st.integers(0, 20), min_size=1)), st.integers(1, 3), st.integers(0, 30)
)
def test_missing_trials_are_those_wanted_that_are_not_finished(trials, of: int, count: int) -> None:
    finished = FinishedTrials((point, [*numbers]) for point, numbers in trials.items())
    assert {*finished} == {(point, trial) for point, numbers in trials.items() for trial in numbers}
    for point in range(3):
        for number in range(of):
            wanted = Share(number + 1, of).trials(point, count)
            missing = [wanted[place] for place in finished.missing(point, wanted)]
            assert missing == [trial for trial in wanted if trial not in trials.get(point, ())]
            assert finished.count(point, wanted) == len(wanted) - len(missing)


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


def test_a_folder_has_users_files_by_relative_names_is_trusted_and_a_merged_one_is_complete(made, tmp_path) -> None:
    names = {f"sources/{name}/{file}.py" for name in ("here", "there") for file in ("mine", "helper")}
    assert {path.relative_to(made).as_posix() for path in made.rglob("*.py")} == {*names, "sources/coverage.py"}
    scenario = yaml.safe_load((made / "scenario.yaml").read_text())
    assert scenario["sweep"]["grid"]["robots.0.controller"] == ["sources/here/mine.py", "sources/there/mine.py"]
    assert [*scenario["measures"][0]] == ["sources/coverage.py:coverage"]
    assert str(made.parent) not in (made / "scenario.yaml").read_text()
    assert is_trusted(made)
    merge_folders([made], tmp_path / "whole")
    shutil.rmtree(made)
    assert all(each.is_whole for each in verify(tmp_path / "whole"))
    assert len(points(load_scenario(tmp_path / "whole"))) == 4


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


def test_a_path_that_a_measure_opens_stays_where_it_is_also_on_an_axis(tmp_path: Path) -> None:
    (tmp_path / "coverage.py").write_text("def coverage(simulation, *, plan=''):\n    return 1.0\n")
    (tmp_path / "plan.txt").touch()
    axis = {"measures.0.coverage.plan": [str(tmp_path / "plan.txt"), "none"]}
    scenario = scenario_of({"grid": axis}, measures=[str(tmp_path / "coverage.py:coverage")])
    fill(tmp_path / "run", scenario, t_sync_cycles=9)
    assert yaml.safe_load((tmp_path / "run" / "scenario.yaml").read_text())["sweep"]["grid"] == axis


def test_files_of_the_same_name_that_come_later_lie_beside_the_first(made: Path, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "coverage.py").write_text(MEASURE.replace("coverage", "other"))
    more = load_scenario(made, measures=[str(tmp_path / "other" / "coverage.py")])
    with Store(made, more, points(more)):
        pass
    assert (made / "sources" / "coverage.py").read_text() == MEASURE
    assert "other" in (made / "sources-2" / "coverage.py").read_text()
    again = load_scenario(made, measures=[str(tmp_path / "own" / "coverage.py")])  # a command that was killed
    names = [each.measure.rpartition("/")[2] for each in again.measures]
    assert names == ["coverage.py:coverage", "coverage.py:other"]


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
        (Path.unlink, "SHA256SUMS", "scenario.yaml: has no digest: an earlier version wrote it", 0),
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
def foreign(made: Path, here: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a run folder that somebody else has made, whose code leaves a trace where it is run, from anywhere."""
    mark = f"open({str(here / 'was-run')!r}, 'w').close()\n"
    for path in made.rglob("*.py"):
        write_soon_after(path, mark + path.read_text())
    shutil.rmtree(here / "own")
    edit(made, "UPDATE points SET scenario = replace(scenario, ?, ?)", str(here / "own"), str(made / "sources"))
    monkeypatch.setenv("XDG_STATE_HOME", str(here / "state"))
    return made


SHOWING = ["plot --form curves --x robots.0.count", "export --to x.csv", "summarize --of coverage"]


@pytest.mark.parametrize("command", ["check", "status", "report", "verify", "summarize", "list", *SHOWING])
def test_what_shows_a_folder_runs_none_of_its_code(foreign: Path, tmp_path: Path, command: str) -> None:
    name, *options = command.split()
    found = call(name, *([foreign] * (name != "list")), *options)
    assert not (tmp_path / "was-run").exists(), found.stdout
    assert name == "verify" or found.exit_code == 0, found.stderr


TAKING = ["page RUN --to x.html", "play RUN", "predict RUN", "compare-film film.mp4 RUN"]


@pytest.mark.parametrize("command", [*TAKING, "replicate --claims claims.yaml --out out"])
def test_what_takes_a_folder_as_a_scenario_runs_no_code_that_is_not_trusted(foreign, command) -> None:
    claim = '{id: A, section: "9", claim: so, sweep: s, checks: [{test: share, above: 0.5}]}'
    Path("claims.yaml").write_text(f"sweeps: {{s: {{scenario: {foreign}}}}}\nclaims: [{claim}]")
    assert "brings code that you have not run" in refused(*command.replace("RUN", str(foreign)).split())
    assert not Path("was-run").exists()


@pytest.mark.parametrize("keys", ["start: {like: run/scenario.yaml}", "sweep: {grid: {start.like: [run, thesis]}}"])
def test_agents_that_start_like_robots_of_a_folder_ask_for_trust(foreign, keys: str) -> None:
    Path("agents.yaml").write_text(f"model: particles\n{keys}")
    for command in ("run agents.yaml --out out", "check agents.yaml"):
        assert "run: brings code that you have not run: sources/coverage.py" in refused(*command.split())
    assert not Path("was-run").exists()
    call("run", "agents.yaml", "--trust", "--out", "out")
    assert is_trusted(foreign)


@pytest.mark.parametrize("command", ["run", "plan", "replay --point 0 --trial 0 --interpret"])
def test_what_runs_a_folder_asks_for_trust_once(foreign: Path, tmp_path: Path, monkeypatch, command: str) -> None:
    name, *options = command.split()
    refusal = call(name, foreign, *options)
    assert refusal.exit_code == 2
    assert "brings code that you have not run: sources/coverage.py, sources/here/helper.py" in refusal.stderr
    assert not (tmp_path / "was-run").exists()
    merge_folders([foreign], tmp_path / "whole")
    assert not is_trusted(tmp_path / "whole")  # a merged folder is trusted as its parts are
    call(name, foreign, *options, "--trust")
    assert (tmp_path / "was-run").exists()
    monkeypatch.setattr("epuck_sim.runs.sources._trusted", set())  # another process
    assert is_trusted(foreign)
    (foreign / "sources" / "more.py").touch()
    assert not is_trusted(foreign)
