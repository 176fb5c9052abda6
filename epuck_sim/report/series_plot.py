"""Figures of series, measures that have a value for each cycle: their means over the trials of each point."""

import html

import numpy as np
from plotly import graph_objects as go

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.measures.interface import Value
from epuck_sim.report.contents import Series
from epuck_sim.report.groups import Group, arrange, point_labels
from epuck_sim.report.theme import Choices, add_choices, colours, make_figure
from epuck_sim.runs.reader import PointTrials

MOST_CYCLES = 400
"""Largest number of cycles of a line that are drawn; of longer series, every second, third and so on."""


def draw_series(series: Series) -> go.Figure | None:
    """Draw the mean over the trials of each point, cycle by cycle; a menu chooses the group. None without values."""
    means = [mean_series(point.measured) for point in series.points]
    filled = [place for place, (values, _) in enumerate(means) if len(values)]
    if not filled:
        return None
    arrangement = arrange(series.points, filled)
    names = arrangement.names if arrangement else point_labels(series.points)
    figure = make_figure("cycle", html.escape(series.name))
    choices: Choices = {}
    for group in arrangement.groups if arrangement else [Group("", filled)]:
        palette = colours(len(group.places))
        choices[html.escape(group.label)] = [
            _line(html.escape(names[place]), *means[place], colour)
            for place, colour in zip(group.places, palette, strict=True)
        ]
    add_choices(figure, choices)
    figure.update_layout(showlegend=len(filled) > 1)
    return figure


def mean_series(values: tuple[Value, ...]) -> tuple[FloatArray, IntArray]:
    """Return the mean of series at each cycle, (cycles,), and the number of trials that have a value there.

    A trial that has ended, and a value that is undetermined, counts no more.

    >>> mean_series(([1, 3, 5], [2, None], None))
    (array([1.5, 3. , 5. ]), array([2, 1, 1]))
    """
    lists = [value for value in values if isinstance(value, list)]
    longest = max(map(len, lists), default=0)
    sums, counts = np.zeros(longest), np.zeros(longest, np.int64)
    for each in lists:
        row = np.array(each, float)  # None becomes NaN
        sums[: len(row)] += np.nan_to_num(row)
        counts[: len(row)] += ~np.isnan(row)
    return np.divide(sums, counts, out=np.full(longest, np.nan), where=counts > 0), counts


def count_series(point: PointTrials) -> int:
    """Return the number of trials of a point that have a series."""
    return sum(isinstance(value, list) for value in point.measured)


def _line(name: str, values: FloatArray, counts: IntArray, colour: str) -> go.Scatter:
    every = slice(None, None, -(-len(values) // MOST_CYCLES))
    return go.Scatter(
        x=np.arange(1, len(values) + 1, dtype=np.int32)[every],
        y=values[every].astype(np.float32),
        customdata=counts[every].astype(np.int32),
        mode="lines",
        line={"color": colour, "width": 1.5},
        name=name,
        hovertemplate=f"{name}<br>cycle %{{x}}: %{{y:.4g}}, mean of %{{customdata}} trials<extra></extra>",
    )
