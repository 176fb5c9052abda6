"""What is read from a run folder: every result of each point, how far the run is, and nothing written by reading."""

import math
import os
import shutil
import sqlite3
import sys
from contextlib import closing, contextmanager
from pathlib import Path

import numpy as np
import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs import database, export, reader
from epuck_sim.runs.compatibility import stored_point
from epuck_sim.runs.database import ENTER_POINT
from epuck_sim.runs.reader import Failure, Status, SweepTrials, TrialsByOrigin, read_points, read_status
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.util.provenance import host, versions
from tests.runs.made_folders import ended, in_memory, store, sweep
from tests.runs.test_store import COUNT, DATABASE, DEMO, SPEED, contents, fill, outcome, put, scenario_of

MADE_BY = {**versions(), "host": host()}


def test_times_are_the_cycles_at_which_trials_ended_and_say_whether_synchrony_was_observed(tmp_path) -> None:
    late = {"t_sync_cycles": None, "censored": True, "cycles": 40}
    ended = (1, 2, {"t_sync_cycles": 7, "cycles": 7}), (3, 0, {"t_sync_cycles": 0, "cycles": 0})
    put(tmp_path, *ended, (1, 0, late), (1, 1, {"error": "gone"}))
    none, some, still_none, one = read_points(tmp_path)
    assert some.times.tolist() == [40.0, 7.0]
    assert some.observed.tolist() == [False, True]
    assert (one.times.tolist(), one.observed.tolist()) == ([0.0], [True])
    for empty in (none, still_none):
        assert empty.times.shape == empty.observed.shape == (0,)
    for each in (none, some, still_none, one):
        assert (each.times.dtype, each.observed.dtype) == (np.float64, np.bool_)


def test_the_status_counts_points_trials_results_censored_and_failed(tmp_path) -> None:
    ended = (0, 0, {"wall_s": 0.5}), (0, 1, {"wall_s": 0.25, "t_sync_cycles": None, "censored": True})
    failed = (3, 1, {"error": "RuntimeError: second"}), (1, 2, {"error": "RuntimeError: first"})
    found = put(tmp_path, *ended, *failed)
    assert read_status(tmp_path) == Status(
        scenario="demo",
        points=4,
        trials=12,
        stored=2,
        censored=1,
        failed=[
            Failure(1, 2, found[1].seed(2), "RuntimeError: first"),
            Failure(3, 1, found[3].seed(1), "RuntimeError: second"),
        ],
        wall_s=0.75,
        versions=[TrialsByOrigin(**MADE_BY, trials=4)],
        at_work=None,
    )


def test_the_status_tells_trials_apart_by_the_versions_and_hosts_that_made_them(tmp_path) -> None:
    found = points(DEMO)
    with Store(tmp_path, DEMO, found) as store:
        for trial, changed in enumerate(({}, {}, {"host": "elsewhere"})):
            ended = outcome(found[0], trial)
            store.add([ended._replace(provenance={**ended.provenance, **changed})])
    here, elsewhere = sorted(read_status(tmp_path).versions, key=lambda row: -row.trials)
    assert (here.made_by, here.trials) == (MADE_BY, 2)
    assert (elsewhere.made_by, elsewhere.trials) == ({**MADE_BY, "host": "elsewhere"}, 1)


def test_the_status_is_of_the_scenario_that_was_run_last(tmp_path) -> None:
    fill(tmp_path)
    grown = load_scenario(DEMO, ["name=grown", "trials=7"])
    with Store(tmp_path, grown, points(grown)):
        pass
    status = read_status(tmp_path)
    assert (status.scenario, status.trials, status.stored) == ("grown", 28, 12)


def test_while_a_run_is_at_work_its_committed_trials_are_read_and_nothing_is_written_and_it_is_named(tmp_path) -> None:
    found = points(DEMO)
    with Store(tmp_path, DEMO, found) as store:
        for trial in range(3):
            store.add([outcome(found[0], trial)])
            before = contents(tmp_path)
            assert read_points(tmp_path)[0].times.tolist() == [*range(trial + 1)]
            assert read_status(tmp_path).stored == trial + 1
            after = contents(tmp_path)
            assert after.keys() == before.keys()
            changed = {name for name in before if after[name] != before[name]}
            assert changed <= {f"{DATABASE}-shm"}  # readers' marks
        assert read_status(tmp_path).at_work == f"process {os.getpid()} on {host()}"
    assert read_status(tmp_path).at_work is None


