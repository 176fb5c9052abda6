"""What a control step calls, in order: sensors, controllers, faults, and robots that come and go."""

from collections.abc import Sequence
from typing import Any, NamedTuple

from epuck_sim.embodied.changes import faults
from epuck_sim.embodied.changes.attendance import blank, rest
from epuck_sim.scenario.embodied import EmbodiedScenario


class Calls(NamedTuple):
    """Functions (block, addresses, number), and the number that each gets, in order."""

    early: list[tuple[Any, int]]
    """When bodies have moved: all sense, then all controllers run."""
    late: list[tuple[Any, int]]
    """When commands have been carried out."""
    hide: Any | None
    """What sensors call for a robot, at `swarm.HIDE`, if faults may keep robots from seeing flashes."""


def plan_calls(
    scenario: EmbodiedScenario, sensors: Sequence[Sequence[Any]], controllers: Sequence[Any], own: Sequence[Any] = ()
) -> Calls:
    """Return what a control step calls.

    Sensors are for each group the functions with which its robots sense, controllers what runs them; `own` are sensors
    in files of their own, of all groups.
    """
    groups = range(len(scenario.robots))

    def hooks(moment: int, *numbers: int) -> list[tuple[Any, int]]:
        return [(hook, number) for hook in faults.hooks_at(moment, scenario) for number in numbers]

    absent = scenario.members_change
    early = [
        *hooks(faults.BEGIN, 0),
        *hooks(faults.BEFORE_SENSING, *groups),
        *((sense, group) for group in groups for sense in sensors[group]),
        *((sensor, number) for number, sensor in enumerate(own)),
        *hooks(faults.AFTER_SENSING, *groups),
        *((blank, group) for group in groups if absent),
        *((controllers[group], group) for group in groups),
        *hooks(faults.AFTER_CONTROLLERS, *groups),
    ]
    late = [*hooks(faults.LATE, 0), *([(rest, 0)] if absent else [])]
    return Calls(early, late, next(iter(faults.hooks_at(faults.WHILE_SENSING, scenario)), None))
