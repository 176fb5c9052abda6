"""Distributions of T_sync beside Appendix A's mean, also as if trials had been censored earlier (thesis Fig. A.1)."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.labels import axis_label, distinguishing_labels
from epuck_sim.figures.scales import format_tick, is_logarithmic, is_plain, make_logarithmic
from epuck_sim.figures.style import BAND, GREY, STYLE, count_trials, finish, make_panels, typeset
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import group_by_other_axes
from epuck_sim.statistics.estimate import Estimate
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.weibull_mean import estimate_weibull_mean

COLUMNS = ("trials", "censored", "mean", "weibull_mean", "weibull_low", "weibull_high")
"""Columns after the axes in the table: number of trials, share of censored ones, and cycles."""

HEIGHTS = 100
"""Number of times at which the density of a violin is evaluated."""

LABEL = typeset("T_sync [cycles]")
"""Label of the vertical axis."""

HALF_WIDTH = 0.4
"""Half the largest width of a violin, relative to the smallest distance between two."""

VIOLIN = "#5f9fd0"
"""Colour of violins."""

LINE = "#b2182b"
"""Colour of the line through the estimates."""


class Violins(NamedTuple):
    """Distributions of T_sync, in cycles, along an axis, at the S points that have trials."""

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
    """(S, 3) mean by Appendix A and the ends of its 95 % interval, with early censoring; NaN where undetermined."""

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
    return [_violins(group, axis, others, censored_at) for others, group in group_by_other_axes(points, axis)]


def _violins(points: Sequence[PointTrials], axis: str, others: dict[str, Any], censored_at: int | None) -> Violins:
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
    return Table((*groups[0].axes, axis, *COLUMNS), _rows(groups))


def _rows(groups: Sequence[Violins]) -> Iterator[list[Any]]:
    for group in groups:
        columns = (group.x, group.trials, group.censored / group.trials, group.sample_means, *group.estimates.T)
        for row in zip(*columns, strict=True):
            yield [*group.axes.values(), *map(rounded, row)]


@rc_context(STYLE)
def draw_violins(
    title: str, axis: str, groups: Sequence[Violins], censored_at: int | None = None, width_cm: float | None = None
) -> Figure:
    """Draw a panel for each group; `plot_violins` says how.

    Args:
        title: Title of the figure, to which the numbers of trials are added, and how many of them are censored.
        axis: Dotted key of the horizontal axis.
        groups: Violins of each panel, at least one.
        censored_at: Cycle with which they were read.
        width_cm: Width of the figure; by default that of a column, or of a page for several panels.

    Raises:
        EpuckSimError: There are more groups than panels of a figure.
    """
    among = (axis, *groups[0].axes)
    titles = distinguishing_labels([each.axes for each in groups], among)
    labels = axis_label(axis, among), LABEL
    figure, panels = make_panels(_heading(title, groups), titles, labels, width_cm)
    plot_violins(panels, axis, groups, censored_at)
    finish(figure, panels)
    return figure


def plot_violins(panels: Sequence[Axes], axis: str, groups: Sequence[Violins], censored_at: int | None = None) -> None:
    """Draw each group into a panel, T_sync on a logarithmic scale; the panels share their scales.

    A violin is the density of log T_sync of the trials that synchronised, a bar where they all took one time. The line
    is the estimate in its 95 % band, with a cross at the upper edge where it is undetermined; a dot is the mean of all
    trials, where none is censored; a dashed line is where the estimate takes trials to be censored. Every mark has a
    label, which `panel.legend()` shows.
    """
    x = np.concatenate([each.x for each in groups])
    is_log = is_logarithmic(axis, x)
    make_logarithmic(panels[0], "y", *["x"] * is_log)
    places = np.unique(np.log10(x) if is_log else x)
    half_width = HALF_WIDTH * (np.diff(places).min() if len(places) > 1 else 1.0)
    shown = [array for each in groups for array in (*each.synchronised, each.estimates[:, 0])]
    highest = float(np.nanmax(np.concatenate(shown), initial=censored_at or 1))
    for panel, group in zip(panels, groups, strict=True):
        _draw_violins(panel, group, half_width, is_log)
        _draw_estimates(panel, group, highest)
        if censored_at is not None:
            limit = format_tick(censored_at, plain=is_plain(1, censored_at))
            label = f"{typeset('T_cens')} of the Weibull mean: {limit}"
            panel.axhline(censored_at, color=GREY, linestyle="--", linewidth=1, label=label)
    panels[0].set_ylim(top=3 * highest)


def _heading(title: str, groups: Sequence[Violins]) -> str:
    numbers = count_trials(np.concatenate([each.trials for each in groups]).tolist())
    censored, trials = (int(sum(getattr(each, name).sum() for each in groups)) for name in ("censored", "trials"))
    left_out = f"; {censored} of {trials} trials censored, not in the violins" if censored else ""
    return f"{title}\n{numbers}{left_out}"


def _draw_violins(panel: Axes, group: Violins, half_width: float, is_log: bool) -> None:
    """Draw violins with this largest half-width, in decades where x is logarithmic."""
    for x, times in zip(group.x, group.synchronised, strict=True):
        if len(times):
            heights, widths = density(times)
            left, right = (x * 10**side if is_log else x + side for side in (-half_width * widths, half_width * widths))
            panel.fill_betweenx(heights, left, right, color=VIOLIN, linewidth=1, label="trials that synchronised")


def density(times: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Estimate the density of the logarithms of times, (n,) cycles, by normal kernels as wide as Scott's rule says.

    Returns:
        Times from the smallest to the largest, and the density there, relative to its maximum; 1 where all are equal.

    >>> density(np.array([7.0, 7.0]))
    (array([7., 7.]), array([1., 1.]))
    """
    # scipy.stats.gaussian_kde gives the same to 1e-15, but takes a second to import and 20 ms for 1,000 times
    logs = np.log10(times)
    if logs.min() == logs.max():
        return np.repeat(times[0], 2), np.ones(2)
    heights = np.linspace(logs.min(), logs.max(), HEIGHTS)
    width = logs.std(ddof=1) * len(logs) ** -0.2
    found = np.array([np.exp(-(((logs - height) / width) ** 2) / 2).sum() for height in heights])
    return 10**heights, found / found.max()


def _draw_estimates(panel: Axes, group: Violins, highest: float) -> None:
    means, low, high = np.nan_to_num(group.estimates, posinf=1e12, nan=np.nan).T
    panel.plot(group.x, means, ".-", color=LINE, label="Weibull mean (Appendix A)")
    panel.fill_between(group.x, low, high, color=LINE, alpha=BAND, linewidth=0, label="its 95 % interval")
    unknown = group.x[np.isnan(means)]
    if len(unknown):
        panel.plot(
            unknown, np.full(len(unknown), 2 * highest), "x", color=LINE, label="undetermined: too many censored"
        )
    if not np.isnan(group.sample_means).all():
        panel.plot(group.x, group.sample_means, "D", color="black", markersize=3, label="mean of all trials")
