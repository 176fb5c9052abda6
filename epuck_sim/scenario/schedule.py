"""What changes while a trial runs, and when: what the section `schedule` has in common for all models."""

from collections.abc import Sequence
from typing import Annotated, Any, ClassVar, Generic, Literal, NamedTuple, Self, TypeVar

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber
from epuck_sim.scenario.condition import Awaited, Condition

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