class Grown:
    """A connection to a run folder's database, to which another process adds a point with a trial after one query."""

    def __init__(self, connection: sqlite3.Connection, path: Path) -> None:
        self._connection, self._path = connection, path

    def execute(self, query: str, *values):
        cursor = self._connection.execute(query, *values)
        point = stored_point(points(scenario_of({"grid": {COUNT: [9], SPEED: [9]}}))[0])._replace(number=4)
        with closing(sqlite3.connect(self._path)) as other, other:
            row = {name: 1 for _, name, *_ in other.execute("PRAGMA table_info(trials)")} | {"point": point.key}
            row |= {"error": None}
            other.execute(ENTER_POINT, point)
            other.execute(f"INSERT OR IGNORE INTO trials VALUES ({', '.join('?' * len(row))})", [*row.values()])
        return cursor


@pytest.mark.parametrize(
    ("module", "read", "expected"),
    [
        (reader, lambda folder: [len(point.times) for point in read_points(folder)], [3, 3, 3, 3]),
        (reader, lambda folder: read_status(folder)[1:4], (4, 12, 12)),
        (export, lambda folder: export.export(folder, folder / "table.csv"), 0),
    ],
    ids=["points", "status", "export"],
)
def test_a_folder_that_grows_while_it_is_read_is_read_as_it_was(tmp_path, monkeypatch, module, read, expected) -> None:
    fill(tmp_path)
    reading = module.reading

    @contextmanager
    def reading_while_it_grows(folder: Path):
        with reading(folder) as connection:
            yield Grown(connection, folder / DATABASE)

    with closing(sqlite3.connect(tmp_path / DATABASE)) as run_at_work:
        run_at_work.execute("PRAGMA journal_mode = WAL")
        monkeypatch.setattr(module, "reading", reading_while_it_grows)
        assert read(tmp_path) == expected
        monkeypatch.undo()
        assert read_status(tmp_path)[1:4] == (5, 15, 13)


@pytest.mark.parametrize("read", [read_points, read_status])
def test_a_database_is_checked_once_however_often_it_is_read_and_written(tmp_path, monkeypatch, read) -> None:
    fill(tmp_path / "made")
    shutil.copytree(tmp_path / "made", tmp_path / "run")
    checked = []
    check = database._damage
    monkeypatch.setattr(database, "_damage", lambda path: checked.append(path) or check(path))
    for _ in range(2):
        read(tmp_path / "run")
        fill(tmp_path / "run", load_scenario(DEMO, ["trials=4"]))
        read(tmp_path / "made")  # which this process has made
    assert checked == [tmp_path / "run" / DATABASE]
    (tmp_path / "run" / DATABASE).touch()
    read(tmp_path / "run")
    assert len(checked) == 2


FOUR = sweep({COUNT: [3, 5], SPEED: [1, 2]}, trials=2)


def half_censored(point):
    return ended([10 * point.axes[COUNT], 90], [True, False])


def test_there_is_a_row_for_each_trial_in_the_order_of_the_sweep(tmp_path) -> None:
    read = read_points(store(tmp_path / "run", FOUR, half_censored))
    frame = read.to_pandas()
    assert [*frame.columns] == ["point", COUNT, SPEED, "seed", "cycles", "censored", "t_sync_cycles"]
    assert frame["point"].tolist() == [0, 0, 1, 1, 2, 2, 3, 3]
    assert frame[COUNT].tolist() == [3] * 4 + [5] * 4
    assert frame["seed"].tolist() == [seed for point in read for seed in point.seeds]
    assert frame["cycles"].tolist() == [30, 90, 30, 90, 50, 90, 50, 90]
    assert frame["censored"].tolist() == [False, True] * 4
    assert frame["t_sync_cycles"].mean() == 40  # pandas leaves out what is NaN
    assert math.isnan(frame["t_sync_cycles"][1])


def test_the_measure_asked_for_is_a_column_and_trials_without_t_sync_are_neither_censored_nor_not() -> None:
    without = {"has_t_sync": False, "measured": (0.5, [1, 2]), "of": "order"}
    points = SweepTrials(
        point._replace(observed=point.observed & False, **without) for point in in_memory(FOUR, half_censored)
    )
    frame = points.to_pandas()
    assert frame["order"].tolist() == [0.5, [1, 2]] * 4
    assert frame["censored"].tolist() == [None] * 8
    assert frame["t_sync_cycles"].isna().all()
    assert points._repr_html_().count("<td>-</td>") == 4


def test_without_pandas_it_says_what_is_missing(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(EpuckSimError, match="to_pandas needs pandas, which is not installed: pip install pandas"):
        SweepTrials(in_memory(FOUR, half_censored)).to_pandas()
