"""Maps of T_sync (thesis Figs. 3.5, 5.6, D.4), or of a measure, over two axes; a panel for each value of the others."""

from collections.abc import Sequence
from itertools import groupby
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.figures.csv_tables import Table, curves_table
from epuck_sim.figures.forms.levels import COLOURS, add_colour_bar, choose_levels, choose_linear_levels
from epuck_sim.figures.labels import axis_label, distinguishing_labels, statistic_label
from epuck_sim.figures.scales import has_log_scale, is_logarithmic, make_logarithmic
from epuck_sim.figures.style import STYLE, count_trials, finish, make_panels, typeset
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import Curve, estimate_curve, group_by_other_axes
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import MOST_CENSORED

MIN_CONTOUR_VALUES = 3
"""Fewest values of x and of y in every panel with which contours are drawn between the points."""

GREY = "0.88"
"""Colour of cells where half of the trials or more are censored."""


class Map(NamedTuple):
    """A statistic of T_sync, in cycles, or of a measure, at the points of two axes; the grid may have holes."""

    axes: dict[str, Any]
    """Values of the other axes."""
    x: FloatArray
    """(nx,) values of the horizontal axis, ascending."""
    y: FloatArray
    """(ny,) values of the vertical axis, ascending."""
    values: FloatArray
    """(ny, nx) the statistic; NaN where half of the trials or more are censored, and where there are none."""
    is_tried: BoolArray
    """(ny, nx) whether there are trials."""
    rows: list[Curve]
    """The same points as curves over x, one for each y, which is the last of its axes."""


def read_maps(points: Sequence[PointTrials], x: str, y: str, statistic: Statistic = Statistic.MEAN) -> list[Map]:
    """Estimate a map for each combination of the values of the other axes, in the order of the sweep."""
    return [_map(group, x, y, others, statistic) for others, group in group_by_other_axes(points, y, x)]


def _map(points: Sequence[PointTrials], x: str, y: str, others: dict[str, Any], statistic: Statistic) -> Map:
    rows = [
        estimate_curve(list(row), x, {**others, y: value}, statistic)
        for value, row in groupby(points, lambda each: each.axes[y])
    ]
    xs = np.unique(np.concatenate([row.x for row in rows]))
    values = np.full((len(rows), len(xs)), np.nan)
    is_tried = np.zeros(values.shape, bool)
    for place, row in enumerate(rows):
        columns = np.searchsorted(xs, row.x)
        values[place, columns] = np.where(row.censored < MOST_CENSORED, row.values, np.nan)
        is_tried[place, columns] = True
    return Map(others, xs, np.array([row.axes[y] for row in rows], np.float64), values, is_tried, rows)


def maps_table(x: str, maps: Sequence[Map]) -> Table:
    """Return the points of maps over `x`, with the columns of a table of curves."""
    return curves_table(x, [row for each in maps for row in each.rows])


@rc_context(STYLE)
def draw_maps(title: str, x: str, y: str, maps: Sequence[Map], width_cm: float | None = None) -> Figure:
    """Draw a panel for each map, all in the same colours; `plot_maps` says how.

    Args:
        title: Title of the figure, to which the numbers of trials are added.
        x: Dotted key of the horizontal axis.
        y: Dotted key of the vertical axis.
        maps: The maps, at least one.
        width_cm: Width of the figure; by default that of a column, or of a page for several panels.

    Raises:
        EpuckSimError: There are more maps than panels of a figure.
    """
    among = (x, y, *maps[0].axes)
    titles = distinguishing_labels([each.axes for each in maps], among)
    trials = np.concatenate([row.trials for each in maps for row in each.rows]).tolist()
    labels = axis_label(x, among), axis_label(y, among)
    figure, panels = make_panels(f"{title}\n{count_trials(trials)}", titles, labels, width_cm)
    plot_maps(panels, x, y, maps)
    finish(figure, panels)
    return figure


