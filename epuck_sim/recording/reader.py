"""Reads a recording back into arrays."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rerun.blueprint as rrb

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.errors import RecordingError, ScenarioError
from epuck_sim.recording.entities import Entities
from epuck_sim.recording.layers import time_series
from epuck_sim.recording.layers.arena import HEADINGS, MOVABLES, ROBOTS
from epuck_sim.recording.layers.events import EVENTS
from epuck_sim.recording.layers.memory import MEMORY, memory_entity
from epuck_sim.recording.level import Level
from epuck_sim.recording.links import LINKED, Links, read_links
from epuck_sim.recording.parts import layout_of, population_of
from epuck_sim.recording.recorder import FORMAT, OUTCOME, TRIAL
from epuck_sim.scenario.arena_changes import arena_after, arena_entries
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.provenance import format_versions

_SERIES = (time_series.ORDER_AT_STEPS, time_series.ORDER_AT_FIRINGS, time_series.FLASHES, time_series.PHASES)


class Recorded(NamedTuple):
    """A trial as it was recorded; poses and phases have no rows if the level leaves them out.

    Robots have a row for each control step; point-like agents one for each instant at which some fire, and 20 regular
    ones in each nominal period.
    """

    scenario: Scenario
    """The scenario, with all defaults written out."""
    seed: int
    """Seed of the trial."""
    level: Level
    """How much the recording holds."""
    versions: dict[str, str]
    """Versions of epuck-sim and its libraries that made the recording."""
    cycles: int
    """Number of firings of the reference."""
    synchronised: bool
    """Whether the trial ended with the swarm synchronised."""
    time_s: FloatArray
    """(rows,) s: simulated time of each row."""
    order_parameter: FloatArray
    """(rows,) of all oscillators."""
    flash_s: FloatArray
    """(flashes,) s: time of each flash."""
    flash_robot: IntArray
    """(flashes,) number of the robot or agent that flashed."""
    flash_cycle: IntArray
    """(flashes,) which of its own flashes this was, from 1."""
    firing_s: FloatArray
    """(firings,) s: times at which the reference fired."""
    firing_order: FloatArray
    """(firings,) order parameter that the trial measured then."""
    phase_ms: FloatArray
    """(rows, count) ms: phases; count is the number of robots or agents."""
    positions: Float32Array
    """(rows, count, 2) cm: x and y, in single precision as in the file; a cube is seen from above."""
    headings: FloatArray
    """(rows, count) rad in -pi to pi, from arrows in single precision."""
    ring_on: BoolArray
    """(rows, count) whether the ring is lit; of agents, whether they fired within the last 0.075 of a period."""
    movables: Float32Array
    """(rows, movables, 2) cm: x and y of the arena's movables, in single precision."""
    memory: Mapping[str, FloatArray]
    """(rows, robots) what robots remember, by the names of the fields that are recorded; NaN for robots without one."""
    events: tuple[tuple[float, str], ...]
    """Time in seconds, and text, of what changed by a schedule, or by faults."""
    links: Links | None
    """Who was linked to whom; None if the level leaves it out. The properties below raise RecordingError instead."""

    @property
    def sightings(self) -> IntArray:
        """(sightings, 4) row, robot that looks, robot in its view, and 1 if that is seen lit."""
        return self._linked("sightings", "embodied")

    @property
    def contacts(self) -> IntArray:
        """(contacts, 3) row, robot, and the robot that it touches, or -1: a wall, obstacle or movable."""
        return self._linked("contacts", "embodied")

    @property
    def pulses(self) -> IntArray:
        """(pulses, 4) row, agent that fires, agent that receives, and 1 if its phase shifts.

        Swarms of 50 agents or more are recorded with the pulses alone that shift a phase.
        """
        return self._linked("pulses", "particles")

    def arena_at(self, row: int) -> Arena:
        """Return the arena with its walls, and with its movables where they are, in a row."""
        stand = [arena for time_s, arena in self.arenas if time_s <= self.time_s[row]]
        return stand[-1].with_movables_at(self.movables[row])

    @property
    def arenas(self) -> list[tuple[float, Arena]]:
        """Times from which on walls and obstacles stand, and the arena with them; its movables are elsewhere."""
        found = [(0.0, population_of(self.scenario).arena)]
        if isinstance(self.scenario, EmbodiedScenario):
            arenas = {f"schedule.{entry}": arena_after(self.scenario, entry) for entry in arena_entries(self.scenario)}
            sources = [(time_s, text.partition(":")[0]) for time_s, text in self.events]
            found += [(time_s, arenas[source].build()) for time_s, source in sources if source in arenas]
        return found

    def _repr_html_(self) -> str:
        """Return the last moment at which most rings were lit, and what is recorded, for notebooks."""
        from epuck_sim.recording.notebook import show_recorded  # noqa: PLC0415 is for notebooks alone

        return show_recorded(self)

    def _linked(self, what: str, model: str) -> IntArray:
        if self.scenario.model != model:
            raise RecordingError(
                f"{self.scenario.name}: model: {self.scenario.model} has no {what}; they are of model: {model}"
            )
        if self.links is None:
            raise RecordingError(
                f"{self.scenario.name}: a recording of level {self.level} holds no {what}; record the trial again with "
                "--record-level full"
            )
        found: IntArray = getattr(self.links, what)
        return found


def last_moment_s(path: Path) -> float:
    """Return the time of a recording's last row in seconds, 0 if there is none; raise as `read_recording` does."""
    entities = Entities(path, time_series.ORDER_AT_STEPS)
    _check_format(path, entities.properties(TRIAL))
    return float(entities.times(time_series.ORDER_AT_STEPS).max(initial=0))


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
        time_s=entities.times(time_series.ORDER_AT_STEPS),
        order_parameter=entities.values(time_series.ORDER_AT_STEPS, "Scalars:scalars"),
        flash_s=entities.times(time_series.FLASHES),
        flash_robot=entities.values(time_series.FLASHES, "Scalars:scalars").astype(np.int64),
        flash_cycle=entities.values(time_series.FLASHES, "cycle").astype(np.int64),
        firing_s=entities.times(time_series.ORDER_AT_FIRINGS),
        firing_order=entities.values(time_series.ORDER_AT_FIRINGS, "Scalars:scalars"),
        phase_ms=entities.values(time_series.PHASES, "Scalars:scalars").reshape(-1, count),
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
    """Return the scenario in a recording's properties; raise ScenarioError if this version cannot read it."""
    given = parse_yaml(trial["scenario"], "its scenario")
    if not isinstance(given, dict):
        raise ScenarioError("its scenario is not a mapping of keys to values")
    return validate(given, "its scenario")
