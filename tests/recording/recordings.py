"""Recordings for tests: trials that are recorded, what rerun's own reader finds in a file, and comparison of files."""

from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
from rerun.chunk import RrdReader

from epuck_sim import Scenario, Step, TrialResult, record
from epuck_sim.recording import Level
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.trial.model import Observer, run_trial, simulate

Array = npt.NDArray[Any]


def recorded(
    path: Path, scenario: Scenario, seed: int = 1, level: Level = Level.FULL, *others: Observer, **more: Any
) -> TrialResult:
    with record(path, scenario, seed, level, **more) as observer:
        return run_trial(simulate(scenario, seed), [observer, *others])


class Watched:
    def __init__(self) -> None:
        self.steps: list[SimpleNamespace] = []
        self.order: list[float] = []
        self.firings: list[tuple[float, float]] = []
        self._cycles = 0

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        arrays = ("poses", "camera", "distance_mm", "wheels_cm_s", "ring_on", "phase_ms", "contacts", "sightings")
        copies = {field: np.array(getattr(step, field)) for field in arrays}
        self.steps.append(SimpleNamespace(number=step.number, time_s=step.time_s, **copies))
        self.order.append(float(watch.measure(step.phase_ms)))
        if watch.cycles > self._cycles and watch.order_parameter is not None:
            self.firings.append((step.time_s, watch.order_parameter))
        self._cycles = watch.cycles

    def __getitem__(self, field: str) -> Array:
        return np.array([getattr(step, field) for step in self.steps])

    def is_like(self, other: "Watched") -> bool:
        """Whether robots did and sensed the same, to the bit."""
        fields = ("poses", "camera", "distance_mm", "wheels_cm_s", "ring_on", "phase_ms")
        return all(self[field].tobytes() == other[field].tobytes() for field in fields)

    def pairs(self, field: str) -> list[list[int]]:
        """Return rows of links of all steps, each with the number of its step."""
        return sorted([step.number, *pair] for step in self.steps for pair in getattr(step, field).tolist())


class Found:
    def __init__(self, path: Path) -> None:
        self.static: dict[str, dict[str, Any]] = defaultdict(dict)
        self.moving: dict[str, list[Any]] = defaultdict(list)
        for chunk in RrdReader(path).store().stream().to_chunks():
            batch = chunk.to_record_batch()
            if chunk.is_static:
                self.static[chunk.entity_path].update({key: each[0] for key, each in batch.to_pydict().items()})
            else:
                self.moving[chunk.entity_path].append(batch)
        for batches in self.moving.values():
            batches.sort(key=lambda batch: batch.column("sim_time")[0].value)

    def property(self, name: str) -> dict[str, Any]:
        columns = self.static[f"/__properties/{name}"].items()
        return {key: each[0] for key, each in columns if not key.startswith("rerun.")}

    def times(self, entity: str) -> list[int]:
        return [time for batch in self.moving[entity] for time in batch.column("sim_time").cast(pa.int64()).to_pylist()]

    def lists(self, entity: str, component: str) -> list[Any]:
        return [row for batch in self.moving[entity] for row in batch.column(component).to_pylist()]

    def array(self, entity: str, component: str) -> Array:
        """Return (rows, ...) values, of as many dimensions as the lists are deep; every list is as long."""
        column = pa.concat_arrays([batch.column(component) for batch in self.moving[entity]])
        shape = [len(column)]
        while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
            (length,) = set(pc.list_value_length(column).to_pylist())
            shape.append(length)
            column = column.flatten()
        return column.to_numpy(zero_copy_only=False).reshape(shape)
