"""Curves of T_sync, or of a measure, against speed or another axis: a line for each combination of the others."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.figures.csv_tables import Table, curves_table, extrema_table
from epuck_sim.figures.labels import axis_label, format_axis_values, statistic_label, undetermined_label
from epuck_sim.figures.looks import Look, choose_looks
from epuck_sim.figures.scales import has_log_scale, is_logarithmic, make_logarithmic
from epuck_sim.figures.style import BAND, GREY, STYLE, count_trials, finish, make_panels, typeset
from epuck_sim.scenario.figure_axes import SPEED, distinguishing_axes
from epuck_sim.statistics.curve_extrema import ExtremaSearch, search_extrema
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import SpeedExtrema

MAX_EXTRAPOLATION = 100
"""Largest Weibull mean that is shown, as a multiple of the limit of cycles; larger ones are extrapolated too far."""

CROSS_ROW = 0.045
"""Height of a row of crosses at the upper edge of a panel, one for each curve that has any, as a share of the panel."""

NOT_A_SPEED = ExtremaSearch(None, "the axis is no speed")

NOT_T_SYNC = ExtremaSearch(None, "those of a measure are printed by fit")


def find_extrema(axis: str, curves: Sequence[Curve]) -> list[ExtremaSearch]:
    """Look for the minimum and the peak of each curve of T_sync over `axis`, a dotted key."""
    if curves[0].of is not None:
        return [NOT_T_SYNC] * len(curves)
    return [search_extrema(curve) if axis.endswith(SPEED) else NOT_A_SPEED for curve in curves]


def curves_tables(axis: str, curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> dict[str, Table]:
    """Return the points of curves over `axis`, and their minima and peaks, as tables by the endings of their files.

    Of a measure there is the first table alone.
    """
    if curves[0].of is not None:
        return {".csv": curves_table(axis, curves)}
    return {".csv": curves_table(axis, curves), "-regimes.csv": extrema_table(curves, searches)}


@rc_context(STYLE)
def draw_curves(
    title: str,
    axis: str,
    curves: Sequence[Curve],
    searches: Sequence[ExtremaSearch],
    split_by: str | None = None,
    width_cm: float | None = None,
) -> Figure:
    """Draw curves in one panel, or in a panel for each value of an axis; `plot_curves` says how.

    Args:
        title: Title of the figure, to which the numbers of trials are added.
        axis: Dotted key of the horizontal axis.
        curves: The curves, at least one.
        searches: Minimum and peak of each curve.
        split_by: Dotted key of the axis that has a panel for each of its values; one panel by default.
        width_cm: Width of the figure; by default that of a column, or of a page for several panels.
    """
    among = (axis, *curves[0].axes)
    heads = [format_axis_values({split_by: curve.axes[split_by]}, among) if split_by else "" for curve in curves]
    titles = list(dict.fromkeys(heads))
    trials = np.concatenate([curve.trials for curve in curves]).tolist()
    labels = axis_label(axis, among), curves_label(curves)
    figure, panels = make_panels(f"{title}\n{count_trials(trials)}", titles, labels, width_cm)
    _draw([panels[titles.index(head)] for head in heads], axis, curves, searches, split_by)
    finish(figure, panels)
    return figure


def plot_curves(axes: Axes, axis: str, curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> None:
    """Draw curves over `axis`, a dotted key, with their 95 % bands.

    The scale is logarithmic for T_sync, and for measures that are positive and far apart. Points are hollow where
    trials are censored; a cross at the upper edge is undetermined; triangles are the local minimum and the peak, where
    found; the base case is dashed. Every mark has a label, which `axes.legend()` shows.
    """
    _draw([axes] * len(curves), axis, curves, searches, None)


def _draw(
    panels: Sequence[Axes],
    axis: str,
    curves: Sequence[Curve],
    searches: Sequence[ExtremaSearch],
    split_by: str | None,
) -> None:
    """Draw each curve into its panel; all panels share their scales."""
    distinguishing = distinguishing_axes([curve.axes for curve in curves])
    labels = [
        format_axis_values({key: row[key] for key in row if key != split_by}, (axis, *row)) for row in distinguishing
    ]
    highest, beyond = _ends(curves)
    x, values = (np.concatenate([getattr(curve, name) for curve in curves]) for name in ("x", "values"))
    is_log = has_log_scale(curves[0].of, values)
    make_logarithmic(panels[0], *["y"] * is_log, *["x"] * is_logarithmic(axis, x))
    names = list(dict.fromkeys(labels))
    looks = dict(zip(names, choose_looks(len(names)), strict=True))
    for name, look in looks.items():
        if name:
            panels[0].plot([], [], marker=look.marker, color=look.colour, label=typeset(name))
    crossed = [
        name
        for name in names
        if any(np.isnan(curve.values).any() for curve, label in zip(curves, labels, strict=True) if label == name)
    ]
    for panel, curve, search, label in zip(panels, curves, searches, labels, strict=True):
        row = crossed.index(label) if label in crossed else 0
        _draw_curve(panel, curve, search.extrema, looks[label], 1 - CROSS_ROW * (row + 0.8), beyond)
    _label_marks(panels[0], curves, searches)
    if curves[0].of is None:
        panels[0].set_ylim(top=min(panels[0].get_ylim()[1], 3 * highest))
    if math.isfinite(highest):
        _make_room(panels[0], highest, CROSS_ROW * (len(crossed) + 0.8) if crossed else 0.0)


def _ends(curves: Sequence[Curve]) -> tuple[float, float]:
    """Return the highest value, -inf without any, and how far up bands are drawn whose end is not reached."""
    values, ends = (np.concatenate(each) for each in zip(*((c.values, c.intervals[:, 1]) for c in curves), strict=True))
    known = values[np.isfinite(values)]
    if curves[0].of is not None:
        highest = float(known.max(initial=-math.inf))
        return highest, float(ends[np.isfinite(ends)].max(initial=highest))
    longest = MAX_EXTRAPOLATION * max(curve.scenario.stop.max_cycles for curve in curves)
    return min(float(known.max(initial=1.0)), longest), 1e12


def _make_room(axes: Axes, highest: float, share: float) -> None:
    """End the vertical scale so high that the highest value stays below this upper share of the panel."""
    bottom, top = axes.get_ylim()
    if axes.get_yscale() == "log":
        reach = bottom * math.exp(math.log(1.15 * highest / bottom) / (1 - share))
    else:
        reach = bottom + 1.05 * (highest - bottom) / (1 - share)
    axes.set_ylim(top=max(top, reach))


def curves_label(curves: Sequence[Curve]) -> str:
    """Return the label of an axis with the statistic that curves show."""
    return typeset(statistic_label([name for curve in curves for name in curve.names], curves[0].of))


def is_base_case(curve: Curve) -> bool:
    """Return whether a curve has the axis values that its scenario calls the base case."""
    base = curve.scenario.figure.base_case
    return bool(base) and all(key in curve.axes and curve.axes[key] == value for key, value in base.items())


def _draw_curve(
    axes: Axes, curve: Curve, extrema: SpeedExtrema | None, look: Look, cross_at: float, beyond: float
) -> None:
    known = ~np.isnan(curve.values)
    low, high = np.where(known[:, None], np.nan_to_num(curve.intervals, nan=np.nan, posinf=beyond), np.nan).T
    axes.fill_between(curve.x, low, high, color=look.colour, alpha=BAND, linewidth=0)
    style = "--" if is_base_case(curve) else "-"
    axes.plot(curve.x, curve.values, style, color=look.colour)  # with a gap where it is undetermined
    for censored, face in ((False, look.colour), (True, "white")):
        chosen = known & ((curve.censored > 0) == censored)
        axes.plot(curve.x[chosen], curve.values[chosen], look.marker, color=look.colour, markerfacecolor=face)
    at = np.full(np.count_nonzero(~known), cross_at)
    axes.plot(curve.x[~known], at, "x", color=look.colour, transform=axes.get_xaxis_transform())
    if extrema is not None and extrema.is_found:
        for speed, time, marker in ((extrema.v_m, extrema.t_m, "v"), (extrema.v_p, extrema.t_p, "^")):
            axes.plot(speed, time, marker, color=look.colour, markersize=7, markeredgecolor="black", zorder=4)


def _label_marks(axes: Axes, curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> None:
    """Add an empty mark with a label for each kind that is drawn."""
    known = [~np.isnan(curve.values) for curve in curves]
    if any(np.isfinite(curve.intervals[chosen, 0]).any() for curve, chosen in zip(curves, known, strict=True)):
        axes.fill_between([], [], color=GREY, alpha=BAND, linewidth=0, label="95 % interval")
    if any(map(is_base_case, curves)):
        axes.plot([], [], "--", color=GREY, label="base case")
    if any((curve.censored[chosen] > 0).any() for curve, chosen in zip(curves, known, strict=True)):
        axes.plot([], [], "o", color=GREY, markerfacecolor="white", label="some trials censored")
    if not all(chosen.all() for chosen in known):
        axes.plot([], [], "x", color=GREY, label=undetermined_label(curves[0].of))
    if any(search.extrema is not None and search.extrema.is_found for search in searches):
        for marker, label in (("v", "local minimum V_m"), ("^", "peak V_p")):
            axes.plot([], [], marker, color=GREY, markersize=7, markeredgecolor="black", label=typeset(label))
