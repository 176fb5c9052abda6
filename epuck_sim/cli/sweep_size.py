"""How large a sweep is, in words."""

from collections.abc import Sequence

from epuck_sim.scenario.points import Point
from epuck_sim.util.memory import NEGLIGIBLE_BYTES, in_bytes

TRIAL_BYTES = 145
"""Size of a trial in a run folder, without measures; as measured with 10,000 to 1,000,000 trials (docs/speed.md)."""


def describe_size(points: Sequence[Point]) -> str:
    """Return how many points and trials a sweep has, how much disk it takes, and how much memory if that is much."""
    scenario = points[0].scenario
    count = sum(point.scenario.trials for point in points)
    measures = ", besides its measures" if scenario.measures else ""
    words = f"{counted(len(points), 'point')}, {counted(count, 'trial')}: about {in_bytes(TRIAL_BYTES * count)} on disk"
    memory = max(point.scenario.memory_bytes for point in points)
    needed = f"; up to {in_bytes(memory)} of memory for a trial" if memory > NEGLIGIBLE_BYTES else ""
    return f"{words}{measures}{needed}"


def counted(number: int, what: str) -> str:
    """Return a number of things, in the plural unless it is one."""
    return f"{number} {what}" + ("" if number == 1 else "s")
