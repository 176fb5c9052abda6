"""The page of a replication in Markdown: a table of verdicts, then each claim."""

from collections import Counter
from collections.abc import Iterator, Mapping

from epuck_sim.display.numbers import in_words
from epuck_sim.replication.checks import FormulaCheck
from epuck_sim.replication.contents import Contents
from epuck_sim.replication.cost import Cost
from epuck_sim.replication.markdown import Cell, Code, Link, paragraph, table
from epuck_sim.replication.sweeps import Version
from epuck_sim.replication.verdicts import Answer, Judged, Verdict
from epuck_sim.replication.wording import describe_check, describe_effect, describe_prediction, format_p

TITLE = "Replication of the thesis, claim by claim"

RULES = (
    "Tests and thresholds are those of the file of claims. A claim holds if all its tests do, and is contradicted if "
    "any is; otherwise it is undecided: the interval holds the threshold, or there are too few trials. Means are "
    "restricted to the limit of cycles where trials are censored. Intervals are of 95 %, each for itself. A p-value is "
    "that of data which decide as clearly, for either side, if the truth were at the threshold; a test is decided if "
    "it is below 0.05 after Holm's correction for all tests of trials on this page, of which there are "
)
"""How verdicts come about; the number of tests follows."""

QUICK = "This is the quick version: what it leaves undecided, more trials, or longer ones, may decide (--full). "


def make_page(contents: Contents, pictures: Mapping[str, str]) -> Iterator[str]:
    """Yield the parts of the page, between which there are empty lines.

    Args:
        contents: What it shows.
        pictures: Path of each claim's figure, relative to the page, by the claim's id.
    """
    yield f"# {TITLE}"
    yield paragraph(
        _count_verdicts(contents),
        " This page is what this command wrote: ",
        _command(contents, *contents.chosen),
        "; followed by the ids of claims, it asks these alone.",
    )
    yield paragraph(QUICK if contents.version == Version.QUICK else "", RULES, f"{contents.checks}.")
    yield _verdict_table(contents)
    for answer in contents.answers:
        if answer.checks:
            yield from _show_claim(contents, answer, pictures)
    if contents.notes:
        yield "## Contradictions, misprints and identities"
        for note in contents.notes:
            yield paragraph(f"- {note}")
    yield from _sweeps(contents)


def _count_verdicts(contents: Contents) -> str:
    counts = Counter(answer.verdict for answer in contents.answers)
    parts = [f"{verdict} {counts[verdict]}" for verdict in Verdict if counts[verdict]]
    return f"{len(contents.answers)} claims: {', '.join(parts)}."


def _command(contents: Contents, *ids: str) -> Code:
    words = ["epuck-sim replicate", *ids, f"--{contents.version}", f"--out {contents.folder}"]
    return Code(" ".join(words))


def _verdict_table(contents: Contents) -> str:
    rows: list[list[Cell]] = []
    for answer in contents.answers:
        claim, is_asked = answer.claim, bool(answer.checks)
        rows.append(
            [
                Link(claim.id) if is_asked else claim.id,
                claim.claim,
                claim.section,
                claim.says,
                "; ".join(describe_effect(each.tested.effect) for each in answer.checks) or claim.not_asked,
                answer.verdict.value,
            ]
        )
    return table(["", "claim", "section", "it says", "ours", "verdict"], rows)


def _show_claim(contents: Contents, answer: Answer, pictures: Mapping[str, str]) -> Iterator[str]:
    claim = answer.claim
    yield f"## {claim.id}"
    yield paragraph(
        f"{claim.claim} (section {claim.section}; the thesis says: {claim.says}). Verdict: {answer.verdict}."
    )
    headings = ["test", "ours", "predicted", "p", "corrected", "trials a point", "censored at most", ""]
    yield table(headings, [_check_row(each) for each in answer.checks])
    if claim.id in pictures:
        yield f"![Claim {claim.id}: the curves that its tests look at]({pictures[claim.id]})"
    if claim.otherwise:
        yield paragraph(f"What would change this: {claim.otherwise}")
    if cost := contents.costs.get(claim.sweep or ""):
        yield paragraph(f"The full version takes {_in_time(cost)} of one core.")


def _in_time(cost: Cost) -> str:
    """Return how long a sweep takes, as a range if it depends on trials that are censored."""
    least, most = in_words(cost.least), in_words(cost.most)
    return least if least == most else f"{least} to {most}"


def _check_row(judged: Judged) -> list[Cell]:
    tested = judged.tested
    check = tested.check
    head = [describe_check(check), describe_effect(tested.effect), describe_prediction(check)]
    if isinstance(check, FormulaCheck):
        return [*head, "", "", "", "", judged.verdict.value]
    fewest, most = tested.trials
    return [
        *head,
        format_p(judged.p_value),
        format_p(judged.p_holm),
        str(most) if fewest == most else f"{fewest} to {most}",
        f"{tested.censored:.0%}",
        judged.verdict.value,
    ]


def _sweeps(contents: Contents) -> Iterator[str]:
    if not contents.sweeps:
        return
    yield "## What was run"
    rows: list[list[Cell]] = [
        [
            name,
            str(status.points),
            f"{status.stored} of {status.trials}",
            "-" if status.censored is None else str(status.censored),
            str(len(status.failed)),
            str(contents.limits[name]),
            in_words(status.wall_s),
            _in_time(contents.costs[name]) if name in contents.costs else "",
        ]
        for name, status in contents.sweeps.items()
    ]
    yield table(
        [
            "sweep",
            "points",
            "trials",
            "censored",
            "failed",
            "limit of cycles",
            "time of trials",
            "of the full version",
        ],
        rows,
    )
    total = in_words(sum(status.wall_s for status in contents.sweeps.values()))
    yield paragraph(f"The times of trials are sums over all workers: {total} in all.")
    if contents.costs:
        least, most = (sum(each) for each in zip(*contents.costs.values(), strict=True))
        yield paragraph(
            f"The full version would take {_in_time(Cost(least, most))} of one core: the lower end if trials that are "
            "censored here end soon after, the upper one if they reach the limit of the full version."
        )
