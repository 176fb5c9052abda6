"""How the points of a sweep are arranged in figures: along one axis, in groups that share all others."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.labels import axis_label, distinguishing_labels, format_axis_values
from epuck_sim.figures.scales import is_logarithmic
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import canonical_text
from epuck_sim.scenario.figure_axes import choose_axis, choose_second_axis, distinguishing_axes, other_axes


class Group(NamedTuple):
    """Points that differ along the horizontal axis alone."""

    label: str
    """The values of the other axes; empty if there are none."""
    places: list[int]
    """Places of the points among all, in the order of the axis."""


class Arrangement(NamedTuple):
    """The points along an axis."""

    axis: str
    """Dotted key of the horizontal axis."""
    label: str
    """Its symbol and unit."""
    values: list[Any]
    """Value of every point, not only of those in groups: a number, or text."""
    names: list[str]
    """The same as text, with symbol and unit."""
    is_numeric: bool
    is_logarithmic: bool
    groups: list[Group]
    """The points that are shown."""


def arrange(points: Sequence[PointTrials], places: Sequence[int]) -> Arrangement | None:
    """Arrange some points for figures; None where no axis distinguishes the points of the sweep.

    The axis is the one that `plot` draws against; without an axis of numbers, it is the first that distinguishes.

    Args:
        points: All points of the sweep.
        places: Places of the points that are shown, at least one.
    """
    rows = [point.axes for point in points]
    axis = choose_horizontal(points)
    if axis is None:
        return None
    others = other_axes(rows, axis)
    found: dict[str, list[int]] = {}
    for place in places:
        found.setdefault(canonical_text({key: rows[place][key] for key in others}), []).append(place)
    values = [row[axis] for row in rows]
    is_numeric = all(isinstance(value, int | float) and not isinstance(value, bool) for value in values)
    names = [format_axis_values({axis: value}) for value in values]
    members = [sorted(group, key=lambda place: values[place]) if is_numeric else group for group in found.values()]
    labels = distinguishing_labels([{key: rows[group[0]][key] for key in others} for group in members])
    return Arrangement(
        axis,
        axis_label(axis),
        values if is_numeric else [name.partition(" = ")[2] for name in names],
        names,
        is_numeric,
        is_numeric and is_logarithmic(axis, np.array(values, float)),
        [Group(label, group) for label, group in zip(labels, members, strict=True)],
    )


def choose_horizontal(points: Sequence[PointTrials]) -> str | None:
    """Choose the horizontal axis of figures; None where no axis distinguishes the points."""
    rows = [point.axes for point in points]
    distinguishing = list(distinguishing_axes(rows)[0])
    if not distinguishing:
        return None
    try:
        chosen = choose_axis(rows, points[0].scenario.figure.x, "figure.x")
    except EpuckSimError:  # no axis has numbers
        return distinguishing[0]
    return chosen if _varies(rows, chosen) else distinguishing[0]


def choose_vertical(points: Sequence[PointTrials], horizontal: str) -> str | None:
    """Choose the vertical axis of a map, as `plot --form map` does; None where there is none, or several."""
    rows, figure = [point.axes for point in points], points[0].scenario.figure
    try:
        return choose_second_axis(rows, horizontal, None if figure.y == horizontal else figure.y, "figure.y")
    except EpuckSimError:
        return None


def point_labels(points: Sequence[PointTrials]) -> list[str]:
    """Return for each point the axis values that distinguish it, as text."""
    return [format_axis_values(row) for row in distinguishing_axes([point.axes for point in points])]


def _varies(rows: Sequence[Mapping[str, Any]], key: str) -> bool:
    return len({repr(row[key]) for row in rows}) > 1
