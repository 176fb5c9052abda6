"""Distributions of T_sync beside Appendix A's mean, also as if trials had been censored earlier (thesis Fig. A.1).

Distributions of measures stand beside their means.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import Estimate
from epuck_sim.figures.forms.form import Choices, Form, check_has_values, draw_trials
from epuck_sim.figures.labels import undetermined_label
from epuck_sim.figures.saving import Table, tabulate
from epuck_sim.figures.style import (
    BAND,
    GREY,
    count_trials,
    format_tick,
    has_log_scale,
    is_logarithmic,
    is_plain,
    make_logarithmic,
    typeset,
)
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import choose_axis
from epuck_sim.statistics.curves import group_by_other_axes
from epuck_sim.statistics.measured import Measured, cut, measure
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import estimate
from epuck_sim.statistics.survival import estimate_weibull_mean

HEIGHTS = 100
"""Number of values at which a density is evaluated."""

CROSS_AT = 0.965
"""Height of crosses, as a share of the panel."""

HALF_WIDTH = 0.4
"""Half the largest width of a violin, relative to the smallest distance between two."""

VIOLIN, LINE = "#5f9fd0", "#b2182b"
"""Colours of violins, and of the line through the estimates."""


class Group(NamedTuple):
    """Distributions of T_sync, in cycles, or of a measure, along an axis, at the S points that have trials."""

    axes: dict[str, Any]
    """Values of the other axes."""
    x: FloatArray
    """(S,) values of the axis, ascending."""
    measured: list[Measured]
    """The trials at each of the S points."""
    sample_means: FloatArray
    """(S,) mean of all trials; NaN where some are censored, and of a measure, whose estimates are means."""
    estimates: FloatArray
    """(S, 3) mean by Appendix A and the ends of its 95 % interval, with early censoring; NaN where undetermined.

    Of a measure, the mean of the sample and the ends of its interval.
    """

    @property
    def synchronised(self) -> list[FloatArray]:
        """S arrays, (trials,) each: T_sync of the trials that are not censored."""
        return [each.values[each.observed] for each in self.measured]

    @property
    def trials(self) -> IntArray:
        """(S,) number of trials, censored ones included."""
        return np.array([len(each.values) for each in self.measured], np.int64)

    @property
    def censored(self) -> IntArray:
        """(S,) number of trials that are censored in the data themselves."""
        return np.array([(~each.observed).sum() for each in self.measured], np.int64)


@dataclass(kw_only=True)
class Violins(Form):
    """Violins and estimates, a panel for each combination of the other axes.

    A violin is the density of log T_sync of the trials that synchronised, a bar where they all took one time. The line
    is the estimate in its 95 % band, with a cross at the upper edge where it is undetermined; a dot is the mean of all
    trials, where none is censored; a dashed line is where the estimate takes trials to be censored. Of a measure, a
    violin is the density of its values, or of their logarithms on a logarithmic scale, and the line is the mean. The
    scale is logarithmic for T_sync, and where values are positive and far apart.
    """

    name = "violins"
    takes = ("x", "censored_at_cycles", "scale", "points")

    axis: str
    """Dotted key of the horizontal axis."""
    groups: Sequence[Group]
    """The violins of each panel, at least one."""
    censored_at: int | None = None
    """Cycle at which the estimates take trials to be censored; where they are if None."""

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        """Read the trials of each combination of the other axes, in the order of the sweep.

        Raises:
            EpuckSimError: There is no such axis, or no trial has a value.
        """
        check_has_values(points, cls.name)
        axis = choose_axis([point.axes for point in points], *choices.axis("x"))
        censored_at = choices.section.censored_at_cycles if points[0].of is None else None
        groups = read_groups(points, axis, censored_at)
        return cls(axis=axis, groups=groups, censored_at=censored_at)

    @property
    def titles(self) -> Sequence[str]:
        return self.labels_of([group.axes for group in self.groups], self._keys)

    @property
    def _keys(self) -> tuple[str, ...]:
        return (self.axis, *self.groups[0].axes)

    @property
    def labels(self) -> Sequence[str]:
        return self.label_of(self.axis, self._keys), self.quantity

    @property
    def shows(self) -> str:
        estimates = "means" if self.of else "Weibull means"
        what = f"Distribution of {self.quantity} against {self.labels[0]}, with {estimates} and their 95 % intervals"
        numbers = count_trials(np.concatenate([group.trials for group in self.groups]).tolist())
        censored, trials = (
            int(sum(getattr(group, name).sum() for group in self.groups)) for name in ("censored", "trials")
        )
        left_out = f"; {censored} of {trials} trials censored, not in the violins" if censored else ""
        return f"{what}; {numbers}{left_out}"

    @property
    def tables(self) -> Mapping[str, Table]:
        """A row for each violin: number of trials, share of censored ones, and cycles, or values of the measure."""
        return {".csv": tabulate((group.axes, self._columns(group)) for group in self.groups)}

    def _columns(self, group: Group) -> dict[str, FloatArray | IntArray]:
        found = {self.axis: group.x, "trials": group.trials}
        if self.of is None:
            found |= {"censored": group.censored / group.trials, "mean": group.sample_means}
        names = (
            ("weibull_mean", "weibull_low", "weibull_high") if self.of is None else ("mean", "mean_low", "mean_high")
        )
        return found | dict(zip(names, group.estimates.T, strict=True))

    def draw(self, panels: Sequence[Axes]) -> None:
        x = np.concatenate([group.x for group in self.groups])
        shown = np.concatenate([each for group in self.groups for each in (*group.synchronised, group.estimates[:, 0])])
        dots = [each.values for group in self.groups for each in group.measured if self.settings.points]
        is_log, has_logs = is_logarithmic(self.axis, x), has_log_scale(self.of, shown, self.settings.scale)
        places = np.unique(np.log10(x) if is_log else x)
        half_width = HALF_WIDTH * (np.diff(places).min() if len(places) > 1 else 1.0)
        for panel, group in zip(panels, self.groups, strict=True):
            make_logarithmic(panel, *["y"] * has_logs, *["x"] * is_log)
            self._draw_violins(panel, group, half_width, is_log, has_logs)
            self._draw_estimates(panel, group)
            for place, measured in zip(group.x, group.measured if self.settings.points else [], strict=False):
                draw_trials(panel, float(place), measured, "black")
            if self.censored_at is not None:
                limit = format_tick(self.censored_at, plain=is_plain(1, self.censored_at))
                label = f"{typeset('T_cens')} of the Weibull mean: {limit}"
                panel.axhline(self.censored_at, color=GREY, linestyle="--", linewidth=1, label=label)
        if self.of is None and has_logs:
            for panel in panels:
                panel.set_ylim(top=3 * float(np.nanmax(np.concatenate([shown, *dots]), initial=self.censored_at or 1)))

    def _draw_violins(self, panel: Axes, group: Group, half_width: float, is_log: bool, has_logs: bool) -> None:
        """Draw violins with this largest half-width, in decades where x is logarithmic."""
        label = "trials that synchronised" if self.of is None else "trials"
        for x, times in zip(group.x, group.synchronised, strict=True):
            if len(times):
                heights, widths = density(times, of_logarithms=has_logs)
                ends = -half_width * widths, half_width * widths
                left, right = (x * 10**end if is_log else x + end for end in ends)
                panel.fill_betweenx(heights, left, right, color=VIOLIN, linewidth=1, label=label)

    def _draw_estimates(self, panel: Axes, group: Group) -> None:
        means, low, high = np.nan_to_num(group.estimates, posinf=1e12, nan=np.nan).T
        label = "Weibull mean (Appendix A)" if self.of is None else "mean"
        panel.plot(group.x, means, ".-", color=LINE, label=label)
        panel.fill_between(group.x, low, high, color=LINE, alpha=BAND, linewidth=0, label="its 95 % interval")
        unknown = group.x[np.isnan(means)]
        if len(unknown):
            at, place = np.full(len(unknown), CROSS_AT), panel.get_xaxis_transform()
            panel.plot(unknown, at, "x", color=LINE, transform=place, label=undetermined_label(self.of))
        if not np.isnan(group.sample_means).all():
            panel.plot(group.x, group.sample_means, "D", color="black", markersize=3, label="mean of all trials")


def read_groups(points: Sequence[PointTrials], axis: str, censored_at: int | None = None) -> list[Group]:
    """Return the violins of each combination of the values of the other axes, in the order of the sweep.

    Args:
        points: Points of a sweep.
        axis: Dotted key of the horizontal axis.
        censored_at: Cycle at which the estimate takes trials to be censored; by default, where they are.
    """
    return [_group(group, axis, others, censored_at) for others, group in group_by_other_axes(points, axis)]


def _group(points: Sequence[PointTrials], axis: str, others: dict[str, Any], censored_at: int | None) -> Group:
    measured = [measure(point) for point in points]
    if any(each.is_share for each in measured):
        raise EpuckSimError(f"{points[0].of} is a truth value, whose distribution is a share: give --form curves")
    return Group(
        axes=others,
        x=np.array([point.axes[axis] for point in points], np.float64),
        measured=measured,
        sample_means=np.array([_plain_mean(each) for each in measured]),
        estimates=np.array([_estimate(each, censored_at).ends for each in measured]),
    )


def _plain_mean(measured: Measured) -> float:
    return float(measured.values.mean()) if measured.is_time and measured.observed.all() else np.nan


def _estimate(measured: Measured, censored_at: int | None) -> Estimate:
    if not measured.is_time:
        return estimate(measured, Statistic.MEAN)
    return estimate_weibull_mean(measured if censored_at is None else cut(measured, censored_at))


def density(values: FloatArray, *, of_logarithms: bool) -> tuple[FloatArray, FloatArray]:
    """Estimate the density of values, (n,), or of their logarithms, by normal kernels as wide as Scott's rule says.

    Returns:
        Values from the smallest to the largest, and the density there, relative to its maximum; 1 where all are equal.

    >>> density(np.array([7.0, 7.0]), of_logarithms=True)
    (array([7., 7.]), array([1., 1.]))
    """
    if of_logarithms and values.min() < values.max():
        heights, found = density(np.log10(values), of_logarithms=False)
        return 10**heights, found
    # scipy.stats.gaussian_kde gives the same to 1e-15, but takes a second to import and 20 ms for 1,000 times
    if values.min() == values.max():
        return np.repeat(values[0], 2), np.ones(2)
    heights = np.linspace(values.min(), values.max(), HEIGHTS)
    width = values.std(ddof=1) * len(values) ** -0.2
    found = np.array([np.exp(-(((values - height) / width) ** 2) / 2).sum() for height in heights])
    return heights, found / found.max()
