"""The page of a replication in Markdown, its tables and figures.

The page has a table of verdicts, and explains those that are not plain. Tables as CSV have a row for each claim, test
or sweep; the figure of a claim has the curves that its tests use.
"""

import math
import shlex
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib import rc_context

from epuck_sim.display.html import in_words
from epuck_sim.display.table import Row, Share, Table
from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import plot
from epuck_sim.figures.labels import format_axis_values, format_value, key_name
from epuck_sim.figures.style import style
from epuck_sim.replication.claims import RISE, TESTS, Check, Claim, Claims
from epuck_sim.replication.sweeps import LOOKS, Trials, check_claim
from epuck_sim.replication.verdicts import Answer, Finding, Verdict, judge_claims, points_at, reduction
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import FigureSection, choose_axis
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.atomic_write import atomic_write
from epuck_sim.util.messages import counted

ALL, SOME = "replication", "chosen"
"""Stem of the page's name: of all claims, and of some, so that one does not overwrite the other."""

FIGURES = "figures"  # folder beside the page
DOTS_PER_INCH = 120  # enough for a screen: a page has a figure for each claim
MOST_POINTS = 200  # most points of a figure of several tests: with more, curves cannot be told apart
MIN_VALUES = 3  # fewest values of an axis that are drawn as a curve
MOST_TESTS = 4  # most tests of a claim that are written out
LEAST_P = 1e-4  # p-values below this are given as this one

RULES = (
    "A claim holds if all its tests do, and is contradicted if any is; else it is undecided. An identity cannot fail. "
    "A reading is decided by a limit or a wording of ours. The table shows the first test that decides, with its 95 % "
    "interval and, in brackets, the prediction; below it, all that do not hold. T_sync rises if the ratio of "
    f"means is above {RISE}. A test is decided if p is below 0.05 after Holm's correction for all tests of trials, of "
    "which there are "
)
"""How verdicts come about; the number of tests follows."""

EXPLAINED = (Verdict.CONTRADICTED, Verdict.UNDECIDED, Verdict.READING)


class Contents(NamedTuple):
    """Everything on the page."""

    folder: Path  # folder of the replication, as it was given
    answers: list[Answer]  # those of the chosen claims
    sweeps: Mapping[str, tuple[Sequence[PointTrials], float, int]]
    """The sweeps of these claims: points, computing time, s, and number of trials that failed."""
    claims: Claims  # the file of claims
    looks: int  # most looks at a sweep; 1 if no sweep has more trials than its scenario
    file: str | None = None  # the file of claims, if they are not the thesis's

    @property
    def has_all(self) -> bool:
        """Whether all claims were chosen."""
        return len(self.answers) == len(self.claims.claims)


def read_contents(
    claims: Claims,
    chosen: Sequence[Claim],
    scenarios: Mapping[str, Scenario],
    trials: Trials,
    folder: Path,
    file: str | None = None,
    looks: int = 1,
) -> Contents:
    """Test the chosen claims on the stored trials of their sweeps, whose scenarios are given by name.

    p-values are corrected for `looks` looks, or for `LOOKS` if trials were added. StoreError is raised if a run folder
    is missing or damaged.
    """
    findings = [(claim, check_claim(claim, trials)) for claim in chosen]
    sweeps = {name: (trials.read(name), *trials.effort(name)) for name in trials.folders}
    stored = {name: max(len(point.times) for point in points) for name, (points, *_) in sweeps.items()}
    looks = LOOKS if any(count > scenarios[name].trials for name, count in stored.items()) else looks
    return Contents(folder, judge_claims(findings, looks), sweeps, claims, looks, file)


def write_replication(contents: Contents, trials: Trials, folder: Path) -> Path:
    """Write a page about claims into a folder, with tables and figures beside it, and return its path."""
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    paths = {answer.claim.id: f"{FIGURES}/claim-{answer.claim.id}.png" for answer in contents.answers}
    drawn = [each.claim.id for each in contents.answers if draw_claim(each, trials, folder / paths[each.claim.id])]
    pictures = {name: paths[name] for name in drawn}
    stem, texts = ALL if contents.has_all else SOME, {}
    tables = make_tables(contents)
    links = {name: f"{stem}.csv" if name == "claims" else f"{stem}-{name}.csv" for name in tables}
    for name, table in tables.items():
        if table.rows:
            texts[links[name]] = table.to_csv()
        else:  # it may be left from claims that were chosen before
            (folder / links.pop(name)).unlink(missing_ok=True)
    texts[f"{stem}.md"] = "\n\n".join(make_page(contents, pictures, links)) + "\n"
    for name, text in texts.items():
        with atomic_write(folder / name) as part:
            part.write_text(text, encoding="utf-8")
    return folder / f"{stem}.md"


