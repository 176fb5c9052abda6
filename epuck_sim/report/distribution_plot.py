"""Figures of how the values of T_sync, or of a measure, are distributed over the trials of each point."""

import html

import numpy as np
from plotly import graph_objects as go

from epuck_sim.report.contents import Quantity
from epuck_sim.report.groups import Group, arrange
from epuck_sim.report.theme import Choices, add_choices, colours, make_figure
from epuck_sim.statistics.survival import kaplan_meier

MOST_STEPS = 1000
"""Largest number of steps of a distribution that are drawn."""


def draw_distributions(quantity: Quantity) -> go.Figure | None:
    """Draw, for each point, the share of its trials with at most a value; a menu chooses the group. None without.

    Of T_sync, this is one minus the Kaplan-Meier estimate.
    """
    filled = [place for place, measured in enumerate(quantity.measured) if measured.observed.any()]
    if not filled:
        return None
    arrangement = arrange(quantity.points, filled)
    groups = arrangement.groups if arrangement else [Group("", filled)]
    figure = make_figure(html.escape(quantity.label), "share of trials")
    figure.update_yaxes(range=[0, 1.03])
    if quantity.is_time:
        figure.update_xaxes(type="log")
    names = arrangement.names if arrangement else quantity.labels
    choices: Choices = {}
    for group in groups:
        palette = colours(len(group.places))
        choices[html.escape(group.label)] = [
            _steps(quantity, place, html.escape(names[place]), colour)
            for place, colour in zip(group.places, palette, strict=True)
        ]
    add_choices(figure, choices)
    figure.update_layout(showlegend=len(filled) > 1)
    return figure


def _steps(quantity: Quantity, place: int, name: str, colour: str) -> go.Scatter:
    measured = quantity.measured[place]
    shift = min(float(measured.values.min()), 0.0)  # the estimate takes no negative values
    times, survival = kaplan_meier(measured.values - shift, measured.observed)
    chosen = np.unique(np.linspace(0, len(times) - 1, min(len(times), MOST_STEPS)).round().astype(int))
    x, y = (times + shift)[chosen], (1 - survival)[chosen]
    last = measured.values.max()  # of censored trials, it is known that they take longer
    return go.Scatter(
        x=np.array([x[0], *x, last], np.float32),
        y=np.array([0.0, *y, y[-1]], np.float32),
        mode="lines",
        line={"shape": "hv", "color": colour, "width": 1.5},
        name=name,
        hovertemplate=f"{name}<br>%{{x}}: %{{y:.0%}}<extra></extra>",
    )
