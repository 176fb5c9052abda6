"""Records a trial: an observer that gathers rows in a buffer and turns full buffers into chunks of a recording.

A recording has a layout for the viewer: the arena on the left, plots on the right, pictures below, time in seconds.
"""

import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from functools import lru_cache
from importlib.metadata import version
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk

from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.step import READING
from epuck_sim.errors import RecordingError
from epuck_sim.recording import NIGHT, Level, layers, series
from epuck_sim.recording.layers import AgentLayers, RobotLayers
from epuck_sim.recording.rerun import APPLICATION, TIMELINE, rrd_file, static_chunk, strict_mode
from epuck_sim.recording.rows import AgentBuffer, RobotBuffer, population_of
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_of_model, write_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario, ScenarioLike, seed_of_trial
from epuck_sim.trial.result import TrialState
from epuck_sim.util.provenance import versions

FORMAT = 1  # version of the entities in a recording
BUFFER_S, BUFFER_ROWS = 600, 60_000
"""Longest simulated time, s, and most rows times robots (8 MB) that are kept in memory before they are written."""

TRIAL, OUTCOME = "trial", "outcome"  # names of the properties that describe the trial, and say how it ended

MARGIN_CM, MARGIN_SHARE = 2.0, 1 / 30
"""Margin around the arena of robots, cm, and around the space of agents, as a share of its width."""


@contextmanager
def record(
    path: Path | str,
    scenario: ScenarioLike,
    seed: int | None,
    level: Level | str = Level.FULL,
    *,
    memory: Sequence[str] = (),
) -> Iterator["Recorder"]:
    """Yield an observer of a trial (see `run_trial`) that records it into a file for rerun's viewer.

    Args:
        path: The file, whose name must end in `.rrd`. It gets its name when the block ends; if the block ends with an
            error, an older file stays, and nothing else is left.
        scenario: The trial's scenario, or what `load_scenario` takes.
        seed: The trial's seed; None for the scenario's own.
        level: How much is recorded: summary, poses or full.
        memory: Fields of the controllers' MEMORY to record, whatever the level.

    Raises:
        EpuckSimError: The file cannot be written, the scenario cannot be recorded, there is no such level, or no
            controller remembers a field.
    """
    if level not in list(Level):
        raise RecordingError(f"level is {level!r}; allowed: {', '.join(Level)}")
    level, scenario = Level(level), load_of_model(scenario, Scenario)  # with every default written out
    seed = seed_of_trial(scenario, seed)
    memory = series.recorded_fields(scenario, level, memory)
    layout = layout_file(arrangement_of(scenario, level, memory))
    described = "\n".join([write_scenario(scenario), str(seed), level, json.dumps(versions()), *memory])
    recording_id = hashlib.sha256(described.encode()).hexdigest()[:32]  # the same for the same trial, level and fields
    with rrd_file(Path(path), recording_id, layout) as write:
        recorder = Recorder(scenario, seed, level, BUFFER_S, write, memory)
        yield recorder
        recorder.finish()


