"""Curves of T_sync against speed, or another axis, from a run folder: a line for each combination of the others."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.csv_tables import Table, curves_table, rounded
from epuck_sim.figures.labels import axis_label, format_axis_values
from epuck_sim.figures.style import (
    add_shared_legend,
    disable_mathtext,
    is_logarithmic,
    make_logarithmic,
    make_panels,
)
from epuck_sim.scenario.figure_axes import SPEED, distinguishing_axes
from epuck_sim.statistics.curve_extrema import ExtremaSearch, search_extrema
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.extrema import SpeedExtrema

EXTREMA_COLUMNS = tuple(f"{name}{end}" for name in ("v_m", "t_m", "v_p", "t_p") for end in ("", "_low", "_high"))
"""Columns of the minimum and the peak in the table of extrema, cm/s and cycles."""

MAX_EXTRAPOLATION = 100
"""Largest Weibull mean that is shown, as a multiple of the limit of cycles; larger ones are extrapolated too far."""

NOT_A_SPEED = ExtremaSearch(None, "the axis is no speed")


def find_extrema(axis: str, curves: Sequence[Curve]) -> list[ExtremaSearch]:
    """Look for the minimum and the peak of each curve over `axis`, a dotted key."""
    return [search_extrema(curve) if axis.endswith(SPEED) else NOT_A_SPEED for curve in curves]


def curves_tables(axis: str, curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> dict[str, Table]:
    """Return the points of curves over `axis`, and their minima and peaks, as tables by the endings of their files."""
    columns = (*curves[0].axes, *EXTREMA_COLUMNS, "p_value", "reason")
    return {".csv": curves_table(axis, curves), "-regimes.csv": Table(columns, _extrema_rows(curves, searches))}


def draw_curves(
    title: str, axis: str, curves: Sequence[Curve], searches: Sequence[ExtremaSearch], split_by: str | None = None
) -> Figure:
    """Draw the curves with their 95 % bands, T_sync on a logarithmic scale, hollow where trials are censored.

    A cross at the upper edge is undetermined; triangles are the local minimum and the peak, where found. The label of
    the vertical axis names the statistic.

    Args:
        title: Title of the figure.
        axis: Dotted key of the horizontal axis.
        curves: The curves, at least one.
        searches: Minimum and peak of each curve.
        split_by: Dotted key of the axis that has a panel for each of its values; one panel by default.
    """
    distinguishing = distinguishing_axes([curve.axes for curve in curves])
    heads = [format_axis_values({split_by: curve.axes[split_by]}) if split_by else "" for curve in curves]
    labels = [format_axis_values({key: row[key] for key in row if key != split_by}) for row in distinguishing]
    titles, size = list(dict.fromkeys(heads)), (6.0, 3.8) if len(set(heads)) == 1 else (3.8, 3.4)
    figure, panels = make_panels(title, titles, (axis_label(axis), _label(curves)), size)
    highest = max((np.nanmax(each, initial=1.0) for each in (curve.values for curve in curves)), default=1.0)
    highest = min(highest, MAX_EXTRAPOLATION * max(curve.scenario.stop.max_cycles for curve in curves))
    x = np.concatenate([curve.x for curve in curves])
    make_logarithmic(panels[0], "y", *["x"] * is_logarithmic(axis, x))
    names = list(dict.fromkeys(labels))
    colours = dict(zip(names, colormaps["viridis"](np.linspace(0, 0.9, len(names))), strict=True))
    for curve, search, head, label in zip(curves, searches, heads, labels, strict=True):
        _draw_curve(panels[titles.index(head)], curve, search.extrema, colours[label], label, 2 * highest)
    panels[0].set_ylim(top=min(panels[0].get_ylim()[1], 3 * highest))
    if any(labels) and len(panels) == 1:
        disable_mathtext(panels[0].legend(fontsize="small"))
    elif any(labels):
        add_shared_legend(figure, panels)
    return figure


def _label(curves: Sequence[Curve]) -> str:
    names = dict.fromkeys(name for curve in curves for name in curve.names)
    return f"T_sync [cycles], {' or '.join(names)}"


def _draw_curve(
    axes: Axes, curve: Curve, extrema: SpeedExtrema | None, colour: FloatArray, label: str, unknown_at: float
) -> None:
    known = ~np.isnan(curve.values)
    low, high = np.where(known[:, None], np.nan_to_num(curve.intervals, posinf=1e12), np.nan).T
    axes.fill_between(curve.x, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(curve.x, curve.values, color=colour, linewidth=1.2, label=label)  # with a gap where it is undetermined
    for censored, face in ((False, colour), (True, "white")):
        chosen = known & ((curve.censored > 0) == censored)
        axes.plot(curve.x[chosen], curve.values[chosen], "o", color=colour, markersize=4, markerfacecolor=face)
    axes.plot(curve.x[~known], np.full(np.count_nonzero(~known), unknown_at), "x", color=colour)
    if extrema is not None and extrema.is_found:
        for speed, time, marker in ((extrema.v_m, extrema.t_m, "v"), (extrema.v_p, extrema.t_p, "^")):
            axes.plot(speed, time, marker, color=colour, markersize=10, markeredgecolor="black", zorder=4)


def _extrema_rows(curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> Iterator[list[Any]]:
    """Yield a row for each curve, with the p-value alone where the pair may be noise, or why there is none."""
    for curve, (each, reason) in zip(curves, searches, strict=True):
        numbers = [np.nan] * len(EXTREMA_COLUMNS)
        if each is not None and each.is_found:
            numbers = [n for estimate, ends in zip(each[:4], each.intervals, strict=True) for n in (estimate, *ends)]
        p_value = np.nan if each is None else each.p_value
        yield [*curve.axes.values(), *map(rounded, numbers), rounded(p_value), reason]
