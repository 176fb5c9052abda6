"""Layouts of the viewer: the arena on the left, plots on the right, pictures below, time in seconds."""

import tempfile
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import rerun.blueprint as rrb

from epuck_sim.recording.chunks import APPLICATION, TIMELINE
from epuck_sim.recording.layers.images import CAMERA, INFRARED, SPACE_TIME
from epuck_sim.recording.layers.time_series import FLASHES, PHASES, WHEELS
from epuck_sim.recording.level import Level

MARGIN_CM = 2.0
"""Margin around the arena of robots, cm."""

MARGIN_SHARE = 1 / 30
"""Margin around the space of point-like agents, as a share of its width."""


def robot_layout(level: Level, width_cm: float, height_cm: float) -> rrb.Blueprint:
    """Return the layout for recordings of robots at a level, in an arena of this size."""
    flashes, phases, order = _plots("robot")
    arena = _arena(width_cm, height_cm, MARGIN_CM)
    if level is Level.SUMMARY:
        body: rrb.Container = rrb.Vertical(flashes, order)
    elif level is Level.POSES:
        body = rrb.Horizontal(arena, rrb.Vertical(flashes, phases, order), column_shares=[3, 2])
    else:
        wheels = _plot(WHEELS, "wheels [cm/s]")
        rows = rrb.Spatial2DView(origin=CAMERA, name="camera rows")
        space_time = rrb.Spatial2DView(origin=SPACE_TIME, name="camera rows over a minute")
        distances = rrb.Spatial2DView(origin=INFRARED, name="infrared distances [mm]")
        pictures = rrb.Horizontal(rows, distances, column_shares=[3, 2])
        plots = rrb.Vertical(flashes, rrb.Tabs(phases, wheels), order)
        above = rrb.Horizontal(rrb.Tabs(arena, space_time), plots, column_shares=[3, 2])
        body = rrb.Vertical(above, pictures, row_shares=[3, 1])
    return _blueprint(body)


def agent_layout(level: Level, width_cm: float, height_cm: float) -> rrb.Blueprint:
    """Return the layout for recordings of point-like agents; a segment, which has no height, lies above the plots."""
    flashes, phases, order = _plots("agent")
    arena = _arena(width_cm, height_cm, MARGIN_SHARE * width_cm)
    if level is Level.SUMMARY:
        body: rrb.Container = rrb.Vertical(flashes, order)
    elif height_cm > 0:
        body = rrb.Horizontal(arena, rrb.Vertical(flashes, phases, order), column_shares=[1, 1])
    else:
        body = rrb.Vertical(arena, flashes, phases, order, row_shares=[1, 2, 2, 2])
    return _blueprint(body)


def _plots(noun: str) -> tuple[rrb.TimeSeriesView, rrb.TimeSeriesView, rrb.TimeSeriesView]:
    """Return the plots of flashes, phases and the order parameter; `noun` is robot or agent."""
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(*[rrb.TimeRangeBoundary.infinite()] * 2))
    unit = rrb.ScalarAxis(range=(0, 1.02))
    order = rrb.TimeSeriesView(origin="/order", name="order parameter", axis_x=whole, axis_y=unit)
    return _plot(FLASHES, f"flashes [{noun}]"), _plot(PHASES, "phases [ms]"), order


def _plot(origin: str, name: str) -> rrb.TimeSeriesView:
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(*[rrb.TimeRangeBoundary.infinite()] * 2))
    return rrb.TimeSeriesView(origin=origin, name=name, axis_x=whole, plot_legend=rrb.PlotLegend(visible=False))


def _arena(width_cm: float, height_cm: float, margin_cm: float) -> rrb.Spatial2DView:
    bounds = rrb.VisualBounds2D(x_range=(-margin_cm, width_cm + margin_cm), y_range=(-margin_cm, height_cm + margin_cm))
    return rrb.Spatial2DView(origin="/", contents="/arena/**", name="arena [cm]", visual_bounds=bounds)


def _blueprint(body: rrb.Container) -> rrb.Blueprint:
    return rrb.Blueprint(body, rrb.TimePanel(timeline=TIMELINE, state="collapsed"), collapse_panels=True)


@lru_cache
def layout_file(
    level: Level,
    width_cm: float,
    height_cm: float,
    make: Callable[[Level, float, float], rrb.Blueprint] = robot_layout,
) -> bytes:
    """Return a layout as a file for the viewer (.rbl), which is cached: rerun leaves two threads behind for each."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layout.rbl"
        make(level, width_cm, height_cm).save(APPLICATION, file)
        return file.read_bytes()
