"""Curves of T_sync, or of a measure, against speed or another axis: a line for each combination of the others."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.csv_tables import Table, curves_table, rounded
from epuck_sim.figures.labels import axis_label, format_axis_values, quantity_label
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
    columns = (*curves[0].axes, *EXTREMA_COLUMNS, "p_value", "reason")
    return {".csv": curves_table(axis, curves), "-regimes.csv": Table(columns, _extrema_rows(curves, searches))}


def draw_curves(
    title: str, axis: str, curves: Sequence[Curve], searches: Sequence[ExtremaSearch], split_by: str | None = None
) -> Figure:
    """Draw the curves with their 95 % bands, T_sync on a logarithmic scale, hollow where trials are censored.

    Measures have a logarithmic scale where they are positive and far apart. A cross at the upper edge is undetermined;
    triangles are the local minimum and the peak, where found. The label of the vertical axis names the statistic.

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
    is_log, unknown_at = _vertical_scale(curves)
    x = np.concatenate([curve.x for curve in curves])
    make_logarithmic(panels[0], *["y"] * is_log, *["x"] * is_logarithmic(axis, x))
    names = list(dict.fromkeys(labels))
    colours = dict(zip(names, colormaps["viridis"](np.linspace(0, 0.9, len(names))), strict=True))
    for curve, search, head, label in zip(curves, searches, heads, labels, strict=True):
        _draw_curve(panels[titles.index(head)], curve, search.extrema, colours[label], label, unknown_at)
    if curves[0].of is None:
        panels[0].set_ylim(top=min(panels[0].get_ylim()[1], 1.5 * unknown_at))
    if any(labels) and len(panels) == 1:
        disable_mathtext(panels[0].legend(fontsize="small"))
    elif any(labels):
        add_shared_legend(figure, panels)
    return figure


def _label(curves: Sequence[Curve]) -> str:
    names = dict.fromkeys(name for curve in curves for name in curve.names)
    return f"{quantity_label(curves[0].of)}, {' or '.join(names)}"


def _vertical_scale(curves: Sequence[Curve]) -> tuple[bool, float]:
    """Return whether the vertical scale is logarithmic, and where on it marks of undetermined points are."""
    of, values = curves[0].of, np.concatenate([curve.values for curve in curves])
    known = values[np.isfinite(values)]
    if of is not None:
        is_log = bool(len(known)) and is_logarithmic(of, known)
        low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
        return is_log, float(2 * high if is_log else high + 0.2 * (high - low))
    longest = MAX_EXTRAPOLATION * max(curve.scenario.stop.max_cycles for curve in curves)
    return True, 2 * min(float(known.max(initial=1.0)), longest)


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
