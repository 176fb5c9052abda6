"""What people see of how far a sweep is."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from epuck_sim.display.numbers import in_words
from epuck_sim.runs.share import Share
from epuck_sim.runs.status import Failure, Status
from epuck_sim.util.messages import counted
from epuck_sim.util.provenance import format_versions

MOST_FAILURES = 10
"""Maximum number of failed trials that are listed."""

MOST_MISSING = 10
"""Maximum number of shares without a folder that are listed."""


def print_status(status: Status, as_json: bool) -> None:
    """Print how far a sweep is on stdout."""
    if as_json:
        print(json.dumps(_as_dict(status)))
        return
    share = "" if status.share is None else f"share {status.share}, "
    print(
        f"{status.scenario}: {share}{counted(status.points, 'point')}, "
        f"{status.stored} of {status.trials} trials have a result"
    )
    censored = "" if status.censored is None else f"censored: {status.censored}; "
    print(f"  {censored}failed: {len(status.failed)}; computing time: {in_words(status.wall_s)}")
    if status.unmeasured:
        print(f"  {status.unmeasured} of these results lack measures that were added")
    for row in status.versions:
        print(f"  {counted(row.trials, 'trial')}: {format_versions(row.made_by)}")
    if status.at_work:
        print(f"  {status.at_work} is at work on it")
    print_failures(status.failed)


def print_failures(failures: Sequence[Failure]) -> None:
    """Print the first failed trials on stdout, each with the words that run it alone."""
    for failure in failures[:MOST_FAILURES]:
        print(f"  failed: --point {failure.point} --trial {failure.trial}: {failure.error}")
    if len(failures) > MOST_FAILURES:
        print(f"  and {len(failures) - MOST_FAILURES} more")


def _as_dict(status: Status) -> dict[str, Any]:
    rows = {name: [row._asdict() for row in getattr(status, name)] for name in ("failed", "versions")}
    return {**status._asdict(), **rows}


def print_statuses(statuses: Mapping[str, Status], as_json: bool) -> None:
    """Print how far several run folders are on stdout, a line each, and their sum."""
    if as_json:
        print(json.dumps([{"folder": folder, **_as_dict(status)} for folder, status in statuses.items()]))
        return
    for folder, status in statuses.items():
        share = "" if status.share is None else f" (share {status.share})"
        failed = f"; failed: {len(status.failed)}" if status.failed else ""
        at_work = f"; {status.at_work} is at work" if status.at_work else ""
        print(f"{folder}{share}: {status.stored} of {status.trials}{failed}{at_work}")
    stored, trials = (sum(getattr(status, name) for status in statuses.values()) for name in ("stored", "trials"))
    failures = sum(len(status.failed) for status in statuses.values())
    print(f"together: {stored} of {trials} trials have a result; failed: {failures}")
    if missing := _missing_shares(statuses.values()):
        more = f" and {len(missing) - MOST_MISSING} more" if len(missing) > MOST_MISSING else ""
        print(f"shares without a folder here: {', '.join(missing[:MOST_MISSING])}{more}")


def _missing_shares(statuses: Iterable[Status]) -> list[str]:
    """Return the shares that none of the folders is for, if all are shares of the same number of them."""
    shares = {Share.parse(status.share) for status in statuses if status.share is not None}
    if len({share.of for share in shares}) != 1:
        return []
    (count,) = {share.of for share in shares}
    return [str(share) for share in (Share(number, count) for number in range(1, count + 1)) if share not in shares]
