"""The commands that read run folders: what they print and write, and how they end where something is wrong."""

import json
import os
from functools import partial
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from matplotlib import image

from epuck_sim.estimate import Estimate, significant
from tests.cli.commands import call, called, cells, contents, read
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, COUPLING, MANY_SPEEDS, SPEED, SPEEDS, bumpy, rows, store, sweep, weibull

FIGURE = ["T_sync-regimes.csv", "T_sync.csv", "T_sync.png", "T_sync.svg", "T_sync.txt"]


@pytest.fixture(scope="module")
def made(tmp_path_factory) -> Path:
    """Return a run folder that no test changes: point 0 has but three failed trials."""

    def law(point):
        mean = made_folders.bumpy_mean(point.axes[SPEED], point.axes[COUPLING] / 0.1)
        return weibull(point, mean, 97 if point.number else 0)

    scenario = sweep({COUPLING: [0.1, 0.2], SPEED: MANY_SPEEDS}, trials=100, name="fig-x")
    return store(tmp_path_factory.mktemp("made") / "run", scenario, law, failed=3)


@pytest.fixture
def small(tmp_path) -> Path:
    return store(tmp_path / "small", sweep({SPEED: SPEEDS}, trials=5), lambda point: weibull(point, 30))


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_export_writes_a_row_for_each_trial_with_a_result_and_tells_of_failed_ones(made, tmp_path, ending) -> None:
    target = tmp_path / f"results{ending}"
    result = call("export", made, "--to", target)
    assert (result.exit_code, result.stdout) == (0, f"{target}\n")
    others = [call(*each).stderr for each in (("summarize", made), ("compare", made, "--axis", f"{COUPLING}=0.1,0.2"))]
    assert [result.stderr, *others] == 3 * [f"left out: 3 trials that failed; see: epuck-sim status {made}\n"]
    table = rows(target) if ending == ".csv" else pq.read_table(target).to_pylist()
    assert len(table) == 97 * 25
    assert [*table[0]][:4] == [COUPLING, SPEED, "seed", "t_sync_cycles"]
    assert [path.name for path in tmp_path.iterdir()] == [target.name]


def test_summarize_that_fails_leaves_no_transaction_open(small, monkeypatch) -> None:
    given = []
    fails = lambda points: (given.append(points), next(points), 1 / 0)  # noqa: E731
    monkeypatch.setattr("epuck_sim.statistics.statistic.summarize", fails)
    assert isinstance(call("summarize", small).exception, ZeroDivisionError)
    assert given[0].gi_frame is None


def test_plot_writes_the_figure_into_the_folder_and_names_its_files(small) -> None:
    before = set(contents(small))
    stdout = called("plot", small)
    assert sorted(Path(line).name for line in stdout.splitlines()) == FIGURE
    assert all(Path(line).parent == small for line in stdout.splitlines())
    assert set(contents(small)) == before | set(FIGURE)
    assert image.imread(small / "T_sync.png").std() > 0.05


def test_options_of_the_figure_are_those_of_the_section(small, figures_noted, tmp_path) -> None:
    words = ["--title", "mine", "--label", f"{SPEED}=speed = V", "--linear", "--points", "--font-pt", 9]
    assert call("plot", small, *words, "--to", tmp_path / "fig").exit_code == 0
    (panel,) = figures_noted[0].axes
    assert (figures_noted[0].get_suptitle(), panel.get_xlabel(), panel.get_yscale()) == ("mine", "speed = V", "linear")
    assert panel.xaxis.label.get_fontsize() == 9
    assert "a trial" in panel.get_legend_handles_labels()[1]


