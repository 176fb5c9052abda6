"""Simulation of point-like agents, from one event to the next (thesis chapters 3 and 5)."""

import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import CurveError
from epuck_sim.order_parameter import Firing
from epuck_sim.particles.cascade import CYCLES, FIRINGS, INSTANTS, PULSES, SYNCHRONISED, make_instant
from epuck_sim.particles.curve_compilation import make_response
from epuck_sim.particles.events import UNLIMITED, advance, reflect_if_next
from epuck_sim.particles.initial_conditions import initial_oscillators, initial_trajectories, receiver_streams
from epuck_sim.particles.motion import compute_positions
from epuck_sim.particles.neighbour_lists import NeighbourLists
from epuck_sim.particles.neighbourhood import make_neighbourhood
from epuck_sim.particles.rules import Rules, make_rules
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario, require_model, seed_of_trial


class Event(NamedTuple):
    """An event: an agent reaches a wall, or agents fire at one instant."""

    time_s: float
    """Simulated time of the event."""
    turned: int | None
    """Index of the agent that reached a wall, or the edge of a cyclic space; None if agents fired."""
    fired: IntArray
    """Indices of the agents that fired, in the order of the cascade."""
    received: IntArray
    """Indices of the agents whose phases were shifted by a pulse, including those that fired because of it."""


