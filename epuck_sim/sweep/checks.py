"""Checks of a sweep's points before the first trial runs, and how large it is."""

from collections.abc import Iterable, Sequence

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.scenario.axes import check_figure_axes, check_labels
from epuck_sim.scenario.points import Point, describe_axes
from epuck_sim.trial import model
from epuck_sim.util.machine import NEGLIGIBLE_BYTES, available_bytes, in_bytes, lack_of_memory
from epuck_sim.util.messages import counted

TRIAL_BYTES = 145
"""Size of a trial in a run folder, without measures; as measured with 10,000 to 1,000,000 trials (docs/speed.md)."""


def check_sweep(points: Sequence[Point]) -> None:
    """Raise ScenarioError for a sweep that cannot be run, or cannot be drawn as its section `figure` says."""
    scenario = points[0].scenario
    try:
        check_figure_axes(scenario.figure, [point.axes for point in points])
        measures = (measure.name for measure in scenario.measures)
        check_labels(scenario.figure.labels, points[0].axes, measures, "figure.labels")
    except EpuckSimError as error:
        raise ScenarioError(f"{scenario.name}: {error}") from error
    for point in points:
        try:
            model.check_room(point.scenario)
        except ScenarioError as error:
            name = f"{point.scenario.name}: "
            where = f"sweep: point {point.number} ({describe_axes(point.axes)}): " if point.axes else ""
            raise ScenarioError(f"{name}{where}{str(error).removeprefix(name)}") from error


def check_memory(points: Iterable[Point], workers: int) -> None:
    """Raise ScenarioError for a sweep whose trials need more memory on this machine than there is."""
    largest = max(point.scenario.memory_bytes for point in points)
    if lack := lack_of_memory(workers * largest):
        raise ScenarioError(
            f"a trial on each of {workers} workers {lack}; "
            f"{in_bytes(largest)} each: give --workers {max(1, available_bytes() // largest)}, or smaller swarms"
        )


def describe_size(points: Sequence[Point]) -> str:
    """Return how many points and trials a sweep has, how much disk it takes, and how much memory if that is much."""
    count = sum(point.scenario.trials for point in points)
    measures = ", besides its measures" if points[0].scenario.measures else ""
    memory = max(point.scenario.memory_bytes for point in points)
    needed = f"; up to {in_bytes(memory)} of memory for a trial" if memory > NEGLIGIBLE_BYTES else ""
    words = f"{counted(len(points), 'point')}, {counted(count, 'trial')}"
    return f"{words}: about {in_bytes(TRIAL_BYTES * count)} on disk{measures}{needed}"
