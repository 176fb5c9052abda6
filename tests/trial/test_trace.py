"""A trace holds what the simulation's arrays held, and never half of it."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from epuck_sim import Simulation, Trace, load_scenario, run_trial
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.trial import trace as trace_module
from epuck_sim.util.provenance import versions

COLUMNS = [
    *("time_s", "robot", "x_cm", "y_cm", "heading_rad", "left_cm_s", "right_cm_s"),
    *("ring_on", "phase_ms", "flash_seen"),
    *(f"distance_mm_{sensor}" for sensor in range(8)),
    *(f"infrared_{sensor}" for sensor in range(8)),
    "camera",
]


def traced(path, scenario, seed=0):
    with Trace(path, scenario, seed) as trace:
        result = run_trial(Simulation(scenario, seed), [trace])
    return result, pq.read_table(path)


@pytest.fixture
def small_chunks(monkeypatch) -> None:
    monkeypatch.setattr(trace_module, "CHUNK_ROWS", 35)  # three steps of ten robots, and no whole number of chunks


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize("arena", ["thesis", "spotlight"])
def test_every_value_is_that_of_the_simulation(tmp_path, arena: str) -> None:
    scenario = load_scenario(arena, ["stop.max_time_s=8"])
    (tmp_path / "link.parquet").symlink_to(tmp_path / "t.parquet")
    result, _ = traced(tmp_path / "link.parquet", scenario, 0)
    assert result._replace(wall_s=0) == run_trial(Simulation(scenario, 0))._replace(wall_s=0)
    table = pq.read_table(tmp_path / "t.parquet")
    metadata = table.schema.metadata
    assert load_scenario(parse_yaml(metadata[b"scenario"].decode(), "metadata")) == scenario
    assert (metadata[b"seed"], json.loads(metadata[b"versions"])) == (b"0", versions())
    assert pq.ParquetFile(tmp_path / "t.parquet").num_row_groups == -(
        -result.steps // max(1, 35 // scenario.robot_count)
    )
    assert table.column_names == COLUMNS
    assert table.num_rows == result.steps * scenario.robot_count
    numbers = np.column_stack([table[name].to_numpy().astype(float) for name in COLUMNS[:-1]])
    camera = np.array(table["camera"].to_pylist())
    simulation = Simulation(scenario, 0)
    for number, step in zip(range(result.steps), simulation, strict=False):
        rows = slice(number * scenario.robot_count, (number + 1) * scenario.robot_count)
        moment = np.full(scenario.robot_count, number / 10), np.arange(scenario.robot_count)
        seen = step.ring_on, step.phase_ms, step.flash_seen, step.distance_mm, step.infrared
        expected = np.column_stack([*moment, step.poses, step.wheels_cm_s, *seen])
        np.testing.assert_array_equal(numbers[rows], expected)
        np.testing.assert_array_equal(camera[rows], step.camera)


def test_where_the_trial_fails_an_older_trace_stays_and_nothing_else_is_left(tmp_path) -> None:
    path = tmp_path / "t.parquet"
    path.write_text("older")
    with pytest.raises(ZeroDivisionError), Trace(path, load_scenario("thesis"), 0):
        1 / 0  # noqa: B018
    assert [each.read_text() for each in tmp_path.iterdir()] == ["older"]


@pytest.mark.usefixtures("small_chunks")
def test_memory_and_relations_are_columns_if_asked_for(tmp_path) -> None:
    scenario = load_scenario("thesis", ["stop.max_cycles=3"])
    memory = ["rotation_time", "phase_ms"]
    with Trace(tmp_path / "t.parquet", scenario, 1, memory=memory, relations=True) as trace:
        result = run_trial(Simulation(scenario, 1), [trace])
    table = pq.read_table(tmp_path / "t.parquet")
    assert table.column_names == [*COLUMNS, "memory.rotation_time", "memory.phase_ms", "sees", "touches"]
    assert table["memory.phase_ms"].to_pylist() == table["phase_ms"].to_pylist()
    sees, touches = table["sees"].to_pylist(), table["touches"].to_pylist()
    for number, step in zip(range(result.steps), Simulation(scenario, 1), strict=False):
        rows = range(10 * number, 10 * number + 10)
        assert [table["memory.rotation_time"][row].as_py() for row in rows] == step.memories[0][
            "rotation_time"
        ].tolist()
        pairs = [[row % 10, seen] for row in rows for seen in sees[row]]
        assert sorted(pairs) == sorted(step.sightings.tolist())
        touching = [[row % 10, other] for row in rows for other in touches[row]]
        assert sorted(touching) == sorted(
            [*step.contacts.tolist(), *[[b, a] for a, b in step.contacts.tolist() if b >= 0]]
        )
    assert any(sees)
    assert any(touches)
