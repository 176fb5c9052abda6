"""What run folders keep of measures: values to the bit, and never those of two different measures."""

import json
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs.export import export
from epuck_sim.runs.reader import read_points
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from tests.measures.files import COUNTER, write
from tests.runs.made_folders import rows
from tests.runs.test_store import outcome

VALUES = [1 / 3, None, 2.0]
SERIES = [[0.1, None, 1 / 3], [], [1, 0.25]]


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return tmp_path / "run"


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    return write(tmp_path / "mine.py", COUNTER + "\ndef course(simulation): return []\n")


def scenario(*measures, **changes):
    return load_scenario({"name": "demo", "trials": 3, "measures": list(measures), **changes})


def fill(folder: Path, loaded, values: list[dict]) -> None:
    found = points(loaded)
    with Store(folder, loaded, found) as store:
        for trial, measures in enumerate(values):
            store.add([outcome(found[0], trial, measures=measures)])


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
    ],
)
def test_a_column_has_the_kind_of_its_values(values, kind, folder, mine, tmp_path):
    fill(folder, scenario(f"{mine}:Counter"), [{"Counter": value} for value in values])
    export(folder, tmp_path / "t.parquet")
    column = pq.read_table(tmp_path / "t.parquet")["measures.Counter"]
    assert (column.type, column.to_pylist()) == (kind, values)


def refused(folder: Path, loaded) -> str:
    with pytest.raises(StoreError) as caught:
        fill(folder, loaded, [])
    return str(caught.value)


def test_a_folder_is_refused_to_other_measures(folder, mine):
    fill(folder, scenario({f"{mine}:Counter": {"offset": 1}}), [{"Counter": 1.0}])
    fill(folder, scenario({f"{mine}:Counter": {"offset": 1}}), [])
    other = refused(folder, scenario({f"{mine}:Counter": {"offset": 2}}))
    assert "another measure Counter; give another folder: offset: 1 in the folder, 2 now" in other
    assert "holds results of the measure Counter, which is lacking now" in refused(folder, scenario())
    write(mine, mine.read_text() + "\n# edited\n")
    edited = refused(folder, scenario({f"{mine}:Counter": {"offset": 1}}))
    assert "another measure Counter; give another folder: measure: 'mine.py:Counter with digest " in edited
    assert [point.measured for point in read_points(folder, "Counter")] == [(1.0,)]
