"""Distributions of T_sync beside Appendix A's mean, also as if trials had been censored earlier (thesis Fig. A.1).

Distributions of measures stand beside their means.
"""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.labels import axis_label, distinguishing_labels, quantity_label
from epuck_sim.figures.style import (
    add_shared_legend,
    format_tick,
    is_logarithmic,
    make_logarithmic,
    make_panels,
)
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import group_by_other_axes
from epuck_sim.statistics.estimate import Estimate
from epuck_sim.statistics.measured import Measured, measure
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import estimate
from epuck_sim.statistics.weibull_mean import estimate_weibull_mean

COLUMNS = ("trials", "censored", "mean", "weibull_mean", "weibull_low", "weibull_high")
"""Columns after the axes in the table: number of trials, share of censored ones, and cycles."""

MEASURE_COLUMNS = ("trials", "mean", "mean_low", "mean_high")
"""Columns after the axes in the table of a measure."""

HEIGHTS = 100
"""Number of times at which the density of a violin is evaluated."""

HALF_WIDTH = 0.4
"""Half the largest width of a violin, relative to the smallest distance between two."""

VIOLIN = "#6baed6"
"""Colour of violins."""

LINE = "#b2182b"
"""Colour of the line through the estimates."""


class Violins(NamedTuple):
    """Distributions of T_sync, in cycles, or of a measure, along an axis, at the S points that have trials."""

    axes: dict[str, Any]
    """Values of the other axes."""
    x: FloatArray
    """(S,) values of the axis, ascending."""
    synchronised: list[FloatArray]
    """S arrays, (trials,) each: T_sync of the trials that are not censored."""
    trials: IntArray
    """(S,) number of trials, censored ones included."""
    sample_means: FloatArray
    """(S,) mean of all trials; NaN where some are censored."""
    estimates: FloatArray
    """(S, 3) mean by Appendix A and the ends of its 95 % interval, with early censoring; NaN where undetermined.

    Of a measure, the mean of the sample and the ends of its interval.
    """
    of: str | None = None
    """Name of the measure; None for T_sync."""

    @property
    def censored(self) -> IntArray:
        """(S,) number of trials that are censored in the data themselves."""
        return self.trials - np.array([len(times) for times in self.synchronised], np.int64)


def read_violins(points: Sequence[PointTrials], axis: str, censored_at: int | None = None) -> list[Violins]:
    """Return the violins of each combination of the values of the other axes, in the order of the sweep.

    Args:
        points: Points of a sweep.
        axis: Dotted key of the horizontal axis.
        censored_at: Cycle at which the estimate takes trials to be censored; by default, where they are.
    """
    groups = group_by_other_axes(points, axis)
    if points[0].of is not None:
        return [_measure_violins(group, axis, others) for others, group in groups]
    return [_violins(group, axis, others, censored_at) for others, group in groups]


def _measure_violins(points: Sequence[PointTrials], axis: str, others: dict[str, Any]) -> Violins:
    measured = [measure(point) for point in points]
    if any(each.is_share for each in measured):
        raise EpuckSimError(f"{points[0].of} is a truth value, whose distribution is a share: give --form curves")
    return Violins(
        axes=others,
        x=np.array([point.axes[axis] for point in points], np.float64),
        synchronised=[each.values for each in measured],
        trials=np.array([len(each.values) for each in measured]),
        sample_means=np.full(len(points), np.nan),
        estimates=np.array([estimate(each, Statistic.MEAN) for each in measured]),
        of=points[0].of,
    )


def _violins(points: Sequence[PointTrials], axis: str, others: dict[str, Any], censored_at: int | None) -> Violins:
    for point in points:
        measure(point)  # refuses trials without T_sync
    return Violins(
        axes=others,
        x=np.array([point.axes[axis] for point in points], np.float64),
        synchronised=[point.times[point.observed] for point in points],
        trials=np.array([len(point.times) for point in points]),
        sample_means=np.array([point.times.mean() if point.observed.all() else np.nan for point in points]),
        estimates=np.array([_estimate(point, censored_at) for point in points]),
    )


def _estimate(point: PointTrials, censored_at: int | None) -> Estimate:
    limit = np.inf if censored_at is None else censored_at
    observed = point.observed & (point.times <= limit)
    return estimate_weibull_mean(Measured(np.minimum(point.times, limit), observed, limit, point.seed))


def violins_table(axis: str, groups: Sequence[Violins]) -> Table:
    """Return a table with a row for each violin of groups over `axis`, a dotted key."""
    columns = COLUMNS if groups[0].of is None else MEASURE_COLUMNS
    return Table((*groups[0].axes, axis, *columns), _rows(groups))


def _rows(groups: Sequence[Violins]) -> Iterator[list[Any]]:
    for group in groups:
        columns = [group.x, group.trials, *group.estimates.T]
        if group.of is None:
            columns[2:2] = [group.censored / group.trials, group.sample_means]
        for row in zip(*columns, strict=True):
            yield [*group.axes.values(), *map(rounded, row)]


