"""Simulation of point-like agents, from one event to the next (thesis chapters 3 and 5)."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import ScenarioError
from epuck_sim.order_parameter import Firing
from epuck_sim.particles.cascade import CYCLES, FIRINGS, INSTANTS, PULSES, SYNCHRONISED, make_instant
from epuck_sim.particles.curve_compilation import make_response
from epuck_sim.particles.events import UNLIMITED
from epuck_sim.particles.initial_conditions import (
    initial_oscillators,
    initial_speeds,
    initial_trajectories,
    receiver_streams,
)
from epuck_sim.particles.motion import fastest_speed
from epuck_sim.particles.neighbour_links import NeighbourLinks
from epuck_sim.particles.neighbourhood import make_neighbourhood
from epuck_sim.particles.pulse_links import PulseLinks
from epuck_sim.particles.rules import make_rules
from epuck_sim.particles.schedule import (
    NEVER,
    SCHEDULE_SEED,
    Moment,
    any_ends_by,
    change_speeds,
    displace_phases,
    last_firing_before,
    timed_entries,
)
from epuck_sim.particles.state import HeldState, SwarmState, make_observed
from epuck_sim.scenario.agent_changes import with_values
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario, require_model, seed_of_trial
from epuck_sim.scenario.schedule import TrialEvent


class Event(NamedTuple):
    """An event: an agent reaches a wall or the end of a run, agents fire at one instant, or something is changed."""

    time_s: float
    """Simulated time of the event."""
    turned: int | None
    """Index of the agent that reached a wall, the edge of a cyclic space, or the end of a run of its random walk; None
    at other events."""
    fired: IntArray
    """Indices of the agents that fired, in the order of the cascade."""
    received: IntArray
    """Indices of the agents whose phases were shifted by a pulse, including those that fired because of it."""


class LastInstant:
    """The last instant at which agents fired, as an `Event` that is made when it is asked for.

    It is that of the simulation's present time: what is kept beyond that must be read before.
    """

    def __init__(self, simulation: "ParticleSimulation") -> None:
        self._simulation = simulation

    turned: None = None
    """Agents fired: none turned."""

    @property
    def time_s(self) -> float:
        """Simulated time of the instant."""
        return self._simulation.time_s

    @property
    def fired(self) -> IntArray:
        """Indices of the agents that fired, in the order of the cascade."""
        return self._simulation.last_instant().fired

    @property
    def received(self) -> IntArray:
        """Indices of the agents whose phases were shifted by a pulse, including those that fired because of it."""
        return self._simulation.last_instant().received


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
    events: list[TrialEvent]
    """Entries of the schedule that were carried out, in order."""

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
        if loaded.start.like is not None:
            raise ScenarioError(
                f"{loaded.name}: start.like is {loaded.start.like!r}, which is for trials of `run` and sweeps; give a "
                "ParticleSimulation start_like(robots, seed) as start"
            )
        self.scenario = loaded
        self.seed = seed_of_trial(loaded, seed)
        position_seed, phase_seed, motion_seed = np.random.SeedSequence(self.seed).spawn(3)
        self._trajectories = initial_trajectories(loaded, position_seed, motion_seed)
        self._oscillators = initial_oscillators(loaded, phase_seed)
        self._instant = make_instant(loaded.space.dimensions, loaded.agents.count)
        streams = receiver_streams(loaded, self.seed)
        neighbourhood = make_neighbourhood(loaded, fastest_speed(self._trajectories), streams)
        self._state = SwarmState(
            self._trajectories,
            neighbourhood,
            self._oscillators,
            make_rules(loaded, make_response(loaded.response), neighbourhood),
            self._instant,
            make_observed(loaded.space.dimensions, loaded.agents.count),
        )
        self._held = HeldState(self._state, loaded.response.curve)
        self._neighbour_links: NeighbourLinks | None = None
        self._pulse_links: PulseLinks | None = None
        self.events = []
        self._present = loaded  # with what the schedule has set
        self._timed = timed_entries(loaded.schedule, loaded.clocks.period_s)
        self._is_changed = False  # by the schedule since the last event

    def __iter__(self) -> Iterator[Event]:
        """Return the simulation itself, which continues from its present state."""
        return self

    def __next__(self) -> Event:
        """Simulate up to the next event and return it."""
        if self._is_changed or (self._timed.next is not NEVER and self._is_change_next()):
            if not self._is_changed:
                self._carry_out_timed()
            self._is_changed = False
            return self._event_without_firing(None)
        turned = self._held.turn_if_next()
        if turned >= 0:
            return self._event_without_firing(turned)
        self._held.advance(int(self._instant.counters[PULSES]) + 1, UNLIMITED, UNLIMITED)
        return self.last_instant()

    def _event_without_firing(self, turned: int | None) -> Event:
        no_agents = np.empty(0, np.int64)
        return Event(self.time_s, turned, no_agents, no_agents)

    def _is_change_next(self) -> bool:
        """Return whether an entry of the schedule with a time comes before the next firing, wall and end of a run."""
        moment = self._timed.next
        if self.next_firing <= last_firing_before(moment):
            return False
        self.positions()  # continues trajectories that have ended
        return not any_ends_by(self._trajectories, moment)

    def last_instant(self) -> Event:
        """Return the last event at which agents fired, if no time has passed since."""
        instant = self._instant
        fired = instant.fired[: instant.counts[0]].astype(np.int64)
        received = instant.received[: instant.counts[1]].astype(np.int64)
        return Event(self.time_s, None, fired, received)

    def run(self, cycles: int, periods: int | None = None, pulses: int | None = None, *, share: float = 0.0) -> None:
        """Simulate until the reference has fired `cycles` times since the beginning, or until synchrony.

        Args:
            cycles: Limit of firings of the reference, counted from the beginning of the trial.
            periods: Limit in nominal periods, 1 or more, counted from the start of the present one; None for no
                limit, with which the call never returns if other agents hold the reference back for ever.
            pulses: Limit of pulses whose receivers are looked for, 1 or more, counted from now: a measure of the time
                that the call takes. The instant that reaches it is completed. None for no limit.
            share: Part of a period, below 1, by which the limit of periods lies later.
        """
        last_cycle = UNLIMITED if periods is None else int(self._oscillators.cycle[0]) + periods
        last_pulse = UNLIMITED if pulses is None else int(self._instant.counters[PULSES]) + pulses
        self._is_changed = False
        while self._timed.next is not NEVER and self._timed.next <= (last_cycle, share):
            self._held.advance(last_pulse, cycles, *last_firing_before(self._timed.next))
            if self.is_synchronised or self.cycles >= cycles or self._instant.counters[PULSES] >= last_pulse:
                return
            self._carry_out_timed()
        self._held.advance(last_pulse, cycles, last_cycle, share)

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
        self._is_changed = False
        while self._timed.next <= (cycle, time):
            self._held.advance_to(*last_firing_before(self._timed.next))
            if self.is_synchronised:
                return
            self._carry_out_timed()
        self._held.advance_to(int(cycle), time)
        if not self.is_synchronised:
            self._oscillators.now[0] = int(cycle) - self._oscillators.cycle[0] + time

    def _carry_out_timed(self) -> None:
        """Carry out the entries of the schedule that have the next time; nothing else happens up to then."""
        oscillators, moment = self._oscillators, self._timed.next
        self._held.advance(UNLIMITED, UNLIMITED, *last_firing_before(moment))  # counts time from the moment's cycle
        oscillators.now[0] = max(oscillators.now[0], moment[0] - oscillators.cycle[0] + moment[1])
        while self._timed.next == moment:
            self.carry_out_scheduled(self._timed.take())

    def carry_out_scheduled(self, entry: int) -> None:
        """Carry out an entry of the scenario's schedule at the present time.

        Entries with a time are carried out by the simulation itself, others by `run_trial`.

        Args:
            entry: Number of the entry.
        """
        section, source = self.scenario.schedule[entry], f"schedule.{entry}"
        if section.set:
            self._change(with_values(self._present, section.set, f"{self.scenario.name}: {source}.set"))
        if section.displace is not None:
            sequence = np.random.SeedSequence(self.seed, spawn_key=(SCHEDULE_SEED, entry))
            displace_phases(self._oscillators, self.phases(), section.displace, sequence)
        self.events.append(TrialEvent(self.instants, self.time_s, source, section.what))
        self._is_changed = True

    def _change(self, scenario: ParticleScenario) -> None:
        """Go on with the speeds, neighbourhood and response of a scenario."""
        trajectories = self._trajectories
        if scenario.agents != self._present.agents:
            speed = initial_speeds(scenario, self.seed)
            change_speeds(trajectories, self.positions(), speed, float(self._oscillators.now[0]))
        streams = self._state.neighbourhood.streams
        neighbourhood = make_neighbourhood(scenario, fastest_speed(trajectories), streams)
        rules = make_rules(scenario, make_response(scenario.response), neighbourhood)
        self._state = self._state._replace(neighbourhood=neighbourhood, rules=rules)
        self._held = HeldState(self._state, scenario.response.curve)
        self._neighbour_links = self._pulse_links = None
        self._present = scenario

    def displace(self, agent: int, cycles: float) -> None:
        """Bring the next firing of an agent forward, before the first event; its phase is ahead by so much at most.

        Args:
            agent: Index of the agent.
            cycles: By how much, 0 or more; no further than to the present time.

        Raises:
            ValueError: Agents have fired already, or `cycles` is negative.
        """
        if self.instants or cycles < 0:
            raise ValueError(
                f"cycles is {cycles}, after {self.instants} instants; allowed: 0 or more, before the first"
            )
        oscillators = self._oscillators
        forward = cycles * oscillators.period[agent]
        oscillators.next_firing[agent] = max(oscillators.next_firing[agent] - forward, oscillators.now[0])
        oscillators.is_stale[:] = True

    @property
    def time_s(self) -> float:
        """Simulated time in s."""
        return float(self._oscillators.cycle[0] + self._oscillators.now[0]) * self.scenario.clocks.period_s

    @property
    def period(self) -> int:
        """Number of the present nominal period, from 0."""
        return int(self._oscillators.cycle[0])

    @property
    def next_firing(self) -> tuple[int, float]:
        """Number of the nominal period, from 0, in which the next agent fires, and the share of it that has passed."""
        periods, share = divmod(self._held.next_firing(), 1.0)
        return int(self._oscillators.cycle[0]) + int(periods), share

    @property
    def next_change(self) -> Moment:
        """Nominal period, and the share of it that has passed, when the schedule changes something at a time."""
        return self._timed.next

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
        return self._held.phases()

    @property
    def periods_s(self) -> FloatArray:
        """(agents,) s: time in which each oscillator goes from phase 0 to 1 if it receives no pulse; constant."""
        periods: FloatArray = self._oscillators.period * self.scenario.clocks.period_s
        return periods

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(agents,) cm/s: speed of each agent at the present time; constant unless a run or a schedule changes it."""
        self.positions()  # continues trajectories that have ended
        speeds: FloatArray = self._trajectories.speed / self.scenario.clocks.period_s
        return speeds

    def positions(self) -> FloatArray:
        """Return (agents, dimensions) cm: positions at the present time."""
        return self._held.positions()

    def adjacency(self) -> BoolArray:
        """Return (agents, agents) the adjacency matrix at the present time (eq. 5.6).

        Row i, column j: whether agent j would receive a pulse of agent i; its phase is another matter.

        Raises:
            ScenarioError: Receivers are drawn anew for each pulse.
        """
        agents = self.scenario.agents.count
        matrix = np.zeros(agents * agents, np.bool_)
        matrix[self.neighbour_links()] = True
        return matrix.reshape(agents, agents)

    def headings(self) -> FloatArray:
        """Return (agents, dimensions) unit vectors: directions of motion at the present time."""
        self.positions()  # continues trajectories that have ended
        return self._trajectories.heading.T.copy()

    def neighbour_links(self) -> IntArray:
        """Return the links from each agent to those that would receive its pulse at the present time.

        Returns:
            (links,) ascending: the sender times the number of agents, plus the receiver.

        Raises:
            ScenarioError: Receivers are drawn anew for each pulse.
        """
        if self._neighbour_links is None:
            self._neighbour_links = NeighbourLinks(self._present, self._state)
        return self._neighbour_links.find()

    def pulse_links(self) -> IntArray:
        """Return who received whose pulse at the last instant at which agents fired, if no time has passed since.

        Returns:
            (links, 3) agent that fires, agent that receives, and 1 where that shifts its phase, in the order of the
            cascade; of 50 agents or more, those alone that shift a phase. There are no links if receivers are
            drawn anew for each pulse: nobody else is shown whom.
        """
        if self._pulse_links is None:
            self._pulse_links = PulseLinks(self._present)
        turns = bool(self.scenario.agents.reorient_on)
        headings = self._instant.headings.T if turns else self.headings()
        event = self.last_instant()
        return self._pulse_links.find(self.positions(), headings, event.fired, event.received)

    def _repr_html_(self) -> str:
        """Return the space with the agents as they are now, for notebooks."""
        from epuck_sim.particles.notebook import show_simulation  # noqa: PLC0415 is for notebooks alone

        return show_simulation(self)
