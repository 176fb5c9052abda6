"""The page of a run folder as HTML: its sections, one after the other."""

from collections.abc import Iterator

from plotly import graph_objects as go
from plotly.offline import get_plotlyjs

from epuck_sim.display.html import element, to_html
from epuck_sim.display.page import make_document
from epuck_sim.report.contents import Contents, Quantity, Series
from epuck_sim.report.distribution_plot import draw_distributions
from epuck_sim.report.estimate_plots import draw_estimates, draw_map
from epuck_sim.report.sections import (
    anchor,
    count_trials,
    describe_run,
    list_commands,
    list_failures,
    show_scenario,
    tabulate,
)
from epuck_sim.report.series_plot import count_series, draw_series

CONFIG = {
    "responsive": True,
    "displaylogo": False,
    "showSendToCloud": False,
    "modeBarButtonsToRemove": ["select2d", "lasso2d"],
    "toImageButtonOptions": {"format": "svg"},
}
"""How plotly shows figures: as wide as the window, with buttons to zoom and to save as SVG, none that uploads data."""

ZOOM = "Hover for numbers; drag to zoom, double-click to zoom out."
ESTIMATES = "Estimates of the trials of each point, with 95 % intervals."
CENSORED = (
    "Hollow: some trials are censored, and means are restricted to the limit of cycles. Missing: all are censored, or "
    "there are none."
)
MAP = "Means over two axes, in cells of equal width."
CENSORED_MAP = "Missing: half of the trials or more are censored, or there are none."
DISTRIBUTIONS = "Share of the trials of each point that have at most this value."
CENSORED_DISTRIBUTIONS = "A line ends below 1 where trials are censored (Kaplan-Meier)."
SERIES = "Mean of the trials of each point at each cycle; a trial that has ended counts no more."
"""Captions of figures."""

_FIGURE = '<figure class="plot">'


def make_page(contents: Contents) -> str:
    """Return the page; equal contents give an equal page."""
    body = "".join(_sections(contents))
    library = f"<script>{get_plotlyjs()}</script>" if _FIGURE in body else ""
    return make_document(f"{contents.status.scenario}: report", body, library)


def _sections(contents: Contents) -> Iterator[str]:
    yield to_html(*describe_run(contents))
    for quantity in contents.quantities:
        yield to_html(element("h2", quantity.label, id=anchor(quantity.name)), *tabulate(contents, quantity))
        yield from _draw_quantity(quantity)
    if not contents.quantities:  # neither oscillators nor a measure of one value
        yield to_html(element("h2", "Points"), *count_trials(contents))
    for series in contents.series:
        yield to_html(element("h2", series.name, id=anchor(series.name)))
        yield from _draw_series(series)
    yield to_html(*list_failures(contents), *list_commands(contents), *show_scenario(contents))


def _draw_quantity(quantity: Quantity) -> Iterator[str]:
    forms = (
        ("estimates", draw_estimates, ESTIMATES, CENSORED),
        ("map", draw_map, MAP, CENSORED_MAP),
        ("distribution", draw_distributions, DISTRIBUTIONS, CENSORED_DISTRIBUTIONS),
    )
    for form, draw, caption, if_censored in forms:
        drawn = draw(quantity)
        if drawn is not None:
            is_censored = any(summary.censored for summary in quantity.summaries)
            yield _figure(drawn, f"{form}-{quantity.name}", " ".join([caption, *[if_censored] * is_censored, ZOOM]))


def _draw_series(series: Series) -> Iterator[str]:
    trials = sum(map(count_series, series.points))
    yield to_html(element("p", f"A value for each cycle, in {trials} trials.", class_="note"))
    drawn = draw_series(series)
    if drawn is not None:
        yield _figure(drawn, f"series-{series.name}", f"{SERIES} {ZOOM}")


def _figure(figure: go.Figure, name: str, caption: str) -> str:
    """Return a figure with a caption below it."""
    identifier = "".join(letter if letter.isalnum() else "-" for letter in name)
    drawn = figure.to_html(config=CONFIG, include_plotlyjs=False, full_html=False, div_id=identifier)
    return f"{_FIGURE}{drawn}{to_html(element('figcaption', caption))}</figure>\n"
