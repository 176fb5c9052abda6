"""Maps of the mean T_sync over two axes, a panel for each combination of the others (thesis Figs. 3.5, 5.6, D.4)."""

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.figures.csv_tables import save_curves
from epuck_sim.figures.labels import axis_label, format_axis_values
from epuck_sim.figures.style import (
    add_shared_legend,
    format_tick,
    is_logarithmic,
    make_logarithmic,
    make_panels,
    output_paths,
    save_drawing,
)
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import Curve, distinguishing_axes, estimate_curve, group_by_other_axes

COLOURS = colormaps["viridis"]

MOST_LEVELS = 20
"""So many colours can be told apart."""

STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
"""Decades from one level to the next; the least of them is taken that needs no more than `MOST_LEVELS`."""

FEWEST_VALUES = 3
"""Of x and of y in every panel, or no contours are drawn between the points."""

GREY = "0.88"


class Map(NamedTuple):
    """Mean T_sync, in cycles, over two axes: the points measured, of which the grid may have holes."""

    axes: dict[str, Any]
    """Values of the other axes."""
    x: FloatArray
    """(nx,) values of the axis to the right, ascending."""
    y: FloatArray
    """(ny,) values of the axis that goes up, ascending."""
    means: FloatArray
    """(ny, nx) by Appendix A; NaN where undetermined, and where there are no trials."""
    is_tried: BoolArray
    """(ny, nx) whether there are trials."""
    rows: list[Curve]
    """The same points along x, one curve for each y, which is the last of its axes."""


def read_maps(points: Sequence[PointTrials], x: str, y: str) -> list[Map]:
    """Return a map for each combination of the values of the other axes, in the order of the sweep."""
    return [_map(group, x, y, others) for others, group in group_by_other_axes(points, y, x)]


def _map(points: Sequence[PointTrials], x: str, y: str, others: dict[str, Any]) -> Map:
    rows = [
        estimate_curve(list(row), x, {**others, y: value}) for value, row in groupby(points, lambda each: each.axes[y])
    ]
    xs = np.unique(np.concatenate([row.x for row in rows]))
    means = np.full((len(rows), len(xs)), np.nan)
    is_tried = np.zeros(means.shape, bool)
    for place, row in enumerate(rows):
        columns = np.searchsorted(xs, row.x)
        means[place, columns], is_tried[place, columns] = row.means, True
    return Map(others, xs, np.array([row.axes[y] for row in rows], np.float64), means, is_tried, rows)


def save_maps(stem: Path, title: str, x: str, y: str, maps: Sequence[Map]) -> list[Path]:
    """Write the maps as STEM.png and STEM.svg, and their points as STEM.csv, with the columns of a figure of curves.

    x, y: dotted keys of the axes. Returns the files; raises EpuckSimError where one cannot be written, and for more
    maps than there can be panels.
    """
    files = output_paths(stem, ".png", ".svg", ".csv")
    save_drawing(draw_maps(title, x, y, maps), *files[:2])
    save_curves(files[2], x, [row for each in maps for row in each.rows])
    return files


def draw_maps(title: str, x: str, y: str, maps: Sequence[Map]) -> Figure:
    """Return the figure: a panel for each map, all in the same colours.

    Each point fills the cell around it, with a hatched grey where its mean is undetermined; one without trials is
    blank. Between neighbours that are determined, contours are drawn over the cells; nothing else is interpolated.
    """
    told = distinguishing_axes([each.axes for each in maps])
    size = (5.2, 3.8) if len(maps) == 1 else (2.9, 2.5)
    figure, panels = make_panels(
        title, [format_axis_values(each) for each in told], (axis_label(x), axis_label(y)), size
    )
    logarithmic = (
        is_logarithmic(x, np.concatenate([each.x for each in maps])),
        is_logarithmic(y, np.concatenate([each.y for each in maps])),
    )
    make_logarithmic(panels[0], *(name for name, chosen in zip("xy", logarithmic, strict=True) if chosen))
    has_contours = all(min(each.means.shape) >= FEWEST_VALUES for each in maps)
    levels = choose_levels(np.concatenate([each.means.ravel() for each in maps]))
    for panel, each in zip(panels, maps, strict=True):
        _draw_map(panel, each, levels, logarithmic, has_contours)
    _set_limits(panels[0], maps, logarithmic, has_contours)
    _add_colour_bar(figure, panels, levels)
    add_shared_legend(figure, panels)
    return figure


