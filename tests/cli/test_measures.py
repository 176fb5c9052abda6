"""Measures on the command line: run, listed, written anew, and `--of`; trials that have no T_sync."""

import numpy as np
import pytest

from epuck_sim.measures.measure import SHIPPED, find_measure
from tests.cli.commands import call, called, read
from tests.measures.files import COUNTER, write
from tests.runs.made_folders import COUNT, SPEED, rows, store_measured, sweep

pytestmark = pytest.mark.usefixtures("here", "figures_noted", "sweeps_run_here")


@pytest.mark.parametrize("scenario", ["thesis", "particles"])
def test_run_prints_measures_as_json_and_as_columns(scenario, here):
    write(here / "mine.py", COUNTER)
    short = ["run", scenario, "--set", "stop.max_cycles=3"]
    command = [*short, "--measure", "order_parameter", "--measure", "mine.py:Counter"]
    trial = read(*command)
    assert list(trial["measures"]) == ["order_parameter", "Counter"]
    assert trial["measures"]["Counter"] == 3.0
    assert len(trial["measures"]["order_parameter"]) == trial["cycles"] == 3
    assert trial["measures"]["order_parameter"][-1] == trial["order_parameter"]
    assert read(*short, "--measure", "mine.py:Counter: {offset: 2, as: later}")["measures"] == {"later": 5.0}
    table = called(*command)
    assert all(said in table for said in ("3 values", "Counter"))


def test_list_tells_the_shipped_measures_and_their_parameters():
    heading, *lines = called("list", "--measures").splitlines()
    assert heading == "measures"
    assert [line.split()[0] for line in lines] == sorted(SHIPPED)
    for line in lines:
        assert all(f"{name}: {default}" in line for name, default in find_measure(line.split()[0]).parameters.items())


LAWS = {
    "number": lambda at, random: float(np.exp(1 - (np.log10(at.axes[SPEED]) - 0.2) ** 2 + random.normal(0, 0.05))),
    "truth": lambda point, random: bool(random.random() < 0.1 * point.axes[COUNT]),
    "course": lambda _, random: random.normal(1, 0.1, random.integers(3, 7)).tolist(),
}


def folder_of(here, name, trials=25, shift=0):
    """Make a run folder with a measure, whose values follow the law of its name."""
    path = write(here / "mine.py", f"UNIT = 'cm'\ndef {name}(simulation): return 0\n")
    random = np.random.default_rng(3 + shift)
    scenario = sweep({SPEED: [0.1, 0.2, 0.5, 1, 2, 5, 10], COUNT: [2, 6]}, measures=[str(path)], figure={"y": COUNT})
    folder = here / f"{name}{shift}"
    return store_measured(folder, scenario, lambda point: [LAWS[name](point, random) for _ in range(trials)])


def test_numbers_are_summarised_drawn_fitted_and_compared(here):
    folder, other = (folder_of(here, "number", shift=shift) for shift in (0, 1))
    printed, found = called("summarize", folder, "--of", "number"), read("summarize", folder, "--of", "number")
    assert "censored" not in printed
    assert "median" in printed
    assert len(found) == 14
    means = [row["mean"] for row in found]
    for form, column in (("curves", "estimate"), ("map", "estimate"), ("violins", "mean")):
        call("plot", folder, "--of", "number", "--form", form, "--to", form)
        drawn = [float(row[column]) for row in rows(here / f"{form}.csv")]
        assert sorted(drawn) == pytest.approx(sorted(means), rel=1e-5)
    fits = read("fit", folder, "--of", "number")
    assert [fit["peak"]["place"]["value"] for fit in fits] == pytest.approx([10**0.2] * 2, rel=0.15)
    assert "peak at" in called("fit", folder, other, "--of", "number")
    compared = read("compare", folder, other, "--of", "number")
    assert (compared["of"], compared["compared"]) == ("number", 14)
    assert "Over all: B / A = " in called("compare", folder, other, "--of", "number")