class Recorder:
    """An observer of a trial of any model that hands chunks on whenever its buffer is full."""

    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        level: Level,
        buffer_s: float,
        write: Callable[[Iterable[Chunk]], None],
        memory: Sequence[str] = (),
    ) -> None:
        """Write the static chunks; the simulation need not exist yet. At most `buffer_s` of it are buffered."""
        self._level, self._send, self.trial_seed, self.trial_scenario = level, write, seed, scenario
        self._population = population = population_of(scenario)
        self._threshold = scenario.stop.order_parameter
        self._state: TrialState | None = None
        self._capacity = max(1, int(min(buffer_s * population.rows_per_s, BUFFER_ROWS / population.size)))
        self._buffer: Any
        self._layers: list[RobotLayers | AgentLayers]  # of a full recording
        if isinstance(scenario, EmbodiedScenario):
            self._buffer = RobotBuffer(scenario, level, self._capacity, memory)
            self._layers = [RobotLayers(scenario, population)] if level is Level.FULL else []
        else:
            assert isinstance(scenario, ParticleScenario), "other models have no population"
            self._buffer = AgentBuffer(scenario, seed, level)
            self._layers = [AgentLayers(scenario, population)] if level is Level.FULL else []
        self._texts = series.Texts(self._threshold)
        self._write(
            _description(scenario, seed, level, memory),
            series.static_time_series(population, level, memory),
            layers.static_arena_entities(population, level) if level is not Level.SUMMARY else (),
            *(each.static_chunks() for each in self._layers),
        )

    def __call__(self, event: Any, state: TrialState) -> None:
        """Record an event of the trial; raise RecordingError for one of another trial than the first."""
        if self._state not in (None, state):
            raise RecordingError("a recorder is for one trial; record each trial into a file of its own")
        self._state = state
        self._buffer.append(event, state)
        if self._buffer.row_count >= self._capacity:
            self.flush()

    def catch_up(self, time_s: float) -> None:
        """Record agents up to a time before their next event, as observers are called at events only."""
        self._buffer.catch_up(time_s)
        self.flush()

    def flush(self) -> None:
        """Write the buffered rows."""
        if not self._buffer.row_count:
            return
        batch, population = self._buffer.flush(), self._population
        self._write(
            self._texts.chunks(batch, self._state) if self._state is not None else (),
            series.time_series(batch, population, self._threshold, self._level),
            layers.arena_entities(batch, population) if self._level is not Level.SUMMARY else (),
            *(each.chunks(batch) for each in self._layers),
        )

    def _write(self, *parts: Iterable[Chunk]) -> None:
        with strict_mode():
            self._send(chain.from_iterable(parts))

    def finish(self) -> None:
        """Write the remaining rows, and how the trial ended."""
        cycles, synchronised = 0, False
        if self._state is not None:
            cycles, synchronised = self._state.outcome.cycles, self._state.is_synchronised
            if isinstance(self._buffer, AgentBuffer):
                self._buffer.end(self._state.time_s)
        self.flush()
        final = (each.final_chunks() for each in self._layers if isinstance(each, RobotLayers))
        self._write(*final, [Chunk.from_property(OUTCOME, rr.AnyValues(cycles=cycles, synchronised=synchronised))])


def _description(scenario: Scenario, seed: int, level: Level, memory: Sequence[str]) -> Iterator[Chunk]:
    described: dict[str, Any] = {
        "format": FORMAT,
        "level": str(level),
        "scenario": write_scenario(scenario),
        "seed": str(seed),  # which may exceed 64 bits
        "versions": json.dumps({**versions(), "rerun": version("rerun-sdk")}),
        **({"memory": json.dumps(memory)} if memory else {}),
    }
    yield Chunk.from_property(TRIAL, rr.AnyValues(**described))
    yield static_chunk("/__properties", rr.archetypes.RecordingInfo(name=f"{scenario.name}, seed {seed}"))


class Arrangement(NamedTuple):
    """Facts on which a layout depends."""

    level: Level
    noun: str  # what one of the population is called
    place: str  # title of the arena
    largest_cm: tuple[float, float]  # width and height, which is 0 of a segment
    margin_cm: float  # around the arena
    memory: tuple[str, ...]  # fields of the controllers' MEMORY that are recorded
    has_events: bool
    pixels: int  # of a camera's row; 0 for agents
    size: int


def arrangement_of(scenario: Scenario, level: Level, memory: Sequence[str] = ()) -> Arrangement:
    """Return all that the layout of a scenario's recording depends on; raise RecordingError as `population_of` does."""
    population = population_of(scenario)
    bodies = scenario if isinstance(scenario, EmbodiedScenario) else None
    return Arrangement(
        level,
        population.noun,
        "a cube from above [cm]" if population.is_cube else "arena [cm]",
        population.largest_cm,
        MARGIN_CM if bodies else MARGIN_SHARE * population.largest_cm[0],
        tuple(memory),
        scenario.has_events,
        bodies.camera_pixels if bodies else 0,
        population.size,
    )


