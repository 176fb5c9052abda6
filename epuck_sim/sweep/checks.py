"""Checks of a sweep's points before the first trial runs."""

from collections.abc import Iterable

import numpy as np

from epuck_sim.embodied.placement import place_robots
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.points import Point, _told


def check_room(places: Iterable[Point]) -> None:
    """Raise ScenarioError for a point whose robots find no room in their arena."""
    for point in places:
        if not isinstance(point.scenario, EmbodiedScenario):
            continue  # points need no room
        try:
            place_robots(point.scenario, np.random.SeedSequence(point.scenario.seed))
        except ScenarioError as error:
            name = f"{point.scenario.name}: "
            where = f"sweep: point {point.number} ({_told(point.axes)}): " if point.axes else ""
            raise ScenarioError(f"{name}{where}{str(error).removeprefix(name)}") from error
