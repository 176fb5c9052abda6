"""Estimates how long a sweep will take, and prints it for `plan`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from epuck_sim.cli.options import read_scenario
from epuck_sim.cli.tables import describe_at_limit, folded, show
from epuck_sim.display.html import in_words
from epuck_sim.estimate import Estimate
from epuck_sim.runs.compatibility import WHOLE, Share
from epuck_sim.runs.reader import PointAtLimit, read_status, read_wall_times
from epuck_sim.scenario.loader import RUN_SCENARIO, Point
from epuck_sim.statistics.planning import TrialPlan
from epuck_sim.statistics.statistic import Measured, estimate_mean
from epuck_sim.sweep.demand import time_trials
from epuck_sim.util.messages import counted


class Duration(NamedTuple):
    """How long a sweep will take."""

    points: int
    trials: int  # trials at each point
    left: int  # number of trials that are still to be run
    workers: int
    compute_s: Estimate  # computing time of these trials together
    timed: int  # number of timed trials, from which this follows
    is_cut: bool  # whether the last timed trial was cut: then the sweep takes longer
    at_limit: Sequence[PointAtLimit] = ()  # points whose timed trials have all reached their limit
    share: str | None = None  # share of the sweep that the run folder is for, such as 3/40; None if it is for all of it


def duration_of_folder(folder: Path, trials: int | None, workers: int, *, trusted: bool) -> Duration:
    """Return how long the rest of a run folder's sweep, or of `trials` trials at each point, will take."""
    stored, status = read_wall_times(folder), read_status(folder)
    share = Share.parse(status.share) if status.share else WHOLE
    wanted = trials or read_scenario(folder / RUN_SCENARIO, trusted=trusted).trials
    times = [time for of_point in stored.values() for time in of_point]
    left = {number: max(0, len(share.trials(number, wanted)) - len(of_point)) for number, of_point in stored.items()}
    compute_s = sum(left[number] * np.mean(of_point or times or [0.0]) for number, of_point in stored.items())
    seconds, count = Estimate(float(compute_s)), sum(left.values())
    return Duration(len(stored), wanted, count, workers, seconds, len(times), False, status.at_limit, status.share)


def duration_of_scenario(points: Sequence[Point], wanted: int, budget_s: float, workers: int) -> Duration:
    """Return how long `wanted` trials at each point will take, from some that are run now, for `budget_s` at most."""
    timed, count = time_trials(points, budget_s), wanted * len(points)
    times = np.array([each.wall_s for each in timed])
    estimate = estimate_mean(Measured(times, np.ones(len(times), bool), math.inf, 0))
    compute = estimate.apply(lambda seconds: count * seconds)
    is_cut = any(each.is_cut for each in timed)
    ends = {number: [each.is_censored for each in timed if each.point == number] for number in range(len(points))}
    at_limit = [PointAtLimit(number, points[number].axes, len(of)) for number, of in ends.items() if of and all(of)]
    return Duration(len(points), wanted, count, workers, compute, len(times), is_cut, at_limit)


def print_plan(name: str, duration: Duration, plan: TrialPlan | None, *, as_json: bool) -> None:
    """Print on stdout how long a sweep will take, and for a run folder how many trials show a difference."""
    at_once = max(1, min(duration.workers, duration.left))
    wall_s = duration.compute_s.apply(lambda seconds: seconds / at_once)
    if as_json:
        found = {"duration": {**duration._asdict(), "wall_s": wall_s.value}}
        show([], {**plan._asdict(), **found} if plan else found, as_json=True)
        return
    if plan:
        show([plan.table(name)], None, as_json=False)
    total = f"{name}: {counted(duration.points, 'point')}, {counted(duration.trials, 'trial')} each"
    of_share = f" of share {duration.share}" if duration.share else ""
    left = f"{duration.left}{of_share} {'is' if duration.left == 1 else 'are'} left"
    if not duration.left:
        lines = [f"{total}: all{of_share} are stored."]
    elif not duration.timed:
        lines = [f"{total}: {left}; none has been timed."]
    else:
        computing, with_workers = (_in_words(each, duration.is_cut) for each in (duration.compute_s, wall_s))
        workers = counted(duration.workers, "worker")
        cut = "; the last was cut short, so the sweep takes longer" if duration.is_cut else ""
        lines = [
            f"{total}: {left}: {computing} of computing, {with_workers} with {workers}.",
            f"Estimated from {counted(duration.timed, 'trial')}{cut}.",
        ]
    print("\n".join(map(folded, [*lines, *describe_at_limit(duration.at_limit)])))


def _in_words(estimate: Estimate, is_cut: bool) -> str:
    value, low, high = map(in_words, estimate.ends)
    interval = f" ({low} to {high})" if estimate.has_interval else ""
    return f"{'more than ' if is_cut else ''}{value}{interval}"
