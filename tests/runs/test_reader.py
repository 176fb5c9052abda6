"""What is read from a run folder, and exported from it, and that nothing is written by reading."""

import json
import math
import os
import random
import shutil
import sqlite3
import sys
from contextlib import closing, contextmanager
from pathlib import Path
from typing import BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs import database, export as exporting, reader
from epuck_sim.runs.compatibility import stored_point
from epuck_sim.runs.database import ENTER_POINT
from epuck_sim.runs.export import WRITERS, export
from epuck_sim.runs.reader import Failure, Status, SweepTrials, TrialsByOrigin, each_point, read_points, read_status
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario, points
from epuck_sim.statistics.statistic import summarize
from epuck_sim.sweep.run import run_sweep
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.util.provenance import host, versions
from tests.cli.commands import contents
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, DATABASE, DEMO, SPEED, ended, fill, outcome, put, scenario_of, store
from tests.sweep.pool_here import pool_here

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


def test_points_are_read_one_after_the_other_a_block_of_trials_at_a_time(tmp_path, monkeypatch) -> None:
    fill(tmp_path, DEMO)
    every = read_points(tmp_path)
    monkeypatch.setattr(reader, "BLOCK", 2)
    each = each_point(tmp_path)
    assert next(each).times.tolist() == every[0].times.tolist()
    both = ([(p.times.tolist(), p.observed.tolist(), [*p.seeds]) for p in found] for found in (each, every[1:]))
    assert next(both) == next(both)
    assert summarize(each_point(tmp_path)) == summarize(every)


def test_the_status_counts_results_and_tells_trials_apart_by_what_made_them_under_the_latest_scenario(tmp_path) -> None:
    ended = (0, 0, {"wall_s": 0.5}), (0, 1, {"wall_s": 0.25, "t_sync_cycles": None, "censored": True})
    failed = (3, 1, {"error": "RuntimeError: second"}), (1, 2, {"error": "RuntimeError: first"})
    found = put(tmp_path, *ended, *failed)
    places = ((1, 2, "RuntimeError: first"), (3, 1, "RuntimeError: second"))
    failures = [Failure(point, trial, found[point].seed(trial), error) for point, trial, error in places]
    whole = {"scenario": "demo", "points": 4, "trials": 12, "axes": (COUNT, SPEED), "at_work": None}
    done = {"stored": 2, "censored": 1, "failed": failures, "wall_s": 0.75}
    assert read_status(tmp_path) == Status(**whole, **done, versions=[TrialsByOrigin(**MADE_BY, trials=4)])
    found = points(DEMO)
    with Store(tmp_path / "other", DEMO, found) as store:
        for trial in range(3):
            ended = outcome(found[0], trial)
            made = ended.provenance if trial < 2 else (*ended.provenance[:-1], "elsewhere")
            store.add([ended._replace(provenance=made)])
    here, elsewhere = sorted(read_status(tmp_path / "other").versions, key=lambda row: -row.trials)
    assert (here.made_by, here.trials) == (MADE_BY, 2)
    assert (elsewhere.made_by, elsewhere.trials) == ({**MADE_BY, "host": "elsewhere"}, 1)
    grown = load_scenario(DEMO, ["name=grown", "trials=7"])
    with Store(tmp_path / "other", grown, points(grown)):
        pass
    status = read_status(tmp_path / "other")
    assert (status.scenario, status.trials, status.stored) == ("grown", 28, 3)


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
            columns = [name for _, name, *_ in other.execute("PRAGMA table_info(trials)")]
            row = dict.fromkeys(columns, 1) | {"point": point.key, "error": None}
            other.execute(ENTER_POINT, point)
            other.execute(f"INSERT OR IGNORE INTO trials VALUES ({', '.join('?' * len(row))})", [*row.values()])
        return cursor


