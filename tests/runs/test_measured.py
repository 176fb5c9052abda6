"""Measures of sweeps: values to the bit however they are run, never those of two, and some that are added later."""

import json
import tempfile
from contextlib import nullcontext, suppress
from functools import partial
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim.errors import StoreError
from epuck_sim.runs.database import reading
from epuck_sim.runs.export import export
from epuck_sim.runs.reader import read_points, read_status
from epuck_sim.runs.store import Store, difference
from epuck_sim.scenario.loader import load_scenario, points
from epuck_sim.sweep.run import run_sweep
from epuck_sim.trial.model import run_trial, simulate
from tests.cli.commands import call, called
from tests.measures.files import COUNTER, write
from tests.runs.made_folders import DEMO, edit, outcome, put, refusal, rows, stored
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import Stopped, agents_sweep, stopper, table

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture(scope="module")
def mine(tmp_path_factory) -> Path:
    course = "\ndef course(simulation): return []\n"
    settled = "def settled(simulation): return bool(simulation.positions()[0, 0] > 50)\n"
    return write(tmp_path_factory.mktemp("measures") / "mine.py", COUNTER + course + settled)


@pytest.fixture
def counter(mine) -> str:
    return f"{mine}:Counter"


def scenario(*measures):
    return load_scenario({"name": "demo", "trials": 3, "measures": list(measures)})


def fill(folder: Path, loaded, values: list[dict]) -> None:
    put(folder, *((0, trial, {"measures": measures}) for trial, measures in enumerate(values)), scenario=loaded)


VALUES = [1 / 3, None, 2.0]
SERIES = [[0.1, None, 1 / 3], [], [1, 0.25]]


def test_values_come_back_to_the_bit_and_are_columns_of_numbers_and_lists_in_exported_tables(folder, mine, tmp_path):
    both = [{"Counter": value, "course": series} for value, series in zip(VALUES, SERIES, strict=True)]
    fill(folder, scenario(f"{mine}:Counter", f"{mine}:course"), both)
    (plain,), (counter,), (course,) = (read_points(folder, of) for of in (None, "Counter", "course"))
    assert plain.measured == ()
    assert counter.measured == tuple(VALUES)
    assert course.measured == tuple(SERIES)
    assert counter.seed == plain.seed
    for name in ("t.parquet", "t.csv"):
        export(folder, tmp_path / name)
    table = pq.read_table(tmp_path / "t.parquet")
    assert table.column_names[-2:] == ["measures.Counter", "measures.course"]
    assert table["measures.Counter"].to_pylist() == VALUES
    assert table["measures.course"].type == pa.list_(pa.float64())
    assert table["measures.course"].to_pylist() == SERIES
    written = rows(tmp_path / "t.csv")
    assert [float(row["measures.Counter"]) if row["measures.Counter"] else None for row in written] == VALUES
    assert [json.loads(row["measures.course"]) for row in written] == SERIES


@pytest.mark.parametrize(
    ("values", "kind"),
    [
        ([1, 2], pa.int64()),
        ([1, 2.5], pa.float64()),
        ([True, None], pa.bool_()),
        ([None, None], pa.float64()),
        ([[1], [2, None]], pa.list_(pa.int64())),
        ([[True], None], pa.list_(pa.bool_())),
        ([[True], [3, None]], pa.list_(pa.float64())),
        ([3, True], pa.float64()),
        ([True, 3], pa.float64()),
    ],
)
def test_a_column_has_the_kind_of_its_values(values, kind, folder, counter, tmp_path):
    fill(folder, scenario(counter), [{"Counter": value} for value in values])
    export(folder, tmp_path / "t.parquet")
    column = pq.read_table(tmp_path / "t.parquet")["measures.Counter"]
    assert (column.type, column.to_pylist()) == (kind, values)


def test_a_folder_is_refused_to_other_measures_but_not_if_one_has_got_a_parameter_since(folder, mine, tmp_path):
    own = write(tmp_path / "mine.py", mine.read_text())
    counting, otherwise = (scenario({f"{own}:Counter": {"offset": offset}}) for offset in (1, 2))
    fill(folder, counting, [{"Counter": 1.0}])
    fill(folder, counting, [])
    other = refusal(folder, otherwise)
    assert "another measure Counter; give another folder: offset: 1 in the folder, 2 now" in other
    assert "holds results of the measure Counter, which is missing now; give it again" in refusal(folder, scenario())
    found = points(counting)
    with Store(folder, counting, found) as store:
        write(own, mine.read_text() + "\n# edited\n")
        with pytest.raises(StoreError, match=r"mine\.py: was changed while this run was at work"):
            store.add([outcome(found[0], 1, measures={"Counter": 2.0})])
    edited = refusal(folder, scenario({f"{own}:Counter": {"offset": 1}}))
    assert "another measure Counter; give another folder: measure: 'mine.py:Counter with digest " in edited
    assert [point.measured for point in read_points(folder, "Counter")] == [(1.0,)]
    shipped = tmp_path / "shipped"
    plain, later = scenario("stays_above"), scenario({"stays_above": {"from_cycle": 30}})
    fill(shipped, plain, [{"stays_above": True}])
    edit(shipped, """UPDATE points SET measures = json_remove(measures, '$."stays_above".from_cycle')""")
    fill(shipped, plain, [])
    said = "another measure stays_above; give another folder: from_cycle: 1 in the folder, 30 now"
    assert said in refusal(shipped, later)


