"""The points of a sweep, and the seed of each trial at each of them.

A point is identified by its axis values, not by its number: points and trials that are added leave the seeds of the
others as they were.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.display.table import shortest_endings
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import canonical_text, map_files
from epuck_sim.scenario.keys import set_value
from epuck_sim.scenario.loader import complete, from_keys, load_scenario
from epuck_sim.scenario.robots import share_parameters
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.messages import short_repr
from epuck_sim.util.seeds import point_seed


class Point(NamedTuple):
    """One combination of a sweep's axis values."""

    number: int
    """Index in the sweep."""
    key: str
    """The axis values as text."""
    axes: dict[str, Any]
    """Value of each axis by dotted key; for a user's file, such as a controller, its name."""
    scenario: Scenario
    """The scenario with these values, and without a sweep."""

    def seed(self, trial: int) -> int:
        """Return the seed of trial number `trial`, which follows from the master seed, the axis values and `trial`."""
        return point_seed(self.scenario.seed, self.key, trial)


def points(scenario: Scenario | str | Path | Mapping[str, Any]) -> tuple[Point, ...]:
    """Return the points of a scenario's sweep, in order; a scenario without a sweep is one point without axes.

    Args:
        scenario: A Scenario, or what `load_scenario` takes.

    Raises:
        ScenarioError: The values of a point make no valid scenario, or two points are the same.

    >>> sweep = load_scenario("thesis", axes=["robots.0.count=2,3", "robots.0.parameters.speed_cm_s=1,5"])
    >>> [tuple(point.axes.values()) for point in points(sweep)]
    [(2, 1), (2, 5), (3, 1), (3, 5)]
    """
    loaded = scenario if isinstance(scenario, Scenario) else load_scenario(scenario)
    if loaded.sweep is None:
        return (Point(0, canonical_text({}), {}, complete(loaded, loaded.name)),)
    base = loaded.model_copy(update={"sweep": None}).model_dump(mode="json")
    rows = loaded.sweep.rows()
    names = _short_names(rows)
    bases = share_parameters(base, rows)
    found = tuple(_point(number, row, bases[number], names) for number, row in enumerate(rows))
    first: dict[str, int] = {}
    for point in found:
        if point.key in first:
            numbers = f"{first[point.key]} and {point.number}"
            raise ScenarioError(f"{loaded.name}: sweep: points {numbers} are the same: {describe_axes(point.axes)}")
        first[point.key] = point.number
    return found


def _short_names(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return the name of each controller, response curve and picture in the rows.

    That of a file has the folders which tell it from others. It does not depend on the folders that all files share,
    so that a sweep can move to another machine.
    """
    names: dict[str, str] = {}
    for row in rows:
        for key, value in row.items():
            map_files(key, value, lambda _, name: names.setdefault(name, Path(name).as_posix()))
    endings = shortest_endings(names.values(), "/")
    return {name: endings[path] for name, path in names.items()}


def _point(number: int, row: dict[str, Any], base: dict[str, Any], names: dict[str, str]) -> Point:
    origin = f"{base['name']}: sweep: point {number} ({describe_axes(row)})"
    given = base
    for key in sorted(row, key=lambda key: key.count(".")):  # a whole section before a key inside it
        given = set_value(given, key, row[key], origin)
    scenario = from_keys(given, origin)
    if scenario.sweep is not None:
        raise ScenarioError(f"{origin}: a point cannot have a sweep")
    axes = {key: map_files(key, value, lambda _, name: names[name]) for key, value in row.items()}
    return Point(number, canonical_text(axes), axes, scenario)


def describe_axes(row: dict[str, Any]) -> str:
    """Return axis values as messages show them."""
    return ", ".join(f"{key} = {short_repr(value)}" for key, value in row.items())
