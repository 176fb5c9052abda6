"""Sweeps that end by themselves: which trials they run, however they are run."""

import json
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs.reader import read_points, read_status
from epuck_sim.runs.share import Share
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.measured import measure_t_sync
from epuck_sim.statistics.sequential import Precision, look_contrast, look_interval, look_sizes
from epuck_sim.sweep.executors import local_pool
from epuck_sim.sweep.looks import Looks
from epuck_sim.sweep.run import run_sweep
from tests.cli.commands import call
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import Stopped, short_sweep, stopper, table

MOST, ASKED, MORE, TOO_MUCH = 67, "24%", "19%", "14%"
"""Most trials at a point, and what is asked: some points end sooner than others, and the last is too much for some."""


def four_points(folder: Path, *changes: str) -> Scenario:
    """Return a sweep of 4 points, with so many trials."""
    return load_scenario(short_sweep(folder, MOST), changes, ["robots.0.parameters.speed_cm_s=4,12"])


@pytest.fixture(scope="module")
def all_trials(tmp_path_factory) -> Path:
    """Return the run folder of the plain sweep, with all trials at all points."""
    folder = tmp_path_factory.mktemp("all_trials")
    run_sweep(four_points(folder), folder / "run", pool_here)
    return folder / "run"


def expected(
    all_trials: Path, asked: str, ended_well: Callable[[int], bool] = lambda _: True
) -> tuple[list[int], list[tuple]]:
    """Return where each point of the plain sweep would end, and the rows until there, if these seeds end well."""
    ends: dict[str, int] = {}
    for point in read_points(all_trials):
        is_kept = np.array([ended_well(seed) for seed in point.seeds])
        for size in look_sizes(MOST):
            times, observed = (each[:size][is_kept[:size]] for each in (point.times, point.observed))
            found = look_interval(measure_t_sync(point._replace(times=times, observed=observed)), MOST)
            ends[point.key] = size
            if Precision.parse(asked).width(found) <= 1:
                break
    return [*ends.values()], [row for row in table(all_trials) if row[1] < ends[row[0]]]


def test_the_trials_are_the_first_ones_of_a_plain_sweep_to_the_first_narrow_look(tmp_path, all_trials) -> None:
    scenario, folder = four_points(tmp_path), tmp_path / "run"
    for asked in (ASKED, MORE):  # a smaller one goes on in the folder
        ends, rows = expected(all_trials, asked)
        assert len(set(ends)) > 1
        looks = Looks(asked)
        progress = run_sweep(scenario, folder, pool_here, until=looks)
        assert table(folder) == rows
        assert (progress.trials, progress.stored) == (sum(ends), sum(ends))
        assert read_status(folder)[2:4] == (sum(ends), sum(ends))
        assert [row.cells["trials"] for row in looks.table().rows] == ends
    run_sweep(scenario, folder, pool_here)  # so does the plain sweep
    assert table(folder) == table(all_trials)
    again = run_sweep(scenario, folder, pool_here, until=Looks(ASKED))  # what else is stored changes nothing
    assert (again.trials, again.ended) == (sum(expected(all_trials, ASKED)[0]), 0)
    assert read_status(folder)[2:4] == (4 * MOST, 4 * MOST)


def test_trials_that_fail_are_looked_at_as_ended_and_left_out_of_intervals(tmp_path, all_trials) -> None:
    measure = tmp_path / "picky.py"
    measure.write_text("def picky(simulation):\n    return 1 // (simulation.seed % 3)\n")
    looks, scenario = Looks(ASKED), four_points(tmp_path, f"measures=[{measure}]")
    progress = run_sweep(scenario, tmp_path / "run", pool_here, until=looks)
    ends, rows = expected(all_trials, ASKED, lambda seed: seed % 3 > 0)
    assert [row.cells["trials"] for row in looks.table().rows] == ends
    assert 0 < progress.failed == sum(row[5] % 3 == 0 for row in rows)
    assert progress.stored + progress.failed == progress.trials == sum(ends)


def test_workers_and_interruptions_do_not_change_what_is_run(tmp_path, all_trials) -> None:
    scenario, folder = four_points(tmp_path), tmp_path / "run"
    ends, rows = expected(all_trials, ASKED)
    with pytest.raises(Stopped):
        run_sweep(scenario, folder, partial(local_pool, 2), stopper(sum(ends) - 30), until=Looks(ASKED))
    assert set(table(folder)) < set(rows)
    run_sweep(scenario, folder, pool_here, until=Looks(ASKED))
    assert table(folder) == rows


PERIOD, SPEED = "robots.0.parameters.period_s", "robots.0.parameters.speed_cm_s"


@pytest.mark.parametrize(("asked", "name"), [("33%", "ratio"), ("2.65", "difference")])
def test_points_of_a_contrast_end_together_at_the_first_look_at_which_all_of_it_is_narrow(
    tmp_path, all_trials, asked, name
) -> None:
    looks, folder = Looks(asked, PERIOD), tmp_path / "run"
    progress = run_sweep(four_points(tmp_path), folder, pool_here, until=looks)
    precision, plain = Precision.parse(asked), {point.key: point for point in read_points(all_trials)}
    rows = dict(zip([point.key for point in read_points(folder)], looks.table().rows, strict=True))
    ends = {key: row.cells["trials"] for key, row in rows.items()}
    for speed in (4, 12):
        pair = [key for key, row in rows.items() if row.axes[SPEED] == speed]
        for size in look_sizes(MOST):
            times = [
                plain[key]._replace(times=plain[key].times[:size], observed=plain[key].observed[:size]) for key in pair
            ]
            first, other = (look_interval(measure_t_sync(each), MOST) for each in times)
            found = look_contrast(first, other, is_relative=name == "ratio")
            if precision.width(found) <= 1:
                break
        assert [ends[key] for key in pair] == [size, size]
        assert [rows[key].cells[name] for key in pair] == [None, found]
        assert rows[pair[1]].cells["is_narrow"] == (precision.width(found) <= 1)
    assert len(set(ends.values())) > 1
    assert table(folder) == [row for row in table(all_trials) if row[1] < ends[row[0]]]
    assert progress.trials == sum(ends.values())


def test_the_command_says_how_narrow_intervals_are(all_trials) -> None:
    ends, _ = expected(all_trials, TOO_MUCH)
    text, as_json = (call("run", f"{all_trials}/", "--until", TOO_MUCH, *words) for words in ([], ["--json"]))
    said = json.loads(as_json.stdout)["until"]
    assert [row["trials"] for row in said] == ends
    narrow = sum(row["is_narrow"] for row in said)
    assert 0 < narrow < 4
    for row in said:
        assert row["half_width"] == pytest.approx((row["mean_high"] - row["mean_low"]) / 2 / row["mean"])
        assert row["is_narrow"] == (row["half_width"] <= 0.14)
    assert f"Narrow enough: {narrow} of 4 points; the others have {MOST} trials" in text.stdout
    assert f"{narrow} of 4 points narrow enough" in text.stderr


def test_a_share_has_too_few_trials_for_a_look(tmp_path) -> None:
    scenario = load_scenario(short_sweep(tmp_path, 20))
    with pytest.raises(Stopped):
        run_sweep(scenario, tmp_path / "run", pool_here, stopper(0), share=Share(1, 20))
    with pytest.raises(StoreError, match="share 1/20; --until looks at all trials of a point"):
        run_sweep(scenario, tmp_path / "run", pool_here, until=Looks("10%"))