def choose_levels(means: FloatArray) -> FloatArray:
    """Return the levels, log10 of cycles, ascending, between which means, (n,), have one colour; all lie between them.

    >>> choose_levels(np.array([20.0, 70.0, np.nan])).tolist()
    [1.3, 1.35, 1.4, 1.45, 1.5, 1.55, 1.6, 1.65, 1.7, 1.75, 1.8, 1.85]
    """
    known = np.log10(means[~np.isnan(means)])
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    for step in STEPS:
        first, last = math.floor(low / step), math.floor(high / step) + 1
        if last - first <= MOST_LEVELS:
            break
    return np.round(np.arange(first, last + 1) * step, 9)


def _draw_map(panel: Axes, each: Map, levels: FloatArray, logarithmic: tuple[bool, bool], has_contours: bool) -> None:
    norm = BoundaryNorm(levels, COLOURS.N)
    logs = np.ma.log10(np.ma.masked_invalid(each.means))
    edges = [_edges(values, is_log) for values, is_log in zip((each.x, each.y), logarithmic, strict=True)]
    panel.pcolormesh(*edges, logs, cmap=COLOURS, norm=norm, edgecolors="face", linewidth=0.2)
    is_undetermined = each.is_tried & np.isnan(each.means)
    if is_undetermined.any():
        grey = np.ma.masked_where(~is_undetermined, np.zeros(each.means.shape))
        cells = panel.pcolor(
            *edges, grey, cmap=ListedColormap([GREY]), edgecolor="0.55", linewidth=0, antialiased=False
        )
        cells.set(hatch="////", label="undetermined")
        cells.update_scalarmappable()  # or the legend would have another colour
    if has_contours:
        # in the coordinates of the page, where a contour between two points of a logarithmic axis belongs
        scaled = [_scaled(values, is_log) for values, is_log in zip((each.x, each.y), logarithmic, strict=True)]
        on_page = panel.transLimits + panel.transAxes
        panel.contourf(*scaled, logs, levels=levels, cmap=COLOURS, norm=norm, transform=on_page)


def _set_limits(panel: Axes, maps: Sequence[Map], logarithmic: tuple[bool, bool], has_contours: bool) -> None:
    """Have the panels end at the outermost points, which lie within their cells where there are cells alone."""
    for name, is_log in zip("xy", logarithmic, strict=True):
        values = [getattr(each, name) for each in maps]
        ends = np.concatenate(values if has_contours else [_edges(each, is_log) for each in values])
        panel.set(**{f"{name}lim": (ends.min(), ends.max())})


def _add_colour_bar(figure: Figure, panels: Sequence[Axes], levels: FloatArray) -> None:
    """Add it beside the panels, with powers of ten; where there are not two of them, with the numbers between."""
    colours = ScalarMappable(BoundaryNorm(levels, COLOURS.N), COLOURS)
    bar = figure.colorbar(colours, ax=list(panels), label="T_sync [cycles]", spacing="proportional")
    powers = range(math.ceil(levels[0]), math.floor(levels[-1]) + 1)
    if len(powers) > 1:
        bar.set_ticks(list(powers), labels=[f"$10^{{{power}}}$" for power in powers])
    else:
        decades = range(math.floor(levels[0]), math.ceil(levels[-1]))
        logs = [power + math.log10(factor) for power in decades for factor in range(1, 10)]
        within = [each for each in logs if levels[0] <= each <= levels[-1]]
        ticks = within if len(within) > 1 else levels.tolist()
        bar.set_ticks(ticks, labels=[format_tick(float(f"{10**each:.3g}")) for each in ticks])
    bar.ax.minorticks_off()


def _scaled(values: FloatArray, is_log: bool) -> FloatArray:
    """Return values, (n,), as far apart as they are on the page."""
    return np.log10(values) if is_log else values


def _edges(values: FloatArray, is_log: bool) -> FloatArray:
    """Return the ends of the cells around ascending values, (n,): (n + 1,), halfway on the page; one alone is 1 wide.

    >>> _edges(np.array([1.0, 2.0, 4.0]), False), _edges(np.array([1.0, 100.0]), True)
    (array([0.5, 1.5, 3. , 5. ]), array([1.e-01, 1.e+01, 1.e+03]))
    """
    places = _scaled(values, is_log)
    gaps = np.diff(places) if len(places) > 1 else np.ones(1)
    inner = places[:-1] + gaps[: len(places) - 1] / 2
    edges = np.concatenate([[places[0] - gaps[0] / 2], inner, [places[-1] + gaps[-1] / 2]])
    return 10**edges if is_log else edges
