"""What may fail in robots while a trial runs (thesis 4.4): the section `faults` of a scenario."""

from collections.abc import Sequence
from typing import Annotated, ClassVar, Literal, Self, get_args

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, Positive, WholeNumber
from epuck_sim.scenario.robots import RobotGroup, members
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
