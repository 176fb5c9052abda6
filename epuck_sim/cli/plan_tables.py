"""What `epuck-sim plan` prints: how long a sweep takes, and how many trials show a difference."""

import json
import math
import sys
from typing import NamedTuple

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.sweep_size import counted
from epuck_sim.cli.tables import WIDE
from epuck_sim.display.numbers import in_digits, in_words
from epuck_sim.figures.labels import axis_labels, quantity_label
from epuck_sim.scenario.figure_axes import distinguishing_axes
from epuck_sim.statistics.estimate import MIN_TRIALS, Estimate
from epuck_sim.statistics.planning import TrialPlan
from epuck_sim.statistics.summary import finite_or_none


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


def print_plan(name: str, duration: Duration, as_json: bool) -> None:
    """Print how long a scenario's sweep will take, on stdout."""
    if as_json:
        print(json.dumps({"duration": _duration_object(duration)}))
    else:
        _print_duration(name, duration)


def print_power(name: str, plan: TrialPlan, duration: Duration, as_json: bool) -> None:
    """Print how many trials show a difference, and how long the rest of a run folder's sweep will take, on stdout."""
    if as_json:
        points = [
            {**point._asdict(), "mean": finite_or_none(point.mean), "spread": finite_or_none(point.spread)}
            for point in plan.points
        ]
        print(json.dumps({**plan._asdict(), "points": points, "duration": _duration_object(duration)}))
        return
    _print_points(name, plan)
    unit = "percentage points" if plan.is_of_shares else "%"
    wanted = f"a difference of {100 * plan.difference:g} {unit} in {100 * plan.power:g} % of all cases, with p < 0.05"
    if any(point.trials is not None for point in plan.points):
        print(f"Trials: those at a point, of each of two sweeps, that show {wanted}.")
    elif any(point.stored >= MIN_TRIALS for point in plan.points):
        print(f"No number of trials shows {wanted}: all stored ones have one value, or no share can differ by so much.")
    else:
        print(f"No point has the {MIN_TRIALS} trials that its spread takes; run again with --trials 20 or more.")
    if plan.over_all is not None:
        print(f"Over all points together, if all differ alike: {plan.over_all} at each.")
    _print_duration(name, duration)


def _print_points(name: str, plan: TrialPlan) -> None:
    table = Table(title=Text(f"{name}: {quantity_label(plan.of)}"), title_justify="left")
    shown = distinguishing_axes([point.axes for point in plan.points])
    for heading in ("point", *axis_labels(shown[0]), "stored", "statistic", "estimate", "spread / mean", "trials"):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for point, axes in zip(plan.points, shown, strict=True):
        table.add_row(
            str(point.point),
            *(Text(str(value)) for value in axes.values()),
            str(point.stored),
            point.statistic,
            "-" if math.isnan(point.mean) else in_digits(point.mean),
            "-" if math.isnan(point.spread) else f"{point.spread:.2f}",
            "-" if point.trials is None else str(point.trials),
        )
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)


def _print_duration(name: str, duration: Duration) -> None:
    total = f"{name}: {duration.points} points, {duration.trials} trials each"
    if not duration.left:
        print(f"{total}: all are stored.")
        return
    if not duration.timed:
        print(f"{total}: {duration.left} are left; none has been timed.")
        return
    computing, source = describe_computing(duration)
    print(f"{total}: {duration.left} are left: {computing}.")
    print(f"{source}.")


def describe_computing(duration: Duration) -> tuple[str, str]:
    """Return how long the trials that are left take, and from how many that follows."""
    compute, wall = (
        _in_words(Estimate(*(each / share for each in duration.compute_s)), duration.is_cut)
        for share in (1, duration.workers)
    )
    cut = "; the last was cut, so that it is more" if duration.is_cut else ""
    follows = f"That follows from {counted(duration.timed, 'trial')}{cut}"
    return f"{compute} of computing, {wall} with {counted(duration.workers, 'worker')}", follows


def _in_words(estimate: Estimate, is_cut: bool) -> str:
    value, low, high = estimate
    words = f"{'more than ' if is_cut else ''}{in_words(value)}"
    return f"{words} ({in_words(low)} to {in_words(high)})" if estimate.has_interval else words


def _duration_object(duration: Duration) -> dict[str, object]:
    compute = {end: finite_or_none(number) for end, number in duration.compute_s._asdict().items()}
    return {**duration._asdict(), "compute_s": compute, "wall_s": duration.compute_s.value / duration.workers}
