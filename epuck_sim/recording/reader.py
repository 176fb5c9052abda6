"""Reads a recording back into arrays."""

import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import rerun.blueprint as rrb

from epuck_sim.arrays import Float32Array
from epuck_sim.errors import RecordingError, ScenarioError
from epuck_sim.recording.entities import Entities
from epuck_sim.recording.layers import series
from epuck_sim.recording.layers.arena import HEADINGS, MOVABLES, ROBOTS
from epuck_sim.recording.layers.series import EVENTS, MEMORY, memory_entity
from epuck_sim.recording.level import Level
from epuck_sim.recording.links import LINKED, read_links
from epuck_sim.recording.parts import layout_of, population_of
from epuck_sim.recording.recorded import Recorded
from epuck_sim.recording.recorder import FORMAT, OUTCOME, TRIAL
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import validate
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.provenance import format_versions

_SERIES = (series.ORDER_AT_STEPS, series.ORDER_AT_FIRINGS, series.FLASHES, series.PHASES)


def last_moment_s(path: Path) -> float:
    """Return the time of a recording's last row in seconds, 0 if there is none; raise as `read_recording` does."""
    entities = Entities(path, series.ORDER_AT_STEPS)
    _check_format(path, entities.properties(TRIAL))
    return float(entities.times(series.ORDER_AT_STEPS).max(initial=0))


def read_layout(path: Path) -> rrb.Blueprint | None:
    """Return how the viewer lays out a recording; raise as `read_recording` does.

    The layout is None if this version cannot read the scenario: then the viewer chooses one itself.
    """
    trial = Entities(path).properties(TRIAL)
    _check_format(path, trial)
    try:
        return layout_of(_scenario(trial), Level(trial["level"]), _fields(trial))
    except (ScenarioError, KeyError, ValueError):
        return None


def read_recording(path: Path | str) -> Recorded:
    """Read a recording of any level into arrays.

    Args:
        path: The file, whose name ends in `.rrd`.

    Returns:
        The trial's scenario, seed and outcome, and a row for each recorded moment.

    Raises:
        RecordingError: The file is no complete recording, or one of another program or version.
    """
    path = Path(path)
    entities = Entities(path, *_SERIES, EVENTS, f"{MEMORY}/**", ROBOTS, HEADINGS, MOVABLES, *LINKED)
    trial = entities.properties(TRIAL)
    _check_format(path, trial)
    try:
        recorded = _gather(entities, trial, entities.properties(OUTCOME))
    except ScenarioError as error:
        raise RecordingError(f"{path}: holds a scenario that this version cannot read: {error}") from error
    except (KeyError, ValueError) as error:
        raise RecordingError(f"{path}: is not a complete recording: {error}") from error
    rows = len(recorded.time_s)
    posed = ("phase_ms", "positions", "headings", "ring_on", "movables") if recorded.level is not Level.SUMMARY else ()
    arrays = {name: getattr(recorded, name) for name in posed} | {
        f"memory.{name}": recorded.memory[name] for name in recorded.memory
    }
    for name, array in arrays.items():
        if len(array) != rows:
            raise RecordingError(f"{path}: is not a complete recording: {name} is missing in some of {rows} rows")
    return recorded


def _check_format(path: Path, trial: dict[str, Any]) -> None:
    if trial.get("format") != FORMAT:
        made_by = format_versions(json.loads(trial.get("versions", "{}"))) or "an unknown version"
        raise RecordingError(
            f"{path}: is a recording of format {trial.get('format', 'unknown')}, made by {made_by}; this version of "
            f"epuck-sim reads format {FORMAT}"
        )


def _gather(entities: Entities, trial: dict[str, Any], outcome: dict[str, Any]) -> Recorded:
    """Return a recording's arrays; raise KeyError or ValueError if something is missing."""
    scenario = _scenario(trial)
    count = scenario.population
    arrows = entities.values(HEADINGS, "Arrows2D:vectors").reshape(-1, count, 2)
    positions = entities.values(ROBOTS, "Points2D:positions").astype(np.float32).reshape(-1, count, 2)
    headings = np.arctan2(arrows[..., 1], arrows[..., 0])
    level = Level(trial["level"])
    return Recorded(
        scenario=scenario,
        seed=int(trial["seed"]),
        level=level,
        versions=json.loads(trial["versions"]),
        cycles=outcome["cycles"],
        synchronised=outcome["synchronised"],
        time_s=entities.times(series.ORDER_AT_STEPS),
        order_parameter=entities.values(series.ORDER_AT_STEPS, "Scalars:scalars"),
        flash_s=entities.times(series.FLASHES),
        flash_robot=entities.values(series.FLASHES, "Scalars:scalars").astype(np.int64),
        flash_cycle=entities.values(series.FLASHES, "cycle").astype(np.int64),
        firing_s=entities.times(series.ORDER_AT_FIRINGS),
        firing_order=entities.values(series.ORDER_AT_FIRINGS, "Scalars:scalars"),
        phase_ms=entities.values(series.PHASES, "Scalars:scalars").reshape(-1, count),
        positions=positions,
        headings=headings,
        ring_on=entities.values(ROBOTS, "Points2D:class_ids").reshape(-1, count) == 1,
        movables=_movables(entities, scenario, len(positions)),
        memory={
            field: entities.values(memory_entity(field), "Scalars:scalars").reshape(-1, count)
            for field in _fields(trial)
        },
        events=tuple(zip(entities.times(EVENTS).tolist(), entities.texts(EVENTS, "TextLog:text"), strict=True)),
        links=read_links(entities, scenario, positions, headings) if level is Level.FULL else None,
    )


def _movables(entities: Entities, scenario: Scenario, rows: int) -> Float32Array:
    """Return (rows, movables, 2) cm: where movables are in these rows."""
    count = len(population_of(scenario).arena.movables)
    if not count:
        return np.empty((rows, 0, 2), np.float32)
    return entities.values(MOVABLES, "Points2D:positions").astype(np.float32).reshape(-1, count, 2)


def _fields(trial: dict[str, Any]) -> list[str]:
    """Return the fields of memory in a recording."""
    fields: list[str] = json.loads(trial.get("memory", "[]"))
    return fields


def _scenario(trial: dict[str, Any]) -> Scenario:
    """Return the scenario in a recording's properties; raise ScenarioError if this version cannot read it.

    A picture of its floor that is not there any more is left out.
    """
    given = parse_yaml(trial["scenario"], "its scenario")
    if not isinstance(given, dict):
        raise ScenarioError("its scenario is not a mapping of keys to values")
    scenario = validate(given, "its scenario")
    if not isinstance(scenario, EmbodiedScenario) or not (picture := scenario.arena.floor.picture):
        return scenario
    if Path(picture).is_file():
        return scenario
    warnings.warn(f"{scenario.name}: the picture of its floor is left out: there is no file {picture}", stacklevel=4)
    floor = scenario.arena.floor.model_copy(update={"picture": None})
    return scenario.model_copy(update={"arena": scenario.arena.model_copy(update={"floor": floor})})
