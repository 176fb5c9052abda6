"""The page of a replication in Markdown: a table of verdicts, and what is to be known of those that are not plain."""

from collections import Counter
from collections.abc import Iterator, Mapping

from epuck_sim.replication.checks import RISE, Check
from epuck_sim.replication.contents import Contents, Cost
from epuck_sim.replication.tables import describe_check, time_range
from epuck_sim.replication.verdicts import Answer, Judged, Verdict

TITLE = "Replication of the thesis, claim by claim"

RULES = (
    "A claim holds if all its tests do, and is contradicted if any is; else it is undecided. An identity cannot fail. "
    "A reading is decided by a limit or a wording of ours. Shown is the first test that decides, with its 95 % "
    "interval and, in brackets, what was predicted; below are all that do not hold. T_sync rises if the ratio of "
    f"means is above {RISE}. A test is decided if p is below 0.05 after Holm's correction for all tests of trials, of "
    "which there are "
)
"""How verdicts come about; the number of tests follows."""

FULL_ONLY = "--full alone asks it"
"""Why the quick version does not ask a claim."""

EXPLAINED = (Verdict.CONTRADICTED, Verdict.UNDECIDED, Verdict.READING)
"""Verdicts that are explained, claim by claim."""


def escaped(text: str) -> str:
    """Return running text, or a cell, whose letters mean nothing in Markdown."""
    for letter in "*_<|":
        text = text.replace(letter, f"\\{letter}")
    return text


def make_page(contents: Contents, pictures: Mapping[str, str], tables: Mapping[str, str]) -> Iterator[str]:
    """Yield the parts of the page, between which there are empty lines.

    Args:
        contents: What it shows.
        pictures: Path of each claim's figure, relative to the page, by the claim's id.
        tables: The same of the tables, by what their rows are.
    """
    version = f"--{contents.version}"
    command = " ".join(["epuck-sim replicate", *contents.chosen, version, f"--out {contents.folder}"])
    counts = Counter(answer.verdict for answer in contents.answers)
    parts = [f"{verdict} {counts[verdict]}" for verdict in Verdict if counts[verdict]]
    links = ", ".join(f"[{name}]({path})" for name, path in tables.items())
    yield f"# {TITLE}"
    yield f"{len(contents.answers)} claims: {', '.join(parts)}. Written by `{command}`, with all numbers: {links}."
    yield escaped(f"{RULES}{contents.checks}. {contents.claims.pooled}".rstrip())
    rows = [_verdict_row(answer, pictures) for answer in contents.answers]
    yield "\n".join(["claim | the thesis says | ours | verdict", "--- | --- | --- | ---", *rows])
    for verdict in EXPLAINED:
        answers = [answer for answer in contents.answers if answer.verdict == verdict]
        if answers:
            yield f"## {verdict.capitalize()}"
        for answer in answers:
            yield from _explain(answer, pictures)
    if contents.claims.notes:
        yield "## Slips in the text"
        yield "\n".join(escaped(f"- {note}") for note in contents.claims.notes)
    costs = [each.full for each in contents.sweeps.values() if each.full]
    if costs:
        least, most = (sum(each) for each in zip(*costs, strict=True))
        yield f"The full version would take {time_range(Cost(least, most))} of one core."


def _verdict_row(answer: Answer, pictures: Mapping[str, str]) -> str:
    """Return a row of the table, with a link to what explains the verdict, or else to the figure."""
    claim = answer.claim
    said = f'"{claim.quote}"' if claim.quote else claim.claim
    ours = escaped(claim.untested or FULL_ONLY)
    decisive = _decisive(answer)
    if decisive and not claim.untested:
        ours = escaped(_in_short(decisive[0]))
    is_explained = answer.verdict in EXPLAINED
    if claim.id in pictures and not is_explained:
        ours = f"[{ours}]({pictures[claim.id]})"
    name = f"[{claim.id}](#{claim.id.lower()})" if is_explained else claim.id
    source = f" ({claim.source})" if claim.source and "et al." not in said else ""
    return " | ".join([name, escaped(said + source), ours, answer.verdict])


def _decisive(answer: Answer) -> list[Judged]:
    """Return the tests by which a claim has its verdict: those that do not hold, if there are any."""
    for verdict in (Verdict.CONTRADICTED, Verdict.UNDECIDED, Verdict.HOLDS):
        if found := [judged for judged in answer.checks if judged.verdict == verdict]:
            return found
    return []


def _in_short(judged: Judged) -> str:
    check = judged.tested.check
    what = check.number if check.test == "formula" else check.test
    return f"{what.replace('_', ' ')} {judged.tested.effect.estimate} ({_predicted(check)})"


def _predicted(check: Check) -> str:
    low, high = check.predicted
    if low is not None and high is not None:
        return f"{low:g} to {high:g}"
    return f"<{high:g}" if low is None else f">{low:g}"


def _explain(answer: Answer, pictures: Mapping[str, str]) -> Iterator[str]:
    """Yield a claim's heading, its tests that do not hold, of which the table has the first one's number, and texts."""
    claim = answer.claim
    yield f"### {claim.id}"
    first, *others = _decisive(answer)
    found = [f": {each.tested.effect.estimate} ({_predicted(each.tested.check)})" for each in others]
    tests = zip([first, *others], ["", *found], strict=True)
    yield "\n".join(escaped(f"- {describe_check(each.tested.check)}{number}") for each, number in tests)
    if claim.id in pictures:
        yield f"![{claim.id}]({pictures[claim.id]})"
    for heading, text in (("Ours:", claim.reading), ("Would change it:", claim.otherwise)):
        if text:
            yield escaped(f"{heading} {text}")
