"""Table of `epuck-sim fit --of`: the minimum and the peak of a measure along an axis."""

import json
import sys
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.tables import WIDE
from epuck_sim.display.numbers import in_digits
from epuck_sim.figures.labels import axis_label, distinguishing_labels
from epuck_sim.statistics.estimate import Estimate
from epuck_sim.statistics.measure_fit import MeasureFit
from epuck_sim.statistics.turning_points import TurningPoint


def print_measure_fit(fits: Sequence[MeasureFit], as_json: bool) -> None:
    """Print the minimum and the peak of a measure on each curve, on stdout."""
    if as_json:
        print(json.dumps([_as_object(fit) for fit in fits]))
        return
    of, axes = fits[0].of, " or ".join(dict.fromkeys(axis_label(fit.axis) for fit in fits))
    table = Table(title=Text(f"Minimum and peak of {of} against {axes}, with 95 % intervals"), title_justify="left")
    for heading in ("run", "curve", "minimum at", "minimum", "p", "peak at", "peak", "p"):
        table.add_column(Text(heading), overflow="fold")
    for run in dict.fromkeys(fit.run for fit in fits):
        group = [fit for fit in fits if fit.run == run]
        for fit, label in zip(group, distinguishing_labels([fit.axes for fit in group]), strict=True):
            cells = [cell for each in (fit.minimum, fit.peak) for cell in _cells(each, fit.reason)]
            table.add_row(Text(run), Text(label), *cells)
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)
    statistics = " or ".join(dict.fromkeys(fit.statistic for fit in fits))
    print(f"{of}: {statistics}. -: none between the ends of the axis that noise could not explain.")
    reasons = [fit.reason for fit in fits if fit.reason]
    for reason in dict.fromkeys(reasons):
        print(f"?: not looked for on {reasons.count(reason)} of {len(fits)} curves: {reason}.")


def _cells(point: TurningPoint | None, reason: str) -> list[str]:
    if point is None:
        return ["?" if reason else "-"] * 3
    numbers = [_format(point.place), _format(point.value)] if point.is_found else ["-", "-"]
    return [*numbers, f"{point.p_value:.3f}"]


def _format(estimate: Estimate) -> str:
    return "{} ({} to {})".format(*map(in_digits, estimate))


def _as_object(fit: MeasureFit) -> dict[str, Any]:
    return {**fit._asdict(), "minimum": _turning_point(fit.minimum), "peak": _turning_point(fit.peak)}


def _turning_point(point: TurningPoint | None) -> dict[str, Any] | None:
    if point is None:
        return None
    found = {name: getattr(point, name)._asdict() if point.is_found else None for name in ("place", "value")}
    return {**found, "p_value": point.p_value}
