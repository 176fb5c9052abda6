"""Faults (thesis 4.4), and changes while a trial runs: the sections `faults` and `schedule`."""

import re
from collections import deque
from collections.abc import Callable, Sequence
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeVar

from pydantic import AfterValidator, Field

from epuck_sim.scenario.base import LARGEST, ConfigModel, Length, Number, Pose, Positive, WholeNumber, check_range
from epuck_sim.scenario.scenario import Condition

FAULTS = {
    "ring_dead": "ring",
    "ring_stuck_on": "ring",
    "oscillator_frozen": "phase",
    "clock_drift": "clock",
    "clock_jitter": "clock",
    "camera_blind": "flashes",
    "camera_misses": "flashes",
    "infrared_dead": "infrared",
    "wheels_dead": "wheels",
    "restart": "phase",
    "sensor_dead": "sensor",
}
"""The reading, actuator or clock that a fault changes, by its kind: `flashes` stands for a robot's camera or ideal
sensor, or the pulses that an agent receives, `phase` for the phase of its oscillator."""

NOT_OF_AGENTS = {
    "ring_stuck_on": "a pulse takes no time",
    "clock_jitter": "they have no control steps; give clocks.jitter",
    "infrared_dead": "they have no proximity sensors",
    "sensor_dead": "they have no sensors",
}
"""Kinds of faults that have no meaning for point agents, and why."""


def _each_once(numbers: tuple[int, ...]) -> tuple[int, ...]:
    if len(set(numbers)) < len(numbers):
        raise ValueError("each number once")
    return numbers


Members = Annotated[tuple[Annotated[WholeNumber, Field(ge=0)], ...], AfterValidator(_each_once)]
"""Numbers of robots or agents, or of faults."""

Whom = Annotated[Members, Field(min_length=1)] | None
"""Numbers of the robots or agents that are concerned; None for all."""


class FaultSection(ConfigModel):
    """A fault: in which robots or agents, from when to when."""

    later_keys: ClassVar[tuple[str, ...]] = ("agents",)

    kind: str
    robots: Whom = None
    """Numbers of the robots that may have it; all by default."""
    agents: Whom = None
    """Numbers of the agents that may have it, with `model: particles`."""
    share: Annotated[Number, Field(ge=0, le=1)] | None = None
    """Share of these that has it, drawn at random in each trial; 1 by default."""
    count: Annotated[WholeNumber, Field(ge=0)] | None = None
    """Number of these that have it, drawn at random in each trial, instead of `share`."""
    at_s: Annotated[Number, Field(ge=0, le=1e9)] | None = None
    """Time at which it begins; with `per_hour`, the earliest such time. 0 by default."""
    until_s: Annotated[Number, Field(gt=0, le=1e9)] | None = None
    """Time at which it ends; with `per_hour`, it does not begin again after that. Never by default."""
    per_hour: Annotated[Number, Field(gt=0, le=360_000)] | None = None
    """Mean number of times that it begins in an hour without it, in each at times of its own."""
    mean_s: Positive | None = None
    """With `per_hour`, mean time for which it lasts; until the end by default."""
    scheduled: bool = False
    """Whether it begins and ends as the section `schedule` says, instead of at a time or at a rate."""

    def _check_together(self) -> None:
        if self.share is not None and self.count is not None:
            raise ValueError("share and count are given; give one of them, or neither for all")
        when = [key for key in ("at_s", "until_s", "per_hour", "mean_s") if getattr(self, key) is not None]
        if self.scheduled and when:
            raise ValueError(f"scheduled is true and {when[0]} is given; leave one of them out")
        if self.mean_s is not None and self.per_hour is None:
            raise ValueError("mean_s is given without per_hour; give per_hour, too, or until_s instead")
        if self.until_s is not None and self.until_s <= (self.at_s or 0):
            raise ValueError(f"until_s is {self.until_s:g}; allowed: above at_s, which is {self.at_s or 0:g}")

    @property
    def changes(self) -> str:
        """The part of a robot or agent that it changes, see `FAULTS`."""
        return FAULTS[self.kind]

    @property
    def whom(self) -> Sequence[int] | None:
        """Numbers of the robots or agents that may have it; None for all."""
        return self.robots if self.agents is None else self.agents


