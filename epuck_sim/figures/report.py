"""The page of a run folder as HTML: its sections, one after the other."""

import shlex
from collections.abc import Iterable, Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path

from epuck_sim.display.html import Node, details, element, facts, in_words, make_document, table, to_html, write_html
from epuck_sim.display.table import Row, Table
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms.curves import PREDICTED_AXES
from epuck_sim.figures.labels import axis_label, group_labels
from epuck_sim.figures.saving import to_svg
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.runs.folder import database_of
from epuck_sim.runs.reader import PointTrials, Status, read_points, read_status
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.statistics.curves import has_series
from epuck_sim.statistics.statistic import summarize
from epuck_sim.util.messages import in_yaml
from epuck_sim.util.provenance import PROVENANCE

FORMS = ("curves", "map", "violins")  # forms in which T_sync and a measure of one value are drawn, where they fit
MOST_FAILURES = 100  # maximum number of failed trials that are listed
MOST_VALUES = 12  # maximum number of values of an axis that are listed


def write_report(folder: Path | str, path: Path | str) -> None:
    """Write one HTML page about a run folder, complete in itself: it needs no network, and can be sent to others.

    Args:
        folder: A run folder, finished or not; it stays as it is.
        path: The page, whose name ends in `.html`.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
        EpuckSimError: The page cannot be written.
    """
    write_html(path, lambda: make_page(folder))


def make_page(folder: Path | str) -> str:
    """Return the page of a run folder, also of an unfinished one; equal folders give equal pages."""
    status = read_status(Path(folder))
    return make_document(f"{status.scenario}: report", to_html(*_sections(folder, status)))


def _sections(folder: Path | str, status: Status) -> Iterator[Node]:
    points = read_points(folder)
    names = dict.fromkeys(section.name for point in points for section in point.scenario.measures)
    measures = {name: read_points(folder, name) for name in names}
    series = {name: found for name, found in measures.items() if any(map(has_series, found))}
    quantities = {"T_sync": points} if all(point.has_t_sync for point in points) else {}
    quantities |= {name: found for name, found in measures.items() if name not in series}
    yield element("h1", status.scenario)
    if description := points[0].scenario.description:
        yield element("p", description)
    links = [(f"of-{name}", name) for name in (*quantities, *series)]
    links += [("failed", "Failed trials")] * bool(status.failed) + [("again", "Run a trial again")]
    yield element("nav", *(element("a", text, href=f"#{target}") for target, text in links))
    yield element("h2", "What was run")
    yield facts(_facts(folder, status, points))
    if status.versions:
        headings = ("trials", *(name.replace("_", "-") for name in PROVENANCE))
        rows = [[str(row.trials), *row.made_by.values()] for row in status.versions]
        yield element("h3", "Versions and hosts")
        yield table(headings, rows, class_="left")
    for name, found in quantities.items():
        summaries = summarize(found)
        yield element("h2", summaries.label, id=f"of-{name}")
        yield summaries.table().to_html()
        for form in FORMS:
            yield from _draw(found, form, name)
    if not quantities:  # neither oscillators nor a measure of one value
        yield element("h2", "Points")
        cells = [{"point": point.number, "trials": len(point.times)} for point in points]
        yield Table("", [Row(point.axes, each) for point, each in zip(points, cells, strict=True)]).to_html()
    for name, found in series.items():
        yield element("h2", name, id=f"of-{name}")
        yield from _draw(found, "series", name)
    yield from _list_failures(shlex.quote(str(folder)), status)
    again = f"epuck-sim run {shlex.quote(str(folder))} --point K --trial J"
    yield element("h2", "Run a trial again", id="again")
    said = "K is the number of a point, J that of a trial, from 0 to one less than trials at a point."
    yield element("p", f"Trials repeat to the bit with the same versions. {said}")
    yield element("pre", "\n".join([again, f"{again} --record trial.rrd", "epuck-sim replay trial.rrd"]))
    yield element("h2", "Scenario")
    stored = Path(folder) / RUN_SCENARIO
    text = stored.read_text(encoding="utf-8", errors="replace") if stored.is_file() else ""
    yield details("The scenario with every default, as YAML", element("pre", text))


