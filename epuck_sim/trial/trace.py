"""A trace: what every robot sensed and did in every control step of a trial, in one Parquet file.

Rows are gathered in columns and written in chunks, so that memory does not grow with the length of the trial. The file
appears under its name only when it is complete; its metadata holds the scenario, the seed and the versions.
"""

import json
from collections.abc import Iterable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from epuck_sim.arrays import IntArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.step import Step, check_fields, field_values, reading_fields
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import write_scenario
from epuck_sim.scenario.scenario import Scenario, require_model
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.util.atomic_write import check_target, publish, temporary_path, write_errors
from epuck_sim.util.provenance import versions

CHUNK_ROWS = 20_000
"""Number of rows that are gathered in memory before they are written, about 4 MB."""


POSE, WHEELS = ("x_cm", "y_cm", "heading_rad"), ("left_cm_s", "right_cm_s")


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
        check_fields(scenario, memory)
        self._fields = {name: name for name in reading_fields(scenario)} | {f"memory.{name}": name for name in memory}
        rows = max(1, CHUNK_ROWS // self._robots), self._robots
        self._rows = np.zeros(rows, _row_type(scenario.camera_pixels, self._fields))
        self._filled = 0
        self._relations: dict[str, list[list[int]]] = {"sees": [], "touches": []} if relations else {}
        fields = [(name, _arrow_type(self._rows.dtype[name])) for name in self._rows.dtype.names or ()]
        lists = [(name, pa.list_(pa.int32())) for name in self._relations]
        metadata = {"scenario": write_scenario(scenario), "seed": str(seed), "versions": json.dumps(versions())}
        self._schema = pa.schema([*fields, *lists], metadata)
        with ExitStack() as stack:
            self._part = stack.enter_context(temporary_path(self._path))
            with write_errors(path):
                # pyarrow opens no file whose name is not UTF-8
                self._contents = stack.enter_context(self._part.open("wb"))
                self._writer = pq.ParquetWriter(self._contents, self._schema, compression="zstd")
            self._file = stack.pop_all()

    def __call__(self, step: Step, _: SynchronyWatch) -> None:
        """Take note of a step."""
        columns = {
            "time_s": step.time_s,
            "robot": np.arange(self._robots),
            **dict(zip(POSE, step.poses.T, strict=True)),
            **dict(zip(WHEELS, step.wheels_cm_s.T, strict=True)),
            **{name: getattr(step, name) for name in ("ring_on", "phase_ms", "flash_seen", "camera")},
            **{f"distance_mm_{sensor}": step.distance_mm[:, sensor] for sensor in range(SENSORS)},
            **{f"infrared_{sensor}": step.infrared[:, sensor] for sensor in range(SENSORS)},
            **{name: field_values(step, field) for name, field in self._fields.items()},
        }
        for name, values in columns.items():
            self._rows[name][self._filled] = values
        if self._relations:
            self._relations["sees"] += _listed(step.sightings, self._robots)
            contacts = step.contacts  # those of two robots are to be listed for each of them
            both_ways = np.concatenate([contacts, contacts[contacts[:, 1] >= 0, ::-1]])
            self._relations["touches"] += _listed(both_ways, self._robots)
        self._filled += 1
        if self._filled == len(self._rows):
            self._write()

    def _write(self) -> None:
        rows = self._rows[: self._filled]
        arrays = {name: _arrow_array(rows[name]) for name in rows.dtype.names or ()}
        for name, lists in self._relations.items():
            arrays[name] = pa.array(lists, pa.list_(pa.int32()))
            lists.clear()
        self._writer.write_table(pa.table(arrays, schema=self._schema))
        self._filled = 0

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        with write_errors(self._path), self._file:
            if kind is None and self._filled:
                self._write()
            self._writer.close()
            self._contents.close()
            if kind is None:
                publish(self._part, self._path)


def _listed(pairs: IntArray, robots: int) -> list[list[int]]:
    """Return, for each robot, the second numbers of the pairs that it begins, ascending."""
    lists: list[list[int]] = [[] for _ in range(robots)]
    for first, second in sorted(pairs.tolist()):
        lists[first].append(second)
    return lists


def _row_type(pixels: int, fields: Iterable[str]) -> np.dtype[np.void]:
    """Return the record of a robot in a control step."""
    return np.dtype(
        [
            ("time_s", np.float64),
            ("robot", np.int32),
            *((name, np.float64) for name in (*POSE, *WHEELS)),
            *[("ring_on", np.bool_), ("phase_ms", np.float64), ("flash_seen", np.bool_)],
            *((f"distance_mm_{sensor}", np.int32) for sensor in range(SENSORS)),
            *((f"infrared_{sensor}", np.float64) for sensor in range(SENSORS)),
            ("camera", np.uint8, (pixels,)),
            *((name, np.float64) for name in fields),
        ]
    )


def _arrow_type(field: np.dtype[Any]) -> Any:
    single = pa.from_numpy_dtype(field.base)
    return pa.list_(single, *field.shape) if field.shape else single


def _arrow_array(values: npt.NDArray[Any]) -> Any:
    """Return (steps, robots, ...) values as a column; NaN, the phase of a robot without an oscillator, becomes null."""
    column = pa.array(values.ravel(), from_pandas=True)
    return pa.FixedSizeListArray.from_arrays(column, values.shape[2]) if values.ndim > 2 else column
