"""Distributions of T_sync beside Appendix A's mean, also as if trials had been censored earlier (thesis Fig. A.1).

Distributions of measures stand beside their means.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import style
from epuck_sim.figures.forms.form import Choices, Form, check_has_values, draw_trials, end_scale, joined, named_axis
from epuck_sim.figures.labels import undetermined_label
from epuck_sim.figures.saving import tabulate
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import is_logarithmic
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.curves import Curve, read_curves

HEIGHTS = 100  # number of values at which a density is evaluated
HALF_WIDTH = 0.4  # half the width of a violin of all trials, relative to the smallest distance between two

VIOLIN, LINE = "#5f9fd0", "#b2182b"
"""Colours of violins, and of the line through the estimates."""


@dataclass(kw_only=True)
class Violins(Form):
    """Violins and estimates, a panel for each combination of the other axes.

    A violin is the density of log T_sync of the trials that synchronised, as wide as their share, or a bar if all took
    the same time. The line is the estimate in its 95 % band, or dots with bars over names, with a cross on the upper
    edge where it is undetermined or far beyond all trials; a diamond is the mean of all trials, if none is censored; a
    dashed line is the cycle at which the estimate takes trials as censored. For a measure, a violin is the density of
    its values, or of their logarithms on a logarithmic scale (`style.has_log_scale`), and the line is the mean.
    """

    name = "violins"

    axis: str  # dotted key of the horizontal axis
    names: Sequence[str] = ()  # values of the axis if they are no numbers; violins are then at 0, 1 and so on
    curves: Sequence[Curve]  # the estimates of each panel, and their trials
    censored_at: int | None = None  # cycle at which estimates take trials as censored; None for their own limits

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        check_has_values(points, cls.name)
        axis, points, names = named_axis(points, choices)
        censored_at = choices.section.censored_at_cycles if points[0].of is None else None
        limit = max(point.scenario.stop.max_cycles for point in points)
        if "censored_at_cycles" in choices.given and censored_at is not None and censored_at > limit:
            name = "--censored-at" if choices.prefix else "censored_at_cycles"
            raise EpuckSimError(f"{name} is {censored_at}; allowed: up to {limit}, the limit of the trials")
        curves = read_violins(points, axis, censored_at)
        return cls.made(points, choices, axis=axis, names=names, curves=curves, censored_at=censored_at)

    def __post_init__(self) -> None:
        keys = (self.axis, *self.curves[0].axes)
        self.titles = self.labels_of([curve.axes for curve in self.curves], keys)
        self.labels = self.label_of(self.axis, keys), self.quantity
        estimates = "Weibull means" if self.of in T_SYNC else "means"
        what = f"Distribution of {self.quantity} against {self.labels[0]}, with {estimates} and their 95 % intervals"
        observed = [each.observed for curve in self.curves for each in curve.measured]
        trials = np.concatenate(observed)
        censored = np.count_nonzero(~trials)
        left_out = f"; {censored} of {len(trials)} trials censored, not in the violins" if censored else ""
        self.shows = f"{what}; {style.count_trials(list(map(len, observed)))}{left_out}"

    @property
    def tables(self) -> Mapping[str, str]:
        """A row for each violin: number of trials, share of censored ones, and cycles, or values of the measure."""
        groups = []
        for curve in self.curves:
            values = np.array(self.names)[curve.x.astype(int)] if self.names else curve.x
            columns: dict[str, Any] = {self.axis: values, **curve.tied, "trials": curve.trials}
            ends: tuple[str, ...] = ("mean", "mean_low", "mean_high")
            if self.of in T_SYNC:
                columns |= {"censored": curve.censored, "mean": sample_means(curve)}
                ends = "weibull_mean", "weibull_low", "weibull_high"
            groups.append((curve.axes, columns | dict(zip(ends, (curve.values, *curve.intervals.T), strict=True))))
        return {".csv": tabulate(groups)}

    def draw(self, panels: Sequence[Axes]) -> None:
        x = joined(self.curves, "x")
        shown = np.concatenate([each for curve in self.curves for each in (*synchronised(curve), curve.values)])
        kept = [each.values[each.observed | self.settings.points] for curve in self.curves for each in curve.measured]
        top = 3 * float(np.concatenate(kept).max(initial=self.censored_at or 1)) if self.of in T_SYNC else np.inf
        is_log, has_logs = is_logarithmic(self.axis, x), style.has_log_scale(self.of, shown, self.settings.scale)
        places = np.unique(np.log10(x) if is_log else x)
        half_width = HALF_WIDTH * (np.diff(places).min() if len(places) > 1 else 1.0)  # in decades where x has logs
        for panel, curve in zip(panels, self.curves, strict=True):
            style.make_logarithmic(panel, *["y"] * has_logs, *["x"] * is_log)
            style.mark_wholes(panel.xaxis, x)
            style.set_names(panel, self.names)
            label = "trials that synchronised" if self.of in T_SYNC else "trials"
            for at, times, censored in zip(curve.x, synchronised(curve), curve.censored, strict=True):
                if len(times):
                    heights, widths = density(times, of_logarithms=has_logs)
                    ends = np.outer((-half_width, half_width), (1 - censored) * widths)
                    left, right = (at * 10**end if is_log else at + end for end in ends)
                    panel.fill_betweenx(heights, left, right, color=VIOLIN, linewidth=1, label=label)
            self._draw_estimates(panel, curve, top)
            if self.settings.points:
                draw_trials(panel, curve, "black")
            if self.censored_at is not None:
                label = f"{style.typeset('T_cens')} of the Weibull mean: {self.censored_at}"
                panel.axhline(self.censored_at, color=style.GREY, linestyle="--", linewidth=1, label=label)
        end_scale(panels, self.curves, top)

    def _draw_estimates(self, panel: Axes, curve: Curve, top: float) -> None:
        low, high = np.nan_to_num(curve.intervals, posinf=1e12, nan=np.nan).T
        name, source = ("Weibull mean", " (Appendix A)") if self.of in T_SYNC else ("mean", "")
        panel.plot(curve.x, curve.values, "." if self.names else ".-", color=LINE, label=f"{name}{source}")
        draw = panel.vlines if self.names else partial(style.draw_intervals, panel)  # nothing is between names
        draw(curve.x, low, high, LINE, label=f"95 % interval of the {name}")
        if len(unknown := curve.x[~(curve.values <= top)]):  # also of a mean that is extrapolated too far
            far = f"above {top:.3g} or " if (joined(self.curves, "values") > top).any() else ""
            style.draw_crosses(panel, unknown, LINE, f"{far}{undetermined_label(self.of)}")
        if self.of in T_SYNC and not np.isnan(means := sample_means(curve)).all():
            panel.plot(curve.x, means, "D", color="black", markersize=3, label="mean, if no trial is censored")


def read_violins(points: Sequence[PointTrials], axis: str, censored_at: int | None = None) -> list[Curve]:
    """Return the estimates, and the trials, for each combination of the values of the other axes.

    Estimates are Appendix A's means, with `censored_at` as if trials were censored at that cycle; or a measure's means.
    """
    of = points[0].of
    curves = read_curves(points, axis, Statistic.WEIBULL_MEAN if of in T_SYNC else Statistic.MEAN, censored_at)
    if any(curve.is_share for curve in curves):
        raise EpuckSimError(f"{of} is a truth value, whose distribution is a share: give --form curves")
    return curves


def synchronised(curve: Curve) -> list[FloatArray]:
    """Return (S,) values of the trials at each point that are not censored."""
    return [each.values[each.observed] for each in curve.measured]


def sample_means(curve: Curve) -> FloatArray:
    """Return the means, (S,), of all trials; NaN where some are censored."""
    return np.array([each.values.mean() if each.observed.all() else np.nan for each in curve.measured])


def density(values: FloatArray, *, of_logarithms: bool) -> tuple[FloatArray, FloatArray]:
    """Estimate the density of values, (n,), or of their logarithms, by normal kernels of the width of Scott's rule.

    Returns values from the smallest to the largest, and densities there, relative to the largest; 1 if all are equal.

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