def draw_violins(title: str, axis: str, groups: Sequence[Violins], censored_at: int | None = None) -> Figure:
    """Draw a panel for each group, T_sync on a logarithmic scale, and measures that are positive and far apart.

    A violin is the density of log T_sync of the trials that synchronised, a bar where they all took one time. The line
    is the estimate in its 95 % band, with a cross at the upper edge where it is undetermined; a dot is the mean of all
    trials, where none is censored; a dashed line is where the estimate takes trials to be censored.

    Args:
        title: Title of the figure.
        axis: Dotted key of the horizontal axis.
        groups: Violins of each panel, at least one.
        censored_at: Cycle with which they were read.

    Raises:
        EpuckSimError: There are more groups than panels of a figure.
    """
    titles = distinguishing_labels([each.axes for each in groups])
    size = (6.2, 3.8) if len(groups) == 1 else (3.6, 2.7)
    figure, panels = make_panels(
        _heading(title, groups), titles, (axis_label(axis), quantity_label(groups[0].of)), size
    )
    x = np.concatenate([each.x for each in groups])
    is_log = is_logarithmic(axis, x)
    shown = np.concatenate([array for each in groups for array in (*each.synchronised, each.estimates[:, 0])])
    known = shown[np.isfinite(shown)]
    has_logs = groups[0].of is None or (len(known) > 0 and is_logarithmic(groups[0].of, known))
    make_logarithmic(panels[0], *["y"] * has_logs, *["x"] * is_log)
    places = np.unique(np.log10(x) if is_log else x)
    half_width = HALF_WIDTH * (np.diff(places).min() if len(places) > 1 else 1.0)
    highest = float(known.max(initial=censored_at or 1)) if groups[0].of is None else float(known.max(initial=-np.inf))
    for panel, group in zip(panels, groups, strict=True):
        _draw_violins(panel, group, half_width, is_log, has_logs)
        _draw_estimates(panel, group, highest)
        if censored_at is not None:
            limit = f"T_cens of the Weibull mean: {format_tick(censored_at)}"
            panel.axhline(censored_at, color="0.3", linestyle="--", linewidth=1, label=limit)
    if groups[0].of is None:
        panels[0].set_ylim(top=3 * highest)
    add_shared_legend(figure, panels)
    return figure


def _heading(title: str, groups: Sequence[Violins]) -> str:
    censored, trials = (int(sum(getattr(each, name).sum() for each in groups)) for name in ("censored", "trials"))
    return f"{title}\n{censored} of {trials} trials censored, not in the violins" if censored else title


def _draw_violins(panel: Axes, group: Violins, half_width: float, is_log: bool, has_logs: bool) -> None:
    """Draw violins with this largest half-width, in decades where x is logarithmic."""
    label = "trials that synchronised" if group.of is None else "trials"
    for x, times in zip(group.x, group.synchronised, strict=True):
        if len(times):
            heights, widths = density(times) if has_logs else linear_density(times)
            left, right = (x * 10**side if is_log else x + side for side in (-half_width * widths, half_width * widths))
            panel.fill_betweenx(heights, left, right, color=VIOLIN, linewidth=1, label=label)


def density(times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Estimate the density of the logarithms of times, (n,) cycles, by normal kernels as wide as Scott's rule says.

    Returns:
        Times from the smallest to the largest, and the density there, relative to its maximum; 1 where all are equal.

    >>> density(np.array([7.0, 7.0]))
    (array([7., 7.]), array([1., 1.]))
    """
    if times.min() == times.max():
        return np.repeat(times[0], 2), np.ones(2)
    heights, found = linear_density(np.log10(times))
    return 10**heights, found


def linear_density(values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Estimate the density of values, (n,), as `density` does that of logarithms of times."""
    # scipy.stats.gaussian_kde gives the same to 1e-15, but takes a second to import and 20 ms for 1,000 times
    if values.min() == values.max():
        return np.repeat(values[0], 2), np.ones(2)
    heights = np.linspace(values.min(), values.max(), HEIGHTS)
    width = values.std(ddof=1) * len(values) ** -0.2
    found = np.array([np.exp(-(((values - height) / width) ** 2) / 2).sum() for height in heights])
    return heights, found / found.max()


def _draw_estimates(panel: Axes, group: Violins, highest: float) -> None:
    means, low, high = np.nan_to_num(group.estimates, posinf=1e12, nan=np.nan).T
    panel.fill_between(group.x, low, high, color=LINE, alpha=0.25, linewidth=0)
    label = "Weibull mean (Appendix A)" if group.of is None else "mean"
    panel.plot(group.x, means, ".-", color=LINE, linewidth=1.2, markersize=3, label=label)
    unknown = group.x[np.isnan(means)]
    if len(unknown) and group.of is None:
        panel.plot(unknown, np.full(len(unknown), 2 * highest), "x", color=LINE, label="undetermined")
    if not np.isnan(group.sample_means).all():
        panel.plot(group.x, group.sample_means, "o", color="black", markersize=4, label="mean of all trials")