def escaped(text: str) -> str:
    """Return running text, or a cell, with the letters escaped that have a meaning in Markdown."""
    for letter in "*_<|":
        text = text.replace(letter, f"\\{letter}")
    return text


def make_page(contents: Contents, pictures: Mapping[str, str], tables: Mapping[str, str]) -> Iterator[str]:
    """Yield the parts of the page, between which there are empty lines.

    `pictures` are relative paths of figures by the ids of claims, `tables` those of tables by name.
    """
    answers, file = contents.answers, contents.file
    names = [] if contents.has_all else [answer.claim.id for answer in answers]
    asked = [] if file is None else ["--claims", file]
    command = shlex.join(["epuck-sim", "replicate", *names, *asked, "--out", str(contents.folder)])
    counts = Counter(answer.verdict for answer in answers)
    parts = [f"{verdict} {counts[verdict]}" for verdict in Verdict if counts[verdict]]
    links = ", ".join(f"[{name}]({path})" for name, path in tables.items())
    count = sum(each.check.test != "formula" for answer in answers for each in answer.checks)
    yield f"# Replication{' of the thesis' if file is None else ''}, claim by claim"
    yield f"{counted(len(answers), 'claim')}: {', '.join(parts)}. Written by `{command}`, with all numbers: {links}."
    looked = f"Each sweep was looked at up to {contents.looks} times, for which p is corrected, too."
    rules = [f"{RULES}{count}.", looked if contents.looks > 1 else "", contents.claims.pooled]
    yield escaped(" ".join(filter(None, rules)))
    said = "the thesis says" if file is None else "what is claimed"
    rows = [_verdict_row(answer, pictures) for answer in answers]
    yield "\n".join([f"claim | {said} | ours | verdict", "--- | --- | --- | ---", *rows])
    for verdict in EXPLAINED:
        if counts[verdict]:
            yield f"## {verdict.capitalize()}"
        for answer in answers:
            if answer.verdict == verdict:
                yield from _explain(answer, pictures)
    if contents.claims.notes:
        yield "## Slips in the text"
        yield "\n".join(escaped(f"- {note}") for note in contents.claims.notes)


def _verdict_row(answer: Answer, pictures: Mapping[str, str]) -> str:
    claim = answer.claim
    said = f'"{claim.quote}"' if claim.quote else claim.claim
    ours, is_explained = claim.identity or claim.no_claim or claim.not_asked, answer.verdict in EXPLAINED
    if is_explained or not ours:  # an identity may be contradicted
        first = _decisive(answer)[0]
        ours = f"{_effect(first.check)}: {_found(first)}"
    ours = escaped(ours)
    if claim.id in pictures and not is_explained:
        ours = f"[{ours}]({pictures[claim.id]})"
    name = f"[{claim.id}](#{claim.id.lower()})" if is_explained else claim.id
    source = f" ({claim.source})" if claim.source and "et al." not in said else ""
    return " | ".join([name, escaped(said + source), ours, answer.verdict])


def _decisive(answer: Answer) -> list[Finding]:
    """Return the tests that decide a claim: those contradicted, or else those undecided, or else those that hold."""
    order = (Verdict.CONTRADICTED, Verdict.UNDECIDED, Verdict.HOLDS)
    decides = min((judged.verdict for judged in answer.checks), key=order.index)
    return [judged for judged in answer.checks if judged.verdict == decides]


def _found(judged: Finding) -> str:
    low, high = judged.check.predicted
    between = f"{low:g} to {high:g}" if low is not None and high is not None else ""
    return f"{judged.effect.estimate} ({between or (f'<{high:g}' if low is None else f'>{low:g}')})"


def _why_no_p_value(judged: Finding) -> str:
    found = judged.effect.estimate
    if found.has_interval or judged.check.test == "formula":
        return ""
    if math.isnan(found.value):
        return "; it has no number: too few trials or points, values of 0 or below, or no such place on a curve"
    return "; it has no p-value: its trials are few, or have one value, and show no scatter"


