"""Which axes of a sweep a figure is drawn over, and which of them distinguish its curves."""

from collections.abc import Mapping, Sequence
from typing import Any

from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.scenario import FigureSection
from epuck_sim.util.messages import comma_list, did_you_mean

SPEED = ".speed_cm_s"
"""Ending of the keys of speeds, against which T_sync is drawn by default."""

Rows = Sequence[Mapping[str, Any]]
"""Axis values of each point of a sweep, by dotted key."""


def choose_axis(rows: Rows, requested: str | None = None, origin: str = "--x") -> str:
    """Choose the axis to draw against: the requested one, or a speed, or the one with the most distinct numbers.

    A speed with a single value is chosen only where every axis has a single value.

    Args:
        rows: Axis values of each point of a sweep.
        requested: Dotted key, or None.
        origin: Option or key that requests it, for messages.

    Raises:
        EpuckSimError: The requested axis, or every axis, is without numbers.
    """
    numbers = _numeric_axes(rows)
    if requested is not None:
        return _check_axis(requested, numbers, origin)
    if not numbers:
        raise EpuckSimError("there is no axis with numbers to draw T_sync against")
    return max(numbers, key=lambda key: (len(numbers[key]) > 1, key.endswith(SPEED), len(numbers[key])))


def choose_second_axis(rows: Rows, x: str, requested: str | None = None, origin: str = "--y") -> str:
    """Choose the vertical axis of a map: the requested one, or the only other one whose numbers differ.

    Args:
        rows: Axis values of each point of a sweep.
        x: Dotted key of the horizontal axis.
        requested: Dotted key of the vertical axis, or None.
        origin: Option or key that requests it, for messages.

    Raises:
        EpuckSimError: There is no such axis, there are several to choose from, or it is tied one-to-one to `x`.
    """
    numbers = _numeric_axes(rows)
    others: list[str] = []
    for key, values in numbers.items():
        if len(values) > 1 and not any(is_tied_to(key, axis, rows) for axis in (x, *others)):
            others.append(key)
    choice = f"give --y one of {comma_list(others)}" if others else "there is no other axis whose numbers differ"
    if requested is not None:
        if _check_axis(requested, numbers, origin) == x or is_tied_to(requested, x, rows):
            raise EpuckSimError(f"{origin}: {requested} varies together with {x}, the horizontal axis; {choice}")
        return requested
    if len(others) != 1:
        raise EpuckSimError(f"a map needs a second axis, beside {x}: {choice}")
    return others[0]


def check_panels(rows: Rows, x: str, panels: str | None, origin: str = "--panels") -> None:
    """Raise EpuckSimError if `panels` is not an axis beside `x`; `origin` is what messages call it."""
    others = other_axes(rows, x)
    if panels is not None and panels not in others:
        raise EpuckSimError(f"{origin}: {did_you_mean(panels, others)}; other axes: {comma_list(others)}")


def check_figure_axes(figure: FigureSection, rows: Rows) -> None:
    """Check that what a scenario's section `figure` names are axes of its sweep.

    Raises:
        EpuckSimError: A key is no axis, has no numbers, or is tied to that of another direction.
    """
    if figure.x is None and figure.y is None and figure.panels is None and not figure.base_case:
        return
    x = choose_axis(rows, figure.x, "figure.x")
    if figure.y is not None:
        choose_second_axis(rows, x, figure.y, "figure.y")
    check_panels(rows, x, figure.panels, "figure.panels")
    others = other_axes(rows, x)
    for key in figure.base_case:
        if key not in others:
            raise EpuckSimError(f"figure.base_case: {did_you_mean(key, others)}; other axes: {comma_list(others)}")


def other_axes(rows: Rows, *axes: str) -> list[str]:
    """Return the axes that are neither among `axes` nor tied one-to-one to one of them."""
    return [key for key in rows[0] if not any(key == axis or is_tied_to(key, axis, rows) for axis in axes)]


def _check_axis(requested: str, numbers: Mapping[str, object], origin: str) -> str:
    if requested not in numbers:
        raise EpuckSimError(f"{origin}: {did_you_mean(requested, numbers)}; axes with numbers: {comma_list(numbers)}")
    return requested


def _numeric_axes(rows: Rows) -> dict[str, set[float]]:
    """Return the distinct values of each axis all of whose values are numbers."""
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    return {key: set(values) for key, values in columns.items() if _are_numbers(values)}


def _are_numbers(values: Sequence[Any]) -> bool:
    return all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)


def is_tied_to(key: str, axis: str, rows: Rows) -> bool:
    """Return whether the values of `axis` and `key` correspond one-to-one, as in a zip."""
    pairs = {(row[axis], repr(row[key])) for row in rows}
    return len(pairs) == len({x for x, _ in pairs}) == len({value for _, value in pairs}) > 1


def distinguishing_axes(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Keep only the axis values that distinguish each row, and drop axes that are tied one-to-one to another.

    >>> distinguishing_axes([{"width": 4, "height": 4, "tau": 5}, {"width": 6, "height": 6, "tau": 5}])
    [{'width': 4}, {'width': 6}]
    """
    kept: list[str] = []
    patterns: set[tuple[int, ...]] = set()
    for key in rows[0]:
        values = [repr(row[key]) for row in rows]
        pattern = tuple(values.index(value) for value in values)
        if len(set(pattern)) > 1 and pattern not in patterns:
            kept.append(key)
            patterns.add(pattern)
    return [{key: row[key] for key in kept} for row in rows]