def test_fit_of_several_folders_names_the_statistic_and_fit_of_powers_prints_exponents(made, tmp_path) -> None:
    other = store(tmp_path / "other", sweep({COUNT: [10], SPEED: MANY_SPEEDS}, trials=100), bumpy)
    found = json.loads(call("fit", made, other, "--statistic", "weibull-mean", "--json").stdout)
    assert [curve["statistic"] for curve in found["curves"]] == [["Weibull mean"]] * 3
    assert [curve["run"] for curve in found["curves"]] == [str(made), str(made), str(other)]
    assert [each["curves"] for each in found["laws"]] == [3]
    stdout = call("fit", made, other, "--statistic", "median").stdout
    assert all(said in stdout for said in ("T_m and T_p: median.", "Scaling laws of 3 curves", "coupling"))

    scenario = sweep({COUNT: [5, 10, 20], SPEED: SPEEDS}, trials=20)
    folder = store(tmp_path / "run", scenario, lambda point: weibull(point, 3000 / point.axes[COUNT] ** 1.5))
    (found,) = read("fit", folder, "--power", "count,speed_cm_s")
    assert (found["of"], found["trials"], found["points"]) == ("T_sync (cycles)", 300, 15)
    assert found["exponents"][COUNT]["low"] < -1.5 < found["exponents"][COUNT]["high"]
    assert found["exponents"][SPEED]["low"] < 0 < found["exponents"][SPEED]["high"]
    stdout = called("fit", folder, "--power", "count", "--of", "t_sync_s", "--where", "speed_cm_s=1,5")
    assert "T_sync (s) as a product of powers" in stdout
    assert [row[0] for row in cells(stdout)] == ["1.0", "5.0"]


@pytest.mark.parametrize("trials", [1, 3])
def test_with_few_trials_fit_prints_no_p_value_and_plot_no_bands_nor_marks(trials, figures_noted, tmp_path) -> None:
    few = store(tmp_path / "few", sweep({SPEED: MANY_SPEEDS}, trials=trials), bumpy)
    stdout = called("fit", few)
    assert "Not looked for on 1 of 1 curves: fewer than 20 trials at 13 of 13 speeds" in stdout
    assert "give --trials 20 or more" in stdout
    (curve,) = read("fit", few)["curves"]
    assert [curve[name] for name in ("p_value", "v_m", "t_m", "v_p", "t_p")] == [None] * 5
    assert curve["reason"].startswith("fewer than 20 trials")
    result = call("plot", few, "--to", tmp_path / "fig")
    assert result.exit_code == 0
    lines = result.stderr.splitlines()
    assert lines[0] == "note: no bands where a point has fewer than 5 trials"
    assert lines[1].startswith("note: no minimum and peak are looked for: fewer than 20 trials")
    assert {line.get_marker() for line in figures_noted[0].axes[0].get_lines()}.isdisjoint({"v", "^"})
    assert [row["low"] + row["high"] for row in rows(tmp_path / "fig.csv")] == [""] * len(MANY_SPEEDS)


def test_compare_prints_points_and_what_holds_over_all_and_plan_how_long_more_trials_take(tmp_path) -> None:
    swept = partial(sweep, {COUNT: [5, 10], SPEED: [1, 2]}, trials=60)
    first = store(tmp_path / "a", swept(seed=0), lambda point: weibull(point, 90 / point.axes[SPEED]))
    second = store(tmp_path / "b", swept(seed=1), lambda point: weibull(point, 135 / point.axes[SPEED]))
    stdout, found = called("compare", first, second), read("compare", first, second)
    assert (found["a"], found["b"]) == (str(first), str(second))
    assert "trials A 60; trials B 60; censored A 0 %; censored B 0 %" in stdout
    for row, point in zip(cells(stdout), found["points"], strict=True):
        estimates = [str(Estimate(**point[name])) for name in ("first", "second", "ratio")]
        estimates.insert(2, significant(point["difference"]["value"]))
        p_values = [significant(point[name]) for name in ("p_value", "p_holm")]
        assert row == [str(point["axes"][COUNT]), str(point["axes"][SPEED]), *estimates, *p_values]
    assert found["ratio"]["low"] < 1.5 < found["ratio"]["high"]
    assert f"B / A = {Estimate(**found['ratio'])}, the geometric mean of 4 points; p <= 0.0002" in stdout
    speeds = read("compare", first, "--points", "0,1", "--points", "2,3")
    assert [speeds["a"], speeds["b"]] == [f"{first}, place 1", f"{first}, place 2"]
    axes = [{"points": "0, 1", COUNT: 5}, {"points": "2, 3", COUNT: 10}]
    assert [point["axes"] for point in speeds["points"]] == axes
    more = "plan", first, "--trials", 100_060, "--workers", 4
    stdout, duration = called(*more), read(*more)["duration"]
    assert "4 points, 100060 trials each: 400000 are left: 7 min of computing, 2 min with 4 workers." in stdout
    assert duration["compute_s"]["value"] == pytest.approx(400)
    assert (duration["wall_s"], duration["left"], duration["timed"]) == (pytest.approx(100), 400_000, 240)


