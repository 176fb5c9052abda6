"""Curves of T_sync against speed, or another axis, from a run folder: a line for each combination of the others."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.csv_tables import rounded, save_curves, save_table
from epuck_sim.figures.labels import axis_label, format_axis_values
from epuck_sim.figures.style import (
    add_shared_legend,
    disable_mathtext,
    is_logarithmic,
    make_logarithmic,
    make_panels,
    output_paths,
    save_drawing,
)
from epuck_sim.statistics.curves import SPEED, Curve, distinguishing_axes
from epuck_sim.statistics.extrema import SpeedExtrema, find_minimum_and_peak
from epuck_sim.util.messages import comma_list, did_you_mean

BUMP_COLUMNS = tuple(f"{name}{end}" for name in ("v_m", "t_m", "v_p", "t_p") for end in ("", "_low", "_high"))


FARTHEST = 100
"""So many times the limit of cycles a figure shows: means beyond are extrapolated too far to mean much."""


def save_figure(
    stem: Path, title: str, axis: str, curves: Sequence[Curve], panels: str | None = None, origin: str = "--panels"
) -> list[Path]:
    """Write the figure as STEM.png and STEM.svg, its points as STEM.csv and V_m and V_p as STEM-regimes.csv.

    axis: the dotted key of the curves' x; panels: of the axis with a panel for each value, if any; origin: who wants
    that, for messages. Returns the files; raises EpuckSimError where one cannot be written, or there is no such axis.
    """
    if panels is not None and panels not in curves[0].axes:
        raise EpuckSimError(
            f"{origin}: {did_you_mean(panels, curves[0].axes)}; other axes: {comma_list(curves[0].axes)}"
        )
    bumps = [
        find_minimum_and_peak(curve.x, curve.means, curve.resampled) if axis.endswith(SPEED) else None
        for curve in curves
    ]
    files = output_paths(stem, ".png", ".svg", ".csv", "-regimes.csv")
    save_drawing(draw(title, axis, curves, bumps, panels), *files[:2])
    save_curves(files[2], axis, curves)
    save_table(files[3], (*curves[0].axes, *BUMP_COLUMNS, "p_value"), _bump_rows(curves, bumps))
    return files


def draw(
    title: str, axis: str, curves: Sequence[Curve], bumps: Sequence[SpeedExtrema | None], split_by: str | None = None
) -> Figure:
    """Return the figure: means and their 95 % bands, T_sync on a logarithmic scale, hollow where trials are censored.

    A cross at the upper edge is a mean that is undetermined; triangles are the local minimum and the peak, where found.
    split_by: the axis with a panel for each of its values.
    """
    told = distinguishing_axes([curve.axes for curve in curves])
    heads = [format_axis_values({split_by: curve.axes[split_by]}) if split_by else "" for curve in curves]
    labels = [format_axis_values({key: value for key, value in each.items() if key != split_by}) for each in told]
    heading, size = list(dict.fromkeys(heads)), (6.0, 3.8) if len(set(heads)) == 1 else (3.8, 3.4)
    figure, panels = make_panels(title, heading, (axis_label(axis), "T_sync [cycles]"), size)
    highest = max((np.nanmax(each, initial=1.0) for each in (curve.means for curve in curves)), default=1.0)
    highest = min(highest, FARTHEST * max(curve.scenario.stop.max_cycles for curve in curves))
    x = np.concatenate([curve.x for curve in curves])
    make_logarithmic(panels[0], "y", *["x"] * is_logarithmic(axis, x))
    names = list(dict.fromkeys(labels))
    colours = dict(zip(names, colormaps["viridis"](np.linspace(0, 0.9, len(names))), strict=True))
    for curve, bump, head, label in zip(curves, bumps, heads, labels, strict=True):
        _draw_curve(panels[heading.index(head)], curve, bump, colours[label], label, 2 * highest)
    panels[0].set_ylim(top=min(panels[0].get_ylim()[1], 3 * highest))
    if any(labels) and len(panels) == 1:
        disable_mathtext(panels[0].legend(fontsize="small"))
    elif any(labels):
        add_shared_legend(figure, panels)
    return figure


def _draw_curve(
    axes: Axes, curve: Curve, bump: SpeedExtrema | None, colour: FloatArray, label: str, unknown_at: float
) -> None:
    known = ~np.isnan(curve.means)
    low, high = np.where(known[:, None], np.nan_to_num(curve.intervals, posinf=1e12), np.nan).T
    axes.fill_between(curve.x, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(curve.x, curve.means, color=colour, linewidth=1.2, label=label)  # with a gap where it is undetermined
    for censored, face in ((False, colour), (True, "white")):
        chosen = known & ((curve.censored > 0) == censored)
        axes.plot(curve.x[chosen], curve.means[chosen], "o", color=colour, markersize=4, markerfacecolor=face)
    axes.plot(curve.x[~known], np.full(np.count_nonzero(~known), unknown_at), "x", color=colour)
    if bump is not None and bump.is_found:
        for speed, time, marker in ((bump.v_m, bump.t_m, "v"), (bump.v_p, bump.t_p, "^")):
            axes.plot(speed, time, marker, color=colour, markersize=10, markeredgecolor="black", zorder=4)


def _bump_rows(curves: Sequence[Curve], bumps: Sequence[SpeedExtrema | None]) -> Iterator[list[Any]]:
    """Yield a row for each curve; nothing but the p-value where the bump may be noise."""
    for curve, bump in zip(curves, bumps, strict=True):
        numbers = [np.nan] * len(BUMP_COLUMNS)
        if bump is not None and bump.is_found:
            numbers = [n for estimate, ends in zip(bump[:4], bump.intervals, strict=True) for n in (estimate, *ends)]
        yield [*curve.axes.values(), *map(rounded, numbers), rounded(np.nan if bump is None else bump.p_value)]
