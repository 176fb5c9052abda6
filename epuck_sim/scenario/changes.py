"""What may fail in robots while a trial runs (thesis 4.4), and what changes: the sections `faults` and `schedule`."""

import re
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Generic, Literal, NamedTuple, Self, TypeVar, get_args

from pydantic import Field, model_validator

from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.robot_kind import sensor_parameters
from epuck_sim.scenario.robots import RobotGroup, members, resolve_parameters
from epuck_sim.scenario.stop import Awaited, Condition
from epuck_sim.util.messages import comma_list

_WHOM = ("robots", "share", "count")
_WHEN = ("at_s", "until_s", "per_hour", "mean_s")


class FaultSection(ConfigModel):
    """A fault: in which robots, from when to when."""

    changes: ClassVar[str]
    """The reading, the actuator or the clock that it changes: `flashes` are what brings these to a robot, its camera or
    its ideal sensor, and a `phase` is that of an oscillator."""

    kind: str
    robots: tuple[Annotated[WholeNumber, Field(ge=0)], ...] | None = None
    """Numbers of the robots that may have it; all by default."""
    share: Annotated[Number, Field(gt=0, le=1)] | None = None
    """Share of all robots that may have it, drawn at random in each trial, instead of `robots`."""
    count: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Number of robots that may have it, drawn at random in each trial, instead of `robots`."""
    at_s: Annotated[Number, Field(ge=0, le=1e9)] | None = None
    """Time at which it begins; with `per_hour`, from which it may. 0 by default."""
    until_s: Annotated[Number, Field(gt=0, le=1e9)] | None = None
    """Time at which it ends; with `per_hour`, it begins no more, too. Never by default."""
    per_hour: Annotated[Number, Field(gt=0, le=360_000)] | None = None
    """Mean number of times that it begins in an hour without it, in each robot at times of its own."""
    mean_s: Positive | None = None
    """With `per_hour`, mean time for which it lasts; until the end by default."""
    scheduled: bool = False
    """Whether it begins and ends as the section `schedule` says, instead of at a time or at a rate."""

    @model_validator(mode="after")
    def _check_whom_and_when(self) -> Self:
        whom = [key for key in _WHOM if getattr(self, key) is not None]
        if len(whom) > 1:
            raise ValueError(
                f"{whom[0]} and {whom[1]} are given; give one of {', '.join(_WHOM)}, or none for all robots"
            )
        if self.robots is not None and (not self.robots or len(set(self.robots)) < len(self.robots)):
            raise ValueError(f"robots is {list(self.robots)}; allowed: one number or more, each once")
        when = [key for key in _WHEN if getattr(self, key) is not None]
        if self.scheduled and when:
            raise ValueError(f"scheduled is true and {when[0]} is given; leave one of them out")
        if self.mean_s is not None and self.per_hour is None:
            raise ValueError("mean_s is given without per_hour; give until_s, or per_hour, too")
        if self.until_s is not None and self.until_s <= (self.at_s or 0):
            raise ValueError(f"until_s is {self.until_s:g}; allowed: above at_s, which is {self.at_s or 0:g}")
        return self

    def check_robots(self, robot_count: int) -> None:
        """Raise ValueError, with a message that begins with the key, unless a swarm has enough robots."""
        if self.robots is not None and max(self.robots) >= robot_count:
            raise ValueError(f"robots is {list(self.robots)}; allowed: 0 to {robot_count - 1}")
        if self.count is not None and self.count > robot_count:
            raise ValueError(f"count is {self.count}; allowed: 1 to {robot_count}")

    def may_befall(self, robots: range) -> bool:
        """Return whether any robot of these numbers may have it."""
        return self.robots is None or any(robot in robots for robot in self.robots)


class RingDead(FaultSection):
    """The ring stays dark."""

    changes: ClassVar[str] = "ring"
    kind: Literal["ring_dead"]


class RingStuckOn(FaultSection):
    """The ring stays lit."""

    changes: ClassVar[str] = "ring"
    kind: Literal["ring_stuck_on"]


class OscillatorFrozen(FaultSection):
    """The phase, and with it the ring, stay as they are; the robot moves on."""

    changes: ClassVar[str] = "phase"
    kind: Literal["oscillator_frozen"]


class ClockDrift(FaultSection):
    """The robot's clock runs fast or slow (thesis 4.4)."""

    changes: ClassVar[str] = "clock"
    kind: Literal["clock_drift"]
    rate: Annotated[Number, Field(ge=0.1, le=10)]
    """Factor of the clock's rate: 1.01 runs 1 % fast."""


class ClockJitter(FaultSection):
    """The robot's clock runs unevenly (thesis 4.4)."""

    changes: ClassVar[str] = "clock"
    kind: Literal["clock_jitter"]
    jitter: Annotated[Number, Field(gt=0, le=1)]
    """Half-width of the uniform factor around 1 by which each control step is longer by the robot's clock."""


class CameraBlind(FaultSection):
    """The camera sees no flash."""

    changes: ClassVar[str] = "flashes"
    kind: Literal["camera_blind"]


class CameraMisses(FaultSection):
    """The camera misses some flashes, each as a whole (thesis 4.4)."""

    changes: ClassVar[str] = "flashes"
    kind: Literal["camera_misses"]
    missed: Annotated[Number, Field(gt=0, le=1)]
    """Probability with which a flash is missed, drawn for each flash, sender and receiver."""
    nearer_than_cm: Positive | None = None
    """Only flashes of robots nearer than this, from centre to centre, are missed, or of those `farther_than_cm`."""
    farther_than_cm: Positive | None = None
    """Only flashes of robots farther than this are missed, or of those `nearer_than_cm`."""


