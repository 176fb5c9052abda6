"""Checks of a sweep's points before the first trial runs."""

from collections.abc import Iterable

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.points import Point, describe_axes
from epuck_sim.trial import model


def check_room(points: Iterable[Point]) -> None:
    """Raise ScenarioError for a point whose population finds no room in its arena."""
    for point in points:
        try:
            model.check_room(point.scenario)
        except ScenarioError as error:
            name = f"{point.scenario.name}: "
            where = f"sweep: point {point.number} ({describe_axes(point.axes)}): " if point.axes else ""
            raise ScenarioError(f"{name}{where}{str(error).removeprefix(name)}") from error