def plot_maps(panels: Sequence[Axes], x: str, y: str, maps: Sequence[Map]) -> None:
    """Draw maps over `x` and `y`, dotted keys, into panels that share their scales, and a colour bar beside them.

    Each point fills the cell around it, with a hatched grey where half of its trials or more are censored, or none has
    a value of the measure; one without trials is blank. Between four neighbours that are neither, contours are drawn
    over the cells; nothing else is interpolated. Colours stand for logarithms of T_sync, and of measures that are
    positive and far apart. The colour bar names the statistic.
    """
    logarithmic = (
        is_logarithmic(x, np.concatenate([each.x for each in maps])),
        is_logarithmic(y, np.concatenate([each.y for each in maps])),
    )
    make_logarithmic(panels[0], *(name for name, chosen in zip("xy", logarithmic, strict=True) if chosen))
    has_contours = all(min(each.values.shape) >= MIN_CONTOUR_VALUES for each in maps)
    values = np.concatenate([each.values.ravel() for each in maps])
    of = maps[0].rows[0].of
    is_log = has_log_scale(of, values)
    levels = choose_levels(values) if is_log else choose_linear_levels(values)
    for panel, each in zip(panels, maps, strict=True):
        shown = each._replace(values=np.log10(each.values)) if is_log else each
        _draw_map(panel, shown, levels, logarithmic, has_contours)
    _set_limits(panels[0], maps, logarithmic, has_contours)
    names = [name for each in maps for row in each.rows for name in row.names]
    add_colour_bar(panels, levels, typeset(statistic_label(names, of)), is_log=is_log)


def _draw_map(panel: Axes, each: Map, levels: FloatArray, logarithmic: tuple[bool, bool], has_contours: bool) -> None:
    norm = BoundaryNorm(levels, COLOURS.N)
    values = np.ma.masked_invalid(each.values)
    edges = [_edges(places, is_log) for places, is_log in zip((each.x, each.y), logarithmic, strict=True)]
    panel.pcolormesh(*edges, values, cmap=COLOURS, norm=norm, edgecolors="face", linewidth=0.2)
    is_undetermined = each.is_tried & np.isnan(each.values)
    if is_undetermined.any():
        grey = np.ma.masked_where(~is_undetermined, np.zeros(each.values.shape))
        cells = panel.pcolor(
            *edges, grey, cmap=ListedColormap([GREY]), edgecolor="0.55", linewidth=0, antialiased=False
        )
        reason = "half of the trials or more are censored" if each.rows[0].of is None else "no trial has a value"
        cells.set(hatch="////", label=reason)
        cells.update_scalarmappable()  # or the legend would have another colour
    if has_contours:
        # in the coordinates of the page, where a contour between two points of a logarithmic axis belongs
        scaled = [_scaled(values, is_log) for values, is_log in zip((each.x, each.y), logarithmic, strict=True)]
        on_page = panel.transLimits + panel.transAxes
        panel.contourf(*scaled, values, levels=levels, cmap=COLOURS, norm=norm, corner_mask=False, transform=on_page)


def _set_limits(panel: Axes, maps: Sequence[Map], logarithmic: tuple[bool, bool], has_contours: bool) -> None:
    """End the panels at the outermost points, or at the edges of their cells where there are no contours."""
    for name, is_log in zip("xy", logarithmic, strict=True):
        values = [getattr(each, name) for each in maps]
        ends = np.concatenate(values if has_contours else [_edges(each, is_log) for each in values])
        panel.set(**{f"{name}lim": (ends.min(), ends.max())})


def _scaled(values: FloatArray, is_log: bool) -> FloatArray:
    """Return values, (n,), in proportion to their places on the page."""
    return np.log10(values) if is_log else values


def _edges(values: FloatArray, is_log: bool) -> FloatArray:
    """Return the edges, (n + 1,), of cells around ascending values, (n,), halfway on the page; a single cell is 1 wide.

    >>> _edges(np.array([1.0, 2.0, 4.0]), False), _edges(np.array([1.0, 100.0]), True)
    (array([0.5, 1.5, 3. , 5. ]), array([1.e-01, 1.e+01, 1.e+03]))
    """
    places = _scaled(values, is_log)
    gaps = np.diff(places) if len(places) > 1 else np.ones(1)
    inner = places[:-1] + gaps[: len(places) - 1] / 2
    edges = np.concatenate([[places[0] - gaps[0] / 2], inner, [places[-1] + gaps[-1] / 2]])
    return 10**edges if is_log else edges
