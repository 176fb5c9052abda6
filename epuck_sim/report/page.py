"""The page of a run folder as HTML: its sections, one after the other."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from epuck_sim.display.html import Node, element, to_html
from epuck_sim.display.page import check_suffix, make_document
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.saving import to_svg
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.report.contents import Contents, read_contents
from epuck_sim.report.sections import (
    anchor,
    count_trials,
    describe_run,
    list_commands,
    list_failures,
    show_scenario,
)
from epuck_sim.runs.reader import PointTrials
from epuck_sim.util.atomic_write import atomic_write, check_target

FORMS = ("curves", "map", "violins")
"""Forms in which T_sync and a measure of one value are drawn, where they fit."""


def write_report(folder: Path | str, path: Path | str) -> None:
    """Write one HTML page about a run folder, complete in itself: it needs no network, and can be sent to others.

    Args:
        folder: A run folder, finished or not; it stays as it is.
        path: The page, whose name ends in `.html`.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
        EpuckSimError: The page cannot be written.
    """
    target = Path(path)
    check_suffix(target)
    check_target(target)
    page = make_page(read_contents(folder))
    with atomic_write(target) as part:
        part.write_text(page, encoding="utf-8", errors="backslashreplace")


def make_page(contents: Contents) -> str:
    """Return the page; equal contents give an equal page."""
    return make_document(f"{contents.status.scenario}: report", to_html(*_sections(contents)))


def _sections(contents: Contents) -> Iterator[Node]:
    yield from describe_run(contents)
    for quantity in contents.quantities:
        yield element("h2", quantity.summaries.label, id=anchor(quantity.name))
        yield quantity.summaries.table().to_html()
        for form in FORMS:
            yield from _draw(quantity.points, form, quantity.name)
    if not contents.quantities:  # neither oscillators nor a measure of one value
        yield element("h2", "Points")
        yield from count_trials(contents)
    for series in contents.series:
        yield element("h2", series.name, id=anchor(series.name))
        yield from _draw(series.points, "series", series.name)
    yield from (*list_failures(contents), *list_commands(contents), *show_scenario(contents))


def _draw(points: Sequence[PointTrials], name: str, quantity: str) -> Iterator[Node]:
    """Yield a figure with a caption below it, and what theory predicts; nothing where the form does not fit."""
    figure = points[0].scenario.figure.model_copy(update={"theory": points[0].of is None})
    first = points[0]._replace(scenario=points[0].scenario.model_copy(update={"figure": figure}))
    try:
        form = read_form([first, *points[1:]], {"form": name})
        drawn = form.draw_figure()
    except EpuckSimError:
        return
    identifier = "".join(letter if letter.isalnum() else "-" for letter in f"{name}-{quantity}")
    picture = to_svg(drawn, identifier)
    picture.set("id", identifier)
    picture.set("role", "group")
    picture.set("aria-label", f"{quantity}: {name}")
    caption = form.caption.removeprefix(form.ran)
    yield element("figure", picture, element("figcaption", caption))
