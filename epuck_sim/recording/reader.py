"""Reads a recording back into arrays."""

import json
import warnings
from collections import defaultdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from rerun.chunk import Chunk, RrdReader

from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.errors import RecordingError, ScenarioError
from epuck_sim.recording.chunks import APPLICATION, TIMELINE
from epuck_sim.recording.layers import time_series
from epuck_sim.recording.layers.arena import HEADINGS, ROBOTS
from epuck_sim.recording.level import Level
from epuck_sim.recording.recorder import FORMAT, OUTCOME, TRIAL
from epuck_sim.recording.rrd_file import ENDING
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.provenance import format_versions

SERIES = (time_series.ORDER_AT_STEPS, time_series.ORDER_AT_FIRINGS, time_series.FLASHES, time_series.PHASES)


class Recorded(NamedTuple):
    """A trial as it was recorded; poses and phases have no rows where the level leaves them out.

    Of robots, there is a row for each control step; of point-like agents, one for each instant at which some fire, and
    20 in a nominal period beside them.
    """

    scenario: Scenario
    seed: int
    level: Level
    versions: dict[str, str]
    cycles: int
    """Firings of the reference."""
    synchronised: bool
    """Whether the trial ended with the swarm synchronised."""
    time_s: FloatArray
    """(rows,)"""
    order_parameter: FloatArray
    """(rows,) of all oscillators."""
    flash_s: FloatArray
    """(flashes,) when somebody fired."""
    flash_robot: IntArray
    """(flashes,) who it was, by number."""
    flash_cycle: IntArray
    """(flashes,) which of its own flashes it was, from 1."""
    firing_s: FloatArray
    """(firings,) when the reference fired."""
    firing_order: FloatArray
    """(firings,) the order parameter as the trial measured it then."""
    phase_ms: FloatArray
    """(rows, count)"""
    positions: Float32Array
    """(rows, count, 2) cm, in single precision, which is what a recording holds; of a cube, seen from above."""
    headings: FloatArray
    """(rows, count) rad in -pi to pi, of arrows in single precision."""
    ring_on: BoolArray
    """(rows, count) whose ring is lit; of agents, who fired within the last 0.075 of a period."""


def last_moment_s(path: Path) -> float:
    """Return the time of a recording's last row, 0 if there is none; raises as `read_recording` does."""
    entities = _Entities(path, time_series.ORDER_AT_STEPS)
    _check_format(path, entities.properties(TRIAL))
    return float(entities.times(time_series.ORDER_AT_STEPS).max(initial=0))


def read_recording(path: Path) -> Recorded:
    """Return what a recording of any level holds.

    Raises RecordingError for a file that is no whole recording, or one of another program or version.
    """
    entities = _Entities(path, *SERIES, ROBOTS, HEADINGS)
    trial = entities.properties(TRIAL)
    _check_format(path, trial)
    try:
        recorded = _gather(entities, trial, entities.properties(OUTCOME))
    except ScenarioError as error:
        raise RecordingError(f"{path}: holds a scenario that this version cannot read: {error}") from error
    except (KeyError, ValueError) as error:
        raise RecordingError(f"{path}: is no whole recording: {error}") from error
    rows = len(recorded.time_s)
    for name in ("phase_ms", "positions", "headings", "ring_on") if recorded.level is not Level.SUMMARY else ():
        if len(getattr(recorded, name)) != rows:
            raise RecordingError(f"{path}: is no whole recording: {name} of {rows} rows are not there")
    return recorded


def _check_format(path: Path, trial: dict[str, Any]) -> None:
    if trial.get("format") != FORMAT:
        made_by = format_versions(json.loads(trial.get("versions", "{}"))) or "an unknown version"
        raise RecordingError(
            f"{path}: is a recording of format {trial.get('format', 'unknown')}, made by {made_by}; this version of "
            f"epuck-sim reads format {FORMAT}"
        )