@pytest.mark.parametrize(
    ("module", "read", "expected"),
    [
        (reader, lambda folder: [len(point.times) for point in read_points(folder)], [3, 3, 3, 3]),
        (reader, lambda folder: read_status(folder)[1:4], (4, 12, 12)),
        (exporting, lambda folder: export(folder, folder / "table.csv"), None),
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


FOUR = made_folders.sweep({COUNT: [3, 5], SPEED: [1, 2]}, trials=2)


def half_censored(point):
    return ended([10 * point.axes[COUNT], 90], [True, False])


def test_tables_have_a_row_for_each_trial_none_censored_without_t_sync_and_need_pandas(tmp_path, monkeypatch) -> None:
    frame = read_points(store(tmp_path / "run", FOUR, half_censored)).to_pandas()
    export(tmp_path / "run", tmp_path / "trials.parquet")
    assert frame.equals(pq.read_table(tmp_path / "trials.parquet").to_pandas())
    assert frame["t_sync_cycles"].mean() == 40  # pandas leaves out what is NaN
    assert math.isnan(frame["t_sync_cycles"][1])
    made = made_folders.in_memory(FOUR, half_censored)
    points = SweepTrials(point._replace(observed=point.observed & False, has_t_sync=False) for point in made)
    assert points._repr_html_().count("<td>-</td>") == 4
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(EpuckSimError, match="to_pandas needs pandas, which is not installed: pip install pandas"):
        points.to_pandas()


RESULT = {"seed": pa.int64(), "t_sync_cycles": pa.int64(), "censored": pa.bool_()}
RESULT |= dict.fromkeys(("order_parameter", "simulated_s", "wall_s"), pa.float64())
RESULT |= dict.fromkeys(("steps", "cycles", "point", "trial"), pa.int64())
MAKING = ["epuck_sim", "pymunk", "numba", "numpy", "python", "host"]


def exported(folder: Path) -> tuple[pa.Table, list[dict[str, str]]]:
    parquet, text = (folder.with_name(f"results.{kind}") for kind in ("parquet", "csv"))
    for target in (parquet, text):
        export(folder, target)
    return pq.read_table(parquet), made_folders.rows(text)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_an_older_table_stays_and_nothing_else_is_left_where_writing_fails(folder, monkeypatch, ending: str) -> None:
    fill(folder)
    target = folder.with_name(f"results{ending}")
    target.write_text("older")

    def fail(_: pa.Table, file: BinaryIO) -> None:
        file.write(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setitem(WRITERS, ending, fail)
    with pytest.raises((OSError, EpuckSimError), match="No space left"):
        export(folder, target)
    assert target.read_text() == "older"
    assert sorted(path.name for path in folder.parent.iterdir()) == [target.name, folder.name]


def test_every_row_is_a_trial_as_it_was_stored_in_order_of_point_and_trial(folder, monkeypatch) -> None:
    monkeypatch.setattr("epuck_sim.runs.export.BLOCK", 3)
    found = points(DEMO)
    censored = {"t_sync_cycles": None, "censored": True}
    ended = [outcome(point, trial, **(censored if trial == 2 else {})) for point in found for trial in range(3)]
    with Store(folder, DEMO, found) as store:
        for each in random.Random(1).sample(ended, len(ended)):
            store.add([each])
    expected = []
    for each in ended:
        numbers = {name: getattr(each, name) for name in RESULT}
        place = {"point": each.point, "trial": each.trial}
        expected.append({**found[each.point].axes, **numbers, **place, **MADE_BY})
    table, texts = exported(folder)
    assert table.to_pylist() == expected
    read = [
        {name: text if name in MAKING else json.loads(text or "null") for name, text in row.items()} for row in texts
    ]
    assert read == expected  # JSON's numbers, true and false are those of the CSV


def test_columns_are_there_without_a_result_and_values_under_their_own_keys_however_points_list_them(folder) -> None:
    put(folder)
    table, texts = exported(folder)
    assert table.num_rows == 0
    assert table.column_names == [COUNT, SPEED, *RESULT, *MAKING]
    assert {name: table.schema.field(name).type for name in RESULT} == RESULT
    assert texts == []
    assert folder.with_name("results.csv").read_text().startswith(f'"{COUNT}","{SPEED}","seed"')
    width = made_folders.WIDTH
    fill(folder.with_name("listed"), scenario_of({"points": [{COUNT: 2, width: 50}, {width: 60, COUNT: 3}]}, trials=1))
    table, _ = exported(folder.with_name("listed"))
    assert (table[COUNT].to_pylist(), table[width].to_pylist()) == ([2, 3], [50, 60])


@pytest.mark.parametrize(
    ("key", "values", "expected"),
    [
        (COUNT, [2, 3], [2, 3]),
        (SPEED, [1, 0.5], [1.0, 0.5]),
        ("stop.max_time_s", [None, 5], [None, 5]),
        ("stop.max_time_s", [None], [None]),
        ("stop.metric", ["complex", "reference"], ["complex", "reference"]),
        ("noise", ["off", {"wheel_speed": 0.5}], ["off", '{"wheel_speed": 0.5}']),
        ("noise", [False, {"wheel_speed": 0.5}], ["false", '{"wheel_speed": 0.5}']),
        ("robots.0.camera.range_cm", [7, None, 8.5], [7.0, None, 8.5]),
        ("arena.obstacles", [[]], ["[]"]),
    ],
    ids=str,
)
def test_axis_values_keep_their_kinds_and_are_the_same_in_text(folder, key: str, values: list, expected: list) -> None:
    fill(folder, scenario_of({"grid": {key: values}}, trials=1))
    table, texts = exported(folder)
    column = table[key].to_pylist()
    assert column == expected
    in_text = ["" if value is None else value if isinstance(value, str) else f"{value:g}" for value in column]
    assert [row[key] for row in texts] == in_text


SCENARIO = {
    "trials": 4,
    "stop": {"max_cycles": 4, "order_parameter": None},
    "robots": [{"count": 3}],
    "faults": [{"kind": "ring_dead", "count": 1, "per_hour": 360, "mean_s": 3}],
    "schedule": [{"at_cycle": 2, "set": {"robots.0.parameters.speed_cm_s": 0}}],
}


def test_events_are_stored_read_and_exported_to_the_bit(tmp_path):
    run_sweep(load_scenario(SCENARIO), tmp_path, pool_here)
    (point,) = read_points(tmp_path)
    (only,) = points(load_scenario(SCENARIO))
    alone = tuple(run_trial(simulate(only.scenario, only.seed(trial))).events for trial in range(4))
    assert point.events == alone
    assert reader.read_outcome(tmp_path, 0, 1) == (4, None)
    assert {event.source for events in alone for event in events} == {"faults.0", "schedule.0"}
    export(tmp_path, tmp_path / "out.csv")
    table = pyarrow.csv.read_csv(tmp_path / "out.csv").to_pydict()
    expected = [[{**event._asdict(), "robots": list(event.robots)} for event in events] for events in alone]
    assert [json.loads(text) for text in table["events"]] == expected


def test_what_changes_is_resampled_apart_and_its_defaults_leave_seeds_as_they_were(tmp_path):
    def seed(name, **changes):
        fill(tmp_path / name, load_scenario({**DEMO.model_dump(), **changes}))
        return read_points(tmp_path / name)[0].seed

    plain = seed("plain")
    assert plain == 4111783006597517648  # as before there were signals, faults and schedules
    assert seed("same", faults=[], schedule=[]) == plain
    assert seed("faulty", faults=[{"kind": "ring_dead"}]) != plain
    assert seed("scheduled", schedule=[{"at_s": 1, "displace": {"by_cycles": "random"}}]) != plain
    assert seed("silent", contact={"robots": False}) != plain
