"""Reads the file of a recorded trial back into arrays, and shows it in notebooks."""

import json
import warnings
from collections import defaultdict
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import rerun as rr  # first: its extra brings pyarrow, too, and what is missing first is named

# isort: split
import pyarrow as pa
import pyarrow.compute as pc
import rerun.blueprint as rrb
from rerun.chunk import Chunk, RrdReader

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, Float32Array, FloatArray, IntArray
from epuck_sim.display.arena_svg import draw_arena
from epuck_sim.display.html import element, facts, to_html
from epuck_sim.errors import EpuckSimError, RecordingError, ScenarioError, extras_named
from epuck_sim.recording import Level, series
from epuck_sim.recording.layers import CONTACTS, HEADINGS, LINKS, MOVABLES, ROBOTS, SIGHTINGS, unit_vectors
from epuck_sim.recording.recorder import FORMAT, OUTCOME, TRIAL, arrangement_of, make_layout
from epuck_sim.recording.rerun import APPLICATION, ENDING, TIMELINE, crashes_on, is_whole
from epuck_sim.recording.rows import population_of
from epuck_sim.scenario.embodied import EmbodiedScenario, arena_after, arena_entries
from epuck_sim.scenario.loader import validate
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.provenance import format_versions
from epuck_sim.util.yaml_io import parse_yaml


class Links(NamedTuple):
    """Links of a trial, a row each; arrays that its model does not have are empty."""

    sightings: IntArray = np.empty((0, 4), np.int64)  # row, robot that looks, robot in its view, 1 if it is seen lit
    contacts: IntArray = np.empty((0, 3), np.int64)  # row, robot, robot that it touches, or -1 if that is no robot
    contact_points: FloatArray = np.empty((0, 2))  # cm: where they touch, in the same order
    pulses: IntArray = np.empty((0, 4), np.int64)  # row, agent that fires, agent that receives, 1 if its phase shifts


class Recorded(NamedTuple):
    """A trial as it was recorded; poses and phases have no rows if the level leaves them out.

    Robots have a row for each control step; point-like agents one for each instant at which some fire, and 20 regular
    ones in each nominal period.
    """

    scenario: Scenario  # with all defaults written out
    seed: int  # seed of the trial
    level: Level  # how much the recording holds
    versions: dict[str, str]  # versions of epuck-sim and its libraries that made the recording
    cycles: int  # number of firings of the reference
    synchronised: bool  # whether the trial ended with the swarm synchronised
    time_s: FloatArray  # (rows,) s: simulated time of each row
    order_parameter: FloatArray  # (rows,) of all oscillators
    flash_s: FloatArray  # (flashes,) s: time of each flash
    flash_robot: IntArray  # (flashes,) number of the robot or agent that flashed
    flash_cycle: IntArray  # (flashes,) number of the flash among its robot's own, from 1
    firing_s: FloatArray  # (firings,) s: times at which the reference fired
    firing_order: FloatArray  # (firings,) order parameter that the trial measured then
    phase_ms: FloatArray  # (rows, count) ms: phases; count is the number of robots or agents
    positions: Float32Array
    """(rows, count, 2) cm: x and y, in single precision as in the file; a cube is seen from above."""
    headings: FloatArray  # (rows, count) rad in -pi to pi, from arrows in single precision
    ring_on: BoolArray
    """(rows, count) whether the ring is lit; of agents, whether they fired within the last 0.075 of a period."""
    movables: Float32Array  # (rows, movables, 2) cm: x and y of the arena's movables, in single precision
    memory: Mapping[str, FloatArray]
    """(rows, robots) values of the recorded fields of robots, by name; NaN for robots without a field."""
    events: tuple[tuple[float, str], ...]  # time in seconds, and text, of each change by a schedule, or by faults
    links: Links | None
    """The links; None if the level leaves them out. The properties below raise RecordingError instead."""

    @property
    def sightings(self) -> IntArray:
        """See `Links`."""
        return self._linked("sightings", "embodied")

    @property
    def contacts(self) -> IntArray:
        """See `Links`."""
        return self._linked("contacts", "embodied")

    @property
    def pulses(self) -> IntArray:
        """See `Links`; of swarms of 50 agents or more, only pulses that shift a phase are recorded."""
        return self._linked("pulses", "particles")

    @property
    def brightest_row(self) -> int:
        """The last row in which most rings are lit."""
        rings = self.ring_on.sum(axis=1)
        return int(np.flatnonzero(rings == rings.max())[-1])

    def arena_at(self, row: int) -> Arena:
        """Return the arena in a row, with the walls and the places of movables at that time."""
        *_, stands = (arena for time_s, arena in self.arenas if time_s <= self.time_s[row])
        return stands.with_movables_at(self.movables[row])

    @property
    def arenas(self) -> list[tuple[float, Arena]]:
        """Times at which walls and obstacles change, and the arena from then on, but without moves of movables."""
        found = [(0.0, population_of(self.scenario).arena)]
        if isinstance(self.scenario, EmbodiedScenario):
            arenas = {f"schedule.{entry}": arena_after(self.scenario, entry) for entry in arena_entries(self.scenario)}
            sources = [(time_s, text.partition(":")[0]) for time_s, text in self.events]
            found += [(time_s, arenas[source].build()) for time_s, source in sources if source in arenas]
        return found

    def _repr_html_(self) -> str:
        """Return the last moment at which most rings were lit, and what is recorded, for notebooks."""
        population = population_of(self.scenario)
        asked = self.scenario.stop.order_parameter is not None
        rows = [
            (f"{population.noun}s", str(population.size)),
            ("level", str(self.level)),
            ("duration", f"{self.time_s.max(initial=0):.1f} s, {self.cycles} cycles"),
            ("synchronised", "yes" if self.synchronised else "no" if asked else "not asked for"),
            ("rows", str(len(self.time_s))),
        ]
        parts = [element("p", element("b", self.scenario.name), f", seed {self.seed}"), facts(rows)]
        if len(self.ring_on):
            moment = self.brightest_row
            poses = np.column_stack([self.positions[moment], self.headings[moment]])
            parts.append(element("p", f"at {self.time_s[moment]:.2f} s:"))
            parts.append(draw_arena(self.arena_at(moment), poses, population.radii_cm, self.ring_on[moment]))
        return to_html(*parts)

    def _linked(self, what: str, model: str) -> IntArray:
        name, own = self.scenario.name, self.scenario.model
        if own != model:
            raise RecordingError(f"{name}: model: {own} has no {what}; only model: {model} has them")
        if self.links is None:
            again = "record the trial again with --record-level full"
            raise RecordingError(f"{name}: a recording of level {self.level} holds no {what}; {again}")
        found: IntArray = getattr(self.links, what)
        return found