def _draw(points: Sequence[PointTrials], name: str, quantity: str) -> Iterator[Node]:
    """Yield a figure, of T_sync with predictions, and a caption below it; nothing if the form does not fit."""
    is_predicted = points[0].of is None and any(axis in points[0].axes for axis in PREDICTED_AXES)
    figure = points[0].scenario.figure.model_copy(update={"theory": is_predicted})
    first = points[0]._replace(scenario=points[0].scenario.model_copy(update={"figure": figure}))
    try:
        form = read_form([first, *points[1:]], {"form": name})
        drawn = form.draw_figure()
    except EpuckSimError:
        return
    identifier = "".join(letter if letter.isalnum() or letter in "_-" else "-" for letter in f"{name}-{quantity}")
    picture = to_svg(drawn, identifier)
    for key, value in (("id", identifier), ("role", "group"), ("aria-label", f"{quantity}: {name}")):
        picture.set(key, value)
    yield element("figure", picture, element("figcaption", form.caption.removeprefix(form.ran)))


def _facts(folder: Path | str, status: Status, points: Sequence[PointTrials]) -> Iterator[tuple[str, Node]]:
    yield "folder", str(folder)
    yield "model", points[0].scenario.model
    noun = "robots" if points[0].scenario.controllers else "agents"
    yield noun, _range(point.scenario.population for point in points)
    left = status.trials - status.stored - len(status.failed)
    trials = [f"{status.stored} of {status.trials} have a result"]
    trials += [f"{status.censored} censored"] * all(point.has_t_sync for point in points)
    trials += [f"{len(status.failed)} failed"] * bool(status.failed) + [f"{left} still to be run"] * bool(left)
    yield "trials", ", ".join(trials)
    yield "points", str(status.points)
    for key in points[0].axes:
        found = [point.axes[key] for point in points]
        values = list(dict.fromkeys(value if isinstance(value, str) else in_yaml(value) for value in found))
        more = [f"and {len(values) - MOST_VALUES} more"] * (len(values) > MOST_VALUES)
        label = axis_label(key, own=group_labels(points[0].scenario))
        yield key if label == key else f"{label}, {key}", ", ".join([*values[:MOST_VALUES], *more])
    yield "master seed", _range(point.scenario.seed for point in points)
    yield "computing time", in_words(status.wall_s)
    changed = datetime.fromtimestamp(database_of(folder).stat().st_mtime, UTC)
    yield "last result", f"{changed:%Y-%m-%d %H:%M} UTC"
    if status.at_work:
        yield "at work", status.at_work
    if left:
        yield "to go on", _code(f"run {shlex.quote(str(folder))}/")


def _range(numbers: Iterable[int]) -> str:
    found = sorted(set(numbers))
    return str(found[0]) if len(found) == 1 else f"{found[0]} to {found[-1]}"


def _list_failures(folder: str, status: Status) -> Iterator[Node]:
    if not status.failed:
        return
    touched = len({failure.point for failure in status.failed})
    yield element("h2", f"Failed trials: {len(status.failed)}", id="failed")
    yield element("p", f"At {touched} of {status.points} points; ", _code(f"run {folder}/"), " retries them.")
    rows: list[list[Node]] = [
        [element("code", f"--point {each.point} --trial {each.trial}"), str(each.seed), each.error]
        for each in status.failed[:MOST_FAILURES]
    ]
    yield table(("trial", "seed", "message"), rows, class_="left")
    if (more := len(status.failed) - MOST_FAILURES) > 0:
        yield element("p", f"There are {more} more, which ", _code(f"status {folder} --json"), " lists.")


def _code(command: str) -> Node:
    return element("code", f"epuck-sim {command}")
