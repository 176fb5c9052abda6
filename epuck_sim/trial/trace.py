"""A trace: what every robot sensed and did in every control step of a trial, in one Parquet file.

Rows are gathered in columns and written in chunks, so that memory does not grow with the length of the trial. The file
appears under its name only when it is complete; its metadata holds the scenario, the seed and the versions.
"""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from epuck_sim.arrays import IntArray
from epuck_sim.embodied.infrared import SENSORS
from epuck_sim.embodied.memory import check_fields, memory_values
from epuck_sim.embodied.step import Step
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import write_scenario
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.trial.synchrony import SynchronyWatch
from epuck_sim.util.atomic_write import check_target, publish, temporary_path, write_errors
from epuck_sim.util.provenance import versions

CHUNK_ROWS = 20_000
"""Number of rows that are gathered in memory before they are written, about 4 MB."""


class Trace:
    """An observer of a trial (see `run_trial`) that writes every step to a file; to be used in a `with` block.

    If the block ends with an error, no file is left behind.
    """

    def __init__(
        self,
        path: Path | str,
        scenario: Scenario,
        seed: int,
        *,
        memory: Sequence[str] = (),
        relations: bool = False,
    ) -> None:
        """Open the file, before the trial begins.

        Args:
            path: File to write, in the format Parquet.
            scenario: Scenario of the trial, of model `embodied`.
            seed: Seed of the trial.
            memory: Fields of the controllers' MEMORY, each to be a column `memory.NAME`.
            relations: Whether columns list whom each robot sees lit, and whom it touches.

        Raises:
            ScenarioError: The scenario is of another model, or no controller remembers such a field.
            EpuckSimError: The file cannot be written.
        """
        path = Path(path)
        scenario = require_model(scenario, EmbodiedScenario, "traces are of robots")
        check_target(path)
        self._path = path.resolve()
        self._robots = scenario.robot_count
        self._pixels = scenario.camera_pixels
        self._memory = tuple(dict.fromkeys(memory))
        check_fields(scenario, self._memory)
        schema = _schema(self._pixels, self._memory)
        self._steps = max(1, CHUNK_ROWS // self._robots)
        self._columns = {
            field.name: np.zeros((self._steps, self._robots), field.type.to_pandas_dtype())
            for field in schema
            if field.name != "camera"
        }
        self._columns["robot"][:] = np.arange(self._robots)
        self._camera = np.zeros((self._steps, self._robots, self._pixels), np.uint8)
        self._filled = 0
        self._relations: dict[str, list[list[int]]] | None = {"sees": [], "touches": []} if relations else None
        if relations:
            for name in ("sees", "touches"):
                schema = schema.append(pa.field(name, pa.list_(pa.int32())))
        metadata = {
            "scenario": write_scenario(scenario),
            "seed": str(seed),
            "versions": json.dumps(versions()),
        }
        self._schema = schema.with_metadata(metadata)
        with ExitStack() as stack:
            self._part = stack.enter_context(temporary_path(self._path))
            with write_errors(path):
                self._writer = pq.ParquetWriter(self._part, self._schema, compression="zstd")
            self._file = stack.pop_all()

    def __call__(self, step: Step, _: SynchronyWatch) -> None:
        """Take note of a step."""
        columns, row = self._columns, self._filled
        columns["time_s"][row] = step.time_s
        for axis, name in enumerate(("x_cm", "y_cm", "heading_rad")):
            columns[name][row] = step.poses[:, axis]
        for wheel, name in enumerate(("left_cm_s", "right_cm_s")):
            columns[name][row] = step.wheels_cm_s[:, wheel]
        columns["ring_on"][row] = step.ring_on
        columns["phase_ms"][row] = step.phase_ms
        columns["flash_seen"][row] = step.flash_seen
        for sensor in range(SENSORS):
            columns[f"distance_mm_{sensor}"][row] = step.distance_mm[:, sensor]
            columns[f"infrared_{sensor}"][row] = step.infrared[:, sensor]
        for name in self._memory:
            columns[f"memory.{name}"][row] = memory_values(step.memories, name)
        self._camera[row] = step.camera
        if self._relations is not None:
            self._relations["sees"] += _listed(step.sightings, self._robots)
            self._relations["touches"] += _listed(both_ways(step.contacts), self._robots)
        self._filled += 1
        if self._filled == self._steps:
            self._write()

    def _write(self) -> None:
        arrays = {name: _arrow(values[: self._filled].ravel()) for name, values in self._columns.items()}
        pixels = pa.array(self._camera[: self._filled].ravel())
        arrays["camera"] = pa.FixedSizeListArray.from_arrays(pixels, self._pixels)
        for name, lists in (self._relations or {}).items():
            arrays[name] = pa.array(lists, pa.list_(pa.int32()))
            lists.clear()
        self._writer.write_table(pa.table(arrays, schema=self._schema))
        self._filled = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with self._file, write_errors(self._path):
            if kind is None and self._filled:
                self._write()
            self._writer.close()
            if kind is None:
                publish(self._part, self._path)


def both_ways(contacts: IntArray) -> IntArray:
    """Return contacts, (contacts, 2), with those of two robots listed for each of them."""
    between = contacts[contacts[:, 1] >= 0]
    return np.concatenate([contacts, between[:, ::-1]])


def _listed(pairs: IntArray, robots: int) -> list[list[int]]:
    """Return, for each robot, the second numbers of the pairs that it begins, ascending."""
    lists: list[list[int]] = [[] for _ in range(robots)]
    for first, second in sorted(pairs.tolist()):
        lists[first].append(second)
    return lists


def _schema(pixels: int, memory: Sequence[str]) -> Any:
    """Return the columns of a table that has a row for each robot and control step."""
    return pa.schema(
        [
            ("time_s", pa.float64()),
            ("robot", pa.int32()),
            *((name, pa.float64()) for name in ("x_cm", "y_cm", "heading_rad", "left_cm_s", "right_cm_s")),
            ("ring_on", pa.bool_()),
            ("phase_ms", pa.float64()),
            ("flash_seen", pa.bool_()),
            *((f"distance_mm_{sensor}", pa.int32()) for sensor in range(SENSORS)),
            *((f"infrared_{sensor}", pa.float64()) for sensor in range(SENSORS)),
            ("camera", pa.list_(pa.uint8(), pixels)),
            *((f"memory.{name}", pa.float64()) for name in memory),
        ]
    )


def _arrow(values: npt.NDArray[np.generic]) -> Any:
    """Return a column; NaN, the phase of a robot without an oscillator, becomes null."""
    return pa.array(values, from_pandas=True)