def _gather(entities: "_Entities", trial: dict[str, Any], outcome: dict[str, Any]) -> Recorded:
    """Return a recording's arrays; raises KeyError or ValueError for what is missing."""
    given = parse_yaml(trial["scenario"], "its scenario")
    if not isinstance(given, dict):
        raise ScenarioError("its scenario is no mapping of keys to values")
    scenario = validate(given, "its scenario")
    count = scenario.population
    arrows = entities.values(HEADINGS, "Arrows2D:vectors").reshape(-1, count, 2)
    return Recorded(
        scenario=scenario,
        seed=int(trial["seed"]),
        level=Level(trial["level"]),
        versions=json.loads(trial["versions"]),
        cycles=outcome["cycles"],
        synchronised=outcome["synchronised"],
        time_s=entities.times(time_series.ORDER_AT_STEPS),
        order_parameter=entities.values(time_series.ORDER_AT_STEPS, "Scalars:scalars"),
        flash_s=entities.times(time_series.FLASHES),
        flash_robot=entities.values(time_series.FLASHES, "Scalars:scalars").astype(np.int64),
        flash_cycle=entities.values(time_series.FLASHES, "cycle").astype(np.int64),
        firing_s=entities.times(time_series.ORDER_AT_FIRINGS),
        firing_order=entities.values(time_series.ORDER_AT_FIRINGS, "Scalars:scalars"),
        phase_ms=entities.values(time_series.PHASES, "Scalars:scalars").reshape(-1, count),
        positions=entities.values(ROBOTS, "Points2D:positions").astype(np.float32).reshape(-1, count, 2),
        headings=np.arctan2(arrows[..., 1], arrows[..., 0]),
        ring_on=entities.values(ROBOTS, "Points2D:class_ids").reshape(-1, count) == 1,
    )


class _Entities:
    """The properties in a recording's file, and those of its entities that are asked for."""

    def __init__(self, path: Path, *entities: str) -> None:
        self._properties: dict[str, dict[str, Any]] = defaultdict(dict)
        self._moving: dict[str, list[pa.RecordBatch]] = defaultdict(list)
        for chunk in _read_chunks(path, ["/__properties/**", *entities]):
            if chunk.is_static:
                self._properties[chunk.entity_path] |= chunk.to_record_batch().to_pydict()
            else:
                self._moving[chunk.entity_path].append(chunk.to_record_batch())
        for batches in self._moving.values():
            batches.sort(key=lambda batch: batch.column(TIMELINE)[0].value)

    def properties(self, name: str) -> dict[str, Any]:
        """Return a recording's properties, each a single value; none where it has none of this name."""
        columns = self._properties[f"/__properties/{name}"]
        return {key: value[0][0] for key, value in columns.items() if isinstance(value[0], list)}

    def times(self, entity: str) -> FloatArray:
        """Return (rows,) s: the times of an entity's rows."""
        times = [batch.column(TIMELINE).cast(pa.int64()).to_numpy() for batch in self._moving[entity]]
        return np.concatenate([np.empty(0), *times]) / 1e9

    def values(self, entity: str, component: str) -> FloatArray:
        """Return the numbers of a component of all rows, one after the other."""
        columns = [batch.column(component).flatten() for batch in self._moving[entity]]
        numbers = [column.flatten() if pa.types.is_fixed_size_list(column.type) else column for column in columns]
        return np.concatenate([np.empty(0), *(number.to_numpy() for number in numbers)])


def _read_chunks(path: Path, entities: list[str]) -> list[Chunk]:
    if not path.is_file():
        raise RecordingError(f"{path}: {'is no file' if path.exists() else 'there is no such file'}")
    if path.suffix != ENDING:  # which the viewer asks for, too
        raise RecordingError(f"{path}: is no recording, which ends in {ENDING}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # about a file without its end, which is refused below
        try:
            reader = RrdReader(path)
            found = reader.recordings()
            if len(found) == 1 and found[0].application_id == APPLICATION:
                return reader.store().stream().filter(content=entities).to_chunks()
        except (RuntimeError, ValueError) as error:
            if "Not an RRD file" in str(error):
                raise RecordingError(f"{path}: is no recording, though its name ends in {ENDING}") from error
            reason = "its end is missing" if "footer" in str(error) else error
            raise RecordingError(f"{path}: is no whole recording: {reason}; record the trial again") from error
    programs = ", ".join(sorted({entry.application_id for entry in found})) or "nobody"
    raise RecordingError(
        f"{path}: holds {len(found)} recordings, made by {programs}; allowed: one made by {APPLICATION}"
    )