class Failure(FaultSection):
    """A part of the robot, or agent, fails as a whole."""

    kind: Literal["ring_dead", "ring_stuck_on", "oscillator_frozen", "camera_blind", "infrared_dead", "wheels_dead"]
    """`ring_dead`: the ring stays dark, and an agent sends no pulse; `ring_stuck_on` (not of agents): it stays lit;
    `oscillator_frozen`: the phase, and with it the ring, stay as they are, and the robot moves on; `camera_blind`: the
    camera sees no flash, slow ones deliver empty pictures late, and an agent receives no pulse; `infrared_dead` (not of
    agents): the proximity sensors read 0, as if nothing were in range; `wheels_dead`: the robot stands still."""


class ClockDrift(FaultSection):
    """The clock of a robot or agent runs fast or slow (thesis 4.4)."""

    kind: Literal["clock_drift"]
    rate: Annotated[Number, Field(ge=0.1, le=10)]
    """Factor of the clock's rate: 1.01 runs 1 % fast."""


class ClockJitter(FaultSection):
    """The robot's clock runs unevenly (thesis 4.4)."""

    kind: Literal["clock_jitter"]
    jitter: Annotated[Number, Field(gt=0, le=1)]
    """Half-width of the uniform factor around 1 by which each control step is longer by the robot's clock."""


class CameraMisses(FaultSection):
    """The camera misses some flashes, each as a whole (thesis 4.4)."""

    kind: Literal["camera_misses"]
    missed: Annotated[Number, Field(gt=0, le=1)]
    """Probability with which a flash is missed, drawn for each flash, sender and receiver."""
    nearer_than_cm: Length | None = None
    """Only flashes from nearer than this, centre to centre, or farther than `farther_than_cm` if given, are missed."""
    farther_than_cm: Length | None = None
    """Only flashes from farther than this, or nearer than `nearer_than_cm` if given, are missed."""


class SensorDead(FaultSection):
    """A sensor in a file of its own reads 0."""

    kind: Literal["sensor_dead"]
    sensor: str
    """Its name in `sensors`."""


class Restart(FaultSection):
    """The oscillator starts anew at a random phase, with a dark ring; other memory stays, and it takes no time."""

    kind: Literal["restart"]

    def _check_together(self) -> None:
        super()._check_together()
        if self.mean_s is not None or (self.until_s is not None and self.per_hour is None):
            raise ValueError("a restart takes no time; leave out mean_s, and until_s unless per_hour is given")


AnyFault = Annotated[
    Failure | ClockDrift | ClockJitter | CameraMisses | Restart | SensorDead, Field(discriminator="kind")
]


def concerns(whom: Sequence[int] | None, robots: range) -> bool:
    """Return whether any of these robots is among those that `whom` names; None names all."""
    return any(robot in robots for robot in (robots if whom is None else whom))


class TrialEvent(NamedTuple):
    """Something that changed in a trial."""

    step: int  # the first control step in which the change acts; of point agents, the first instant of firings
    time_s: float  # time of that step; of point agents, of the change
    source: str  # its place in the scenario: `schedule.NUMBER`, or `faults.NUMBER`
    what: str  # what changed, in words
    robots: tuple[int, ...] = ()  # numbers of those in which a fault began or ended; none for a schedule


class Displacement(ConfigModel):
    """A displacement of phases."""

    by_cycles: Annotated[Number, Field(ge=-LARGEST, le=LARGEST)] | Literal["random"]
    """Displacement of each phase, in cycles; or `random`, for phases drawn uniformly instead."""

    @property
    def whom(self) -> Sequence[int] | None:
        """Numbers of the robots or agents whose phases are displaced; None for all."""
        return getattr(self, "agents", None) or getattr(self, "robots", None)

    def __str__(self) -> str:
        whose = "all phases" if self.whom is None else f"phases of {', '.join(map(str, self.whom))}"
        by = self.by_cycles if isinstance(self.by_cycles, str) else f"by {self.by_cycles:g} cycles"
        return f"{whose} {by}"


class AgentDisplacement(Displacement):
    """A displacement of phases of agents."""

    agents: Whom = None
    """Numbers of the agents; all by default."""


class RobotDisplacement(Displacement):
    """A displacement of phases of robots; rings of the displaced are commanded dark."""

    robots: Whom = None
    """Numbers of the robots; all by default."""


