"""The page of a replication in Markdown: a table of verdicts, then each claim."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence

from epuck_sim.display.numbers import in_words
from epuck_sim.replication.checks import RISE, FormulaCheck
from epuck_sim.replication.contents import Asked, Contents, Cost
from epuck_sim.replication.sweeps import Version
from epuck_sim.replication.verdicts import Answer, Judged, Verdict
from epuck_sim.replication.wording import describe_check, describe_effect, describe_prediction, format_p

TITLE = "Replication of the thesis, claim by claim"

RULES = (
    "Each claim is a sentence of the thesis, with its section and its line in our copy of the text. It holds if all "
    "its tests do, and is contradicted if any is; otherwise it is undecided: the interval holds the threshold, or "
    "there are too few trials. An identity cannot fail. A reading is decided by a threshold or a wording that is "
    f"ours: both numbers are given. T_sync rises, in all claims, if the ratio of means is above {RISE}, and does not "
    "if it is below. Means are restricted to the limit of cycles where trials are censored. Intervals are of 95 %, "
    "each for itself. A p-value is that of data which decide as clearly, for either side, if the truth were at the "
    "threshold; a test is decided if it is below 0.05 after Holm's correction for all tests of trials on this page, "
    "of which there are "
)
"""How verdicts come about; the number of tests follows."""

QUICK = "This is the quick version: what it leaves undecided, more trials, or longer ones, may decide (--full). "

FULL_ONLY = "the full version alone asks it (--full): its trials take hours"
"""Why the quick version does not ask a claim."""


def escaped(text: str) -> str:
    """Return running text whose letters mean nothing in Markdown."""
    return text.replace("*", r"\*").replace("_", r"\_").replace("<", r"\<")


def table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of cells in Markdown, in which bars do not end them."""
    lines = [headings, ["---"] * len(headings), *rows]
    return "\n".join(f"| {' | '.join(cell.replace('|', BAR) for cell in line)} |" for line in lines)


BAR = r"\|"


def make_page(contents: Contents, pictures: Mapping[str, str]) -> Iterator[str]:
    """Yield the parts of the page, between which there are empty lines.

    Args:
        contents: What it shows.
        pictures: Path of each claim's figure, relative to the page, by the claim's id.
    """
    command = " ".join(["epuck-sim replicate", *contents.chosen, f"--{contents.version}", f"--out {contents.folder}"])
    yield f"# {TITLE}"
    yield (
        f"{_count_verdicts(contents)} This page is what this command wrote: `{command}`; followed by the ids of "
        "claims, it asks these alone."
    )
    yield escaped(f"{QUICK if contents.version == Version.QUICK else ''}{RULES}{contents.checks}.")
    if contents.claims.pooled:
        yield escaped(contents.claims.pooled)
    yield table(["", "the thesis says", "where", "ours", "verdict"], map(_verdict_row, contents.answers))
    for answer in contents.answers:
        yield from _show_claim(contents, answer, pictures)
    if contents.claims.notes:
        yield "## Contradictions, misprints and identities"
        for note in contents.claims.notes:
            yield escaped(f"- {note}")
    yield from _sweeps(contents)


def _count_verdicts(contents: Contents) -> str:
    counts = Counter(answer.verdict for answer in contents.answers)
    parts = [f"{verdict} {counts[verdict]}" for verdict in Verdict if counts[verdict]]
    return f"{len(contents.answers)} claims: {', '.join(parts)}."


def _verdict_row(answer: Answer) -> list[str]:
    claim = answer.claim
    said = f'"{claim.quote}"' if claim.quote else claim.claim
    where = claim.section + (f", line {claim.line}" if claim.line else "")
    found = "; ".join(describe_effect(each.tested.effect) for each in answer.checks)
    cells = [said, where, found or claim.untested or FULL_ONLY]
    return [f"[{claim.id}](#{claim.id.lower()})", *map(escaped, cells), answer.verdict.value]


def _show_claim(contents: Contents, answer: Answer, pictures: Mapping[str, str]) -> Iterator[str]:
    claim = answer.claim
    yield f"## {claim.id}"
    source = f" The sentence quotes {claim.source}." if claim.source else ""
    how_much = f" ({claim.quantifier})" if claim.quantifier else ""
    yield escaped(f"{claim.claim}{how_much}.{source} Verdict: {answer.verdict}.")
    if answer.checks:
        headings = ["test", "ours", "predicted", "p", "corrected", "trials a point", "censored at most", ""]
        yield table(headings, map(_check_row, answer.checks))
    if claim.id in pictures:
        yield f"![Claim {claim.id}: the curves that its tests look at]({pictures[claim.id]})"
    for heading, text in (
        ("Why", claim.untested or ("" if answer.checks else FULL_ONLY)),
        ("What is ours", claim.reading),
        ("What would change this", claim.otherwise),
        ("Changed after first results", claim.changed),
    ):
        if text:
            yield escaped(f"{heading}: {text}")
    sweep = contents.sweeps.get(claim.sweep or "")
    if sweep and sweep.full:
        yield f"The full version takes {_in_time(sweep.full)} of one core."


def _in_time(cost: Cost) -> str:
    """Return how long a sweep takes, as a range if it depends on trials that are censored."""
    least, most = in_words(cost.least), in_words(cost.most)
    return least if least == most else f"{least} to {most}"


def _check_row(judged: Judged) -> list[str]:
    tested = judged.tested
    check = tested.check
    head = [describe_check(check), describe_effect(tested.effect), describe_prediction(check)]
    fewest, most = tested.trials
    numbers = [
        format_p(judged.p_value),
        format_p(judged.p_holm),
        str(most) if fewest == most else f"{fewest} to {most}",
        f"{tested.censored:.0%}",
    ]
    cells = [*head, *([""] * len(numbers) if isinstance(check, FormulaCheck) else numbers)]
    return [*map(escaped, cells), judged.verdict.value]


def _sweeps(contents: Contents) -> Iterator[str]:
    if not contents.sweeps:
        return
    yield "## What was run"
    heads = (
        "sweep",
        "points",
        "trials",
        "censored",
        "failed",
        "limit of cycles",
        "time of trials",
        "of the full version",
    )
    yield table(heads, (_sweep_row(name, each) for name, each in contents.sweeps.items()))
    total = in_words(sum(each.status.wall_s for each in contents.sweeps.values()))
    yield f"The times of trials are sums over all workers: {total} in all."
    if costs := [each.full for each in contents.sweeps.values() if each.full]:
        least, most = (sum(each) for each in zip(*costs, strict=True))
        yield (
            f"The full version would take {_in_time(Cost(least, most))} of one core: the lower end if trials that are "
            "censored here end soon after, the upper one if they reach the limit of the full version."
        )


def _sweep_row(name: str, asked: Asked) -> list[str]:
    status = asked.status
    trials = f"{status.stored} of {status.trials}"
    censored = "-" if status.censored is None else str(status.censored)
    full = _in_time(asked.full) if asked.full else ""
    counts = (str(status.points), trials, censored, str(len(status.failed)), str(asked.limit))
    return [name, *counts, in_words(status.wall_s), full]