def test_where_leaves_the_points_with_some_values_of_an_axis(tmp_path) -> None:
    folder = store(tmp_path / "run", sweep({COUNT: [5, 10], SPEED: SPEEDS}, trials=5), lambda point: weibull(point, 30))
    assert [row["point"] for row in read("summarize", folder, "--where", "count=10")] == [5, 6, 7, 8, 9]
    assert [each["axes"] for each in read("fit", folder, "--where", "count=10")["curves"]] == [{COUNT: 10}]
    compared = read("compare", folder, "--axis", "count=5,10", "--where", "speed_cm_s=5,1")
    assert [point["axes"][SPEED] for point in compared["points"]] == [1, 5]
    called("plot", folder, "--where", "count=10", "--to", tmp_path / "fig")
    assert [row[COUNT] for row in rows(tmp_path / "fig.csv")] == ["10"] * 5
    assert (tmp_path / "fig.txt").read_text().splitlines()[2] == "Only points with count=10."


def test_plan_says_where_trials_tell_of_time_alone_times_some_of_a_scenario_and_names_a_share(tmp_path) -> None:
    for limit, printed, note in (
        (None, ": all are stored.", "note: trials have no T_sync; give --of"),
        (0.95, "in 80 % of all cases: too many are censored at their limit.", ""),
    ):
        scenario = sweep({SPEED: [1, 2]}, trials=9, stop={"order_parameter": limit, "max_cycles": 9})
        result = call("plan", store(tmp_path / str(limit), scenario, lambda point: made_folders.censored(point, 9)))
        assert result.exit_code == 0
        assert printed in result.stdout
        assert result.stderr[: len(note) or None] == note
    call("run", "pair", "--set", "stop.max_cycles=2", "--trials", 2, "--share", "1/2", "--out", tmp_path / "run")
    assert "2 trials each: all of share 1/2 are stored." in called("plan", tmp_path / "run")
    assert "4 trials each: 1 of share 1/2 is left: 0 s of computing" in called("plan", tmp_path / "run", "--trials", 4)
    options = ("--sweep", f"{SPEED}=1,2,4,8,10,12", "--set", "stop.max_cycles=2", "--trials", 1000, "--workers", 2)
    stdout = called("plan", "pair", *options)
    assert stdout.startswith("pair: 6 points, 1000 trials each: 6000 are left: ")
    assert "Estimated from 20 trials." in stdout
    duration = read("plan", "pair", *options)["duration"]
    assert duration["compute_s"]["low"] < duration["compute_s"]["value"] < duration["compute_s"]["high"]
    assert duration["wall_s"] == pytest.approx(duration["compute_s"]["value"] / 2)


def test_a_report_is_written_beside_its_folder_wherever_it_is_called(tmp_path, monkeypatch) -> None:
    folder = store(tmp_path / "run", sweep({"noise": ["on", "off"]}, trials=2), lambda point: weibull(point, 30))
    page = tmp_path / "run.html"
    assert called("report", folder) == f"{page.resolve()}\n"
    page.unlink()
    monkeypatch.chdir(folder)
    assert called("report", ".") == f"{page.resolve()}\n"
    assert page.exists()


def test_results_figures_and_traces_may_have_names_that_are_not_utf_8_recordings_may_not(tmp_path) -> None:
    folder = store(tmp_path / "run", sweep({SPEED: SPEEDS}, trials=2), lambda _: made_folders.ended([5, 6]))
    exported, traced = ("export", folder, "--to"), ("run", "pair", "--set", "stop.max_time_s=0.3", "--trace")
    for words, ending in ((exported, ".csv"), (exported, ".parquet"), (traced, ".parquet")):
        odd, even = (tmp_path / f"{name}{ending}" for name in (os.fsdecode(b"b\xffd"), "same"))
        for path in (odd, even):
            called(*words, path)
        assert odd.read_bytes() == even.read_bytes()
    assert call("plot", folder.rename(odd.with_suffix("")), "--to", even.with_suffix("")).exit_code == 0
    assert "is no name in Unicode" in call("run", "pair", "--record", odd.with_suffix(".rrd")).stderr
