"""What changes while a trial runs, and when: the section `schedule` of scenarios of robots and of agents."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, Generic, Literal, NamedTuple, Self, TypeVar

from pydantic import Field, model_validator

from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber
from epuck_sim.scenario.controllers import resolve_parameters
from epuck_sim.scenario.faults import FaultSection
from epuck_sim.scenario.robots import RobotGroup, members
from epuck_sim.scenario.sensors import sensor_parameters
from epuck_sim.scenario.stop import Awaited, Condition
from epuck_sim.user_files import Value
from epuck_sim.util.messages import comma_list

_AT = ("at_s", "at_cycle", "when")

_Moment = TypeVar("_Moment")


class TrialEvent(NamedTuple):
    """Something that changed in a trial."""

    step: int
    """The first control step in which the change acts; of point agents, the first instant of firings."""
    time_s: float
    """Time of that step; of point agents, of the change."""
    source: str
    """Place in the scenario of which it came: `schedule.NUMBER`, or `faults.NUMBER`."""
    what: str
    """What changed, in words."""
    robots: tuple[int, ...] = ()
    """Numbers of the robots in which a fault began or ended; none for a schedule."""


class Displacement(ConfigModel):
    """A displacement of phases."""

    whose: ClassVar[str]
    """Key of the numbers of those whose phases are displaced."""

    by_cycles: Number | Literal["random"]
    """What is added to each phase, in cycles; or `random`, for phases drawn uniformly instead."""

    @property
    def members(self) -> tuple[int, ...] | None:
        """Numbers of the robots or agents whose phases are displaced; None for all."""
        members: tuple[int, ...] | None = getattr(self, self.whose)
        return members

    def __str__(self) -> str:
        """Return the displacement in words."""
        whose = "all phases" if self.members is None else f"phases of {', '.join(map(str, self.members))}"
        return f"{whose} {self.by_cycles if isinstance(self.by_cycles, str) else f'by {self.by_cycles:g} cycles'}"


class ScheduleEntry(ConfigModel):
    """Changes at one moment; they are made once."""

    changing: ClassVar[tuple[str, ...]] = ("set", "displace")
    """Keys of what changes."""

    at_s: Annotated[Number, Field(ge=0, le=1e9)] | None = None
    """Time of the first control step in which the changes act; of point agents, of the changes."""
    at_cycle: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Firing of the reference after which they act."""
    when: Condition | None = None
    """A condition on a measure, such as `order_parameter >= 0.95`."""
    for_cycles: Annotated[WholeNumber, Field(ge=1)] | None = None
    """With `when`, number of firings of the reference in a row at which it must hold; by default it is enough that it
    holds once, where the measure is told of a step, an event or a firing."""
    set: dict[str, Any] = Field(default_factory=dict)
    """New values by dotted key."""
    displace: Displacement | None = None
    """A displacement of phases."""

    @model_validator(mode="after")
    def _check_moment_and_changes(self) -> Self:
        if sum(getattr(self, key) is not None for key in _AT) != 1:
            raise ValueError(f"give one of {', '.join(_AT)}, the moment of the changes")
        if not any(getattr(self, key) for key in self.changing):
            raise ValueError(f"nothing changes; give one or more of {', '.join(self.changing)}")
        if self.for_cycles is not None and self.when is None:
            raise ValueError(f"for_cycles is {self.for_cycles}; allowed: with when")
        for key in self.set:
            self.check_key(key)
        return self

    @staticmethod
    def check_key(key: str) -> None:
        """Raise ValueError for a key that cannot change during a trial."""
        raise NotImplementedError

    @property
    def awaited(self) -> Awaited | None:
        """The condition for which the changes wait; None if they wait for none."""
        return None if self.when is None else Awaited(self.when, self.for_cycles)

    @property
    def what(self) -> str:
        """The changes in words, for lists of events."""
        return "; ".join(self.in_words())

    def in_words(self) -> list[str]:
        """Return each of the changes in words."""
        changes = [f"{key}: {value}" for key, value in self.set.items()]
        return changes if self.displace is None else [*changes, str(self.displace)]


