"""Colours of a page, and of its figures, that are legible on white and on black."""

from plotly import graph_objects as go
from plotly.colors import sample_colorscale

RAMP = ["#1f83d6", "#8a6fd6", "#c2569f", "#d9572b", "#a07d10"]
"""Colours between which those of curves lie: all have a contrast of at least 3 with `PAPER`, light and dark."""

PAPER = ("#ffffff", "#14171c")
"""Colours of the page, light and dark."""

SYMBOLS = ("circle", "square", "diamond", "triangle-up", "triangle-down", "cross", "x", "star")
"""Markers of curves, which tell them apart where colours do not."""

GREY = "#808890"
"""Colour of text and lines in figures; the style of the page replaces it by what fits the reader's theme."""

Choices = dict[str, list[go.Scatter | go.Heatmap]]
"""Sets of traces of which one is shown at a time, by their names."""


def colours(count: int) -> list[str]:
    """Return colours for a number of curves, neighbours alike and the outermost far apart."""
    places = [place / max(1, count - 1) for place in range(count)]
    found: list[str] = sample_colorscale(RAMP, places)
    return found


def make_figure(x: str, y: str) -> go.Figure:
    """Return an empty figure with labels of its axes; it is as wide as the page and fits both themes."""
    figure = go.Figure()
    axis = {"gridcolor": GREY, "zeroline": False, "automargin": True, "exponentformat": "power", "showline": False}
    figure.update_xaxes(title=x, **axis)
    figure.update_yaxes(title=y, **axis)
    figure.update_layout(
        paper_bgcolor="rgba(0,0,0,0)",
        plot_bgcolor="rgba(0,0,0,0)",
        font={"color": GREY, "size": 13},
        margin={"l": 10, "r": 10, "t": 50, "b": 10},
        height=480,
        legend={"orientation": "h", "yanchor": "top", "y": -0.18, "maxheight": 120},
        modebar={"bgcolor": "rgba(0,0,0,0)", "color": GREY, "activecolor": RAMP[0]},
        hoverlabel={"bgcolor": "#2b3138", "bordercolor": "#2b3138", "font": {"color": "#ffffff"}, "align": "left"},
    )
    return figure


def add_choices(figure: go.Figure, choices: Choices) -> None:
    """Add traces of which one set is shown at a time; a menu chooses it, if there are several.

    Args:
        figure: The figure.
        choices: The sets by their names; the first is shown at first.
    """
    owners: list[str] = []
    for name, traces in choices.items():
        for trace in traces:
            trace.visible = not owners or owners[0] == name
            figure.add_trace(trace)
            owners.append(name)
    if len(choices) < 2:
        return
    buttons = [
        {"label": name, "method": "restyle", "args": [{"visible": [owner == name for owner in owners]}]}
        for name in choices
    ]
    menu = {"buttons": buttons, "x": 0, "xanchor": "left", "y": 1.02, "yanchor": "bottom", "bgcolor": "rgba(0,0,0,0)"}
    figure.update_layout(updatemenus=[{**menu, "bordercolor": GREY, "font": {"color": GREY}}])
