"""How the viewer lays a recording out: the arena on the left, plots on the right, pictures below, time in seconds."""

import tempfile
from functools import lru_cache
from pathlib import Path

import rerun.blueprint as rrb

from epuck_sim.recording.chunks import APPLICATION, TIMELINE
from epuck_sim.recording.level import Level
from epuck_sim.recording.pictures import CAMERA, INFRARED, SPACE_TIME
from epuck_sim.recording.series import FLASHES, PHASES, WHEELS

MARGIN_CM = 2.0
"""Around the arena."""


def make_layout(level: Level, width_cm: float, height_cm: float) -> rrb.Blueprint:
    """Return the layout for recordings of a level, in an arena of this size."""
    whole = rrb.TimeAxis(view_range=rrb.TimeRange(*[rrb.TimeRangeBoundary.infinite()] * 2))
    hidden = rrb.PlotLegend(visible=False)
    flashes = rrb.TimeSeriesView(origin=FLASHES, name="flashes [robot]", axis_x=whole, plot_legend=hidden)
    phases = rrb.TimeSeriesView(origin=PHASES, name="phases [ms]", axis_x=whole, plot_legend=hidden)
    unit = rrb.ScalarAxis(range=(0, 1.02))
    order = rrb.TimeSeriesView(origin="/order", name="order parameter", axis_x=whole, axis_y=unit)
    bounds = rrb.VisualBounds2D(x_range=(-MARGIN_CM, width_cm + MARGIN_CM), y_range=(-MARGIN_CM, height_cm + MARGIN_CM))
    arena = rrb.Spatial2DView(origin="/", contents="/arena/**", name="arena [cm]", visual_bounds=bounds)
    if level is Level.SUMMARY:
        body: rrb.Container = rrb.Vertical(flashes, order)
    elif level is Level.POSES:
        body = rrb.Horizontal(arena, rrb.Vertical(flashes, phases, order), column_shares=[3, 2])
    else:
        wheels = rrb.TimeSeriesView(origin=WHEELS, name="wheels [cm/s]", axis_x=whole, plot_legend=hidden)
        rows = rrb.Spatial2DView(origin=CAMERA, name="camera rows")
        space_time = rrb.Spatial2DView(origin=SPACE_TIME, name="camera rows over a minute")
        distances = rrb.Spatial2DView(origin=INFRARED, name="infrared distances [mm]")
        pictures = rrb.Horizontal(rows, distances, column_shares=[3, 2])
        plots = rrb.Vertical(flashes, rrb.Tabs(phases, wheels), order)
        above = rrb.Horizontal(rrb.Tabs(arena, space_time), plots, column_shares=[3, 2])
        body = rrb.Vertical(above, pictures, row_shares=[3, 1])
    time = rrb.TimePanel(timeline=TIMELINE, state="collapsed")
    return rrb.Blueprint(body, time, collapse_panels=True)


@lru_cache
def layout_file(level: Level, width_cm: float, height_cm: float) -> bytes:
    """Return a layout as a file for the viewer (.rbl); each that is made leaves two threads of rerun behind."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "layout.rbl"
        make_layout(level, width_cm, height_cm).save(APPLICATION, file)
        return file.read_bytes()