class TimedEntries(Generic[_Moment]):
    """The entries of a schedule that have a time, in order, while a trial goes through them."""

    next: _Moment
    """When the next of them is carried out; `never` after the last."""

    def __init__(self, moments: Sequence[tuple[_Moment, int]], never: _Moment) -> None:
        """Begin with the first.

        Args:
            moments: When each entry is carried out, and its number, in order.
            never: Later than any moment of a trial.
        """
        self._moments, self._never = moments, never
        self.restart()

    def restart(self) -> None:
        """Begin with the first."""
        self._place = 0
        self._find_next()

    def take(self) -> int:
        """Return the number of the next entry, and go on to the one after it."""
        _, number = self._moments[self._place]
        self._place += 1
        self._find_next()
        return number

    def _find_next(self) -> None:
        self.next = self._moments[self._place][0] if self._place < len(self._moments) else self._never


def condition_key(entry: int) -> str:
    """Return the dotted key of the condition of an entry."""
    return f"schedule.{entry}.when"


def conditions_in(schedule: Sequence[ScheduleEntry]) -> dict[str, Awaited]:
    """Return the conditions for which entries of a schedule wait, by their dotted keys."""
    awaited = {condition_key(number): entry.awaited for number, entry in enumerate(schedule)}
    return {key: condition for key, condition in awaited.items() if condition is not None}


AGENT_KEYS = (
    "agents.speed_cm_s",
    "neighbourhood.k",
    "neighbourhood.radius_cm",
    "neighbourhood.angle_deg",
    "response.coupling",
    "response.refractory",
)
"""Keys that a schedule may set, besides parameters of the response curve."""

CURVE_PARAMETER = re.compile(r"response\.parameters\.\w+")
"""A key of a parameter of the response curve."""


class AgentDisplacement(Displacement):
    """A displacement of phases of agents."""

    whose: ClassVar[str] = "agents"
    agents: tuple[Annotated[WholeNumber, Field(ge=0)], ...] | None = None
    """Numbers of the agents; all by default."""


class AgentScheduleEntry(ScheduleEntry):
    """Changes at one moment of a trial of point agents."""

    displace: AgentDisplacement | None = None

    @staticmethod
    def check_key(key: str) -> None:
        """Raise ValueError for a key that cannot change during a trial."""
        if key not in AGENT_KEYS and CURVE_PARAMETER.fullmatch(key) is None:
            raise ValueError(
                f"set: {key} cannot change during a trial; allowed: "
                f"{comma_list([*AGENT_KEYS, 'response.parameters.NAME'])}; besides, displace phases"
            )


def check_agents(schedule: Sequence[AgentScheduleEntry], agents: int, *, speed_per_run: bool) -> None:
    """Raise ValueError if a schedule displaces phases of agents that there are not, or sets speeds that runs draw."""
    for number, entry in enumerate(schedule):
        if speed_per_run and "agents.speed_cm_s" in entry.set:
            raise ValueError(
                f"schedule.{number}.set: agents.speed_cm_s cannot change where agents.speed_per_run is true, "
                "as each run draws its speed; leave one of them out"
            )
        for agent in (entry.displace and entry.displace.agents) or ():
            if agent >= agents:
                raise ValueError(f"schedule.{number}.displace.agents: is {agent}; allowed: 0 to {agents - 1}")


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
        for place, group, robots in members(groups):
            concerned = entry.displace and (entry.displace.robots is None or set(entry.displace.robots) & set(robots))
            if concerned and place in known and not find_controller(group.controller).is_oscillator:
                raise ScenarioError(f"{where}.displace: robots.{place} are no oscillators; give robots of others")


def check_parameters(group: RobotGroup, values: Mapping[str, object], step_ms: int, origin: str) -> dict[str, Value]:
    """Return all parameters of a group with new values; raise ScenarioError if its controller does not take them."""
    return resolve_parameters(find_controller(group.controller), {**group.parameters, **values}, step_ms, origin)
