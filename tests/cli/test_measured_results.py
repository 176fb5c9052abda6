"""`--of`: measures of run folders on the command line, and folders whose trials have no T_sync."""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.cli.commands import call, called, refused
from tests.figures.drawn import note_figures
from tests.measures.files import write
from tests.runs.made_folders import COUNT, SPEED, rows, store_measured, sweep

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

SPEEDS = [0.1, 0.2, 0.5, 1, 2, 5, 10]


@pytest.fixture(autouse=True)
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    note_figures(monkeypatch)


def bump(point, random):
    return float(np.exp(1 - (np.log10(point.axes[SPEED]) - 0.2) ** 2 + random.normal(0, 0.05)))


LAWS = {
    "number": bump,
    "signed": lambda point, random: float(point.axes[SPEED] - 3 + random.normal()),
    "truth": lambda point, random: bool(random.random() < 0.1 * point.axes[COUNT]),
    "course": lambda _, random: random.normal(1, 0.1, random.integers(3, 7)).tolist(),
    "nothing": lambda *_: None,
}


def folder_of(tmp_path, name, trials=25, shift=0):
    path = write(tmp_path / "mine.py", f"def {name}(simulation): return 0\n")
    random = np.random.default_rng(3 + shift)
    scenario = sweep({SPEED: SPEEDS, COUNT: [2, 6]}, measures=[str(path)], figure={"y": COUNT})
    law = LAWS[name]
    return store_measured(
        tmp_path / f"{name}{shift}", scenario, lambda point: [law(point, random) for _ in range(trials)]
    )


def test_numbers_are_summarised_drawn_fitted_and_compared(tmp_path):
    folder, other = (folder_of(tmp_path, "number", shift=shift) for shift in (0, 1))
    printed = called("summarize", folder, "--of", "number")
    assert "censored" not in printed
    assert "median" in printed
    found = json.loads(called("summarize", folder, "--of", "number", "--json"))
    assert len(found) == 14
    assert all(row["mean_low"] < row["mean"] < row["mean_high"] for row in found)
    for form in ("curves", "map", "violins"):
        call("plot", folder, "--of", "number", "--form", form, "--to", form)
        assert len(rows(Path(f"{form}.csv"))) == 14
    assert float(rows(Path("curves.csv"))[0]["estimate"]) == pytest.approx(found[0]["mean"], rel=1e-5)
    assert (
        rows(Path("violins.csv"))[0]["mean"]
        == rows(Path("curves.csv"))[0]["estimate"]
        == rows(Path("map.csv"))[0]["estimate"]
    )
    fits = json.loads(called("fit", folder, "--of", "number", "--json"))
    assert [fit["peak"]["place"]["value"] for fit in fits] == pytest.approx([10**0.2] * 2, rel=0.15)
    assert "peak at" in called("fit", folder, other, "--of", "number")
    compared = json.loads(called("compare", folder, other, "--of", "number", "--json"))
    assert (compared["of"], compared["compared"]) == ("number", 14)
    assert compared["difference"]["low"] < compared["difference"]["value"] < compared["difference"]["high"]
    assert "Over all: B - A = " in called("compare", folder, other, "--of", "number")


def test_numbers_that_are_not_positive_have_no_ratio_and_no_extremes(tmp_path):
    folder = folder_of(tmp_path, "signed")
    for form in ("curves", "map", "violins"):
        assert call("plot", folder, "--of", "signed", "--form", form, "--to", form).exit_code == 0
    assert "not all of its values are positive" in called("fit", folder, "--of", "signed")
    compared = json.loads(called("compare", folder, "--of", "signed", "--axis", f"{SPEED}=0.1,10", "--json"))
    assert compared["points"][0]["ratio"]["value"] is None
    assert compared["points"][0]["difference"]["value"] == pytest.approx(9.9, abs=1)
    assert compared["points"][0]["p_value"] < 0.001
    assert "B / A" not in called("compare", folder, "--of", "signed", "--axis", f"{SPEED}=0.1,10").splitlines()[-1]


