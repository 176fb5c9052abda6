"""Layouts of the viewer: the arena on the left, plots on the right, pictures below, time in seconds."""

from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import rerun as rr
import rerun.blueprint as rrb

from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.step import READING
from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level
from epuck_sim.recording.layers import CAMERA, INFRARED, LEGEND, NIGHT, SPACE_TIME, number_width
from epuck_sim.recording.rows import population_of
from epuck_sim.recording.rrd_file import APPLICATION, TIMELINE
from epuck_sim.recording.series import EVENTS, FLASHES, NOW, PHASE_LEAD, PHASES, WHEELS, memory_entity
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import Scenario

MARGIN_CM, MARGIN_SHARE = 2.0, 1 / 30
"""Margin around the arena of robots, cm, and around the space of agents, as a share of its width."""


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


def layout_of(scenario: Scenario, level: Level, memory: Sequence[str] = ()) -> rrb.Blueprint:
    """Return the viewer's layout for recordings of a scenario; raise RecordingError as `population_of` does."""
    return make_layout(arrangement_of(scenario, level, memory))


def make_layout(given: Arrangement) -> rrb.Blueprint:
    """Return a layout; a segment, which has no height, lies above the plots."""
    half, unit = rrb.ScalarAxis(range=(-0.52, 0.52)), rrb.ScalarAxis(range=(0, 1.02))
    flashes = _plot(FLASHES, f"flashes [{given.noun}]")
    order = _plot("/order", "order parameter: blue at firings of the reference, red the threshold", unit)
    tabs: list[rrb.View] = [rrb.TextLogView(origin=EVENTS, name="events")] if given.has_events else []
    names = {field: field if field.startswith(READING) else f"memory: {field}" for field in given.memory}
    tabs += [_plot(memory_entity(field), name) for field, name in names.items()]
    now = rrb.TextDocumentView(origin=NOW, name="now")
    if given.level is Level.SUMMARY:
        logs = [rrb.Tabs(*tabs)] if tabs else []
        return _blueprint(rrb.Vertical(now, flashes, *logs, order, row_shares=[1, *[4] * (2 + len(logs))]))
    tabs += [_plot(PHASE_LEAD, "phase ahead of reference [cycles]", half), _plot(PHASES, "phases [ms]")]
    has_pictures = given.pixels and given.level is Level.FULL
    if has_pictures:
        tabs.append(_plot(WHEELS, "wheels [cm/s]"))
    plots: list[rrb.Container | rrb.View] = [flashes, rrb.Tabs(*tabs), order]
    x_cm, y_cm = ((-given.margin_cm, side + given.margin_cm) for side in given.largest_cm)
    arena: rrb.Container | rrb.View = _picture("/", given.place, x_cm, y_cm, contents="/arena/**")
    said = rrb.Horizontal(now, rrb.TextDocumentView(origin=LEGEND, name="what is drawn"), column_shares=[2, 5])
    if given.largest_cm[1] == 0:
        return _blueprint(rrb.Vertical(said, arena, *plots, row_shares=[1, 1, 2, 2, 2]))
    if has_pictures:
        space_time = rrb.Spatial2DView(origin=SPACE_TIME, name="camera rows over a minute", background=NIGHT)
        arena = rrb.Tabs(arena, space_time)
    left_side, shares = rrb.Vertical(said, arena, row_shares=[1, 5]), [3, 2] if given.pixels else [1, 1]
    above = rrb.Horizontal(left_side, rrb.Vertical(*plots), column_shares=shares)
    if not has_pictures:
        return _blueprint(above)
    left, rows = -number_width(given.size), (-0.3, given.size + 0.3)
    cameras = _picture(CAMERA, "camera rows", (left, given.pixels + 0.3), rows)
    distances = _picture(INFRARED, "infrared distances [mm]", (left, SENSORS + 0.3), rows)
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