def run(folder, *measures):
    return run_sweep(agents_sweep(measures), folder, pool_here)


def everything(folder):
    return [{**row, "wall_s": None, "checksum": None} for row in stored(folder)]


def test_a_run_that_was_stopped_goes_on(folder, counter):
    run(folder, "near_walls")
    counter = {counter: {"as": "Zähler"}}
    with pytest.raises(Stopped):
        run_sweep(agents_sweep(["near_walls", counter]), folder, pool_here, stopper(1))
    status = read_status(folder)
    assert (status.stored, status.unmeasured, status.failed) == (6, 5, [])
    assert "5 of these results lack measures that were added" in called("status", folder)
    assert sorted(point.measured.count(None) for point in read_points(folder, "Zähler")) == [2, 3]
    progress = run(folder, "near_walls", counter)
    assert (progress.ended, progress.stored, read_status(folder).unmeasured) == (5, 6, 0)


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("cycles", 5, "cycles is 5 in the folder, 6 now"),
        ("order_parameter", 0.5, "order_parameter is 0.5 in the folder, 0."),
        ("measured", '{"near_walls": 0.123}', "near_walls is 0.123 in the folder, "),
    ],
)
def test_a_trial_that_is_no_longer_the_same_is_reported_and_stays_as_it_is(folder, counter, column, value, said):
    run(folder, "near_walls")
    edit(folder, f"UPDATE trials SET {column} = ? WHERE trial = 1", value)
    before = everything(folder)
    progress = run(folder, "near_walls", counter)
    assert (progress.stored, progress.failed) == (4, 2)
    status = read_status(folder)
    assert (status.stored, status.unmeasured) == (6, 2)
    assert [(failure.point, failure.trial) for failure in status.failed] == [(0, 1), (1, 1)]
    assert all(said in failure.error for failure in status.failed)
    kept = [row for row in everything(folder) if row["trial"] == 1]
    assert [{**row, "measuring_error": None} for row in kept] == [row for row in before if row["trial"] == 1]
    assert [point.measured for point in read_points(folder, "Counter")] == [(6.0, None, 6.0)] * 2
    result = call("run", folder)
    assert result.exit_code == 1
    assert "2 trials failed; run again to retry them" in result.stderr


def test_a_trial_is_the_same_only_to_the_bit():
    ended = outcome(points(DEMO)[0], 0, order_parameter=0.5, simulated_s=4.0, measures={"a": 1, "b": 2.0})
    stored = {**ended._asdict(), "measured": '{"a": 1}'}
    for changes, differs in [
        ({}, False),
        ({"measured": None}, False),
        ({"measured": '{"a": 1.0}'}, True),
        ({"measured": '{"a": true}'}, True),
        ({"measured": '{"b": 2.0}'}, False),
        ({"order_parameter": 0.5000000000000001}, True),
        ({"t_sync_cycles": None}, True),
        ({"simulated_s": 4.000000000000001}, True),
        ({"steps": 81}, True),
        ({"events": "[]"}, True),
        ({"cycles": 5}, True),
    ]:
        assert (difference({**stored, **changes}, ended) is not None) == differs


@pytest.mark.parametrize("mended", [True, False], ids=["mended", "left out"])
@pytest.mark.parametrize("was_added", [True, False])
@pytest.mark.parametrize(("fails", "failed"), [("True", 6), ("simulation.seed % 2", 4)])
def test_a_measure_that_failed_may_be_mended_or_left_out(fails, failed, was_added, mended, folder, tmp_path):
    run(tmp_path / "other", "near_walls")
    before = everything(tmp_path / "other")
    file = tmp_path / "broken.py"
    broken = str(write(file, f"def half(simulation):\n    return 1 / 0 if {fails} else 0.25\n"))
    if was_added:
        run(folder, "near_walls")
    assert run(folder, "near_walls", broken).failed == failed
    assert len(read_status(folder).failed) == failed
    write(file, "def half(simulation):\n    return 0.5\n")
    few = pytest.warns(UserWarning, match=rf"^{folder}: half failed in some trials, .* of 2 trials are dropped$")
    with few if failed < 6 else nullcontext():
        progress = run(folder, "near_walls", *[broken] * mended)
    assert (progress.stored, progress.failed, read_status(folder).failed) == (6, 0, [])
    if mended:
        assert [point.measured for point in read_points(folder, "half")] == [(0.5,) * 3] * 2
    else:
        assert everything(folder) == before


