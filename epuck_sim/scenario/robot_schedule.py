"""What changes while a trial of robots runs, and when: the section `schedule` of a scenario of robots."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Self

from pydantic import Field, model_validator

from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.base import Number, WholeNumber
from epuck_sim.scenario.controllers import resolve_parameters
from epuck_sim.scenario.faults import FaultSection
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.scenario.schedule import Displacement, ScheduleEntry
from epuck_sim.scenario.sensors import sensor_parameters
from epuck_sim.user_files import Value

PARAMETER = re.compile(r"robots\.(\d+)\.parameters\.(\w+)")
"""A key of a controller that a schedule may set."""

SENSOR = re.compile(r"robots\.(\d+)\.sensors\.(\w+)\.(\w+)")
"""A key of a sensor in a file of its own that a schedule may set."""

ARENA = re.compile(r"arena\.(width_cm|height_cm|obstacles)")
"""A key of the arena that a schedule may set."""


class RobotDisplacement(Displacement):
    """A displacement of phases of robots; rings of the displaced are commanded dark."""

    whose: ClassVar[str] = "robots"
    robots: tuple[Annotated[WholeNumber, Field(ge=0)], ...] | None = None
    """Numbers of the robots; all by default."""


class RobotScheduleEntry(ScheduleEntry):
    """Changes at one moment of a trial of robots; `set` has parameters of controllers, and keys of the arena."""

    changing: ClassVar[tuple[str, ...]] = ("set", "displace", "begin", "end", "remove", "add")
    later_keys: ClassVar[tuple[str, ...]] = ("remove", "add", "poses")

    displace: RobotDisplacement | None = None
    """A displacement of phases."""
    begin: tuple[Annotated[WholeNumber, Field(ge=0)], ...] = ()
    """Numbers of the faults that begin."""
    end: tuple[Annotated[WholeNumber, Field(ge=0)], ...] = ()
    """Numbers of the faults that end."""
    remove: tuple[Annotated[WholeNumber, Field(ge=0)], ...] = ()
    """Numbers of the robots that leave the arena."""
    add: tuple[Annotated[WholeNumber, Field(ge=0)], ...] = ()
    """Numbers of the robots that come into the arena, with controllers that start."""
    poses: tuple[tuple[Number, Number, Number], ...] | None = None
    """With `add`, `x_cm, y_cm, heading_rad` of each robot; by default they come to random free places."""

    @model_validator(mode="after")
    def _check_added(self) -> Self:
        if self.poses is not None and len(self.poses) != len(self.add):
            raise ValueError(
                f"poses has {len(self.poses)} poses; allowed: one for each robot that is added, of which "
                f"there are {len(self.add)}"
            )
        if len(set(self.add)) < len(self.add):
            raise ValueError(f"add is {list(self.add)}; allowed: each robot once")
        return self

    @staticmethod
    def check_key(key: str) -> None:
        """Raise ValueError for a key that cannot change during a trial."""
        if ARENA.fullmatch(key) or SENSOR.fullmatch(key):
            return
        if PARAMETER.fullmatch(key) is None:
            raise ValueError(
                f"set: {key} cannot change during a trial; allowed: robots.NUMBER.parameters.NAME, "
                "robots.NUMBER.sensors.SENSOR.NAME, arena.width_cm, "
                "arena.height_cm and arena.obstacles; besides, displace phases, begin and end faults, "
                "and remove and add robots"
            )
        if key.endswith(".period_s"):
            raise ValueError(f"set: {key} cannot change during a trial: cycles and order parameter are told by it")

    def in_words(self) -> list[str]:
        """Return each of the changes in words."""
        begin = [f"faults.{number} begins" for number in self.begin]
        ended = [f"faults.{number} ends" for number in self.end]
        moved = [
            f"{verb} {', '.join(map(str, robots))}"
            for verb, robots in (("removes", self.remove), ("adds", self.add))
            if robots
        ]
        return [*super().in_words(), *begin, *ended, *moved]

    def parameters(self) -> dict[int, dict[str, Any]]:
        """Return the new values of parameters by name, for each group by its number."""
        values: dict[int, dict[str, Any]] = {}
        for key, value in self.set.items():
            if found := PARAMETER.fullmatch(key):
                values.setdefault(int(found[1]), {})[found[2]] = value
        return values

    def sensor_parameters(self) -> dict[tuple[int, str], dict[str, Any]]:
        """Return the new values of parameters by name, for each sensor by its group's number and its name."""
        values: dict[tuple[int, str], dict[str, Any]] = {}
        for key, value in self.set.items():
            if found := SENSOR.fullmatch(key):
                values.setdefault((int(found[1]), found[2]), {})[found[3]] = value
        return values

    def arena_values(self) -> dict[str, Any]:
        """Return the new values of the arena's keys, by their names in the section."""
        found = {key: ARENA.fullmatch(key) for key in self.set}
        return {match[1]: self.set[key] for key, match in found.items() if match}


def check_schedule(
    schedule: Sequence[RobotScheduleEntry],
    groups: Sequence[RobotGroup],
    faults: Sequence[FaultSection],
    reference: int,
) -> None:
    """Raise ValueError if a schedule names groups, robots or faults that there are not, or removes the reference."""
    robot_count = sum(group.count for group in groups)
    for number, entry in enumerate(schedule):
        origin = f"schedule.{number}"
        for group in (*entry.parameters(), *(group for group, _ in entry.sensor_parameters())):
            if group >= len(groups):
                raise ValueError(f"{origin}.set: robots.{group} is no group; allowed: robots.0 to {len(groups) - 1}")
        named = {"displace.robots": (entry.displace and entry.displace.robots) or (), "remove": entry.remove}
        for key, robots in {**named, "add": entry.add}.items():
            for robot in robots:
                if robot >= robot_count:
                    raise ValueError(f"{origin}.{key}: is {robot}; allowed: 0 to {robot_count - 1}")
        if reference in entry.remove:
            raise ValueError(
                f"{origin}.remove: {reference} is the reference, whose firings are counted, and stays; remove others, "
                "or give another stop.reference_robot"
            )
        for key in ("begin", "end"):
            for fault in getattr(entry, key):
                if fault >= len(faults) or not faults[fault].scheduled:
                    raise ValueError(f"{origin}.{key}: {fault} is no number of a fault with scheduled: true")
                if key == "end" and faults[fault].kind == "restart":
                    raise ValueError(f"{origin}.end: {fault} is a restart, which takes no time")


def check_scheduled_controllers(
    schedule: Sequence[RobotScheduleEntry],
    groups: Sequence[RobotGroup],
    swept: Sequence[str],
    step_ms: int,
    origin: str,
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
        for (place, name), values in entry.sensor_parameters().items():
            sensor_parameters(groups[place].sensors, name, values, f"{where}.set: robots.{place}.sensors")
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
