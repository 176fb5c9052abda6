"""Updates measures while a trial runs, gathers their values, and carries out entries that wait for them or a cycle."""

import math
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import MeasureError
from epuck_sim.measures.measure import CYCLE_METHOD, Measure, Parameter, Scalar, Value
from epuck_sim.scenario.changes import ScheduleEntry
from epuck_sim.scenario.scenario import STOP, Condition, Scenario, condition_key
from epuck_sim.trial.result import Observer, TrialState
from epuck_sim.user_files import line_of_error
from epuck_sim.util.messages import describe_error, short_repr

NEVER = 2**62  # number of a firing that no trial reaches


class ConditionWatch:
    """An observer that checks a condition on the values of a measure until it has held."""

    def __init__(self, condition: Condition, for_cycles: int | None) -> None:
        self.measure = condition.measure
        self.value: Callable[[], Value] | None = None  # returns the measure's value; None for the order parameter
        self.has_held = False
        # whether to check only at firings of the reference, rather than whenever the measure is updated
        self.counts_firings = for_cycles is not None
        self._condition, self._needed, self._in_a_row = condition, for_cycles or 1, 0

    def __call__(self, _: Any, state: TrialState) -> None:
        """Check the present value; where it is undetermined, the condition does not hold."""
        value = state.order_parameter if self.value is None else self.value()
        holds = isinstance(value, int | float) and self._condition.holds(value)
        self._in_a_row = self._in_a_row + 1 if holds else 0
        self.has_held = self.has_held or self._in_a_row >= self._needed


class OneCycle:
    """A firing of the reference in the form of a batch, in models that take one at a time; see `particles.batch.Batch`.

    What the model's events do not have, no measure of such trials may ask for.
    """

    def __init__(self, event: Any, state: TrialState, simulation: Any) -> None:
        self._event, self._simulation = event, simulation
        self.first, self.time_s = state.cycles, np.array([state.time_s])
        self.order_parameter = np.array([math.nan if state.order_parameter is None else state.order_parameter])

    @property
    def phases(self) -> FloatArray:
        """(1, oscillators) phases from 0 to 1; robots that are no oscillators are left out."""
        periods = self._simulation.period_ms
        is_oscillator = ~np.isnan(periods)
        return np.asarray(self._event.phase_ms[is_oscillator] / periods[is_oscillator])[None]

    @property
    def positions(self) -> FloatArray:
        """(1, robots, 2) cm."""
        return np.array(self._event.poses[None, :, :2])

    @property
    def sides_cm(self) -> tuple[float, ...]:
        """Width and height of the arena."""
        return self._event.arena.width_cm, self._event.arena.height_cm


def _tell_one(tell: Observer, simulation: Any, event: Any, state: TrialState) -> None:
    tell(OneCycle(event, state, simulation), state)


def _tell_copy(tell: Observer, step: Any, state: TrialState) -> None:
    tell(step.copied(), state)


