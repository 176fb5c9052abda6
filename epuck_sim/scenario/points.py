"""The points of a sweep, and the seed of each trial at each of them.

A point is known by its axis values, not by its place: points and trials that are added leave the seeds of the others
as they were.
"""

from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import canonical_text
from epuck_sim.scenario.loader import load_scenario, map_controllers
from epuck_sim.scenario.overrides import set_value
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.messages import short_repr
from epuck_sim.util.seeds import point_seed


class Point(NamedTuple):
    """One combination of a sweep's axis values."""

    number: int
    """Its place in the sweep, from 0."""
    key: str
    """The axis values as text."""
    axes: dict[str, Any]
    """Value of each axis by dotted key; of a controller its file's name."""
    scenario: Scenario
    """The scenario with these values, and without a sweep."""

    def seed(self, trial: int) -> int:
        """Return the seed of trial number `trial`: of the master seed, the axis values and the trial alone."""
        return point_seed(self.scenario.seed, self.key, trial)


def points(scenario: Scenario) -> tuple[Point, ...]:
    """Return the points of a scenario's sweep, in order; a scenario without a sweep is one point without axes.

    Raises ScenarioError, which names the point, where its values make no valid scenario.

    >>> sweep = load_scenario("thesis", axes=["robots.0.count=2,3", "robots.0.parameters.speed_cm_s=1,5"])
    >>> [tuple(point.axes.values()) for point in points(sweep)]
    [(2, 1), (2, 5), (3, 1), (3, 5)]
    """
    if scenario.sweep is None:
        return (Point(0, canonical_text({}), {}, scenario),)
    base = scenario.model_copy(update={"sweep": None}).model_dump(mode="json")
    found = tuple(_point(number, row, base) for number, row in enumerate(scenario.sweep.rows()))
    first: dict[str, int] = {}
    for point in found:
        if point.key in first:
            numbers = f"{first[point.key]} and {point.number}"
            raise ScenarioError(f"{scenario.name}: sweep: points {numbers} are the same: {describe_axes(point.axes)}")
        first[point.key] = point.number
    return found


def _point(number: int, row: dict[str, Any], base: dict[str, Any]) -> Point:
    origin = f"{base['name']}: sweep: point {number} ({describe_axes(row)})"
    given = base
    for key in sorted(row, key=lambda key: key.count(".")):  # a section as a whole before what lies in it
        given = set_value(given, key, row[key], origin)
    try:
        scenario = load_scenario(given)
    except ScenarioError as error:
        lines = (line.removeprefix("scenario: ") for line in str(error).splitlines())
        raise ScenarioError("\n".join(f"{origin}: {line}" for line in lines)) from error
    if scenario.sweep is not None:
        raise ScenarioError(f"{origin}: a point cannot hold a sweep")
    axes = {key: map_controllers(key, value, lambda name: Path(name).name) for key, value in row.items()}
    return Point(number, canonical_text(axes), axes, scenario)


def describe_axes(row: dict[str, Any]) -> str:
    """Return axis values as messages show them."""
    return ", ".join(f"{key} = {short_repr(value)}" for key, value in row.items())
