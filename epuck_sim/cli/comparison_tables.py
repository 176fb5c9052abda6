"""Table of `epuck-sim compare`: how T_sync, or a measure, differs at each point, and over all."""

import json
import math
import sys
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.cli.tables import WIDE
from epuck_sim.display.numbers import in_digits
from epuck_sim.figures.labels import axis_labels, quantity_label
from epuck_sim.scenario.figure_axes import distinguishing_axes
from epuck_sim.statistics.comparison import Comparison, PointComparison
from epuck_sim.statistics.estimate import MIN_TRIALS, Estimate
from epuck_sim.statistics.summary import finite_or_none

CENSORED = "censored A, B"

HEADINGS = ("trials A, B", CENSORED, "A", "B", "B - A", "B / A", "p", "p (Holm)")


def print_comparison(names: Sequence[str], comparison: Comparison, as_json: bool) -> None:
    """Print a comparison of A and B, which have these names, on stdout."""
    if as_json:
        print(json.dumps({"a": names[0], "b": names[1], **_as_object(comparison)}))
        return
    title = f"{quantity_label(comparison.of)} with 95 % intervals\nA: {names[0]}\nB: {names[1]}"
    table = Table(title=Text(title), title_justify="left")
    shown = distinguishing_axes([point.axes for point in comparison.points])
    for heading in (*axis_labels(shown[0]), *_headings(comparison)):
        table.add_column(Text(heading), justify="right", overflow="fold")
    for point, axes in zip(comparison.points, shown, strict=True):
        table.add_row(*(Text(str(value)) for value in axes.values()), *_cells(point, comparison))
    Console(width=None if sys.stdout.isatty() else WIDE).print(table)
    _print_conclusion(comparison)


def _print_conclusion(comparison: Comparison) -> None:
    statistics = dict.fromkeys(point.statistic for point in comparison.points)
    print(f"A and B: {' or '.join(statistics)}. p: {comparison.test}; Holm: corrected for the number of points.")
    if comparison.compared < len(comparison.points):
        count = len(comparison.points) - comparison.compared
        none = "with a value" if comparison.of else "that synchronised"
        print(f"-: {count} points have fewer than {MIN_TRIALS} trials on one side, or none {none}.")
    if comparison.left_out:
        print(f"{comparison.left_out} points have trials on one side only, and are left out.")
    if comparison.compared:
        parts = [f"B - A = {_format(comparison.difference)}"] * (comparison.of is not None)
        if comparison.averaged:
            ratio = _format(comparison.ratio, 3)
            parts.append(f"B / A = {ratio}, the geometric mean of {comparison.averaged} points")
        print(f"Over all: {'; '.join([*parts, f'p = {comparison.p_value:.4f}'])}")


def _headings(comparison: Comparison) -> list[str]:
    return [heading for heading in HEADINGS if comparison.of is None or heading != CENSORED]


def _cells(point: PointComparison, comparison: Comparison) -> list[str]:
    return [
        "{}, {}".format(*point.trials),
        *["{:.0%}, {:.0%}".format(*point.censored)] * (comparison.of is None),
        _format(point.first),
        _format(point.second),
        _format(point.difference),
        _format(point.ratio, 3),
        "-" if math.isnan(point.p_value) else f"{point.p_value:.4f}",
        "-" if math.isnan(point.p_holm) else f"{point.p_holm:.4f}",
    ]


def _format(estimate: Estimate, digits: int | None = None) -> str:
    """Return an estimate as cycles, or with a number of digits."""
    value, low, high = (in_digits(number) if digits is None else f"{number:.{digits}g}" for number in estimate)
    if math.isnan(estimate.value):
        return "-"
    return f"{value} ({low} to {high})" if estimate.has_interval else value


def _as_object(comparison: Comparison) -> dict[str, Any]:
    return {
        **_without_nan(comparison._asdict()),
        "points": [_without_nan(point._asdict()) for point in comparison.points],
    }


def _without_nan(fields: dict[str, Any]) -> dict[str, Any]:
    """Return fields as JSON can hold them."""
    found = dict(fields)
    for name, value in fields.items():
        if isinstance(value, Estimate):
            found[name] = {end: finite_or_none(number) for end, number in value._asdict().items()}
        elif isinstance(value, float):
            found[name] = finite_or_none(value)
    return found
