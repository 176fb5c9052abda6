"""Series of a measure over the cycles: at each point of a sweep, the mean of the trials that reach a cycle."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.labels import distinguishing_labels, statistic_label
from epuck_sim.figures.looks import Look, choose_looks, space_markers
from epuck_sim.figures.style import BAND, GREY, STYLE, count_trials, finish, make_panels, typeset
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


@rc_context(STYLE)
def draw_series(title: str, of: str, points: Sequence[PointSeries], width_cm: float | None = None) -> Figure:
    """Draw a line for each point; `plot_series` says how.

    Args:
        title: Title of the figure, to which the numbers of trials are added.
        of: Name of the measure.
        points: Its series at each point, at least one.
        width_cm: Width of the figure; by default that of a column.

    Raises:
        EpuckSimError: There are too many lines.
    """
    trials = count_trials([int(point.statistics.trials[0]) for point in points])
    figure, panels = make_panels(f"{title}\n{trials}", [""], series_labels(of), width_cm)
    plot_series(panels[0], points)
    finish(figure, panels)
    return figure


def series_labels(of: str) -> tuple[str, str]:
    """Return the labels of the horizontal and of the vertical axis, for the measure of this name."""
    return "cycle", typeset(statistic_label(["mean"], of))


def plot_series(axes: Axes, points: Sequence[PointSeries]) -> None:
    """Draw the mean over the cycles at each point, in its 95 % band; dashed where some trials have ended before.

    Every mark has a label, which `axes.legend()` shows.

    Raises:
        EpuckSimError: There are too many lines.
    """
    if len(points) > MAX_LINES:
        raise EpuckSimError(
            f"there would be {len(points)} lines, one for each point; allowed: up to {MAX_LINES}; epuck-sim summarize "
            "prints all"
        )
    labels = distinguishing_labels([point.axes for point in points])
    for place, (point, label, look) in enumerate(zip(points, labels, choose_looks(len(points)), strict=True)):
        _draw_line(axes, point, look, typeset(label), place)
    axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    if any(np.isfinite(point.statistics.mean[:, 1]).any() for point in points):
        axes.fill_between([], [], color=GREY, alpha=BAND, linewidth=0, label="95 % interval")
    if any((point.statistics.trials < point.statistics.trials[0]).any() for point in points):
        axes.plot([], [], "--", color=GREY, label="some trials have ended")


def _draw_line(axes: Axes, point: PointSeries, look: Look, label: str, place: int) -> None:
    series = point.statistics
    mean, low, high = series.mean.T
    complete = int(np.count_nonzero(series.trials == series.trials[0]))
    axes.fill_between(series.cycles, low, high, color=look.colour, alpha=BAND, linewidth=0)
    axes.plot(
        series.cycles[:complete],
        mean[:complete],
        color=look.colour,
        marker=look.marker,
        markevery=space_markers(mean[:complete], place),
        label=label or None,
    )
    if complete < len(mean):
        axes.plot(series.cycles[complete - 1 :], mean[complete - 1 :], "--", color=look.colour)
