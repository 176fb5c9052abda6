"""The exported table: every result once, in order, under the right names and types, exact, and never half of it."""

import json
import random
from pathlib import Path
from typing import BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.export import WRITERS, export
from epuck_sim.runs.store import Store
from epuck_sim.scenario.points import points
from epuck_sim.util.provenance import host, versions
from tests.runs.made_folders import WIDTH, rows
from tests.runs.test_store import COUNT, DEMO, SPEED, fill, outcome, put, scenario_of

RESULT = {
    "seed": pa.int64(),
    "t_sync_cycles": pa.int64(),
    "censored": pa.bool_(),
    "order_parameter": pa.float64(),
    "simulated_s": pa.float64(),
    "wall_s": pa.float64(),
    "steps": pa.int64(),
    "cycles": pa.int64(),
    "point": pa.int64(),
    "trial": pa.int64(),
}
MAKING = ["epuck_sim", "pymunk", "numba", "numpy", "python", "host"]


def parquet_of(folder: Path) -> pa.Table:
    target = folder.with_name("results.parquet")
    export(folder, target)
    return pq.read_table(target)


def csv_of(folder: Path) -> list[dict[str, str]]:
    target = folder.with_name("results.csv")
    export(folder, target)
    return rows(target)


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


def test_every_row_is_a_trial_as_it_was_stored_in_order_of_point_and_trial(folder) -> None:
    found = points(DEMO)
    censored = {"t_sync_cycles": None, "censored": True}
    ended = [outcome(point, trial, **(censored if trial == 2 else {})) for point in found for trial in range(3)]
    with Store(folder, DEMO, found) as store:
        for each in random.Random(1).sample(ended, len(ended)):
            store.add([each])
    expected = []
    for each in ended:
        result = each.result._asdict()
        expected.append(
            found[each.point].axes
            | {name: result[name] for name in RESULT if name in result}
            | {"point": each.point, "trial": each.trial, **versions(), "host": host()}
        )
    assert parquet_of(folder).to_pylist() == expected
    read = [
        {name: text if name in MAKING else json.loads(text or "null") for name, text in row.items()}
        for row in csv_of(folder)
    ]
    assert read == expected  # JSON's numbers, true and false are those of the CSV


def test_without_a_result_columns_and_their_types_are_there_and_no_row(folder) -> None:
    put(folder)
    table = parquet_of(folder)
    assert table.num_rows == 0
    assert table.column_names == [COUNT, SPEED, *RESULT, *MAKING]
    assert {name: table.schema.field(name).type for name in RESULT} == RESULT
    assert csv_of(folder) == []
    assert folder.with_name("results.csv").read_text().startswith(f'"{COUNT}","{SPEED}","seed"')


def exported_axis(folder: Path, key: str, values: list) -> list:
    """Return the column of an axis in the Parquet file; that of the CSV holds the same, as text."""
    fill(folder, scenario_of({"grid": {key: values}}, trials=1))
    column = parquet_of(folder)[key].to_pylist()
    written = [row[key] for row in csv_of(folder)]
    assert written == ["" if value is None else value if isinstance(value, str) else f"{value:g}" for value in column]
    return column


@pytest.mark.parametrize(
    ("key", "values", "expected"),
    [
        (COUNT, [2, 3], [2, 3]),
        (SPEED, [1, 0.5], [1.0, 0.5]),
        ("stop.max_time_s", [None, 5], [None, 5]),
        ("stop.max_time_s", [None], [None]),
        ("stop.metric", ["complex", "reference"], ["complex", "reference"]),
        ("noise", ["off", {"wheel_speed": 0.5}], ["off", '{"wheel_speed": 0.5}']),
        ("noise", [False, {"wheel_speed": 0.5}], ["False", '{"wheel_speed": 0.5}']),
        ("robots.0.camera.range_cm", [7, None, 8.5], [7.0, None, 8.5]),
        ("arena.obstacles", [[]], ["[]"]),
    ],
    ids=str,
)
def test_axis_values_keep_their_kinds(folder, key: str, values: list, expected: list) -> None:
    assert exported_axis(folder, key, values) == expected


def test_values_are_under_their_own_keys_however_the_points_list_them(folder) -> None:
    fill(folder, scenario_of({"points": [{COUNT: 2, WIDTH: 50}, {WIDTH: 60, COUNT: 3}]}, trials=1))
    table = parquet_of(folder)
    assert (table[COUNT].to_pylist(), table[WIDTH].to_pylist()) == ([2, 3], [50, 60])