def make_layout(given: Arrangement) -> rrb.Blueprint:
    """Return a layout; a segment, which has no height, lies above the plots."""
    half, unit = rrb.ScalarAxis(range=(-0.52, 0.52)), rrb.ScalarAxis(range=(0, 1.02))
    flashes = _plot(series.FLASHES, f"flashes [{given.noun}]")
    order = _plot("/order", "order parameter: blue at firings of the reference, red the threshold", unit)
    tabs: list[rrb.View] = [rrb.TextLogView(origin=series.EVENTS, name="events")] if given.has_events else []
    names = {field: field if field.startswith(READING) else f"memory: {field}" for field in given.memory}
    tabs += [_plot(series.memory_entity(field), name) for field, name in names.items()]
    now = rrb.TextDocumentView(origin=series.NOW, name="now")
    if given.level is Level.SUMMARY:
        logs = [rrb.Tabs(*tabs)] if tabs else []
        return _blueprint(rrb.Vertical(now, flashes, *logs, order, row_shares=[1, *[4] * (2 + len(logs))]))
    tabs += [_plot(series.PHASE_LEAD, "phase ahead of reference [cycles]", half), _plot(series.PHASES, "phases [ms]")]
    has_pictures = given.pixels and given.level is Level.FULL
    if has_pictures:
        tabs.append(_plot(series.WHEELS, "wheels [cm/s]"))
    plots: list[rrb.Container | rrb.View] = [flashes, rrb.Tabs(*tabs), order]
    x_cm, y_cm = ((-given.margin_cm, side + given.margin_cm) for side in given.largest_cm)
    arena: rrb.Container | rrb.View = _picture("/", given.place, x_cm, y_cm, contents="/arena/**")
    said = rrb.Horizontal(now, rrb.TextDocumentView(origin=layers.LEGEND, name="what is drawn"), column_shares=[2, 5])
    if given.largest_cm[1] == 0:
        return _blueprint(rrb.Vertical(said, arena, *plots, row_shares=[1, 1, 2, 2, 2]))
    if has_pictures:
        space_time = rrb.Spatial2DView(origin=layers.SPACE_TIME, name="camera rows over a minute", background=NIGHT)
        arena = rrb.Tabs(arena, space_time)
    left_side, shares = rrb.Vertical(said, arena, row_shares=[1, 5]), [3, 2] if given.pixels else [1, 1]
    above = rrb.Horizontal(left_side, rrb.Vertical(*plots), column_shares=shares)
    if not has_pictures:
        return _blueprint(above)
    left = -layers.SCALE - layers.PITCH * len(str(given.size - 1)) - 0.3  # of row numbers
    rows = -0.3, given.size + 0.3
    cameras = _picture(layers.CAMERA, "camera rows", (left, given.pixels + 0.3), rows)
    distances = _picture(layers.INFRARED, "infrared distances [mm]", (left, SENSORS + 0.3), rows)
    pictures = rrb.Horizontal(cameras, distances, column_shares=[3, 2])
    return _blueprint(rrb.Vertical(above, pictures, row_shares=[3, 1]))


def _plot(origin: str, name: str, values: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    """Return a plot of all times; its name replaces the legend, which would lie over the curves."""
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(*[rrb.TimeRangeBoundary.infinite()] * 2))
    legend = rrb.PlotLegend(visible=False)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=whole, axis_y=values, plot_legend=legend)


def _picture(
    origin: str, name: str, x: tuple[float, float], y: tuple[float, float], contents: str = "$origin/**"
) -> rrb.Spatial2DView:
    """Return a view of a plane, dark in every theme, as its colours are chosen for a dark background."""
    bounds = rrb.VisualBounds2D(x_range=x, y_range=y)
    return rrb.Spatial2DView(origin=origin, contents=contents, name=name, visual_bounds=bounds, background=NIGHT)


def _blueprint(body: rrb.Container) -> rrb.Blueprint:
    return rrb.Blueprint(body, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True)


@lru_cache
def layout_file(given: Arrangement) -> bytes:
    """Return the bytes of a layout file for the viewer; cached, as rerun leaves four threads behind for each.

    The file is made in memory, as on a full disk rerun would wait for ever. It also holds an empty recording.
    """
    stream = rr.RecordingStream(APPLICATION, send_properties=False)
    if not rr.is_enabled(stream):
        raise RecordingError("RERUN is off in the environment, and nothing can be recorded: unset it")
    layout = stream.memory_recording()
    stream.send_blueprint(make_layout(given))
    return layout.drain_as_bytes()