def test_values_of_a_measure_are_dropped_only_if_it_failed_and_no_trial_waits_for_it(folder, tmp_path):
    file = tmp_path / "broken.py"
    broken = str(write(file, "def half(simulation):\n    return 0.25\n"))
    with pytest.raises(Stopped):
        run_sweep(agents_sweep(["near_walls", broken]), folder, pool_here, stopper(3))
    without = load_scenario(agents_sweep(["near_walls"]))
    assert "holds results of the measure half, which is missing now" in refusal(folder, without)
    awaiting = agents_sweep([broken], stop={"when": "Mine > 1", "max_cycles": 3})
    write(file, RAISING.format("1 / 0"))
    assert run_sweep(awaiting, tmp_path / "awaiting", pool_here).failed == 3
    write(file, RAISING.format("2"))
    assert "holds results of another measure Mine" in refusal(tmp_path / "awaiting", load_scenario(awaiting))


def content(folder):
    with reading(folder) as connection:
        measures = connection.execute("SELECT key, measures FROM points ORDER BY key").fetchall()
    return table(folder), measures


@settings(max_examples=5, deadline=None)
@given(
    trials=st.lists(st.integers(1, 3), max_size=4),
    counts=st.lists(st.integers(0, 4), min_size=4, max_size=4),
    stops=st.lists(st.integers(1, 6), min_size=4, max_size=4),
)
def test_measures_are_the_same_whatever_was_added_when_and_however_often_a_run_was_stopped(mine, trials, counts, stops):
    measures = ["order_parameter", "near_walls", f"{mine}:Counter", f"{mine}:settled"]
    sweep = partial(agents_sweep, stop={"when": "order_parameter > 0.6", "max_cycles": 5})
    with tempfile.TemporaryDirectory() as place:
        folder, anew = Path(place) / "folder", Path(place) / "anew"
        for number, count, after in zip(sorted(trials), sorted(counts), stops, strict=False):
            with suppress(Stopped):
                run_sweep(sweep(measures[:count], number), folder, pool_here, stopper(after))
        for each in (folder, anew):
            run_sweep(sweep(measures, 3), each, pool_here)
        assert content(folder) == content(anew)
        of_folder = (read_points(folder, name) for name in ("order_parameter", "settled"))
        for point, *stored in zip(points(sweep(measures, 3)), *of_folder, strict=True):
            again = [run_trial(simulate(point.scenario, point.seed(trial))).measures for trial in range(3)]
            for each in stored:
                assert each.measured == tuple(measures[each.of] for measures in again)


RAISING = """
class Mine:
    def __init__(self, simulation):
        self.fails = simulation.scenario.agents.count == 5

    def cycle(self, event, state):
        pass

    def value(self):
        return {} if self.fails else 1
"""


@pytest.mark.parametrize(
    ("value", "said"), [("1 / 0", ":10: ZeroDivisionError"), ("'text'", "its value is 'text', a str; ")]
)
@pytest.mark.parametrize("was_added", [False, True])
def test_a_measure_that_fails_costs_its_trials_alone(value, said, was_added, folder, tmp_path):
    path = write(tmp_path / "mine.py", RAISING.format(value))
    when = "order_parameter > 1" if was_added else "Mine > 1"  # measures end trials, too
    sweep = partial(agents_sweep, trials=2, stop={"when": when, "max_cycles": 3})
    if was_added:
        run_sweep(sweep(["order_parameter"]), folder, pool_here)
    progress = run_sweep(sweep(["order_parameter", str(path)]), folder, pool_here)
    assert (progress.stored, progress.failed) == (2, 2)
    status = read_status(folder)
    assert (status.stored, status.unmeasured) == ((4, 2) if was_added else (2, 0))
    assert [(failure.point, said in failure.error) for failure in status.failed] == [(0, True)] * 2
    assert [point.measured.count(1) for point in read_points(folder, "Mine")] == [0, 2]
    assert json.loads(json.dumps(status._asdict()))["unmeasured"] == status.unmeasured
