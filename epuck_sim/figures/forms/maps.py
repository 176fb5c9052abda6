"""Maps of T_sync (thesis Figs. 3.5, 5.6, D.4), or of a measure, over two axes; a panel for each value of the others."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, count, groupby
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm, ListedColormap

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import style
from epuck_sim.figures.forms.curves import curves_table
from epuck_sim.figures.forms.form import Choices, Form, check_has_values, joined, names_of
from epuck_sim.figures.labels import statistic_label
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import choose_axis, choose_second_axis, is_logarithmic
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.curves import Curve, estimate_curve, group_by_other_axes
from epuck_sim.statistics.statistic import MOST_CENSORED

COLOURS = colormaps["viridis"]

MIN_CONTOUR_VALUES = 3  # fewest values of x and of y, in every panel, for contours between the points
GREY = "0.88"  # colour of cells where half of the trials or more are censored
MAX_LEVELS = 20  # largest number of levels of colour; more of them are hard to distinguish

LOG_STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
"""Distances from one level to the next, in decades; the smallest that needs at most `MAX_LEVELS` is taken."""


class Map(NamedTuple):
    """A statistic of T_sync, in cycles, or of a measure, at the points of two axes; the grid may have holes."""

    axes: dict[str, Any]  # values of the other axes
    x: FloatArray  # (nx,) ascending
    y: FloatArray  # (ny,) ascending
    values: FloatArray  # (ny, nx) NaN where half of the trials or more are censored, and where there are none
    is_tried: BoolArray  # (ny, nx) whether there are trials
    rows: list[Curve]  # the same points as curves over x, one for each y, which is the last of its axes


@dataclass(kw_only=True)
class Maps(Form):
    """Maps in one set of colours, and a colour bar beside them.

    Each point fills the cell around it: hatched grey if half of its trials or more are censored, or none has a value of
    the measure; blank if it has no trials. Between four neighbours with values, contours are drawn over the cells;
    nothing else is interpolated. Colours stand for logarithms of T_sync, and of measures that are positive and far
    apart.
    """

    name = "map"

    x: str
    y: str
    maps: Sequence[Map]

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        check_has_values(points, cls.name)
        statistic = Statistic(choices.section.statistic)
        if statistic == Statistic.WEIBULL_MEAN:
            raise EpuckSimError(
                "--statistic weibull-mean is not for --form map: where trials are censored it is extrapolated from a "
                "few, and a map has no intervals to show that; allowed: mean, which is restricted there, and median"
            )
        rows = [point.axes for point in points]
        x = choose_axis(rows, *choices.axis("x"))
        y = choose_second_axis(rows, x, *choices.axis("y", taken=x))
        return cls.made(points, choices, x=x, y=y, maps=read_maps(points, x, y, statistic))

    def __post_init__(self) -> None:
        self._rows = [row for each in self.maps for row in each.rows]
        keys = (self.x, self.y, *self.maps[0].axes)
        self.titles = self.labels_of([each.axes for each in self.maps], keys)
        x, y = self.labels = self.label_of(self.x, keys), self.label_of(self.y, keys)
        names = " or ".join(names_of(self._rows)).capitalize()
        trials = style.count_trials(joined(self._rows, "trials").tolist())
        self.shows = f"{names} of {self.quantity} over {x} and {y}; {trials}"

    @property
    def tables(self) -> Mapping[str, str]:
        return {".csv": curves_table(self.x, self._rows)}

    def draw(self, panels: Sequence[Axes]) -> None:
        x, y = joined(self.maps, "x"), joined(self.maps, "y")
        scales = is_logarithmic(self.x, x), is_logarithmic(self.y, y)
        has_contours = all(min(each.values.shape) >= MIN_CONTOUR_VALUES for each in self.maps)
        values = np.concatenate([each.values.ravel() for each in self.maps])
        is_log = style.has_log_scale(self.of, values, self.settings.scale)
        levels = choose_levels(values, is_log=is_log)
        norm = BoundaryNorm(levels, COLOURS.N)
        # panels end at the outermost points, or at the edges of their cells where there are no contours
        edges = [
            [_edges(getattr(each, name), log) for each in self.maps] for name, log in zip("xy", scales, strict=True)
        ]
        ends = {
            f"{name}lim": (np.min(reach), np.max(reach))
            for name, reach in zip("xy", (x, y) if has_contours else map(np.concatenate, edges), strict=True)
        }
        for panel, each, *cells in zip(panels, self.maps, *edges, strict=True):
            style.make_logarithmic(panel, *(name for name, chosen in zip("xy", scales, strict=True) if chosen))
            style.mark_wholes(panel.xaxis, x)
            style.mark_wholes(panel.yaxis, y)
            shown = np.ma.masked_invalid(np.log10(each.values) if is_log else each.values)
            _draw_cells(panel, each, shown, norm, cells)
            if has_contours:  # in the coordinates of the page, as contours between points of a logarithmic axis are
                places = [np.log10(at) if log else at for at, log in zip((each.x, each.y), scales, strict=True)]
                looks: Any = {"cmap": COLOURS, "norm": norm, "levels": levels}
                page = panel.transLimits + panel.transAxes
                panel.contourf(*places, shown, corner_mask=False, transform=page, **looks)
        for panel in panels:
            panel.set(**ends)
        label = style.typeset(statistic_label(names_of(self._rows), self.quantity))
        bar = style.add_colour_bar(panels, ScalarMappable(norm, COLOURS), label=label, spacing="proportional")
        if is_log:
            plain = style.is_plain(10 ** levels[0], 10 ** levels[-1])
            logs = _log_ticks(levels)
            bar.set_ticks(logs, labels=[style.format_tick(float(f"{10**each:.3g}"), plain=plain) for each in logs])
        bar.ax.minorticks_off()


def read_maps(points: Sequence[PointTrials], x: str, y: str, statistic: Statistic = Statistic.MEAN) -> list[Map]:
    """Estimate a map for each combination of the values of the other axes, in the order of the sweep."""
    maps = []
    for others, group in group_by_other_axes(points, y, x):
        rows = [
            estimate_curve(list(row), x, {**others, y: value}, statistic)
            for value, row in groupby(group, lambda each: each.axes[y])
        ]
        xs = np.unique(joined(rows, "x"))
        values = np.full((len(rows), len(xs)), np.nan)
        is_tried = np.zeros(values.shape, bool)
        for place, row in enumerate(rows):
            columns = np.searchsorted(xs, row.x)
            values[place, columns] = np.where(row.censored < MOST_CENSORED, row.values, np.nan)
            is_tried[place, columns] = True
        ys = np.array([row.axes[y] for row in rows], np.float64)
        maps.append(Map(others, xs, ys, values, is_tried, rows))
    return maps


def _draw_cells(panel: Axes, each: Map, values: Any, norm: BoundaryNorm, edges: Sequence[FloatArray]) -> None:
    panel.pcolormesh(*edges, values, cmap=COLOURS, norm=norm, edgecolors="face", linewidth=0.2)
    is_undetermined = each.is_tried & np.isnan(each.values)
    if is_undetermined.any():
        grey = np.ma.masked_where(~is_undetermined, np.zeros(each.values.shape))
        looks: Any = {"edgecolor": "0.55", "linewidth": 0, "antialiased": False}
        cells = panel.pcolor(*edges, grey, cmap=ListedColormap([GREY]), **looks)
        reason = "half of the trials or more are censored" if each.rows[0].of in T_SYNC else "no trial has a value"
        cells.set(hatch="////", label=reason)
        cells.update_scalarmappable()  # so that the legend has the same colour


def _edges(values: FloatArray, is_log: bool) -> FloatArray:
    """Return the edges, (n + 1,), of cells around ascending values, (n,), halfway on the page; a single cell is 1 wide.

    >>> _edges(np.array([1.0, 2.0, 4.0]), False), _edges(np.array([1.0, 100.0]), True)
    (array([0.5, 1.5, 3. , 5. ]), array([1.e-01, 1.e+01, 1.e+03]))
    """
    places = np.log10(values) if is_log else values
    gaps = np.diff(places) if len(places) > 1 else np.ones(1)
    inner = places[:-1] + gaps[: len(places) - 1] / 2
    edges = np.concatenate([[places[0] - gaps[0] / 2], inner, [places[-1] + gaps[-1] / 2]])
    return 10**edges if is_log else edges


def choose_levels(values: FloatArray, *, is_log: bool) -> FloatArray:
    """Return the ends of the ranges of one colour, ascending; all values, (n,), or their log10, lie between them.

    >>> choose_levels(np.array([20.0, 70.0, np.nan]), is_log=True).tolist()
    [1.3, 1.35, 1.4, 1.45, 1.5, 1.55, 1.6, 1.65, 1.7, 1.75, 1.8, 1.85]
    """
    known = values[~np.isnan(values)]
    known = np.log10(known) if is_log else known
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    unit = 10.0 ** math.floor(math.log10(((high - low) or abs(high) or 1.0) / MAX_LEVELS))
    steps = LOG_STEPS if is_log else [unit * factor for factor in (1, 2, 5, 10, 20)]
    for step in chain(steps, (steps[-1] * 2.0**power for power in count(1))):
        first, last = math.floor(low / step + 1e-9), math.floor(high / step + 1e-9) + 1
        if last - first <= MAX_LEVELS:
            break
    levels: FloatArray = np.arange(first, last + 1, dtype=np.float64) * step
    return np.round(levels, 9) if is_log else levels


def _log_ticks(levels: FloatArray) -> list[float]:
    """Return the powers of ten within levels, as logarithms, with numbers between them if there are two at most."""
    decades = range(math.floor(levels[0]), math.floor(levels[-1]) + 1)
    for factors in ((1,), (1, 2, 5), range(1, 10)):
        ticks = [power + math.log10(factor) for power in decades for factor in factors]
        within = [tick for tick in ticks if levels[0] <= tick <= levels[-1]]
        if len(within) > 2:
            return within
    return [float(level) for level in levels]
