"""Distributions of T_sync beside Appendix A's mean, also as if trials had been censored earlier (thesis Fig. A.1).

Distributions of measures stand beside their means.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.forms.densities import density, linear_density
from epuck_sim.figures.labels import axis_label, distinguishing_labels, quantity_label, undetermined_label
from epuck_sim.figures.scales import format_tick, has_log_scale, is_logarithmic, is_plain, make_logarithmic
from epuck_sim.figures.style import BAND, GREY, STYLE, count_trials, finish, make_panels, typeset
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import group_by_other_axes
from epuck_sim.statistics.estimate import Estimate
from epuck_sim.statistics.measured import Measured, cut, measure
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import estimate
from epuck_sim.statistics.weibull_mean import estimate_weibull_mean

COLUMNS = ("trials", "censored", "mean", "weibull_mean", "weibull_low", "weibull_high")
"""Columns after the axes in the table: number of trials, share of censored ones, and cycles."""

MEASURE_COLUMNS = ("trials", "mean", "mean_low", "mean_high")
"""Columns after the axes in the table of a measure."""

CROSS_AT = 0.965
"""Height of crosses, as a share of the panel."""

HALF_WIDTH = 0.4
"""Half the largest width of a violin, relative to the smallest distance between two."""

VIOLIN = "#5f9fd0"
"""Colour of violins."""

LINE = "#b2182b"
"""Colour of the line through the estimates."""


Density = Callable[[FloatArray], tuple[FloatArray, FloatArray]]
"""Returns values from the smallest to the largest, and their density there, relative to its maximum."""


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
    """(S,) mean of all trials; NaN where some are censored, and of a measure, whose estimates are means."""
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
    return [_violins(group, axis, others, censored_at) for others, group in groups]


def _violins(points: Sequence[PointTrials], axis: str, others: dict[str, Any], censored_at: int | None) -> Violins:
    measured = [measure(point) for point in points]
    if any(each.is_share for each in measured):
        raise EpuckSimError(f"{points[0].of} is a truth value, whose distribution is a share: give --form curves")
    return Violins(
        axes=others,
        x=np.array([point.axes[axis] for point in points], np.float64),
        synchronised=[each.values[each.observed] for each in measured],
        trials=np.array([len(each.values) for each in measured]),
        sample_means=np.array([_plain_mean(each) for each in measured]),
        estimates=np.array([_estimate(each, censored_at) for each in measured]),
        of=points[0].of,
    )


def _plain_mean(measured: Measured) -> float:
    return float(measured.values.mean()) if measured.is_time and measured.observed.all() else np.nan


def _estimate(measured: Measured, censored_at: int | None) -> Estimate:
    if not measured.is_time:
        return estimate(measured, Statistic.MEAN)
    return estimate_weibull_mean(measured if censored_at is None else cut(measured, censored_at))


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
    labels = axis_label(axis, among), violins_label(groups)
    figure, panels = make_panels(_heading(title, groups), titles, labels, width_cm)
    plot_violins(panels, axis, groups, censored_at)
    finish(figure, panels)
    return figure


def violins_label(groups: Sequence[Violins]) -> str:
    """Return the label of the vertical axis."""
    return typeset(quantity_label(groups[0].of))


def plot_violins(panels: Sequence[Axes], axis: str, groups: Sequence[Violins], censored_at: int | None = None) -> None:
    """Draw each group into a panel, on a logarithmic scale if its values are far apart; the panels share their scales.

    A violin is the density of log T_sync of the trials that synchronised, a bar where they all took one time. The line
    is the estimate in its 95 % band, with a cross at the upper edge where it is undetermined; a dot is the mean of all
    trials, where none is censored; a dashed line is where the estimate takes trials to be censored. Of a measure, a
    violin is the density of its values, or of their logarithms on a logarithmic scale, and the line is the mean. Every
    mark has a label, which `panel.legend()` shows.
    """
    x = np.concatenate([each.x for each in groups])
    shown = np.concatenate([array for each in groups for array in (*each.synchronised, each.estimates[:, 0])])
    is_log, has_logs = is_logarithmic(axis, x), has_log_scale(groups[0].of, shown)
    make_logarithmic(panels[0], *["y"] * has_logs, *["x"] * is_log)
    places = np.unique(np.log10(x) if is_log else x)
    half_width = HALF_WIDTH * (np.diff(places).min() if len(places) > 1 else 1.0)
    for panel, group in zip(panels, groups, strict=True):
        _draw_violins(panel, group, half_width, is_log, density if has_logs else linear_density)
        _draw_estimates(panel, group)
        if censored_at is not None:
            limit = format_tick(censored_at, plain=is_plain(1, censored_at))
            label = f"{typeset('T_cens')} of the Weibull mean: {limit}"
            panel.axhline(censored_at, color=GREY, linestyle="--", linewidth=1, label=label)
    if groups[0].of is None:
        panels[0].set_ylim(top=3 * float(np.nanmax(shown, initial=censored_at or 1)))


def _heading(title: str, groups: Sequence[Violins]) -> str:
    numbers = count_trials(np.concatenate([each.trials for each in groups]).tolist())
    censored, trials = (int(sum(getattr(each, name).sum() for each in groups)) for name in ("censored", "trials"))
    left_out = f"; {censored} of {trials} trials censored, not in the violins" if censored else ""
    return f"{title}\n{numbers}{left_out}"


def _draw_violins(panel: Axes, group: Violins, half_width: float, is_log: bool, estimate_density: Density) -> None:
    """Draw violins with this largest half-width, in decades where x is logarithmic."""
    label = "trials that synchronised" if group.of is None else "trials"
    for x, times in zip(group.x, group.synchronised, strict=True):
        if len(times):
            heights, widths = estimate_density(times)
            left, right = (x * 10**side if is_log else x + side for side in (-half_width * widths, half_width * widths))
            panel.fill_betweenx(heights, left, right, color=VIOLIN, linewidth=1, label=label)


def _draw_estimates(panel: Axes, group: Violins) -> None:
    means, low, high = np.nan_to_num(group.estimates, posinf=1e12, nan=np.nan).T
    label = "Weibull mean (Appendix A)" if group.of is None else "mean"
    panel.plot(group.x, means, ".-", color=LINE, label=label)
    panel.fill_between(group.x, low, high, color=LINE, alpha=BAND, linewidth=0, label="its 95 % interval")
    unknown = group.x[np.isnan(means)]
    if len(unknown):
        at, place = np.full(len(unknown), CROSS_AT), panel.get_xaxis_transform()
        panel.plot(unknown, at, "x", color=LINE, transform=place, label=undetermined_label(group.of))
    if not np.isnan(group.sample_means).all():
        panel.plot(group.x, group.sample_means, "D", color="black", markersize=3, label="mean of all trials")
