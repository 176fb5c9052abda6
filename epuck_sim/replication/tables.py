"""What a replication found, as tables for programs: a row a claim, a row a test, and a row a sweep."""

from epuck_sim.display.numbers import in_words
from epuck_sim.display.table import Row, Share, Table
from epuck_sim.figures.labels import format_axis_values, key_name
from epuck_sim.replication.checks import Check, FormulaCheck, PairCheck, RatioCheck
from epuck_sim.replication.contents import Asked, Contents, Cost
from epuck_sim.replication.verdicts import Judged

LEAST_P = 1e-4
"""p-values below this are given as this one."""


def claim_table(contents: Contents) -> Table:
    """Return a row for each claim, with its texts by their keys in files of claims, and its verdict."""
    texts = ((answer.claim.model_dump(exclude={"checks"}), answer.verdict) for answer in contents.answers)
    return Table("claims", [Row({}, {**text, "verdict": verdict.value}) for text, verdict in texts])


def check_table(contents: Contents) -> Table:
    """Return a row for each test: what it looks at, what was predicted, and what it finds."""
    each = ((answer.claim.id, judged) for answer in contents.answers for judged in answer.checks)
    return Table("tests", [Row({}, {"claim": name, **_check_cells(judged)}) for name, judged in each])


def sweep_table(contents: Contents) -> Table:
    """Return a row for each sweep that was asked: its trials, the time they took, and that of its full version."""
    return Table("sweeps", [Row({}, _sweep_cells(name, each)) for name, each in contents.sweeps.items()])


def _check_cells(judged: Judged) -> dict[str, object]:
    tested = judged.tested
    low, high = tested.check.predicted
    is_exact = isinstance(tested.check, FormulaCheck)
    return {
        "test": describe_check(tested.check),
        "ours": tested.effect.estimate,
        "predicted_above": low,
        "predicted_below": high,
        "p": None if is_exact else max(judged.p_value, LEAST_P),
        "p_corrected": None if is_exact else max(judged.p_holm, LEAST_P),
        "fewest_trials": tested.trials[0],
        "most_trials": tested.trials[1],
        "most_censored": Share(tested.censored),
        "verdict": judged.verdict.value,
    }


def _sweep_cells(name: str, asked: Asked) -> dict[str, object]:
    status = asked.status
    return {
        "sweep": name,
        "points": status.points,
        "trials": status.trials,
        "stored": status.stored,
        "censored": status.censored,
        "failed": len(status.failed),
        "limit_of_cycles": asked.limit,
        "time_of_trials": in_words(status.wall_s),
        "time_of_full_version": time_range(asked.full) if asked.full else None,
    }


def time_range(cost: Cost) -> str:
    """Return how long a sweep takes, as a range if it depends on trials that are censored."""
    least, most = in_words(cost.least), in_words(cost.most)
    return least if least == most else f"{least} to {most}"


def describe_check(check: Check) -> str:
    """Return what a test looks at."""
    if isinstance(check, FormulaCheck):
        return check.number.replace("_", " ")
    what = " ".join(filter(None, [check.take, check.of or "T_sync"]))
    names = {key: getattr(check, key) for key in ("place", "law", "than", "censored_at") if hasattr(check, key)}
    names |= {key: key_name(getattr(check, key)) for key in ("along", "over") if hasattr(check, key)}
    names |= {"what": what, "measure": check.of or "synchronised"}
    if isinstance(check, RatioCheck | PairCheck):
        names["first"], names["second"] = (format_axis_values({**check.where, **place}) for place in check.between)
        return NAMES[check.test].format(**names)
    name = NAMES[check.test].format(**names)
    return f"{name} where {format_axis_values(check.where)}" if check.where else name


NAMES = {
    "ratio": "{what} where {second}, over that where {first}",
    "superiority": "chance that {what} is larger where {second} than where {first}",
    "share_difference": "share {measure} where {second}, minus that where {first}",
    "level": "{what}",
    "share": "share {measure}",
    "largest_rise": "largest rise of {what} with {along}",
    "power_exponent": "power of {along} in {what}",
    "exponential_rate": "c of exp(c {along}) in {what}",
    "rank_trend": "rank correlation of {what} with {along}",
    "likelier": "nats a trial by which {law} distributions make {what} likelier than {than} ones",
    "weibull_ratio": "Weibull mean of {what}, censored at {censored_at:g}, over the mean",
    "place_exponent": "power of {over} in {place}",
    "collapse": "distance of curves of T_sync over {measure}, relative to that over {along}",
}
"""What each test finds."""
