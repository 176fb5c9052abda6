"""What people see of how far a sweep is."""

import json
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from epuck_sim.display.html import in_words
from epuck_sim.runs.share import Share
from epuck_sim.runs.status import Failure, PointAtLimit, Status
from epuck_sim.scenario.points import describe_axes
from epuck_sim.util.messages import counted
from epuck_sim.util.provenance import format_versions

MOST_LISTED = 10
"""Maximum number of failed trials, of shares without a folder, and of points at their limit, that are listed."""


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
    for line in describe_at_limit(status.at_limit):
        print(f"  {line}")
    print_failures(status.failed)


def describe_at_limit(points: Sequence[PointAtLimit]) -> list[str]:
    """Return a line for each of the first points whose trials all reach their limit; the last ends with what to do."""
    lines = [
        f"{f'at {describe_axes(each.axes)}, ' if each.axes else ''}every trial so far ({each.trials}) reaches the limit"
        for each in points[:MOST_LISTED]
    ]
    if len(points) > MOST_LISTED:
        lines.append(f"so it is at {counted(len(points) - MOST_LISTED, 'further point')}")
    if lines:
        lines[-1] += "; go on, or take another limit in a new folder: --set stop.max_cycles=N"
    return lines


def print_failures(failures: Sequence[Failure]) -> None:
    """Print the first failed trials on stdout, each with the words that run it alone."""
    for failure in failures[:MOST_LISTED]:
        print(f"  failed: --point {failure.point} --trial {failure.trial}: {failure.error}")
    if len(failures) > MOST_LISTED:
        print(f"  and {len(failures) - MOST_LISTED} more")


def _as_dict(status: Status) -> dict[str, Any]:
    rows = {name: [row._asdict() for row in getattr(status, name)] for name in ("failed", "versions", "at_limit")}
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
        more = f" and {len(missing) - MOST_LISTED} more" if len(missing) > MOST_LISTED else ""
        print(f"shares without a folder here: {', '.join(missing[:MOST_LISTED])}{more}")


def _missing_shares(statuses: Iterable[Status]) -> list[str]:
    """Return the shares that none of the folders is for, if all are shares of the same number of them."""
    shares = {Share.parse(status.share) for status in statuses if status.share is not None}
    if len({share.of for share in shares}) != 1:
        return []
    (count,) = {share.of for share in shares}
    return [str(share) for share in (Share(number, count) for number in range(1, count + 1)) if share not in shares]