class ScheduleEntry(ConfigModel):
    """Changes at one moment; they are made once."""

    changing: ClassVar[tuple[str, ...]] = ("set", "displace", "begin", "end")  # keys that hold changes
    settable: ClassVar[re.Pattern[str]]  # dotted keys that may be set
    in_short: ClassVar[str]  # what may change, for messages

    at_s: Annotated[Number, Field(ge=0, le=1e9)] | None = None
    """Time of the first control step in which the changes act; of point agents, of the changes."""
    at_cycle: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Firing of the reference after which they act."""
    when: Condition | None = None
    """A condition on a measure, such as `order_parameter >= 0.95`."""
    for_cycles: Annotated[WholeNumber, Field(ge=1)] | None = None
    """With `when`, number of firings of the reference in a row at which the condition must hold; by default it need
    hold only once, at any step, event or firing of which the measure is told."""
    set: dict[str, Any] = Field(default_factory=dict)
    """New values by dotted key."""
    displace: Displacement | None = None
    """A displacement of phases."""
    begin: Members = ()
    """Numbers of the faults that begin."""
    end: Members = ()
    """Numbers of the faults that end."""

    def _check_together(self) -> None:
        if sum(moment is not None for moment in (self.at_s, self.at_cycle, self.when)) != 1:
            raise ValueError("give the moment of the changes: one of at_s, at_cycle and when")
        if not any(getattr(self, key) for key in self.changing):
            raise ValueError(f"nothing changes; give one or more of {', '.join(self.changing)}")
        if self.for_cycles is not None and self.when is None:
            raise ValueError(f"for_cycles is {self.for_cycles} without when; give when, too, or leave it out")
        for key in self.set:
            if not self.settable.fullmatch(key):
                raise ValueError(f"set: {key} cannot change during a trial; allowed: {self.in_short}")
            if re.fullmatch(r"robots\.\d+\.parameters\.period_s", key):
                raise ValueError(f"set: {key} cannot change during a trial: cycles and order parameter depend on it")

    @property
    def what(self) -> str:
        """The changes in words, for lists of events."""
        return "; ".join(self.in_words())

    def in_words(self) -> list[str]:
        """Return each of the changes in words."""
        changes = [f"{key}: {value}" for key, value in self.set.items()]
        changes += [] if self.displace is None else [str(self.displace)]
        begin = [f"faults.{number} begins" for number in self.begin]
        return [*changes, *begin, *(f"faults.{number} ends" for number in self.end)]


def check_changes(
    faults: Sequence[FaultSection], schedule: Sequence[ScheduleEntry], noun: str, population: int
) -> None:
    """Raise ValueError for changes of robots or agents that there are not, or of faults that do not begin or end so."""
    other = "agents" if noun == "robot" else "robots"
    for place, fault in enumerate(faults):
        where, most = f"faults.{place}", len(fault.whom or range(population))
        if getattr(fault, other) is not None:
            raise ValueError(f"{where}.{other}: this model has none; give {noun}s")
        for number in fault.whom or ():
            check_range(f"{where}.{noun}s", number, 0, population - 1)
        check_range(f"{where}.count", fault.count, 0, most)
        none = f", or 0: a smaller share of {most} {noun}s is no {noun}"
        check_range(f"{where}.share", fault.share or None, 0.5 / most, 1, none)
    for place, entry in enumerate(schedule):
        displaced = entry.displace.whom if entry.displace else None
        moved = {key: getattr(entry, key, None) for key in ("remove", "add")}  # which entries of agents lack
        for key, numbers in {f"displace.{noun}s": displaced, **moved}.items():
            for number in numbers or ():
                check_range(f"schedule.{place}.{key}", number, 0, population - 1)
        for key in ("begin", "end"):
            for number in getattr(entry, key):
                if number >= len(faults) or not faults[number].scheduled:
                    said = f"{number} is not the number of a fault with scheduled: true"
                    raise ValueError(f"schedule.{place}.{key}: {said}")
                if key == "end" and faults[number].kind == "restart":
                    raise ValueError(f"schedule.{place}.end: {number} is a restart, which takes no time")


def notes_on_faults(
    faults: Sequence[FaultSection], schedule: Sequence[ScheduleEntry], noun: str, reference: int
) -> list[str]:
    """Return notes on faults that never begin, and on those that may freeze the reference, a robot or an agent."""
    found = []
    for number, fault in enumerate(faults):
        if fault.scheduled and not any(number in entry.begin for entry in schedule):
            found.append(f"faults.{number} never begins: no entry of the schedule begins it")
        may_freeze = fault.kind == "oscillator_frozen" and 0 not in (fault.count, fault.share)
        if may_freeze and reference in (fault.whom or (reference,)):
            said = f"faults.{number} may freeze {noun} {reference}, the reference: then no cycles are counted"
            found.append(f"{said}; give the numbers of others in {noun}s, of which count and share are drawn")
    return found


_Moment = TypeVar("_Moment")


def timed_entries(
    schedule: Sequence[ScheduleEntry], moment: Callable[[float], _Moment], never: _Moment
) -> deque[tuple[_Moment, int]]:
    """Return moment (of a time in s) and number of each entry that has a time, in order, and `never` after them."""
    timed = [(moment(entry.at_s), number) for number, entry in enumerate(schedule) if entry.at_s is not None]
    return deque([*sorted(timed), (never, -1)])


class AgentScheduleEntry(ScheduleEntry):
    """Changes at one moment of a trial of point agents."""

    later_keys: ClassVar[tuple[str, ...]] = ("begin", "end")
    settable: ClassVar[re.Pattern[str]] = re.compile(
        r"agents\.speed_cm_s|neighbourhood\.(k|radius_cm|angle_deg)|response\.(coupling|refractory|parameters\.\w+)"
    )
    in_short: ClassVar[str] = (
        "agents.speed_cm_s, neighbourhood.k, neighbourhood.radius_cm, neighbourhood.angle_deg, response.coupling, "
        "response.refractory, response.parameters.NAME; outside set: displace, begin and end"
    )

    displace: AgentDisplacement | None = None


_PARAMETER = re.compile(r"robots\.(0|[1-9]\d*)\.(?:parameters|sensors\.(\w+)(?!\.file$))\.(\w+)")


class RobotScheduleEntry(ScheduleEntry):
    """Changes at one moment of a trial of robots; `set` has parameters of controllers, and keys of the arena."""

    changing: ClassVar[tuple[str, ...]] = (*ScheduleEntry.changing, "remove", "add")
    later_keys: ClassVar[tuple[str, ...]] = ("remove", "add", "poses")
    settable: ClassVar[re.Pattern[str]] = re.compile(rf"{_PARAMETER.pattern}|arena\.(width_cm|height_cm|obstacles)")
    in_short: ClassVar[str] = (
        "robots.NUMBER.parameters.NAME, robots.NUMBER.sensors.SENSOR.NAME, arena.width_cm, arena.height_cm and "
        "arena.obstacles; outside set: displace, begin, end, remove and add"
    )

    displace: RobotDisplacement | None = None
    remove: Members = ()
    """Numbers of the robots that leave the arena."""
    add: Members = ()
    """Numbers of the robots that come into the arena, with controllers that start."""
    poses: tuple[Pose, ...] | None = None
    """With `add`, `x_cm, y_cm, heading_rad` of each robot; by default they come to random free places."""

    def _check_together(self) -> None:
        super()._check_together()
        if self.poses is not None and len(self.poses) != len(self.add):
            raise ValueError(f"poses has {len(self.poses)} rows; allowed: {len(self.add)}, one for each robot added")

    def in_words(self) -> list[str]:
        """Return each of the changes in words."""
        moved = (("removes", self.remove), ("adds", self.add))
        in_words = (f"{verb} {', '.join(map(str, robots))}" for verb, robots in moved if robots)
        return [*super().in_words(), *in_words]

    def parameters(self) -> dict[tuple[int, str | None], dict[str, Any]]:
        """Return new values of parameters by name, for each group number and sensor; None is the controller."""
        found: dict[tuple[int, str | None], dict[str, Any]] = {}
        for key, value in self.set.items():
            if match := _PARAMETER.fullmatch(key):
                found.setdefault((int(match[1]), match[2]), {})[match[3]] = value
        return found

    def arena_values(self) -> dict[str, Any]:
        """Return the new values of the arena's keys, by their names in the section."""
        return {key.removeprefix("arena."): value for key, value in self.set.items() if key.startswith("arena.")}