def _explain(answer: Answer, pictures: Mapping[str, str]) -> Iterator[str]:
    """Yield a claim's heading, the tests that decide it (of the first, what the table lacks), and its texts."""
    claim = answer.claim
    yield f"### {claim.id}"
    first, *others = _decisive(answer)
    shown = others[: MOST_TESTS - 1]
    told = f"{describe_check(first.check)}{_why_no_p_value(first)}"
    lines = [f"- {told}"] if told != _effect(first.check) else []
    lines += [f"- {describe_check(each.check)}: {_found(each)}{_why_no_p_value(each)}" for each in shown]
    if left := len(others) - len(shown):
        lines.append(f"- and {left} more, which are in the table of tests")
    if lines:
        yield escaped("\n".join(lines))
    if claim.id in pictures:
        yield f"![{claim.id}]({pictures[claim.id]})"
    for heading, text in (("Why:", claim.identity), ("Ours:", claim.reading), ("Would change it:", claim.otherwise)):
        if text:
            yield escaped(f"{heading} {text}")


def make_tables(contents: Contents) -> dict[str, Table]:
    """Return the tables beside the page, with a row for each claim, each test, and each sweep that was used."""
    cells: dict[str, list[Mapping[str, object]]] = {"claims": [], "tests": [], "sweeps": []}
    for answer in contents.answers:
        cells["claims"].append({**answer.claim.model_dump(exclude={"checks"}), "verdict": answer.verdict})
        for judged in answer.checks:
            low, high = judged.check.predicted
            is_exact = judged.check.test == "formula"
            test = {
                "claim": answer.claim.id,
                "test": describe_check(judged.check),
                "ours": judged.effect.estimate,
                "predicted_above": low,
                "predicted_below": high,
                "p": None if is_exact else max(judged.p_value, LEAST_P),
                "p_corrected": None if is_exact else max(judged.p_holm, LEAST_P),
                "fewest_trials": judged.trials[0],
                "most_trials": judged.trials[1],
                "most_censored": Share(judged.censored),
                "verdict": judged.verdict,
            }
            cells["tests"].append(test)
    for name, (points, wall_s, failed) in contents.sweeps.items():
        stored, has_t_sync = sum(len(point.times) for point in points), any(point.has_t_sync for point in points)
        sweep = {
            "sweep": name,
            "points": len(points),
            "trials": stored + failed,
            "stored": stored,
            "censored": sum(int((~point.observed).sum()) for point in points) if has_t_sync else None,
            "failed": failed,
            "limit_of_cycles": points[0].scenario.stop.max_cycles,
            "time_of_trials": in_words(wall_s),
        }
        cells["sweeps"].append(sweep)
    return {name: Table(name, [Row({}, each) for each in rows]) for name, rows in cells.items()}


def describe_check(check: Check) -> str:
    """Return a test in words: the effect that it looks at, and where."""
    first, second = check.between
    shared = {key: value for key, value in second.items() if first.get(key) == value}
    where = format_axis_values({**check.where, **shared})
    return f"{_effect(check)} where {where}" if where else _effect(check)


def _effect(check: Check) -> str:
    test = TESTS[check.test]
    first, second = check.between
    names = {**dict(check), "number": check.number.replace("_", " "), "measure": check.of or "synchronised"}
    names |= {key: key_name(names[key]) for key in ("along", "over") if key in test.takes}
    names["what"] = " ".join(filter(None, [check.take, check.of or "T_sync"]))
    names["first"] = ", ".join(format_value(key, value) for key, value in first.items() if second.get(key) != value)
    names["second"] = format_axis_values({key: value for key, value in second.items() if first.get(key) != value})
    return test.text.format(**names)


def draw_claim(answer: Answer, trials: Trials, path: Path) -> bool:
    """Draw up to `MOST_POINTS` points of a claim's tests as PNG, if they have an axis; return whether they do.

    Tests that decide the claim come first.
    """
    checks = [each.check for each in sorted(answer.checks, key=lambda each: each not in _decisive(answer))]
    drawn = [check for check in checks if check.test != "formula" and reduction(check) is None]
    if answer.claim.sweep is None or not drawn:
        return False
    stored = trials.read(answer.claim.sweep, drawn[0])
    numbers: set[int] = set()
    for check in drawn:
        more = {point.number for point in points_at(check.where, stored)} if check.of == drawn[0].of else set()
        if not numbers or len(numbers | more) <= MOST_POINTS:
            numbers |= more
    # one panel, whatever the figure of the sweep has
    plain = {"figure": FigureSection(base_case=stored[0].scenario.figure.base_case)}
    kept = [point for point in stored if point.number in numbers]
    shown = [point._replace(scenario=point.scenario.model_copy(update=plain)) for point in kept]
    try:
        axis = choose_axis([point.axes for point in shown])
        if len({point.axes[axis] for point in shown}) < MIN_VALUES:
            return False
        figure = plot(shown, form="curves", x=axis)
    except EpuckSimError:  # no axis has numbers
        return False
    with rc_context(style()), atomic_write(path) as part:
        figure.savefig(part, format="png", dpi=DOTS_PER_INCH)
    return True
