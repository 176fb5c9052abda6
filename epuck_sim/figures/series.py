"""Series of a measure over the cycles: at each point of a sweep, the mean of the trials that reach a cycle."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.labels import distinguishing_labels, quantity_label
from epuck_sim.figures.style import disable_mathtext, make_panels
from epuck_sim.statistics.series import PointSeries

COLUMNS = ("cycle", "trials", "known", "mean", "low", "high", "median", "median_low", "median_high")
"""Columns after the axes in the table: number of trials that reach the cycle, and of those with a value there."""

MAX_LINES = 20
"""Largest number of lines; more of them are hard to distinguish."""


def series_table(points: Sequence[PointSeries]) -> Table:
    """Return a table with a row for each cycle of each point of a sweep."""
    return Table((*points[0].axes, *COLUMNS), _rows(points))


def _rows(points: Sequence[PointSeries]) -> Iterator[list[Any]]:
    for axes, series in points:
        columns = (series.cycles, series.trials, series.known, *series.mean.T, *series.median.T)
        for row in zip(*columns, strict=True):
            yield [*axes.values(), *map(rounded, row)]


def draw_series(title: str, of: str, points: Sequence[PointSeries]) -> Figure:
    """Draw the mean over the cycles at each point, in its 95 % band; dashed where some trials have ended before.

    Args:
        title: Title of the figure.
        of: Name of the measure.
        points: Its series at each point, at least one.
    """
    figure, (panel,) = make_panels(title, [""], ("cycle", f"{quantity_label(of)}, mean"), (6.0, 3.8))
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(points)))
    labels = distinguishing_labels([point.axes for point in points])
    for point, colour, label in zip(points, colours, labels, strict=True):
        _draw_line(panel, point, colour, label)
    panel.xaxis.set_major_locator(MaxNLocator(integer=True))
    if any((point.statistics.trials < point.statistics.trials[0]).any() for point in points):
        panel.plot([], [], "--", color="0.4", label="some trials have ended")
    if panel.get_legend_handles_labels()[1]:
        disable_mathtext(panel.legend(fontsize="small"))
    return figure


def _draw_line(panel: Axes, point: PointSeries, colour: FloatArray, label: str) -> None:
    series = point.statistics
    mean, low, high = series.mean.T
    complete = int(np.count_nonzero(series.trials == series.trials[0]))
    panel.fill_between(series.cycles, low, high, color=colour, alpha=0.2, linewidth=0)
    panel.plot(series.cycles[:complete], mean[:complete], color=colour, linewidth=1.2, label=label or None)
    if complete < len(mean):
        panel.plot(series.cycles[complete - 1 :], mean[complete - 1 :], "--", color=colour, linewidth=1.2)
