"""The figures of thesis chapter 4 from a run folder: T_sync against speed, a line for each value of the second axis."""

import csv
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from epuck_sim.curves import SPEED, Curve, told_apart
from epuck_sim.drawing import check_stem, save_drawing
from epuck_sim.files import written_whole
from epuck_sim.regimes import Bump, find_bump
from epuck_sim.symbols import key_name, unit_of, values_told

POINT_COLUMNS = ("trials", "censored", "mean", "mean_low", "mean_high")

BUMP_COLUMNS = tuple(f"{name}{end}" for name in ("v_m", "t_m", "v_p", "t_p") for end in ("", "_low", "_high"))

DIGITS = 6


def save_figure(stem: Path, title: str, axis: str, curves: Sequence[Curve]) -> list[Path]:
    """Write the figure as STEM.png and STEM.svg, its points as STEM.csv and V_m and V_p as STEM-regimes.csv.

    axis: the dotted key of the curves' x. Returns the files; raises EpuckSimError where one cannot be written.
    """
    bumps = [find_bump(curve.x, curve.means, curve.resampled) if axis.endswith(SPEED) else None for curve in curves]
    files = check_stem(stem, ".png", ".svg", ".csv", "-regimes.csv")
    save_drawing(draw(title, axis, curves, bumps), *files[:2])
    others = list(curves[0].axes)
    _save_table(files[2], (*others, axis, *POINT_COLUMNS), _point_rows(curves))
    _save_table(files[3], (*others, *BUMP_COLUMNS, "p_value"), _bump_rows(curves, bumps))
    return files


def draw(title: str, axis: str, curves: Sequence[Curve], bumps: Sequence[Bump | None]) -> Figure:
    """Return the figure: means and their 95 % bands on logarithmic axes, hollow where trials are censored.

    A cross at the upper edge is a mean that is undetermined; triangles are the local minimum and the peak, where found.
    """
    figure = Figure(figsize=(7, 4.8), layout="constrained")
    axes = figure.subplots()
    highest = max((np.nanmax(each, initial=1.0) for each in (curve.means for curve in curves)), default=1.0)
    _scale(axes, np.concatenate([curve.x for curve in curves]))
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(curves)))
    labels = map(values_told, told_apart([curve.axes for curve in curves]))
    for curve, bump, colour, label in zip(curves, bumps, colours, labels, strict=True):
        _draw_curve(axes, curve, colour, label)
        axes.plot(curve.x[np.isnan(curve.means)], np.full(np.isnan(curve.means).sum(), 2 * highest), "x", color=colour)
        if bump is not None and bump.is_found:
            for speed, time, marker in ((bump.v_m, bump.t_m, "v"), (bump.v_p, bump.t_p, "^")):
                axes.plot(speed, time, marker, color=colour, markersize=10, markeredgecolor="black", zorder=4)
    axes.set_ylim(top=min(axes.get_ylim()[1], 3 * highest))
    unit = unit_of(axis)
    axes.set_title(title, parse_math=False)
    axes.set(xlabel=f"{key_name(axis)} [{unit}]" if unit else key_name(axis), ylabel="T_sync [cycles]")
    if any(axes.get_legend_handles_labels()[1]):
        for text in axes.legend(fontsize="small").get_texts():
            text.set_parse_math(False)
    return figure


def _draw_curve(axes: Axes, curve: Curve, colour: npt.NDArray[np.float64], label: str) -> None:
    known = ~np.isnan(curve.means)
    x, low, high = curve.x[known], *np.nan_to_num(curve.intervals[known], posinf=1e12).T
    axes.fill_between(x, low, high, color=colour, alpha=0.2, linewidth=0)
    axes.plot(x, curve.means[known], color=colour, linewidth=1.2, label=label)
    for censored, face in ((False, colour), (True, "white")):
        chosen = known & ((curve.censored > 0) == censored)
        axes.plot(curve.x[chosen], curve.means[chosen], "o", color=colour, markersize=4, markerfacecolor=face)


def _scale(axes: Axes, x: npt.NDArray[np.float64]) -> None:
    """Make both axes logarithmic, where they can be, with plain numbers."""
    axes.set_yscale("log")
    scaled: list[Axis] = [axes.yaxis]
    if x.min() > 0:
        axes.set_xscale("log")
        scaled.append(axes.xaxis)
    for each in scaled:
        each.set_major_locator(LogLocator(subs=(1, 2, 5)))
        each.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
        each.set_minor_formatter(NullFormatter())


def _point_rows(curves: Sequence[Curve]) -> Iterator[list[Any]]:
    for curve in curves:
        columns = (curve.x, curve.trials, curve.censored, curve.means, *curve.intervals.T)
        for row in zip(*columns, strict=True):
            yield [*curve.axes.values(), *map(_rounded, row)]


def _bump_rows(curves: Sequence[Curve], bumps: Sequence[Bump | None]) -> Iterator[list[Any]]:
    """Yield a row for each curve; nothing but the p-value where the bump may be noise."""
    for curve, bump in zip(curves, bumps, strict=True):
        numbers = [np.nan] * len(BUMP_COLUMNS)
        if bump is not None and bump.is_found:
            numbers = [n for estimate, ends in zip(bump[:4], bump.intervals, strict=True) for n in (estimate, *ends)]
        yield [*curve.axes.values(), *map(_rounded, numbers), _rounded(np.nan if bump is None else bump.p_value)]


def _rounded(number: float) -> str:
    return f"{number:.{DIGITS}g}" if np.isfinite(number) else ""


def _save_table(file: Path, columns: Sequence[str], rows: Iterator[list[Any]]) -> None:
    with written_whole(file) as part, part.open("w", newline="", encoding="utf-8") as text:
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)