class InfraredDead(FaultSection):
    """The proximity sensors read 0, as if nothing were in range."""

    changes: ClassVar[str] = "infrared"
    kind: Literal["infrared_dead"]


class WheelsDead(FaultSection):
    """The robot stands still, whatever it commands."""

    changes: ClassVar[str] = "wheels"
    kind: Literal["wheels_dead"]


class SensorDead(FaultSection):
    """A sensor in a file of its own reads 0."""

    changes: ClassVar[str] = "sensor"
    kind: Literal["sensor_dead"]
    sensor: str
    """Its name in `sensors`."""


class Restart(FaultSection):
    """The oscillator starts anew at a random phase, with a dark ring; it takes no time."""

    changes: ClassVar[str] = "phase"
    kind: Literal["restart"]

    @model_validator(mode="after")
    def _check_no_end(self) -> Self:
        if self.mean_s is not None or (self.until_s is not None and self.per_hour is None):
            raise ValueError("a restart takes no time; leave mean_s out, and until_s, too, unless per_hour is given")
        return self


AnyFault = Annotated[
    RingDead
    | RingStuckOn
    | OscillatorFrozen
    | ClockDrift
    | ClockJitter
    | CameraBlind
    | CameraMisses
    | InfraredDead
    | WheelsDead
    | Restart
    | SensorDead,
    Field(discriminator="kind"),
]

FAULTS: dict[str, type[FaultSection]] = {
    get_args(each.model_fields["kind"].annotation)[0]: each for each in get_args(get_args(AnyFault)[0])
}
"""Faults by their kind."""


def check_faults(faults: Sequence[FaultSection], groups: Sequence[RobotGroup]) -> None:
    """Raise ValueError unless robots can have these faults; `groups`: the scenario's groups of robots."""
    robot_count = sum(group.count for group in groups)
    for number, fault in enumerate(faults):
        try:
            fault.check_robots(robot_count)
        except ValueError as error:
            raise ValueError(f"faults.{number}.{error}") from error
        if isinstance(fault, SensorDead) and not any(fault.sensor in group.sensors for group in groups):
            own = comma_list(dict.fromkeys(name for group in groups for name in group.sensors))
            raise ValueError(
                f"faults.{number}.sensor is {fault.sensor!r}; allowed: a sensor in a file of its own: {own}"
            )
        for place, group, robots in members(groups):
            if fault.changes == "flashes" and group.signal.kind == "radio" and fault.may_befall(robots):
                raise ValueError(
                    f"faults.{number}: kind is {fault.kind!r}, but robots.{place} has no camera: its signal is radio; "
                    "give robots, the numbers of others, or robots.*.signal.loss"
                )


def check_oscillators(
    faults: Sequence[FaultSection], groups: Sequence[RobotGroup], swept: Sequence[str], origin: str
) -> None:
    """Raise ScenarioError if a fault of oscillators may befall robots that are none.

    Nothing is known yet of groups whose controller is `swept`, a key of an axis.
    """
    for number, fault in enumerate(faults):
        for place, group, robots in members(groups):
            known = f"robots.{place}.controller" not in swept
            if fault.changes == "phase" and fault.may_befall(robots) and known:
                controller = find_controller(group.controller)
                if not controller.is_oscillator:
                    raise ScenarioError(
                        f"{origin}: faults.{number}: kind is {fault.kind!r}, but robots.{place} are no oscillators: "
                        f"their controller is {controller.name}; give robots, the numbers of others"
                    )


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
        """Begin with the first of some moments and numbers of entries, in order; `never` is later than any moment."""
        self._moments = [*moments, (never, -1)]
        self.restart()

    def restart(self) -> None:
        """Begin with the first."""
        self._place = 0
        self.next = self._moments[0][0]

    def take(self) -> int:
        """Return the number of the next entry, and go on to the one after it."""
        number = self._moments[self._place][1]
        self._place += 1
        self.next = self._moments[self._place][0]
        return number


def condition_key(entry: int) -> str:
    """Return the dotted key of the condition of an entry."""
    return f"schedule.{entry}.when"


def conditions_in(schedule: Sequence[ScheduleEntry]) -> dict[str, Awaited]:
    """Return the conditions for which entries of a schedule wait, by their dotted keys."""
    return {
        condition_key(number): Awaited(entry.when, entry.for_cycles)
        for number, entry in enumerate(schedule)
        if entry.when is not None
    }


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
    """Raise ScenarioError if controllers do not take the parameters, or have the phases, that a schedule changes.

    Nothing is known yet of groups whose controller is `swept`; all others have all their parameters.
    """
    known = {place: group for place, group in enumerate(groups) if f"robots.{place}.controller" not in swept}
    for number, entry in enumerate(schedule):
        where = f"{origin}: schedule.{number}"
        for place, values in entry.parameters().items():
            if place in known:
                group = known[place]
                given = {**group.parameters, **values}
                resolve_parameters(find_controller(group.controller), given, step_ms, f"{where}.set: robots.{place}")
        for (place, name), values in entry.sensor_parameters().items():
            sensor_parameters(groups[place].sensors, name, values, f"{where}.set: robots.{place}.sensors")
        for place, group, robots in members(groups):
            concerned = entry.displace and (entry.displace.robots is None or set(entry.displace.robots) & set(robots))
            if concerned and place in known and not find_controller(group.controller).is_oscillator:
                raise ScenarioError(f"{where}.displace: robots.{place} are no oscillators; give robots of others")
