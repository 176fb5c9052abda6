"""Layouts of the viewer: the arena on the left, plots on the right, pictures below, time in seconds."""

import tempfile
from collections.abc import Callable, Sequence
from functools import lru_cache
from pathlib import Path

import rerun as rr
import rerun.blueprint as rrb

from epuck_sim.embodied.step import READING
from epuck_sim.recording.chunks import APPLICATION, TIMELINE
from epuck_sim.recording.layers.arena import NUMBERS, ROBOTS
from epuck_sim.recording.layers.robots import CAMERA, INFRARED, SPACE_TIME
from epuck_sim.recording.layers.series import EVENTS, FLASHES, PHASE_LEAD, PHASES, WHEELS, memory_entity
from epuck_sim.recording.level import Level
from epuck_sim.util.atomic_write import write_errors

MARGIN_CM = 2.0
"""Margin around the arena of robots, cm."""

NUMBER_RADIUS_CM = 1e-3
"""Radius of the points that carry the numbers of robots, cm: too small to be seen."""

MARGIN_SHARE = 1 / 30
"""Margin around the space of point-like agents, as a share of its width."""


def robot_layout(
    level: Level, width_cm: float, height_cm: float, memory: Sequence[str] = (), has_events: bool = False
) -> rrb.Blueprint:
    """Return the layout for recordings of robots.

    Args:
        level: How much is recorded.
        width_cm: Width of the arena.
        height_cm: Height of the arena.
        memory: Fields of the controllers' MEMORY that are recorded.
        has_events: Whether there is a log of events.
    """
    flashes, lead, phases, order = _plots("robot")
    logs: list[rrb.View] = [
        _plot(memory_entity(field), field if field.startswith(READING) else f"memory: {field}") for field in memory
    ]
    if has_events:
        logs.insert(0, rrb.TextLogView(origin=EVENTS, name="events"))
    arena = _arena(width_cm, height_cm, MARGIN_CM)
    if level is Level.SUMMARY:
        body: rrb.Container = rrb.Vertical(flashes, *([rrb.Tabs(*logs)] if logs else []), order)
    elif level is Level.POSES:
        plots = rrb.Vertical(flashes, rrb.Tabs(*logs, lead, phases), order)
        body = rrb.Horizontal(arena, plots, column_shares=[3, 2])
    else:
        wheels = _plot(WHEELS, "wheels [cm/s]")
        rows = rrb.Spatial2DView(origin=CAMERA, name="camera rows")
        space_time = rrb.Spatial2DView(origin=SPACE_TIME, name="camera rows over a minute")
        distances = rrb.Spatial2DView(origin=INFRARED, name="infrared distances [mm]")
        pictures = rrb.Horizontal(rows, distances, column_shares=[3, 2])
        plots = rrb.Vertical(flashes, rrb.Tabs(*logs, lead, phases, wheels), order)
        above = rrb.Horizontal(rrb.Tabs(arena, space_time), plots, column_shares=[3, 2])
        body = rrb.Vertical(above, pictures, row_shares=[3, 1])
    return _blueprint(body)


def agent_layout(
    level: Level, width_cm: float, height_cm: float, _: Sequence[str] = (), __: bool = False
) -> rrb.Blueprint:
    """Return the layout for recordings of point-like agents, which remember nothing and have no events.

    A segment, which has no height, lies above the plots.
    """
    flashes, lead, phases, order = _plots("agent")
    arena = _arena(width_cm, height_cm, MARGIN_SHARE * width_cm)
    if level is Level.SUMMARY:
        body: rrb.Container = rrb.Vertical(flashes, order)
    elif height_cm > 0:
        body = rrb.Horizontal(arena, rrb.Vertical(flashes, rrb.Tabs(lead, phases), order), column_shares=[1, 1])
    else:
        body = rrb.Vertical(arena, flashes, rrb.Tabs(lead, phases), order, row_shares=[1, 2, 2, 2])
    return _blueprint(body)


def _plots(noun: str) -> tuple[rrb.TimeSeriesView, ...]:
    """Return the plots of flashes, phase leads, phases and the order parameter; `noun` is robot or agent."""
    half = rrb.ScalarAxis(range=(-0.52, 0.52))
    unit = rrb.ScalarAxis(range=(0, 1.02))
    return (
        _plot(FLASHES, f"flashes [{noun}]"),
        _plot(PHASE_LEAD, "phase ahead of reference [cycles]", half),
        _plot(PHASES, "phases [ms]"),
        _plot("/order", "order parameter: blue at firings of the reference, red the threshold", unit),
    )


def _plot(origin: str, name: str, values: rrb.ScalarAxis | None = None) -> rrb.TimeSeriesView:
    """Return a plot of all times; its name says what a legend would, which lies over the curves."""
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(*[rrb.TimeRangeBoundary.infinite()] * 2))
    legend = rrb.PlotLegend(visible=False)
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=whole, axis_y=values, plot_legend=legend)


def _arena(width_cm: float, height_cm: float, margin_cm: float) -> rrb.Spatial2DView:
    bounds = rrb.VisualBounds2D(x_range=(-margin_cm, width_cm + margin_cm), y_range=(-margin_cm, height_cm + margin_cm))
    # a label has the colour of its disc, on which it can hardly be read: it gets points of its own
    discs = rr.Points2D.from_fields(show_labels=False).visualizer()
    numbers = rr.Points2D.from_fields(colors=NUMBERS, radii=NUMBER_RADIUS_CM).visualizer()
    return rrb.Spatial2DView(
        origin="/",
        contents="/arena/**",
        name="arena [cm]",
        visual_bounds=bounds,
        overrides={ROBOTS: [discs, numbers]},
    )


def _blueprint(body: rrb.Container) -> rrb.Blueprint:
    return rrb.Blueprint(body, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True)


LAYOUT_BYTES = 2_000_000
"""More than the file of any layout takes."""


@lru_cache
def layout_file(
    level: Level,
    width_cm: float,
    height_cm: float,
    make: Callable[[Level, float, float, Sequence[str], bool], rrb.Blueprint] = robot_layout,
    memory: tuple[str, ...] = (),
    has_events: bool = False,
) -> bytes:
    """Return a layout as a file for the viewer (.rbl), which is cached: rerun leaves two threads behind for each.

    Raises:
        EpuckSimError: The folder for temporary files has no room.
    """
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layout.rbl"
        with write_errors(file):
            file.write_bytes(bytes(LAYOUT_BYTES))  # rerun would wait for ever for room
        make(level, width_cm, height_cm, memory, has_events).save(APPLICATION, file)
        return file.read_bytes()