class ParticleSimulation:
    """Point-like agents and their oscillators; iteration goes from event to event, without end.

    >>> simulation = ParticleSimulation("particles", seed=1)
    >>> event = next(event for event in simulation if len(event.fired))
    >>> f"{event.time_s:.3f} s: {event.fired} fired, {event.received} received the pulse"
    '0.020 s: [6] fired, [19] received the pulse'
    """

    scenario: ParticleScenario
    """The scenario, with all defaults filled in."""
    seed: int
    """Seed of the trial."""
    _is_compiled: ClassVar[bool] = False
    """Whether the kernel is compiled; its arguments are of the same types in all simulations."""

    def __init__(self, scenario: Scenario | str | Path | Mapping[str, Any], seed: int | None = None) -> None:
        """Place the agents and draw the phases of their oscillators.

        Args:
            scenario: A scenario with `model: particles`, or what `load_scenario` takes.
            seed: Whole number from 0; None for the scenario's own.

        Raises:
            ScenarioError: The scenario is of another model, is a sweep, or the seed is negative.
        """
        why = "a ParticleSimulation needs model: particles; use Simulation"
        loaded = require_model(load_scenario(scenario), ParticleScenario, why)
        self.scenario = loaded
        self.seed = seed_of_trial(loaded, seed)
        position_seed, phase_seed, motion_seed = np.random.SeedSequence(self.seed).spawn(3)
        self._trajectories = initial_trajectories(loaded, position_seed, motion_seed)
        self._oscillators = initial_oscillators(loaded, phase_seed)
        self._instant = make_instant(loaded.agents.count)
        streams = receiver_streams(loaded, self.seed)
        neighbourhood = make_neighbourhood(loaded, float(self._trajectories.speed.max()), streams)
        rules = make_rules(loaded, make_response(loaded.response), neighbourhood)
        self._state = self._trajectories, neighbourhood, self._oscillators, rules, self._instant
        if not ParticleSimulation._is_compiled:
            self.run(0)  # compiles the kernel now, so that no measured time includes it
            ParticleSimulation._is_compiled = True

    def __iter__(self) -> Iterator[Event]:
        """Return the simulation itself, which continues from its present state."""
        return self

    def __next__(self) -> Event:
        """Simulate up to the next event and return it."""
        trajectories, neighbourhood, oscillators, rules, instant = self._state
        turned = reflect_if_next(trajectories, neighbourhood, oscillators, instant)
        if turned >= 0:
            no_agents = np.empty(0, np.int64)
            return Event(self.time_s, turned, no_agents, no_agents)
        self._advance(rules, int(instant.counters[PULSES]) + 1, UNLIMITED, UNLIMITED, 0.0)
        return self.last_instant()

    def last_instant(self) -> Event:
        """Return the last event at which agents fired, if no time has passed since."""
        instant = self._instant
        fired = instant.fired[: instant.counts[0]].astype(np.int64)
        received = instant.received[: instant.counts[1]].astype(np.int64)
        return Event(self.time_s, None, fired, received)

    def run(self, cycles: int, periods: int | None = None, pulses: int | None = None) -> None:
        """Simulate until the reference has fired `cycles` times since the beginning, or until synchrony.

        Args:
            cycles: Limit of firings of the reference, counted from the beginning of the trial.
            periods: Limit in nominal periods, 1 or more, counted from the start of the present one; None for no
                limit, with which the call never returns if other agents hold the reference back for ever.
            pulses: Limit of pulses whose receivers are looked for, 1 or more, counted from now: a measure of the time
                that the call takes. The instant that reaches it is completed. None for no limit.
        """
        last_cycle = UNLIMITED if periods is None else int(self._oscillators.cycle[0]) + periods
        last_pulse = UNLIMITED if pulses is None else int(self._instant.counters[PULSES]) + pulses
        self._advance(self._state[3], last_pulse, cycles, last_cycle, 0.0)

    def run_to(self, time_s: float) -> None:
        """Simulate up to a time, or up to synchrony if that is earlier.

        Args:
            time_s: Simulated time in s, not before the present one.

        Raises:
            ValueError: The time is in the past, or not finite.
        """
        period_s = self.scenario.clocks.period_s
        if not self.time_s - 1e-9 * period_s <= time_s < math.inf:
            raise ValueError(f"time_s is {time_s}; the simulation is at {self.time_s} s and cannot go back")
        cycle, time = divmod(time_s / period_s, 1.0)
        # between events the order parameter at the reference's last firing may be asked for: always measure it
        self._advance(self._state[3]._replace(max_offset=1.0), UNLIMITED, UNLIMITED, int(cycle), time)
        if not self.is_synchronised:
            self._oscillators.now[0] = int(cycle) - self._oscillators.cycle[0] + time

    def _advance(self, rules: Rules, pulses: int, cycles: int, last_cycle: int, last_time: float) -> None:
        """Simulate up to a limit of `advance`.

        Raises:
            CurveError: A user's response curve raises.
        """
        trajectories, neighbourhood, oscillators, _, instant = self._state
        try:
            advance(trajectories, neighbourhood, oscillators, rules, instant, pulses, cycles, last_cycle, last_time)
        except Exception as error:  # nothing else in the kernel raises
            raise CurveError(f"{self.scenario.response.curve}: {type(error).__name__}: {error}") from error

    @property
    def time_s(self) -> float:
        """Simulated time in s."""
        return float(self._oscillators.cycle[0] + self._oscillators.now[0]) * self.scenario.clocks.period_s

    @property
    def period(self) -> int:
        """Number of the present nominal period, from 0."""
        return int(self._oscillators.cycle[0])

    @property
    def next_period(self) -> int:
        """Number of the nominal period, from 0, in which the next agent fires."""
        return int(self._oscillators.cycle[0] + np.floor(self._oscillators.next_firing.min()))

    @property
    def cycles(self) -> int:
        """Number of firings of the reference so far."""
        return int(self._instant.counters[CYCLES])

    @property
    def instants(self) -> int:
        """Number of instants, so far, at which at least one agent fired."""
        return int(self._instant.counters[INSTANTS])

    @property
    def firings(self) -> int:
        """Number of firings of all agents so far."""
        return int(self._instant.counters[FIRINGS])

    @property
    def order_parameter(self) -> float | None:
        """Order parameter at the last firing of the reference.

        None before its first firing; it may also be None after `run` has reached its limit of periods or pulses.
        """
        return None if math.isnan(self._instant.order_parameter[0]) else float(self._instant.order_parameter[0])

    @property
    def outcome(self) -> Firing:
        """The last firing of the reference; a trial ends with the one at which the swarm is synchronised."""
        return Firing(self.cycles, self.order_parameter)

    @property
    def is_synchronised(self) -> bool:
        """Whether the order parameter reached its threshold at the last event."""
        return bool(self._instant.counters[SYNCHRONISED])

    def phases(self) -> FloatArray:
        """Return (agents,) phases at the present time; an agent that has just fired has phase 0."""
        oscillators = self._oscillators
        phases: FloatArray = 1 - (oscillators.next_firing - oscillators.now[0]) / oscillators.period
        return np.maximum(phases, 0.0)  # rounding may leave -1e-16 to an agent that has just fired

    @property
    def periods_s(self) -> FloatArray:
        """(agents,) s: time in which each oscillator goes from phase 0 to 1 if it receives no pulse; constant."""
        periods: FloatArray = self._oscillators.period * self.scenario.clocks.period_s
        return periods

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(agents,) cm/s: speed of each agent; constant."""
        speeds: FloatArray = self._trajectories.speed / self.scenario.clocks.period_s
        return speeds

    def positions(self) -> FloatArray:
        """Return (agents, dimensions) cm: positions at the present time."""
        positions = np.empty_like(self._trajectories.origin)
        compute_positions(self._trajectories, self._oscillators.now[0], positions)
        return positions.T

    def adjacency(self) -> BoolArray:
        """Return (agents, agents) the adjacency matrix at the present time (eq. 5.6).

        Row i, column j: whether agent j would receive a pulse of agent i; its phase is another matter.

        Raises:
            ScenarioError: Receivers are drawn anew for each pulse.
        """
        return self._neighbour_lists.adjacency(self.positions(), self.headings())

    @cached_property
    def _neighbour_lists(self) -> NeighbourLists:
        return NeighbourLists(self.scenario)

    def headings(self) -> FloatArray:
        """Return (agents, dimensions) unit vectors: directions of motion at the present time."""
        self.positions()  # continues trajectories that have ended
        return self._trajectories.heading.T.copy()
