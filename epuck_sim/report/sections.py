"""The parts of a page that are text and tables."""

import shlex
from collections import Counter
from collections.abc import Iterable, Iterator

from epuck_sim.display.html import Node, details, element, facts, table
from epuck_sim.display.numbers import in_words
from epuck_sim.display.table import Row, Table
from epuck_sim.figures.labels import axis_label
from epuck_sim.report.contents import Contents
from epuck_sim.util.provenance import PROVENANCE

MOST_FAILURES = 100
"""Maximum number of failed trials that are listed."""

MOST_VALUES = 12
"""Maximum number of values of an axis that are listed."""


def anchor(name: str) -> str:
    """Return the id of the section of T_sync or a measure."""
    return f"of-{name}"


def describe_run(contents: Contents) -> Iterator[Node]:
    """Yield what was run: scenario, links to the sections, how far it is, by what it was made."""
    status, first = contents.status, contents.points[0].scenario
    yield element("h1", status.scenario)
    if first.description:
        yield element("p", first.description)
    names = [*(quantity.name for quantity in contents.quantities), *(series.name for series in contents.series)]
    links = [(anchor(name), name) for name in names]
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
    trials += [f"{status.censored} censored"] * any(quantity.points[0].of is None for quantity in contents.quantities)
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
        yield "to go on", _code(f"run {_folder(contents)}/")


def _range(numbers: Iterable[int]) -> str:
    found = sorted(set(numbers))
    return str(found[0]) if len(found) == 1 else f"{found[0]} to {found[-1]}"


def count_trials(contents: Contents) -> Iterator[Node]:
    """Yield a table of how many trials of each point have a result."""
    rows = [Row(point.axes, {"point": point.number, "trials": len(point.times)}) for point in contents.points]
    yield Table("", rows).to_html()


def list_failures(contents: Contents) -> Iterator[Node]:
    """Yield the failed trials with their messages, if there are any."""
    failed = contents.status.failed
    if not failed:
        return
    folder, touched = _folder(contents), len(Counter(failure.point for failure in failed))
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


def list_commands(contents: Contents) -> Iterator[Node]:
    """Yield the commands that run trials again: the pattern, and that of each point."""
    folder = _folder(contents)
    yield element("h2", "Run a trial again", id="again")
    yield element(
        "p",
        "Trials repeat to the bit with the same versions. K is the number of a point, J that of a trial, from 0 to one "
        "less than trials at a point.",
    )
    lines = [
        f"epuck-sim run {folder} --point K --trial J",
        f"epuck-sim run {folder} --point K --trial J --record trial.rrd",
        "epuck-sim replay trial.rrd",
    ]
    yield element("pre", "\n".join(lines))


def show_scenario(contents: Contents) -> Iterator[Node]:
    """Yield the scenario as the folder keeps it."""
    yield element("h2", "Scenario")
    yield details("The scenario with every default, as YAML", element("pre", contents.scenario))


def _folder(contents: Contents) -> str:
    return shlex.quote(contents.folder)


def _code(command: str) -> Node:
    return element("code", f"epuck-sim {command}")