class Entities:
    """The properties in a recording's file, and some of its entities."""

    trial: dict[str, Any]  # the properties of its trial

    def __init__(self, path: Path, *entities: str) -> None:
        """Read a file; raise RecordingError unless it is a complete recording of this format."""
        self._properties: dict[str, dict[str, Any]] = defaultdict(dict)
        self._batches: dict[str, list[pa.RecordBatch]] = defaultdict(list)
        for chunk in _read_chunks(path, ["/__properties/**", *entities]):
            if chunk.is_static:
                self._properties[chunk.entity_path] |= chunk.to_record_batch().to_pydict()
            else:
                self._batches[chunk.entity_path].append(chunk.to_record_batch())
        for batches in self._batches.values():
            batches.sort(key=lambda batch: batch.column(TIMELINE)[0].value)
        trial = self.properties(TRIAL)
        if trial.get("format") != FORMAT:
            made_by = format_versions(json.loads(trial.get("versions", "{}"))) or "an unknown version"
            found = f"is a recording of format {trial.get('format', 'unknown')}, made by {made_by}"
            raise RecordingError(f"{path}: {found}; this version of epuck-sim reads format {FORMAT}")
        self.trial = {**trial, "memory": json.loads(trial.get("memory", "[]"))}

    def properties(self, name: str) -> dict[str, Any]:
        """Return the values of a property by key; empty if there is no such property."""
        columns = self._properties[f"/__properties/{name}"]
        return {key: value[0][0] for key, value in columns.items() if isinstance(value[0], list)}

    def times(self, entity: str) -> FloatArray:
        """Return (rows,) s: the times of an entity's rows."""
        times = [column.cast(pa.int64()).to_numpy() for column in self._columns(entity, TIMELINE)]
        return np.concatenate([np.empty(0), *times]) / 1e9

    def values(self, entity: str, component: str) -> FloatArray:
        """Return the numbers of a component in all rows, one after the other."""
        columns = [column.flatten() for column in self._columns(entity, component)]
        numbers = [column.flatten() if pa.types.is_fixed_size_list(column.type) else column for column in columns]
        return np.concatenate([np.empty(0), *(number.to_numpy() for number in numbers)])

    def texts(self, entity: str) -> list[str]:
        """Return the texts of a log."""
        return [text for column in self._columns(entity, "TextLog:text") for text in column.flatten().to_pylist()]

    def rows(self, entity: str, component: str, row_count: int) -> IntArray:
        """Return the row of each value of a component; raise ValueError unless the entity has `row_count` rows."""
        counts = [pc.fill_null(pc.list_value_length(column), 0) for column in self._columns(entity, component)]
        lengths = np.concatenate([np.empty(0, np.int64), *(count.to_numpy() for count in counts)])
        if len(lengths) != row_count:
            raise ValueError(f"{entity} is missing in some of {row_count} rows")
        return np.repeat(np.arange(row_count), lengths)

    def _columns(self, entity: str, name: str) -> list[pa.Array]:
        return [batch.column(name) for batch in self._batches[entity]]