def test_truth_values_are_shares(tmp_path):
    folder = folder_of(tmp_path, "truth", trials=40)
    printed = called("summarize", folder, "--of", "truth")
    assert "share" in printed
    assert "median" not in printed
    (row, *_) = json.loads(called("summarize", folder, "--of", "truth", "--json"))
    assert (row["is_share"], row["median"]) == (True, None)
    assert 0 <= row["mean_low"] <= row["mean"] < row["mean_high"] <= 1
    called("plot", folder, "--of", "truth", "--form", "curves", "--to", "curves")
    assert rows(Path("curves.csv"))[0]["statistic"] == "share"
    compared = json.loads(called("compare", folder, "--of", "truth", "--axis", f"{COUNT}=2,6", "--json"))
    assert {point["statistic"] for point in compared["points"]} == {"share"}
    assert compared["p_value"] < 0.001
    assert 0.2 < compared["difference"]["value"] < 0.6
    assert "truth values have no median" in refused(
        "plot", folder, "--of", "truth", "--statistic", "median", "--form", "curves"
    )
    assert "give --form curves" in refused("plot", folder, "--of", "truth", "--form", "violins")
    assert "shares of trials are not looked at" in called("fit", folder, "--of", "truth")


def test_series_are_summarised_and_drawn_over_the_cycles(tmp_path):
    folder = folder_of(tmp_path, "course")
    found = json.loads(called("summarize", folder, "--of", "course", "--json"))
    assert found[0]["cycle"] == [1, 2, 3, 4, 5, 6]
    assert found[0]["trials"][:3] == [25, 25, 25]
    assert found[0]["trials"][5] < 25
    assert "those that reach the cycle" in called("summarize", folder, "--of", "course")
    plotted = call("plot", folder, "--of", "course", "--width-cm", 12, "--to", "course")
    assert (plotted.exit_code, plotted.stderr) == (0, "note: no bands where fewer than 5 trials have a value\n")
    drawn = rows(Path("course.csv"))
    assert float(drawn[1]["mean"]) == pytest.approx(found[0]["mean"][1], rel=1e-5)
    assert (drawn[1]["cycle"], drawn[1]["trials"]) == ("2", "25")
    for command in (["fit", folder], ["plan", folder], ["compare", folder, "--axis", f"{COUNT}=2,6"]):
        assert "course is a series, with a value for each cycle" in refused(*command, "--of", "course")
    assert "--form map: course is a series" in refused("plot", folder, "--of", "course", "--form", "map")


def test_plan_says_how_many_trials_show_a_difference_of_a_measure(tmp_path):
    numbers = folder_of(tmp_path, "number")
    printed = called("plan", numbers, "--of", "number", "--difference", 5)
    assert f"{numbers}: number" in " ".join(printed.split())
    assert "a difference of 5 % in 80 % of all cases" in printed
    found = json.loads(called("plan", numbers, "--of", "number", "--difference", 5, "--json"))
    assert (found["of"], found["is_of_shares"], len(found["points"])) == ("number", False, 14)
    assert found["over_all"] < min(point["trials"] for point in found["points"])
    truths = folder_of(tmp_path, "truth", trials=40)
    printed = called("plan", truths, "--of", "truth")
    assert "a difference of 20 percentage points in 80 % of all cases" in printed
    shares = json.loads(called("plan", truths, "--of", "truth", "--json"))["points"]
    assert all(point["trials"] > 20 and point["spread"] is None for point in shares)
    assert "no share can differ by so much" in called("plan", truths, "--of", "truth", "--difference", 99)


# --- without oscillators --------------------------------------------------------------------------

WANDERING = ["--set", "robots.0={controller: obstacle_avoidance, count: 3}", "--set", "stop.max_time_s=1"]


def test_nothing_speaks_of_t_sync_where_no_oscillator_is():
    table = called("run", "thesis", *WANDERING, "--measure", "near_walls")
    assert not any(word in table for word in ("T_sync", "censored", "order"))
    assert "near_walls" in table
    trial = json.loads(called("run", "thesis", *WANDERING, "--json"))
    assert (trial["t_sync_cycles"], trial["censored"], trial["order_parameter"]) == (None, None, None)
    result = call("run", "thesis", *WANDERING, "--trials", "2", "--out", "run", "--workers", "1")
    assert result.exit_code == 0
    assert "censored" not in result.stdout + result.stderr + called("status", "run")
    called("export", "run", "--to", "t.csv")
    assert [row["censored"] for row in rows(Path("t.csv"))] == ["", ""]


def test_trials_that_end_at_a_time_or_by_a_measure_have_an_order_parameter_but_no_t_sync():
    table = called(
        "run", "particles", "--set", "stop={when: order_parameter > 0.1, max_cycles: 9}", "--measure", "order_parameter"
    )
    assert "order_parameter" in " ".join(table.split())
    assert not any(word in table for word in ("T_sync", "censored"))
