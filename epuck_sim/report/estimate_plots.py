"""Figures of estimates, of T_sync and of measures, along an axis or over two; plotly draws them in the browser."""

import html
import math
from collections.abc import Sequence

import numpy as np
from plotly import graph_objects as go

from epuck_sim.display.numbers import format_estimate
from epuck_sim.figures.labels import axis_label, format_axis_values
from epuck_sim.figures.scales import LOG_RATIO
from epuck_sim.report.contents import Quantity
from epuck_sim.report.groups import Arrangement, Group, arrange, choose_vertical
from epuck_sim.report.theme import SYMBOLS, Choices, add_choices, colours, make_figure
from epuck_sim.scenario.figure_axes import distinguishing_axes
from epuck_sim.statistics.statistic import MOST_CENSORED
from epuck_sim.statistics.summary import STATISTIC_NAMES, PointSummary, applicable_statistics


def draw_estimates(quantity: Quantity) -> go.Figure | None:
    """Draw estimates with their intervals along an axis, a line for each group; None without an axis or trials."""
    arrangement = arrange_filled(quantity)
    if arrangement is None:
        return None
    figure = make_figure(html.escape(arrangement.label), html.escape(quantity.label))
    _set_axis(figure, arrangement)
    if quantity.is_time and _spans_a_decade(quantity):
        figure.update_yaxes(type="log")
    palette = colours(len(arrangement.groups))
    choices: Choices = {}
    for statistic, label in _choices(quantity.summaries).items():
        choices[label] = [
            _line(quantity, arrangement, group, statistic, colour, SYMBOLS[number % len(SYMBOLS)])
            for number, (group, colour) in enumerate(zip(arrangement.groups, palette, strict=True))
        ]
    add_choices(figure, choices)
    figure.update_layout(showlegend=len(arrangement.groups) > 1)
    return figure


def arrange_filled(quantity: Quantity) -> Arrangement | None:
    """Arrange the points that have values; None where there are none, or no axis distinguishes them."""
    places = [place for place, measured in enumerate(quantity.measured) if len(measured.values)]
    return arrange(quantity.points, places) if places else None


def _choices(summaries: Sequence[PointSummary]) -> dict[str, str]:
    """Return the statistics among which a reader chooses, by their fields; means, restricted or not, are one."""
    names = applicable_statistics(summaries)
    found = {field: name for field, name in names.items() if field not in ("mean", "restricted_mean")}
    means = " or ".join(name for field, name in names.items() if field not in found)
    return {"mean": means, **found}


def _estimate(summary: PointSummary, statistic: str) -> tuple[str, list[float | None]]:
    """Return the name of a statistic at a point, its value and the ends of its interval.

    Where all trials are censored nothing is known: their restricted mean is the limit, whatever T_sync is.
    """
    field = "restricted_mean" if statistic == "mean" and summary.mean is None else statistic
    if summary.censored == 1:
        return STATISTIC_NAMES[field], [None] * 3
    return STATISTIC_NAMES[field], summary.estimate(field)


def _line(
    quantity: Quantity, arrangement: Arrangement, group: Group, statistic: str, colour: str, symbol: str
) -> go.Scatter:
    summaries = [quantity.summaries[place] for place in group.places]
    texts, values, above, below = [], [], [], []
    for place, summary in zip(group.places, summaries, strict=True):
        name, (value, low, high) = _estimate(summary, statistic)
        values.append(value)
        above.append(None if value is None or high is None else high - value)
        below.append(None if value is None or low is None else value - low)
        texts.append(_describe(quantity, place, f"{name} {format_estimate(value, low, high)}"))
    return go.Scatter(
        x=[arrangement.values[place] for place in group.places],
        y=values,
        error_y={"type": "data", "symmetric": False, "array": above, "arrayminus": below, "thickness": 1},
        mode="lines+markers" if arrangement.is_numeric else "markers",
        name=html.escape(group.label) or "all",
        line={"color": colour, "width": 1.5},
        marker={
            "symbol": [f"{symbol}-open" if summary.censored else symbol for summary in summaries],
            "size": 8,
            "color": colour,
        },
        text=texts,
        hovertemplate="%{text}<extra></extra>",
    )