@lru_cache(maxsize=64)
def _is_damaged(path: Path, _mtime_ns: int) -> bool:
    """Return whether a file differs from what was written; cached for each state of the file, as it is read whole."""
    whole = is_whole(path)
    return crashes_on(path) if whole is None else not whole


def _read_chunks(path: Path, entities: list[str]) -> list[Chunk]:
    if not path.is_file():
        what = "file" if path.suffix else "recording or run folder"
        raise RecordingError(f"{path}: {'is not a file' if path.exists() else f'there is no such {what}'}")
    if path.suffix != ENDING:  # which the viewer requires, too
        raise RecordingError(f"{path}: is not a recording: the name must end in {ENDING}")
    if path.stat().st_size and _is_damaged(path.resolve(), path.stat().st_mtime_ns):
        raise RecordingError(f"{path}: is not a complete recording: it is damaged; record the trial again")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of a truncated file, which is refused below
        try:
            reader = RrdReader(path)
            found = reader.recordings()
            if len(found) == 1 and found[0].application_id == APPLICATION:
                return reader.store().stream().filter(content=entities).to_chunks()
        except (RuntimeError, ValueError) as error:
            if "Not an RRD file" in str(error):
                raise RecordingError(f"{path}: is not a recording, though its name ends in {ENDING}") from error
            reason = "its end is missing" if "footer" in str(error) else error
            raise RecordingError(f"{path}: is not a complete recording: {reason}; record the trial again") from error
    made_by = ", ".join(sorted({entry.application_id for entry in found})) or "no program"
    said = f"holds {len(found)} recordings, made by {made_by}"
    raise RecordingError(f"{path}: {said}; allowed: one made by {APPLICATION}")


def last_moment_s(path: Path) -> float:
    """Return the time of a recording's last row in seconds, -1 if there is none; raise as `read_recording` does."""
    return float(Entities(path, series.ORDER_AT_STEPS).times(series.ORDER_AT_STEPS).max(initial=-1))


def read_layout(path: Path) -> rrb.Blueprint | None:
    """Return the viewer's layout for a recording; raise as `read_recording` does.

    The layout is None if this version cannot read the scenario: then the viewer chooses one itself.
    """
    trial = Entities(path).trial
    try:
        return make_layout(arrangement_of(_scenario(trial), Level(trial["level"]), trial["memory"]))
    except (ScenarioError, KeyError, ValueError):
        return None


def read_recording(path: Path | str) -> Recorded:
    """Read a recording of any level, FILE.rrd, into arrays, with a row for each recorded moment.

    Raises:
        RecordingError: The file is no complete recording, or one of another program or version.
    """
    path = Path(path)
    entities = Entities(path, *_READ, f"{series.MEMORY}/**")
    try:
        return _gather(entities)
    except ScenarioError as error:
        raise RecordingError(f"{path}: holds a scenario that this version cannot read: {error}") from error
    except (KeyError, ValueError) as error:
        raise RecordingError(f"{path}: is not a complete recording: {error}") from error


WIDTH_PX, HEIGHT_PX = 960, 600  # size of the viewer in a notebook


