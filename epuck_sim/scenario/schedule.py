"""What changes while a trial of robots runs, and when: the section `schedule` of a scenario."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, Literal, NamedTuple, Self

from pydantic import Field, model_validator

from epuck_sim.control.interface import Value
from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber
from epuck_sim.scenario.condition import Awaited, Condition
from epuck_sim.scenario.controllers import resolve_parameters
from epuck_sim.scenario.faults import FaultSection
from epuck_sim.scenario.robots import RobotGroup

PARAMETER = re.compile(r"robots\.(\d+)\.parameters\.(\w+)")
"""A key that a schedule may set."""

_AT = ("at_s", "at_cycle", "when")
_WHAT = ("set", "displace", "begin", "end")


class TrialEvent(NamedTuple):
    """Something that changed in a trial."""

    step: int
    """The first control step in which the change acts."""
    time_s: float
    """Time of that step."""
    source: str
    """Place in the scenario of which it came: `schedule.NUMBER`, or `faults.NUMBER`."""
    what: str
    """What changed, in words."""
    robots: tuple[int, ...] = ()
    """Numbers of the robots in which a fault began or ended; none for a schedule."""


class Displacement(ConfigModel):
    """A displacement of phases; rings of the displaced are commanded dark."""

    robots: tuple[Annotated[WholeNumber, Field(ge=0)], ...] | None = None
    """Numbers of the robots; all by default."""
    by_cycles: Number | Literal["random"]
    """What is added to each phase, in cycles; or `random`, for phases drawn uniformly instead."""

    def __str__(self) -> str:
        """Return the displacement in words."""
        whose = "all phases" if self.robots is None else f"phases of {', '.join(map(str, self.robots))}"
        return f"{whose} {self.by_cycles if isinstance(self.by_cycles, str) else f'by {self.by_cycles:g} cycles'}"


class ScheduleEntry(ConfigModel):
    """Changes at one moment; they are made once."""

    at_s: Annotated[Number, Field(ge=0, le=1e9)] | None = None
    """Time of the first control step in which the changes act."""
    at_cycle: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Firing of the reference after which they act."""
    when: Condition | None = None
    """A condition on a measure, such as `order_parameter >= 0.95`."""
    for_cycles: Annotated[WholeNumber, Field(ge=1)] | None = None
    """With `when`, number of firings of the reference in a row at which it must hold; by default it is enough that it
    holds once, where the measure is told of a step or a firing."""
    set: dict[str, Any] = Field(default_factory=dict)
    """New values by dotted key: parameters of controllers."""
    displace: Displacement | None = None
    begin: tuple[Annotated[WholeNumber, Field(ge=0)], ...] = ()
    """Numbers of the faults that begin."""
    end: tuple[Annotated[WholeNumber, Field(ge=0)], ...] = ()
    """Numbers of the faults that end."""

    @model_validator(mode="after")
    def _check_moment_and_changes(self) -> Self:
        if sum(getattr(self, key) is not None for key in _AT) != 1:
            raise ValueError(f"give one of {', '.join(_AT)}, the moment of the changes")
        if not any(getattr(self, key) for key in _WHAT):
            raise ValueError(f"nothing changes; give one or more of {', '.join(_WHAT)}")
        if self.for_cycles is not None and self.when is None:
            raise ValueError(f"for_cycles is {self.for_cycles}; allowed: with when")
        for key in self.set:
            if PARAMETER.fullmatch(key) is None:
                raise ValueError(
                    f"set: {key} cannot change during a trial; allowed: robots.NUMBER.parameters.NAME; besides, "
                    "displace phases, and begin and end faults"
                )
            if key.endswith(".period_s"):
                raise ValueError(f"set: {key} cannot change during a trial: cycles and order parameter are told by it")
        return self

    @property
    def awaited(self) -> Awaited | None:
        """The condition for which the changes wait; None if they wait for none."""
        return None if self.when is None else Awaited(self.when, self.for_cycles)

    @property
    def what(self) -> str:
        """The changes in words, for lists of events."""
        parts = [f"{key}: {value}" for key, value in self.set.items()]
        if self.displace is not None:
            parts.append(str(self.displace))
        parts += [f"faults.{number} begins" for number in self.begin]
        parts += [f"faults.{number} ends" for number in self.end]
        return "; ".join(parts)

    def parameters(self) -> dict[int, dict[str, Any]]:
        """Return the new values of parameters by name, for each group by its number."""
        values: dict[int, dict[str, Any]] = {}
        for key, value in self.set.items():
            found = PARAMETER.fullmatch(key)
            assert found is not None
            values.setdefault(int(found[1]), {})[found[2]] = value
        return values


def condition_key(entry: int) -> str:
    """Return the dotted key of the condition of an entry."""
    return f"schedule.{entry}.when"


def check_schedule(
    schedule: Sequence[ScheduleEntry], groups: Sequence[RobotGroup], faults: Sequence[FaultSection]
) -> None:
    """Raise ValueError if a schedule names groups, robots or faults that there are not."""
    robot_count = sum(group.count for group in groups)
    for number, entry in enumerate(schedule):
        origin = f"schedule.{number}"
        for group in entry.parameters():
            if group >= len(groups):
                raise ValueError(f"{origin}.set: robots.{group} is no group; allowed: robots.0 to {len(groups) - 1}")
        for robot in (entry.displace and entry.displace.robots) or ():
            if robot >= robot_count:
                raise ValueError(f"{origin}.displace.robots: is {robot}; allowed: 0 to {robot_count - 1}")
        for key in ("begin", "end"):
            for fault in getattr(entry, key):
                if fault >= len(faults) or not faults[fault].scheduled:
                    raise ValueError(f"{origin}.{key}: {fault} is no number of a fault with scheduled: true")
                if key == "end" and faults[fault].kind == "restart":
                    raise ValueError(f"{origin}.end: {fault} is a restart, which takes no time")


def check_scheduled_controllers(
    schedule: Sequence[ScheduleEntry], groups: Sequence[RobotGroup], swept: Sequence[str], step_ms: int, origin: str
) -> None:
    """Check that controllers take the parameters, and have the phases, that a schedule changes.

    Args:
        schedule: The schedule.
        groups: Groups of robots, with all their parameters; nothing is known of those whose controller is swept.
        swept: Keys of the axes.
        step_ms: Length of a control step.
        origin: Begins every error message.

    Raises:
        ScenarioError: A controller does not take a parameter, or is no oscillator.
    """
    known = {place: group for place, group in enumerate(groups) if f"robots.{place}.controller" not in swept}
    for number, entry in enumerate(schedule):
        where = f"{origin}: schedule.{number}"
        for place, values in entry.parameters().items():
            if place in known:
                check_parameters(known[place], values, step_ms, f"{where}.set: robots.{place}")
        first = 0
        for place, group in enumerate(groups):
            robots = range(first, first + group.count)
            concerned = entry.displace and (entry.displace.robots is None or set(entry.displace.robots) & set(robots))
            if concerned and place in known and not find_controller(group.controller).is_oscillator:
                raise ScenarioError(f"{where}.displace: robots.{place} are no oscillators; give robots of others")
            first += group.count


def check_parameters(group: RobotGroup, values: Mapping[str, object], step_ms: int, origin: str) -> dict[str, Value]:
    """Return all parameters of a group with new values; raise ScenarioError if its controller does not take them."""
    return resolve_parameters(find_controller(group.controller), {**group.parameters, **values}, step_ms, origin)