class Measuring:
    """The measures of a trial, and what waits for one of them or for a cycle.

    Those that wait are the condition that ends the trial, and entries of its schedule without a time.
    """

    def __init__(self, simulation: Any) -> None:
        """Make the measures of a fresh simulation that is about to run."""
        scenario: Scenario = simulation.scenario
        schedule: Sequence[ScheduleEntry] = getattr(scenario, "schedule", ())
        self.at_events: list[Observer] = []  # update the measures that need every event
        self.at_stretches: list[Observer] = []  # update those that take many steps of robots at once, as a `Stretch`
        self.at_cycles: list[Observer] = []  # update the measures that need every firing of the reference
        self.at_batches: list[Observer] = []  # update those that take many firings of agents at once, as a `Batch`
        self._values: dict[str, Callable[[], Value]] = {}
        self._watches = {key: ConditionWatch(*each) for key, each in scenario.conditions.items()}
        # entries of the schedule that wait for a cycle or a condition, by their numbers
        self.entries = {number: entry for number, entry in enumerate(schedule) if entry.at_s is None}
        self.waits = bool(self._watches or self.entries)  # the trial's end, or an entry, for a measure or a cycle
        for section in scenario.measures:
            self._begin(section.find(), section.parameters, simulation)
        # those of the order parameter, which every trial measures
        self.at_cycles += [watch for watch in self._watches.values() if watch.value is None]

    def _begin(self, measure: Measure, parameters: Mapping[str, Parameter], simulation: Any) -> None:
        origin = f"{simulation.scenario.name}: measure {measure.name}, seed {simulation.seed}"
        make = partial(measure.make, simulation, **parameters)
        if measure.is_function:
            self._values[measure.name] = _checked(measure, origin, make, as_value)
            return
        instance = _call(measure, origin, make)
        self._values[measure.name] = _checked(measure, origin, instance.value, as_value)
        watches = [watch for watch in self._watches.values() if watch.measure == measure.name]
        for watch in watches:
            watch.value = _checked(measure, origin, instance.value, last_scalar)
        event_method = simulation.scenario.event_method
        for method, observers in ((event_method, self.at_events), (CYCLE_METHOD, self.at_cycles)):
            if told_by := measure.told_by(method):
                tell = partial(_call, measure, origin, getattr(instance, told_by))
                if told_by == "stretch":
                    self.at_stretches.append(tell)
                elif told_by != "batch":
                    observers.append(partial(_tell_copy, tell) if event_method == "step" else tell)
                elif hasattr(simulation, "take_batch"):
                    self.at_batches.append(tell)
                else:
                    observers.append(partial(_tell_one, tell, simulation))
                observers += [watch for watch in watches if not watch.counts_firings]
        self.at_cycles += [watch for watch in watches if watch.counts_firings]

    def is_over(self) -> bool:
        """Return whether the condition that ends the trial has held, if there is one."""
        return STOP in self._watches and self._watches[STOP].has_held

    @property
    def next_cycle(self) -> int:
        """Number of the next firing after which an entry is to be carried out; `NEVER` if none waits for one."""
        return min((entry.at_cycle for entry in self.entries.values() if entry.at_cycle is not None), default=NEVER)

    def carry_out(self, state: TrialState, carry_out: Callable[[int], None]) -> None:
        """Carry out the entries that are due, by passing their numbers to `carry_out`; call this between two events."""
        for number, entry in self.entries.copy().items():
            by_cycle = entry.at_cycle is not None and state.cycles >= entry.at_cycle
            if by_cycle or (entry.when is not None and self._watches[condition_key(number)].has_held):
                carry_out(number)
                del self.entries[number]

    def values(self) -> dict[str, Value]:
        """Return the value of each measure by its name; the trial must be over."""
        return {name: value() for name, value in self._values.items()}


def _checked(
    measure: Measure, origin: str, value: Callable[[], Any], convert: Callable[[Any], Value]
) -> Callable[[], Value]:
    def checked() -> Value:
        found = _call(measure, origin, value)
        try:
            return convert(found)
        except ValueError as error:
            where = f"{measure.stored_name}: " if measure.sources else ""
            raise MeasureError(f"{origin}: {where}its value {error}") from error

    return checked


def _call(measure: Measure, origin: str, function: Callable[..., Any], *given: Any) -> Any:
    """Call a function of a measure; raise what it raises as MeasureError, with file and line."""
    try:
        return function(*given)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever a user's file may raise
        where = line_of_error(error, measure.sources)
        what = describe_error(error)
        raise MeasureError(f"{origin}: {where}: {what}" if where else f"{origin}: {what}") from error


def as_value(given: Any) -> Value:
    """Convert the value of a measure to a plain number, truth value or None, or to a list of them.

    >>> as_value(np.float64(0.5)), as_value(np.array([1, 2])), as_value(math.nan), as_value([True, None])
    (0.5, [1, 2], None, [True, None])
    """
    if isinstance(given, np.ndarray) and given.ndim == 1:
        given = given.tolist()
    return [_as_scalar(each) for each in given] if isinstance(given, list | tuple) else _as_scalar(given)


def last_scalar(given: Any) -> Scalar:
    """Convert the value of a measure to a plain scalar: that of a series is its last one, or None if it is empty."""
    if isinstance(given, list | tuple | np.ndarray):
        return _as_scalar(given[-1]) if len(given) else None
    return _as_scalar(given)


def _as_scalar(given: Any) -> Scalar:
    plain = given.item() if isinstance(given, np.generic) else given
    if plain is None or isinstance(plain, bool) or (isinstance(plain, int | float) and abs(plain) < 2**63):
        return plain
    if isinstance(plain, float) and math.isnan(plain):
        return None
    if not isinstance(plain, int | float):
        allowed = "a number, true or false, None, or a list of them"
        said = f"{short_repr(given)}, a {type(given).__name__}; allowed: {allowed}"
    elif abs(plain) == math.inf:
        said = f"{plain}; allowed: finite numbers, and None where it is undetermined"
    else:
        said = f"{short_repr(plain)}; allowed: numbers below 2 ** 63"
    raise ValueError(f"is {said}")