def show(file: Path | str) -> Any:
    """Show a recording, FILE.rrd, in rerun's viewer within a notebook, or a film, FILE.mp4, at the end of a cell.

    The viewer is interactive, and gone when the notebook's kernel has ended; a film becomes a part of the notebook.

    Raises:
        RecordingError: The file is no recording, or one of another version.
        EpuckSimError: There is no such file, it is of another kind, or Jupyter's parts are not installed.
    """
    path = Path(file)
    if not path.is_file():
        raise EpuckSimError(f"{path}: there is no such file")
    if path.suffix == ".mp4":
        with extras_named():
            from IPython.display import Video  # noqa: PLC0415 is there in notebooks
        return Video(str(path), embed=True)  # type: ignore[no-untyped-call]
    if path.suffix != ".rrd":
        raise EpuckSimError(f"{path}: unknown format {path.suffix!r}; allowed: .rrd, .mp4")
    from rerun import notebook  # noqa: PLC0415 is there in notebooks, too

    layout = read_layout(path)
    if not notebook.HAS_NOTEBOOK:
        said = "showing needs parts of Jupyter, which are not installed"
        raise EpuckSimError(f'{said}: pip install "epuck-sim[notebook]"')
    reader = RrdReader(path)
    (recorded,) = reader.recordings()
    stream = rr.RecordingStream(recorded.application_id, recording_id=recorded.recording_id, send_properties=False)
    viewer = notebook.Viewer(width=WIDTH_PX, height=HEIGHT_PX, recording=stream, blueprint=layout)
    rr.send_chunks(reader.store(), recording=stream)
    return viewer


SCALARS = "Scalars:scalars"  # a component
_READ = (
    *(series.ORDER_AT_STEPS, series.ORDER_AT_FIRINGS, series.FLASHES, series.PHASES, series.EVENTS),
    *(ROBOTS, HEADINGS, MOVABLES, SIGHTINGS, CONTACTS, LINKS),
)


def _gather(entities: Entities) -> Recorded:
    """Return a recording's arrays; raise KeyError or ValueError if something is missing."""
    trial, outcome, times = entities.trial, entities.properties(OUTCOME), entities.times(series.ORDER_AT_STEPS)
    scenario, level = _scenario(trial), Level(trial["level"])
    count, movables = scenario.population, len(population_of(scenario).arena.movables)

    def rows(entity: str, component: str, *shape: int, is_there: bool = level is not Level.SUMMARY) -> FloatArray:
        found = entities.values(entity, component).reshape(-1 if all(shape) else is_there * len(times), *shape)
        if is_there and len(found) != len(times):
            raise ValueError(f"{entity} is missing in some of {len(times)} rows")
        return found

    arrows = rows(HEADINGS, "Arrows2D:vectors", count, 2)
    positions = rows(ROBOTS, "Points2D:positions", count, 2).astype(np.float32)
    headings = np.arctan2(arrows[..., 1], arrows[..., 0])
    return Recorded(
        scenario=scenario,
        seed=int(trial["seed"]),
        level=level,
        versions=json.loads(trial["versions"]),
        cycles=outcome["cycles"],
        synchronised=outcome["synchronised"],
        time_s=times,
        order_parameter=entities.values(series.ORDER_AT_STEPS, SCALARS),
        flash_s=entities.times(series.FLASHES),
        flash_robot=entities.values(series.FLASHES, SCALARS).astype(np.int64),
        flash_cycle=entities.values(series.FLASHES, "cycle").astype(np.int64),
        firing_s=entities.times(series.ORDER_AT_FIRINGS),
        firing_order=entities.values(series.ORDER_AT_FIRINGS, SCALARS),
        phase_ms=rows(series.PHASES, SCALARS, count),
        positions=positions,
        headings=headings,
        ring_on=rows(ROBOTS, "Points2D:class_ids", count) == 1,
        movables=rows(MOVABLES, "Points2D:positions", movables, 2).astype(np.float32),
        memory={name: rows(series.memory_entity(name), SCALARS, count, is_there=True) for name in trial["memory"]},
        events=tuple(zip(entities.times(series.EVENTS).tolist(), entities.texts(series.EVENTS), strict=True)),
        links=_read_links(entities, scenario, positions, headings) if level is Level.FULL else None,
    )


def _scenario(trial: dict[str, Any]) -> Scenario:
    """Return the scenario in a recording's properties; raise ScenarioError if this version cannot read it.

    If the file of the floor's picture is missing, the picture is left out.
    """
    given = parse_yaml(trial["scenario"], "its scenario")
    if not isinstance(given, dict):
        raise ScenarioError("its scenario is not a mapping of keys to values")
    scenario = validate(given, "its scenario")
    picture = scenario.arena.floor.picture if isinstance(scenario, EmbodiedScenario) else None
    if picture and not Path(picture).is_file():
        said = f"{scenario.name}: the picture of its floor is left out: there is no file {picture}"
        warnings.warn(said, stacklevel=4)
        del given["arena"]["floor"]["picture"]
        return validate(given, "its scenario")
    return scenario