def test_truth_values_are_shares(here):
    folder = folder_of(here, "truth", trials=40)
    printed, (row, *_) = called("summarize", folder, "--of", "truth"), read("summarize", folder, "--of", "truth")
    assert "share" in printed
    assert "median" not in printed
    assert (row["is_share"], row["median"], row["unit"]) == (True, None, "")
    called("plot", folder, "--of", "truth", "--form", "curves", "--to", "curves")
    assert rows(here / "curves.csv")[0]["statistic"] == "share"
    compared = read("compare", folder, "--of", "truth", "--axis", f"{COUNT}=2,6")
    assert {point["statistic"] for point in compared["points"]} == {"share"}
    assert compared["p_value"] < 0.001
    assert 0.2 < compared["difference"]["value"] < 0.6
    assert "the measure is a truth value, and the search is in logarithms" in called("fit", folder, "--of", "truth")


def test_series_are_summarised_and_drawn_over_the_cycles(here):
    folder = folder_of(here, "course")
    found = read("summarize", folder, "--of", "course")
    assert found[0]["cycle"] == [1, 2, 3, 4, 5, 6]
    assert found[0]["trials"][:3] == [25, 25, 25]
    assert found[0]["trials"][5] < 25
    printed = called("summarize", folder, "--of", "course")
    assert all(said in printed for said in ("course (cm) at cycles", "those that reach the cycle"))
    plotted = call("plot", folder, "--of", "course", "--width-cm", 12, "--to", "course")
    assert (plotted.exit_code, plotted.stderr) == (0, "note: no bands where fewer than 5 trials have a value\n")
    drawn = rows(here / "course.csv")
    assert float(drawn[1]["mean"]) == pytest.approx(found[0]["mean"][1], rel=1e-5)
    assert (drawn[1]["cycle"], drawn[1]["trials"]) == ("2", "25")


def test_plan_says_how_many_trials_show_a_difference_of_a_measure(here):
    numbers = "plan", folder_of(here, "number"), "--of", "number", "--difference", 5
    assert f"{numbers[1]}: number (cm)" in " ".join(called(*numbers).split())
    assert "a difference of 5 % in 80 % of all cases" in called(*numbers)
    found = read(*numbers)
    assert (found["of"], found["unit"], found["is_of_shares"], len(found["points"])) == ("number", "cm", False, 14)
    truths = "plan", folder_of(here, "truth", trials=40), "--of", "truth"
    assert "a difference of 20 percentage points in 80 % of all cases" in called(*truths)
    assert all(point["trials"] > 20 and point["spread"] is None for point in read(*truths)["points"])
    assert "no share can differ by so much" in called(*truths, "--difference", 99)


def test_nothing_speaks_of_t_sync_where_no_oscillator_is_or_trials_end_at_a_time_or_by_a_measure(here):
    wandering = ["--set", "robots.0={controller: obstacle_avoidance, count: 3}", "--set", "stop.max_time_s=6"]
    table = called("run", "thesis", *wandering, "--measure", "near_walls")
    assert not any(word in table for word in ("T_sync", "censored", "order"))
    assert "near_walls" in table
    trial = read("run", "thesis", *wandering)
    assert (trial["t_sync_cycles"], trial["censored"], trial["order_parameter"]) == (None, None, None)
    asked = ["--measure", "cluster_count", "--measure", "mean_squared_displacement"]
    result = call("run", "thesis", *wandering, *asked, "--trials", "2", "--out", "run", "--workers", "1")
    assert result.exit_code == 0
    assert "censored" not in result.stdout + result.stderr + called("status", "run")
    assert "Cycles are 5 s long where" in called("summarize", "run", "--of", "mean_squared_displacement")
    called("export", "run", "--to", "t.csv")
    assert [row["censored"] for row in rows(here / "t.csv")] == ["", ""]
    stop = ["--set", "stop={when: order_parameter > 0.1, max_cycles: 9}"]
    table = called("run", "particles", *stop, "--measure", "order_parameter")
    assert "order_parameter" in table
    assert not any(word in table for word in ("T_sync", "censored"))