def _describe(quantity: Quantity, place: int, estimate: str) -> str:
    """Return what is shown where the mouse is at a point."""
    summary = quantity.summaries[place]
    trials = f"{summary.trials} trials"
    if quantity.is_time:
        trials += f", {summary.censored:.0%} censored"
    label = html.escape(quantity.labels[place])
    return f"point {summary.point}: {label}<br>{estimate}<br>{trials}"


def draw_map(quantity: Quantity) -> go.Figure | None:
    """Draw means over two axes of numbers, in equal cells; a menu chooses the values of the others. None without."""
    arrangement = arrange_filled(quantity)
    vertical = choose_vertical(quantity.points, arrangement.axis) if arrangement else None
    if arrangement is None or vertical is None or not arrangement.is_numeric:
        return None
    rows = [point.axes for point in quantity.points]
    places = [place for group in arrangement.groups for place in group.places]
    left = [{key: value for key, value in row.items() if key not in (arrangement.axis, vertical)} for row in rows]
    named = [format_axis_values(row) for row in distinguishing_axes(left)]
    values = {
        place: None if summary.censored >= MOST_CENSORED else _estimate(summary, "mean")[1][0]
        for place, summary in enumerate(quantity.summaries)
    }
    known = [value for place in places if (value := values[place]) is not None]
    if not known:
        return None
    is_log = quantity.is_time and min(known) > 0
    low, high = (math.log10(end) if is_log else end for end in (min(known), max(known)))
    figure = make_figure(html.escape(arrangement.label), html.escape(axis_label(vertical)))
    figure.update_layout(showlegend=False)
    choices: Choices = {}
    for name in dict.fromkeys(named[place] for place in places):
        chosen = [place for place in places if named[place] == name]
        choices[html.escape(name)] = [_heatmap(quantity, arrangement, vertical, chosen, values, (low, high), is_log)]
    add_choices(figure, choices)
    figure.update_xaxes(type="category", showgrid=False)
    figure.update_yaxes(type="category", showgrid=False)
    return figure


def _heatmap(
    quantity: Quantity,
    arrangement: Arrangement,
    vertical: str,
    places: Sequence[int],
    values: dict[int, float | None],
    ends: tuple[float, float],
    is_log: bool,
) -> go.Heatmap:
    xs = sorted({arrangement.values[place] for place in places})
    ys = sorted({quantity.points[place].axes[vertical] for place in places})
    z: list[list[float | None]] = [[None] * len(xs) for _ in ys]
    text = [[""] * len(xs) for _ in ys]
    for place in places:
        row, column = ys.index(quantity.points[place].axes[vertical]), xs.index(arrangement.values[place])
        value = values[place]
        z[row][column] = math.log10(value) if is_log and value is not None else value
        name, numbers = _estimate(quantity.summaries[place], "mean")
        text[row][column] = _describe(quantity, place, f"{name} {format_estimate(*numbers)}")
    ticks = np.linspace(*ends, 5).tolist()
    return go.Heatmap(
        x=[f"{x:g}" for x in xs],
        y=[f"{y:g}" for y in ys],
        z=z,
        text=text,
        hovertemplate="%{text}<extra></extra>",
        hoverongaps=False,
        colorscale="Viridis",
        zmin=ends[0],
        zmax=ends[1],
        colorbar={
            "title": html.escape(quantity.label),
            "tickvals": ticks,
            "ticktext": [f"{10**tick if is_log else tick:.3g}" for tick in ticks],
        },
    )


def _set_axis(figure: go.Figure, arrangement: Arrangement) -> None:
    if not arrangement.is_numeric:
        figure.update_xaxes(type="category")
    elif arrangement.is_logarithmic:
        figure.update_xaxes(type="log")


def _spans_a_decade(quantity: Quantity) -> bool:
    """Return whether estimates differ so much that they want a logarithmic scale."""
    found = [mean for summary in quantity.summaries if (mean := _estimate(summary, "mean")[1][0])]
    return bool(found) and max(found) / min(found) >= LOG_RATIO
