"""What `epuck-sim plan` prints: how long a sweep takes, and how many trials show a difference."""

import json
from collections.abc import Sequence
from typing import NamedTuple

from epuck_sim.cli.status_tables import describe_at_limit
from epuck_sim.cli.tables import show
from epuck_sim.display.html import in_words
from epuck_sim.display.table import plain
from epuck_sim.estimate import Estimate
from epuck_sim.runs.status import PointAtLimit
from epuck_sim.statistics.planning import TrialPlan
from epuck_sim.util.messages import counted


class Duration(NamedTuple):
    """How long a sweep will take."""

    points: int
    trials: int
    """Trials at each point."""
    left: int
    """Number of trials that are still to be run."""
    workers: int
    compute_s: Estimate
    """Computing time of these trials together."""
    timed: int
    """Number of trials from which this follows."""
    is_cut: bool
    """Whether the last of these was cut: then it takes longer."""
    at_limit: Sequence[PointAtLimit] = ()
    """Points whose trials, of these, have all reached their limit."""


def print_plan(name: str, duration: Duration, as_json: bool) -> None:
    """Print how long a scenario's sweep will take, on stdout."""
    if as_json:
        print(json.dumps({"duration": plain(_duration_object(duration))}))
    else:
        _print_duration(name, duration)


def print_power(name: str, plan: TrialPlan, duration: Duration, as_json: bool) -> None:
    """Print how many trials show a difference, and how long the rest of a run folder's sweep will take, on stdout."""
    show([plan.table(name)], {**plan._asdict(), "duration": _duration_object(duration)}, as_json=as_json)
    if not as_json:
        _print_duration(name, duration)


def _print_duration(name: str, duration: Duration) -> None:
    total = f"{name}: {counted(duration.points, 'point')}, {counted(duration.trials, 'trial')} each"
    if not duration.left:
        print(f"{total}: all are stored.")
    elif not duration.timed:
        print(f"{total}: {duration.left} are left; none has been timed.")
    else:
        computing, source = describe_computing(duration)
        print(f"{total}: {duration.left} are left: {computing}.")
        print(f"{source}.")
    for line in describe_at_limit(duration.at_limit):
        print(line)


def describe_computing(duration: Duration) -> tuple[str, str]:
    """Return how long the trials that are left take, and from how many that follows."""
    wall = duration.compute_s.apply(lambda seconds: seconds / duration.workers)
    computing, with_workers = (_in_words(each, duration.is_cut) for each in (duration.compute_s, wall))
    cut = "; the last was cut, so that it is more" if duration.is_cut else ""
    follows = f"That follows from {counted(duration.timed, 'trial')}{cut}"
    return f"{computing} of computing, {with_workers} with {counted(duration.workers, 'worker')}", follows


def _in_words(estimate: Estimate, is_cut: bool) -> str:
    value, low, high = map(in_words, estimate.ends)
    return f"{'more than ' * is_cut}{value}" + f" ({low} to {high})" * estimate.has_interval


def _duration_object(duration: Duration) -> dict[str, object]:
    at_limit = [each._asdict() for each in duration.at_limit]
    return {**duration._asdict(), "at_limit": at_limit, "wall_s": duration.compute_s.value / duration.workers}