BETWEEN_CM = 1e-3  # largest distance of a contact of two robots from the point between them, as it is recorded
BLOCK = 20_000  # most distances that are computed at a time: a core's cache holds them


def _read_links(entities: Entities, scenario: Scenario, positions: Float32Array, headings: FloatArray) -> Links:
    """Return the links of a full recording; raise ValueError if some rows are missing."""
    # robots that are not in the arena, whose places are NaN, are infinitely far away
    middles = np.nan_to_num(positions.astype(np.float64), nan=np.inf)
    if isinstance(scenario, ParticleScenario):
        side_cm = scenario.space.side_cm if scenario.space.boundary == "cyclic" else np.inf
        return Links(pulses=_read_arrows(entities, LINKS, middles, middles, side_cm))
    assert isinstance(scenario, EmbodiedScenario)  # no other model has cameras
    kinds = scenario.robot_kinds
    forward_cm = np.array([kind.camera_forward_cm for kind in kinds])[:, None]
    cameras = np.nan_to_num(middles + forward_cm * unit_vectors(headings), nan=np.inf)
    sightings = _read_arrows(entities, SIGHTINGS, cameras, middles, np.inf)
    return Links(sightings, *_read_contacts(entities, middles, np.array([kind.radius_cm for kind in kinds])))


def _read_arrows(entities: Entities, entity: str, tails: FloatArray, heads: FloatArray, cycle_cm: float) -> IntArray:
    """Return (arrows, 4) row, number at the tail, number at the head, class of each arrow of an entity.

    Arrows begin at one of `tails`, (rows, count, 2) cm of robots or agents, and end at one of `heads`; see `nearest`.
    """
    rows = entities.rows(entity, "Arrows2D:origins", len(tails))
    origins = entities.values(entity, "Arrows2D:origins").reshape(-1, 2)
    ends = origins + entities.values(entity, "Arrows2D:vectors").reshape(-1, 2)
    classes = entities.values(entity, "Arrows2D:class_ids").astype(np.int64)
    froms, tos = nearest(origins, tails, rows, cycle_cm), nearest(ends, heads, rows, cycle_cm)
    return np.column_stack([rows, froms, tos, classes])


def _read_contacts(entities: Entities, positions: FloatArray, radii_cm: FloatArray) -> tuple[IntArray, FloatArray]:
    """Return (contacts, 3) row, robot, and other robot or -1; and (contacts, 2) cm the points.

    A point between two robots divides the line between their centres as their radii do. On a wall or obstacle it
    belongs to the robot whose surface is nearest.
    """
    rows = entities.rows(CONTACTS, "Points2D:positions", len(positions))
    points = entities.values(CONTACTS, "Points2D:positions").reshape(-1, 2)
    contacts = np.column_stack([rows, np.full((len(rows), 2), -1)])
    for contact, point, places in zip(contacts, points, positions[rows], strict=True):
        contact[1] = first = int((np.hypot(*(places - point).T) - radii_cm).argmin())
        shares = radii_cm[first] / (radii_cm[first] + radii_cm)
        between = places[first] + shares[:, None] * (places - places[first])
        distance_cm = np.hypot(*(between - point).T)
        distance_cm[first] = np.inf
        if distance_cm.min() <= BETWEEN_CM:
            contact[1:] = sorted((first, int(distance_cm.argmin())))
    return contacts, points


def nearest(points: FloatArray, places: FloatArray, rows: IntArray, cycle_cm: float) -> IntArray:
    """Return (points,) the number of the nearest place, of (rows, count, 2), to each of (points, 2), within its row.

    `cycle_cm` is the side of a cyclic space, across whose edges a place may be nearest; infinite for other spaces.
    """
    found, by_axis = [np.empty(0, np.int64)], np.ascontiguousarray(places.transpose(2, 0, 1))
    block = max(1, BLOCK // max(1, places.shape[1]))
    for start in range(0, len(points), block):
        part = slice(start, start + block)
        x, y = (np.abs(of[part, None] - each[rows[part]]) for of, each in zip(points.T, by_axis, strict=True))
        if cycle_cm < np.inf:
            x, y = (np.minimum(away, np.abs(cycle_cm - away)) for away in (x, y))
        found.append((x**2 + y**2).argmin(axis=1))
    return np.concatenate(found)
