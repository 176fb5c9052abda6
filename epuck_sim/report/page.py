"""The page of a run folder as HTML: its sections, one after the other."""

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import NamedTuple

from epuck_sim.display.html import Node, check_suffix, details, element, facts, in_words, make_document, table, to_html
from epuck_sim.display.table import Row, Table
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.labels import axis_label
from epuck_sim.figures.saving import to_svg
from epuck_sim.figures.sweep_figure import read_form
from epuck_sim.runs.folder import database_of
from epuck_sim.runs.reader import PointTrials, Status, read_points, read_status
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.statistics.series import has_series
from epuck_sim.statistics.statistic import summarize
from epuck_sim.util.atomic_write import atomic_write, check_target
from epuck_sim.util.provenance import PROVENANCE

FORMS = ("curves", "map", "violins")
"""Forms in which T_sync and a measure of one value are drawn, where they fit."""

MOST_FAILURES = 100  # maximum number of failed trials that are listed
MOST_VALUES = 12  # maximum number of values of an axis that are listed


class Contents(NamedTuple):
    """Everything on the page of a run folder."""

    folder: str  # the folder, as it was given
    scenario: str  # the scenario as the folder keeps it, YAML
    changed: datetime  # when a result was last stored, UTC
    status: Status
    points: list[PointTrials]
    quantities: Mapping[str, list[PointTrials]]  # T_sync, and measures of one value a trial, at all points
    series: Mapping[str, list[PointTrials]]  # measures with a value for each cycle


def read_contents(folder: Path | str) -> Contents:
    """Read a run folder, also an unfinished one; raise StoreError if it is none, or its database is damaged."""
    points = read_points(folder)
    names = dict.fromkeys(section.name for point in points for section in point.scenario.measures)
    measures = {name: read_points(folder, name) for name in names}
    series = {name: found for name, found in measures.items() if any(map(has_series, found))}
    quantities = {"T_sync": points} if all(point.has_t_sync for point in points) else {}
    quantities |= {name: found for name, found in measures.items() if name not in series}
    stored = Path(folder) / RUN_SCENARIO
    text = stored.read_text(encoding="utf-8", errors="replace") if stored.is_file() else ""
    changed = datetime.fromtimestamp(database_of(folder).stat().st_mtime, UTC)
    return Contents(str(folder), text, changed, read_status(Path(folder)), points, quantities, series)


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
    yield from _describe_run(contents)
    for name, points in contents.quantities.items():
        summaries = summarize(points)
        yield element("h2", summaries.label, id=_anchor(name))
        yield summaries.table().to_html()
        for form in FORMS:
            yield from _draw(points, form, name)
    if not contents.quantities:  # neither oscillators nor a measure of one value
        rows = [Row(point.axes, {"point": point.number, "trials": len(point.times)}) for point in contents.points]
        yield element("h2", "Points")
        yield Table("", rows).to_html()
    for name, points in contents.series.items():
        yield element("h2", name, id=_anchor(name))
        yield from _draw(points, "series", name)
    yield from _list_failures(contents)
    yield from _list_commands(contents)
    yield element("h2", "Scenario")
    yield details("The scenario with every default, as YAML", element("pre", contents.scenario))


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
    for key, value in (("id", identifier), ("role", "group"), ("aria-label", f"{quantity}: {name}")):
        picture.set(key, value)
    yield element("figure", picture, element("figcaption", form.caption.removeprefix(form.ran)))


def _anchor(name: str) -> str:
    """Return the id of the section of T_sync or a measure."""
    return f"of-{name}"


def _describe_run(contents: Contents) -> Iterator[Node]:
    """Yield what was run: scenario, links to the sections, how far it is, by what it was made."""
    status, first = contents.status, contents.points[0].scenario
    yield element("h1", status.scenario)
    if first.description:
        yield element("p", first.description)
    links = [(_anchor(name), name) for name in (*contents.quantities, *contents.series)]
    links += [("failed", "Failed trials")] * bool(status.failed) + [("again", "Run a trial again")]
    yield element("nav", *(element("a", text, href=f"#{target}") for target, text in links))
    yield element("h2", "What was run")
    yield facts(_facts(contents))
    if status.versions:
        headings = ("trials", *(name.replace("_", "-") for name in PROVENANCE))
        rows = [[str(row.trials), *row.made_by.values()] for row in status.versions]
        yield element("h3", "Versions and hosts")
        yield element("div", table(headings, rows, class_="left"), class_="scroll")


def _facts(contents: Contents) -> Iterator[tuple[str, Node]]:
    status, points = contents.status, contents.points
    yield "folder", contents.folder
    yield "model", points[0].scenario.model
    noun = "robots" if points[0].scenario.controllers else "agents"
    yield noun, _range(point.scenario.population for point in points)
    left = status.trials - status.stored - len(status.failed)
    trials = [f"{status.stored} of {status.trials} have a result"]
    trials += [f"{status.censored} censored"] * ("T_sync" in contents.quantities)
    trials += [f"{len(status.failed)} failed"] * bool(status.failed) + [f"{left} still to be run"] * bool(left)
    yield "trials", ", ".join(trials)
    yield "points", str(status.points)
    for key in points[0].axes:
        values = list(dict.fromkeys(str(point.axes[key]) for point in points))
        more = [f"and {len(values) - MOST_VALUES} more"] * (len(values) > MOST_VALUES)
        label = key if axis_label(key) == key else f"{axis_label(key)}, {key}"
        yield label, ", ".join([*values[:MOST_VALUES], *more])
    yield "master seed", _range(point.scenario.seed for point in points)
    yield "computing time", in_words(status.wall_s)
    yield "last result", f"{contents.changed:%Y-%m-%d %H:%M} UTC"
    if status.at_work:
        yield "at work", status.at_work
    if left:
        yield "to go on", _code(f"run {shlex.quote(contents.folder)}/")


def _range(numbers: Iterable[int]) -> str:
    found = sorted(set(numbers))
    return str(found[0]) if len(found) == 1 else f"{found[0]} to {found[-1]}"


def _list_failures(contents: Contents) -> Iterator[Node]:
    """Yield the failed trials with their messages, if there are any."""
    failed = contents.status.failed
    if not failed:
        return
    folder, touched = shlex.quote(contents.folder), len({failure.point for failure in failed})
    yield element("h2", f"Failed trials: {len(failed)}", id="failed")
    yield element("p", f"At {touched} of {len(contents.points)} points; ", _code(f"run {folder}/"), " retries them.")
    rows: list[list[Node]] = [
        [element("code", f"--point {each.point} --trial {each.trial}"), str(each.seed), each.error]
        for each in failed[:MOST_FAILURES]
    ]
    yield element("div", table(("trial", "seed", "message"), rows, class_="left"), class_="scroll")
    if len(failed) > MOST_FAILURES:
        more = f"There are {len(failed) - MOST_FAILURES} more, which "
        yield element("p", more, _code(f"status {folder} --json"), " lists.")


def _list_commands(contents: Contents) -> Iterator[Node]:
    """Yield the commands that run trials again."""
    again = f"epuck-sim run {shlex.quote(contents.folder)} --point K --trial J"
    yield element("h2", "Run a trial again", id="again")
    yield element(
        "p",
        "Trials repeat to the bit with the same versions. K is the number of a point, J that of a trial, from 0 to one "
        "less than trials at a point.",
    )
    yield element("pre", "\n".join([again, f"{again} --record trial.rrd", "epuck-sim replay trial.rrd"]))


def _code(command: str) -> Node:
    return element("code", f"epuck-sim {command}")
