"""Distributions of T_sync beside Appendix A's mean, also as if trials had been censored earlier (thesis Fig. A.1).

Distributions of measures stand beside their means.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from matplotlib.axes import Axes

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import style
from epuck_sim.figures.forms.form import Choices, Form, check_has_values, draw_trials, joined
from epuck_sim.figures.labels import format_value, short_files, undetermined_label
from epuck_sim.figures.saving import tabulate
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import choose_axis, numeric_axes
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.curves import Curve, read_curves

HEIGHTS = 100  # number of values at which a density is evaluated
CROSS_AT = 0.965  # height of crosses, as a share of the panel
HALF_WIDTH = 0.4  # half the largest width of a violin, relative to the smallest distance between two

VIOLIN, LINE = "#5f9fd0", "#b2182b"
"""Colours of violins, and of the line through the estimates."""


@dataclass(kw_only=True)
class Violins(Form):
    """Violins and estimates, a panel for each combination of the other axes.

    A violin is the density of log T_sync of the trials that synchronised, a bar if they all took the same time. The
    line is the estimate in its 95 % band, with a cross at the upper edge where it is undetermined; a dot is the mean of
    all trials, if none is censored; a dashed line is the cycle at which the estimate takes trials as censored. For a
    measure, a violin is the density of its values, or of their logarithms on a logarithmic scale, and the line is the
    mean. The scale is logarithmic for T_sync, and for a measure if its values are positive and far apart.
    """

    name = "violins"

    axis: str  # dotted key of the horizontal axis
    names: Sequence[str] = ()  # values of the axis if they are no numbers; violins are then at 0, 1 and so on
    curves: Sequence[Curve]  # the estimates of each panel, and their trials
    censored_at: int | None = None  # cycle at which estimates take trials as censored; None for their own limits

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        check_has_values(points, cls.name)
        rows = [point.axes for point in points]
        axis, names = choose_axis(rows, *choices.axis("x"), by_name=True), list[str]()
        if axis not in numeric_axes(rows):
            texts = [format_value(axis, row[axis]) for row in short_files([{axis: row[axis]} for row in rows])]
            names = list(dict.fromkeys(texts))
            each = zip(points, texts, strict=True)
            points = [point._replace(axes={**point.axes, axis: names.index(text)}) for point, text in each]
        censored_at = choices.section.censored_at_cycles if points[0].of is None else None
        limit = max(point.scenario.stop.max_cycles for point in points)
        if "censored_at_cycles" in choices.given and censored_at is not None and censored_at > limit:
            name = "--censored-at" if choices.prefix else "censored_at_cycles"
            raise EpuckSimError(f"{name} is {censored_at}; allowed: up to {limit}, the limit of the trials")
        return cls(axis=axis, names=names, curves=read_violins(points, axis, censored_at), censored_at=censored_at)

    @property
    def titles(self) -> Sequence[str]:
        return self.labels_of([curve.axes for curve in self.curves], self._keys)

    @property
    def _keys(self) -> tuple[str, ...]:
        return (self.axis, *self.curves[0].axes)

    @property
    def labels(self) -> Sequence[str]:
        return self.label_of(self.axis, self._keys), self.quantity

    @property
    def shows(self) -> str:
        estimates = "Weibull means" if self.of in T_SYNC else "means"
        what = f"Distribution of {self.quantity} against {self.labels[0]}, with {estimates} and their 95 % intervals"
        observed = [each.observed for curve in self.curves for each in curve.measured]
        trials = np.concatenate(observed)
        censored = np.count_nonzero(~trials)
        left_out = f"; {censored} of {len(trials)} trials censored, not in the violins" if censored else ""
        return f"{what}; {style.count_trials(list(map(len, observed)))}{left_out}"

    @property
    def tables(self) -> Mapping[str, str]:
        """A row for each violin: number of trials, share of censored ones, and cycles, or values of the measure."""
        return {".csv": tabulate((curve.axes, self._columns(curve)) for curve in self.curves)}

    def _columns(self, curve: Curve) -> dict[str, Any]:
        values = [self.names[int(place)] for place in curve.x] if self.names else curve.x
        found: dict[str, Any] = {self.axis: values, "trials": curve.trials}
        if self.of in T_SYNC:
            found |= {"censored": curve.censored, "mean": sample_means(curve)}
        name = "weibull" if self.of in T_SYNC else "mean"
        ends = "weibull_mean" if self.of in T_SYNC else "mean", f"{name}_low", f"{name}_high"
        return found | dict(zip(ends, (curve.values, *curve.intervals.T), strict=True))

    def draw(self, panels: Sequence[Axes]) -> None:
        x = joined(self.curves, "x")
        shown = np.concatenate([each for curve in self.curves for each in (*synchronised(curve), curve.values)])
        dots = [each.values for curve in self.curves for each in curve.measured if self.settings.points]
        is_log, has_logs = style.is_logarithmic(self.axis, x), style.has_log_scale(self.of, shown, self.settings.scale)
        places = np.unique(np.log10(x) if is_log else x)
        half_width = HALF_WIDTH * (np.diff(places).min() if len(places) > 1 else 1.0)
        for panel, curve in zip(panels, self.curves, strict=True):
            style.make_logarithmic(panel, *["y"] * has_logs, *["x"] * is_log)
            style.mark_wholes(panel.xaxis, x)
            if self.names:
                panel.set_xticks(range(len(self.names)), list(map(style.typeset, self.names)))
            self._draw_violins(panel, curve, half_width, is_log, has_logs)
            self._draw_estimates(panel, curve)
            if self.settings.points:
                draw_trials(panel, curve.x, curve, "black")
            if self.censored_at is not None:
                limit = style.format_tick(self.censored_at, plain=style.is_plain(1, self.censored_at))
                label = f"{style.typeset('T_cens')} of the Weibull mean: {limit}"
                panel.axhline(self.censored_at, color=style.GREY, linestyle="--", linewidth=1, label=label)
        if self.of in T_SYNC and has_logs:
            for panel in panels:
                panel.set_ylim(top=3 * float(np.nanmax(np.concatenate([shown, *dots]), initial=self.censored_at or 1)))

    def _draw_violins(self, panel: Axes, curve: Curve, half_width: float, is_log: bool, has_logs: bool) -> None:
        """Draw violins with this largest half-width, in decades where x is logarithmic."""
        label = "trials that synchronised" if self.of in T_SYNC else "trials"
        for x, times in zip(curve.x, synchronised(curve), strict=True):
            if len(times):
                heights, widths = density(times, of_logarithms=has_logs)
                ends = -half_width * widths, half_width * widths
                left, right = (x * 10**end if is_log else x + end for end in ends)
                panel.fill_betweenx(heights, left, right, color=VIOLIN, linewidth=1, label=label)

    def _draw_estimates(self, panel: Axes, curve: Curve) -> None:
        low, high = np.nan_to_num(curve.intervals, posinf=1e12, nan=np.nan).T
        label = "Weibull mean (Appendix A)" if self.of in T_SYNC else "mean"
        panel.plot(curve.x, curve.values, ".-", color=LINE, label=label)
        style.draw_intervals(panel, curve.x, low, high, LINE, "its 95 % interval")
        unknown = curve.x[np.isnan(curve.values)]
        if len(unknown):
            at, place = np.full(len(unknown), CROSS_AT), panel.get_xaxis_transform()
            panel.plot(unknown, at, "x", color=LINE, transform=place, label=undetermined_label(self.of))
        if self.of in T_SYNC and not np.isnan(means := sample_means(curve)).all():
            panel.plot(curve.x, means, "D", color="black", markersize=3, label="mean of all trials")


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
