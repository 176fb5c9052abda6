"""A trace: what every robot sensed and did in every control step of a trial, in one Parquet file.

Steps are gathered and written in chunks, so that memory does not grow with the length of the trial. The file
appears under its name only when it is complete; its metadata holds the scenario, the seed and the versions.
"""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, Self

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.parquet as pq

from epuck_sim.arrays import IntArray
from epuck_sim.embodied.step import Step, check_fields, field_values, reading_fields
from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_of_model, write_scenario
from epuck_sim.scenario.scenario import ScenarioLike, seed_of_trial
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.util.atomic_write import check_target, publish, temporary_path, write_errors
from epuck_sim.util.provenance import versions

OF_STEPS = ("poses", "wheels_cm_s", "ring_on", "phase_ms", "flash_seen", "distance_mm", "infrared", "camera")
CHUNK_ROWS = 20_000  # number of rows that are gathered in memory before they are written, about 4 MB


class Trace:
    """An observer of a trial (see `run_trial`) that writes every step to a file; to be used in a `with` block.

    If the block ends with an error, no file is left behind.
    """

    def __init__(
        self,
        path: Path | str,
        scenario: ScenarioLike,
        seed: int | None,
        *,
        memory: Sequence[str] = (),
        relations: bool = False,
    ) -> None:
        """Check that the file can be written; the `with` block opens it.

        Args:
            path: File to write, FILE.parquet.
            scenario: Scenario of the trial, of model `embodied`, or what `load_scenario` takes.
            seed: The trial's seed; None for the scenario's own.
            memory: Fields of the controllers' MEMORY, each of which becomes a column `memory.NAME`.
            relations: Whether columns list whom each robot sees lit, and whom it touches.

        Raises:
            ScenarioError: The scenario is of another model, the seed is not allowed, or no controller has such a field.
            EpuckSimError: The file has another ending, or cannot be written.
        """
        path = Path(path)
        scenario = load_of_model(scenario, EmbodiedScenario, "traces need model: embodied")
        if path.suffix != ".parquet":
            raise EpuckSimError(f"{path}: a trace's name must end in .parquet, its format")
        check_target(path)
        self._path, self.trial_seed, self.trial_scenario = path.resolve(), seed_of_trial(scenario, seed), scenario
        self._robots = scenario.population
        memory = [memory] if isinstance(memory, str) else memory
        check_fields(scenario, memory)
        self._fields = {name: name for name in reading_fields(scenario)} | {f"memory.{name}": name for name in memory}
        self._steps: list[dict[str, npt.NDArray[Any]]] = []
        self._relations: dict[str, list[list[int]]] = {"sees": [], "touches": []} if relations else {}
        described = {"scenario": write_scenario(scenario), "seed": str(self.trial_seed)}
        self._metadata = {**described, "versions": json.dumps(versions())}
        self._writer: pq.ParquetWriter | None = None
        self.is_open = False  # whether the `with` block has begun, and has not ended

    def __call__(self, step: Step, _: SynchronyWatch) -> None:
        """Record a step."""
        shown = {name: getattr(step, name).copy() for name in OF_STEPS}
        fields = {column: field_values(step, field).copy() for column, field in self._fields.items()}
        self._steps.append({"time_s": np.full(self._robots, step.time_s), **shown, **fields})
        if self._relations:
            contacts = step.contacts  # a contact of two robots is listed for both of them
            both_ways = np.concatenate([contacts, contacts[contacts[:, 1] >= 0, ::-1]])
            self._relations["sees"] += _listed(step.sightings, self._robots)
            self._relations["touches"] += _listed(both_ways, self._robots)
        if len(self._steps) == max(1, CHUNK_ROWS // self._robots):
            self._write()

    def _write(self) -> None:
        rows = {name: np.concatenate([step[name] for step in self._steps]) for name in self._steps[0]}
        columns = {
            "time_s": rows["time_s"],
            "robot": np.tile(np.arange(self._robots, dtype=np.int32), len(self._steps)),
            **dict(zip(("x_cm", "y_cm", "heading_rad"), rows["poses"].T, strict=True)),
            **dict(zip(("left_cm_s", "right_cm_s"), rows["wheels_cm_s"].T, strict=True)),
            **{name: rows[name] for name in ("ring_on", "phase_ms", "flash_seen")},
            **{f"distance_mm_{sensor}": values for sensor, values in enumerate(rows["distance_mm"].T.astype(np.int32))},
            **{f"infrared_{sensor}": values for sensor, values in enumerate(rows["infrared"].T)},
            "camera": rows["camera"].astype(np.uint8),
            **{column: rows[column] for column in self._fields},
        }
        arrays = {name: _arrow_array(values) for name, values in columns.items()}
        arrays |= {name: pa.array(lists, pa.list_(pa.int32())) for name, lists in self._relations.items()}
        table = pa.table(arrays, metadata=self._metadata)
        if self._writer is None:
            self._writer = pq.ParquetWriter(self._contents, table.schema, compression="zstd")
        self._writer.write_table(table)
        self._steps.clear()
        for lists in self._relations.values():
            lists.clear()

    def __enter__(self) -> Self:
        with ExitStack() as stack:
            self._part = stack.enter_context(temporary_path(self._path))
            with write_errors(self._path):
                # pyarrow opens no file whose name is not UTF-8
                self._contents = stack.enter_context(self._part.open("wb"))
            self._file = stack.pop_all()
        self.is_open = True
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self.is_open = False
        with write_errors(self._path), self._file:
            if kind is None and self._steps:
                self._write()
            if self._writer is not None:
                self._writer.close()
            self._contents.close()
            if kind is None and self._writer is None:
                raise EpuckSimError(f"{self._path}: cannot be written: there was no step to trace")
            if kind is None:
                publish(self._part, self._path)


def _listed(pairs: IntArray, robots: int) -> list[list[int]]:
    """Return for each robot, in ascending order, the second numbers of the pairs in which it is first."""
    lists: list[list[int]] = [[] for _ in range(robots)]
    for first, second in sorted(pairs.tolist()):
        lists[first].append(second)
    return lists


def _arrow_array(values: npt.NDArray[Any]) -> Any:
    """Return (rows, ...) values as a column; NaN, the phase of a robot without an oscillator, becomes null."""
    column = pa.array(values.ravel(), from_pandas=True)
    return pa.FixedSizeListArray.from_arrays(column, values.shape[1]) if values.ndim > 1 else column
