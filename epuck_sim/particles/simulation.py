"""Simulation of point-like agents, from one event to the next (thesis chapters 3 and 5)."""

import math
from collections.abc import Iterator
from copy import copy
from functools import partial
from threading import Lock
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arena import make_arena
from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.display.arena_svg import draw_arena
from epuck_sim.display.html import element, to_html
from epuck_sim.errors import ScenarioError
from epuck_sim.faults import begin_or_end, fault_event
from epuck_sim.order_parameter import Firing
from epuck_sim.particles.batch import MOST_CYCLES, MOST_LINKS, Batch, links_in, record_cycles
from epuck_sim.particles.events import advance, observe, turn_if_next
from epuck_sim.particles.faults import begin_faults, change_faults, speeds_with_faults
from epuck_sim.particles.initial_conditions import Rules, draw_differences, initial_speeds, rules_of, start
from epuck_sim.particles.motion import begin_motion, start_at_present
from epuck_sim.particles.oscillators import Moment, forget_earliest, last_firing_before
from epuck_sim.particles.phase_response import curve_error
from epuck_sim.particles.swarm import HEAR, SCHEDULE_SEED, Arrays, array_in, keep_state, scene_of, state_of
from epuck_sim.scenario.changes import AgentDisplacement, TrialEvent, timed_entries
from epuck_sim.scenario.loader import load_of_model
from epuck_sim.scenario.particles import ParticleScenario, RandomAgents
from epuck_sim.scenario.scenario import ScenarioLike, seed_of_trial
from epuck_sim.util.messages import ANOTHER_THREAD, numbered, whole
from epuck_sim.util.native import address_of
from epuck_sim.util.seeds import seed_words

NEVER: Moment = (math.inf, 0.0)  # later than any moment of a trial
NEARLY_NEVER = 2**30  # periods to the next firing, from which on all oscillators are frozen
UNLIMITED = 2**62  # larger than any count or cycle number

SHIFTS_ONLY = 50
"""Least size of swarms whose `pulse_links` are only those that shift a phase: if all fire, each receives all pulses."""

NOBODY = np.empty(0, np.int64)  # indices of the agents that fire or receive where none do
SIDE_IN_RADII = 60  # side of the space of agents, in radii of the disc that is drawn for each
GLOW = 0.075  # share of a period for which an agent that has fired is drawn lit; a robot's flash lasts as long


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


def _number(name: str, text: str) -> property:
    return property(lambda simulation: int(simulation._state[name].item()), doc=text)


class ParticleSimulation:
    """Point-like agents and their oscillators; iteration goes from event to event, as long as there are any.

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
    """Entries of the schedule that were carried out, and faults that began and ended, in order."""
    next_change: Moment
    """Nominal period, and the share of it that has passed, when something changes at a time, or `NEVER`."""
    room: ByteArray = np.empty((0, 0), np.uint8)
    """(cycles, bytes) room for the states at firings of the reference, once `record` has made it."""
    recorded = 0  # number of these states that are taken by the next `take_batch`

    def __init__(self, scenario: ScenarioLike, seed: int | None = None) -> None:
        """Place the agents and draw the phases of their oscillators.

        Args:
            scenario: A scenario with `model: particles`, or what `load_scenario` takes.
            seed: Whole number from 0; None for the scenario's own.

        Raises:
            ScenarioError: The scenario is of another model, is a sweep, or the seed is negative.
        """
        why = "a ParticleSimulation needs model: particles; use Simulation"
        loaded = load_of_model(scenario, ParticleScenario, why)
        if loaded.start.like is not None:
            said = f"start.like is {loaded.start.like!r}, which is for trials of `run` and sweeps"
            instead = "for a ParticleSimulation, give start_like(robots, seed) as start"
            raise ScenarioError(f"{loaded.name}: {said}; {instead}")
        self.scenario, self.seed, self._turn = loaded, seed_of_trial(loaded, seed), Lock()
        self._rules = rules_of(loaded)
        self._renew(self._rules)
        self.reset()

    def reset(self, seed: int | None = None) -> None:
        """Restart with the same scenario: equal, to the bit, to a new simulation with this seed.

        Args:
            seed: Whole number from 0; the current one if None.

        Raises:
            ScenarioError: The seed is not allowed.
        """
        self.seed = self.seed if seed is None else seed_of_trial(self.scenario, seed)
        if self._present_rules is self._rules:
            self._arrays.block[: len(self._rules.beginning)] = self._rules.beginning
        else:
            self._renew(self._rules)
        draw_differences(self._arrays, self.scenario, self.seed)
        start(self._arrays.block, self._addresses, seed_words(self.seed))
        self.events, self.recorded = [], 0
        self._present = self.scenario  # with the values that the schedule has set
        self._timed = timed_entries(self.scenario.schedule, self._moment, NEVER)
        if self.scenario.faults:
            begin_faults(self._arrays, self.scenario, self.seed)
        self._await_change()
        self._is_changed = False  # by the schedule since the last event

    def _moment(self, time_s: float) -> Moment:
        return divmod(time_s / self.scenario.clocks.period_s, 1.0) if time_s < math.inf else NEVER

    def _await_change(self) -> None:
        """Note that the schedule or a fault has changed something, and when one does so next."""
        self._is_changed = True
        self._fault_ms = float(self._arrays.affected["change_ms"].min()) if self.scenario.faults else math.inf
        self.next_change = min(self._timed[0][0], self._moment(self._fault_ms / 1000))

    def _renew(self, rules: Rules) -> None:
        """Switch to the block of a new swarm with these rules."""
        self._present_rules, self._addresses, self._arrays = rules, rules.addresses, Arrays(rules.new_block())
        self._state = state_of(self._arrays.block)
        self._scratch: ByteArray | None = None  # a block in which links are looked for
        if len(self.room):
            self.record()

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without addresses, which are valid in this process only."""
        lost = ("_rules", "_present_rules", "_addresses", "_arrays", "_state", "_scratch", "_turn", "room", "recorded")
        kept = {name: value for name, value in vars(self).items() if name not in lost}
        return kept | {"events": self.events.copy(), "_timed": copy(self._timed), "block": self._arrays.block.copy()}

    def __setstate__(self, state: dict[str, Any]) -> None:
        block, self._turn = state.pop("block"), Lock()
        vars(self).update(state)
        self._rules = rules_of(self.scenario)
        self._renew(self._rules if self._present is self.scenario else rules_of(self._present))
        self._arrays.block[:] = block

    def __iter__(self) -> Iterator[Event]:
        return self

    def __next__(self) -> Event:
        """Simulate up to the next event and return it; StopIteration: all are frozen, and stand still, for ever."""
        if self._is_changed or (self.next_change != NEVER and self._is_change_next()):
            if not self._is_changed:
                self._carry_out_timed()
            self._is_changed = False
            return Event(self.time_s, None, NOBODY, NOBODY)
        is_frozen = bool(self.scenario.faults) and self.next_firing[0] - self.period > NEARLY_NEVER
        if is_frozen and np.isinf(self._arrays.end_cycle).all():  # nobody reaches a wall or the end of a run
            raise StopIteration
        turned = turn_if_next(self._arrays.block, self._addresses)
        if turned >= 0:
            return Event(self.time_s, turned, NOBODY, NOBODY)
        self._advance(NEVER, self._state["pulses"].item() + 1)
        return self.last_instant()

    def _advance(self, end: Moment, pulses: int = UNLIMITED, cycles: int = UNLIMITED, offset: float = -1.0) -> None:
        """Simulate until a limit is reached; see `swarm.LIMITS`, of which `max_offset` is `offset` or more."""
        state = self._state
        if not self._turn.acquire(False):
            raise ValueError(ANOTHER_THREAD)
        state["limits"][0] = pulses, cycles, *end, max(offset, state["max_offset"].item())
        try:
            if len(self.room):
                where = address_of(advance), self.room, self.recorded
                self.recorded = record_cycles(self._arrays.block, self._addresses, *where)
            else:
                advance(self._arrays.block, self._addresses)
        except Exception as error:  # nothing else in the kernel raises
            phase = float(self._arrays.scene.response.last_phase)
            raise curve_error(self._present.response, phase, error) from error
        finally:
            self._turn.release()

    def _observe(self) -> Arrays:
        """Return the arrays, with positions and phases at the present time; continue trajectories that have ended."""
        observe(self._arrays.block, self._addresses)
        return self._arrays

    def _is_change_next(self) -> bool:
        """Return whether a change with a time comes before the next firing, wall and end of a run."""
        if self.next_firing <= last_firing_before(self.next_change):
            return False
        swarm, (cycle, time) = self._observe(), self.next_change
        return not ((swarm.end_cycle < cycle) | ((swarm.end_cycle == cycle) & (swarm.end_time <= time))).any()

    def last_instant(self) -> Event:
        """Return the last event at which agents fired, if no time has passed since."""
        swarm, state = self._arrays, self._state
        fired = swarm.fired[: state["fired"].item()].astype(np.int64)
        received = swarm.received[: state["received"].item()].astype(np.int64)
        return Event(self.time_s, None, fired, received)

    def run(self, cycles: int, periods: int | None = None, pulses: int | None = None, *, share: float = 0.0) -> None:
        """Simulate until the reference has fired `cycles` times since the beginning, or until synchrony.

        Args:
            cycles: Limit of firings of the reference, counted from the beginning of the trial.
            periods: Limit in nominal periods, 0 or more, counted from the start of the present one; None for no
                limit, with which the call never returns if other agents hold the reference back for ever.
            pulses: Limit of pulses whose receivers are looked for, 1 or more, counted from now: a measure of the time
                that the call takes. The instant that reaches it is completed. None for no limit.
            share: Part of a period, below 1, that is added to the limit of periods.

        Raises:
            ValueError: A limit, or the share, is not allowed.
        """
        last_cycle = UNLIMITED if periods is None else self.period + whole("periods", periods, 0)
        last_pulse = UNLIMITED if pulses is None else self._state["pulses"].item() + whole("pulses", pulses)
        if not 0 <= share < 1:
            raise ValueError(f"share is {share!r}; allowed: from 0, and below 1")
        self._advance_through((last_cycle, share), last_pulse, whole("cycles", cycles, 0))

    def run_to(self, time_s: float) -> None:
        """Simulate up to a time, or up to synchrony if that is earlier.

        Args:
            time_s: Simulated time in s, not before the present one.

        Raises:
            ValueError: The time is in the past, or not finite.
        """
        period_s = self.scenario.clocks.period_s
        if not math.isfinite(time_s):
            raise ValueError(f"time_s is {time_s}; allowed: a finite number")
        if time_s < self.time_s - 1e-9 * period_s:
            raise ValueError(f"time_s is {time_s}; the simulation is at {self.time_s} s and cannot go back")
        cycle, time = self._moment(time_s)
        # between events the order parameter at the reference's last firing may be asked for: always measure it
        self._advance_through((cycle, time), offset=1.0)
        if not self.is_synchronised:
            self._state["now"][:] = cycle - self._state["cycle"] + time

    def _advance_through(
        self, end: Moment, pulses: int = UNLIMITED, cycles: int = UNLIMITED, offset: float = -1.0
    ) -> None:
        """Simulate until a limit is reached, as `_advance` does, and make the changes on the way that have a time.

        What has been recorded is taken before a change: receivers are looked for by the rules of that time.
        """
        self._is_changed = False
        while self.next_change <= end:
            self._advance(last_firing_before(self.next_change), pulses, cycles, offset)
            is_over = self.is_synchronised or self.cycles >= cycles or self._state["pulses"].item() >= pulses
            if self.recorded or is_over:
                return
            self._carry_out_timed()
        self._advance(end, pulses, cycles, offset)

    def _carry_out_timed(self) -> None:
        """Make the changes that have the next time, by the schedule and by faults; nothing else happens up to then."""
        scene, moment = self._arrays.scene, self.next_change
        self._advance(last_firing_before(moment))  # counts time from the moment's cycle
        scene.now = max(scene.now, moment[0] - scene.cycle + moment[1])
        while self._timed[0][0] == moment:
            self.carry_out_scheduled(self._timed.popleft()[1])
        if self._moment(self._fault_ms / 1000) <= moment:
            self._change_faults(self._fault_ms)

    def _change_faults(self, time_ms: float) -> None:
        for fault in change_faults(self._observe(), time_ms):
            self.events.append(fault_event(self.instants, self.time_s, *fault))
        self._await_change()

    def carry_out_scheduled(self, entry: int) -> None:
        """Carry out the entry with this number of the scenario's schedule at the present time.

        Those with a time the simulation itself carries out, others `run_trial`. ValueError: there is no such entry.
        """
        section, source = numbered("entry", entry, self.scenario.schedule), f"schedule.{entry}"
        if section.set:
            self._change(self._present.with_set(section.set, f"{self.scenario.name}: {source}.set"))
        if section.displace is not None:
            self._displace(section.displace, entry)
        self.events.append(TrialEvent(self.instants, self.time_s, source, section.what))
        if section.begin or section.end:
            time_ms = self.time_s * 1000
            begin_or_end(self._arrays.affected, self.oscillators, section, time_ms)
            self._change_faults(time_ms)
        else:
            self._await_change()

    def _change(self, scenario: ParticleScenario) -> None:
        """Switch to the speeds, neighbourhood and response of a scenario."""
        before = self._arrays
        if scenario.agents != self._present.agents:  # trajectories begin where agents are
            speeds = initial_speeds(scenario, self.seed)
            start_at_present(self._observe(), speeds_with_faults(before, speeds) if scenario.faults else speeds)
        self._renew(rules_of(scenario))
        keep_state(before, self._arrays)
        begin_motion(self._arrays.block)
        self._present = scenario

    def _displace(self, displacement: AgentDisplacement, entry: int) -> None:
        """Displace phases; random phases are drawn for all agents, displaced or not."""
        swarm, by_cycles = self._observe(), displacement.by_cycles
        if isinstance(by_cycles, str):
            sequence = np.random.SeedSequence(self.seed, spawn_key=(SCHEDULE_SEED, entry))
            displaced = np.random.Generator(np.random.SFC64(sequence)).random(len(swarm.phases_now))
        else:
            displaced = (swarm.phases_now + by_cycles % 1.0) % 1.0
        agents = slice(None) if displacement.agents is None else list(displacement.agents)
        swarm.next_firing[agents] = swarm.scene.now + ((1 - displaced) * swarm.period)[agents]
        forget_earliest(swarm)

    def displace(self, agent: int, cycles: float) -> None:
        """Bring the next firing of an agent forward, before the first event.

        Args:
            agent: Index of the agent, from 0.
            cycles: Displacement of its phase, 0 or more; at most up to a firing at the present time.

        Raises:
            ValueError: There is no such agent, agents have fired already, or `cycles` is negative or NaN.
        """
        numbered("agent", agent, range(self.scenario.agents.count))
        if self.instants or not cycles >= 0:
            raise ValueError(f"cycles is {cycles}, after {self.instants} instants; allowed: 0 or more before the first")
        swarm = self._arrays
        swarm.next_firing[agent] = max(swarm.next_firing[agent] - cycles * swarm.period[agent], swarm.scene.now)
        forget_earliest(swarm)

    @property
    def time_s(self) -> float:
        """Simulated time in s."""
        return float(self._state["cycle"].item() + self._state["now"].item()) * self.scenario.clocks.period_s

    period = _number("cycle", "Number of the present nominal period, from 0.")

    @property
    def next_firing(self) -> tuple[int, float]:
        """Number of the nominal period, from 0, in which the next agent fires, and the share of it that has passed."""
        times = self._arrays.next_firing
        periods, share = divmod(times.item(times.argmin()), 1.0)  # a third of the time of `min`
        return self.period + int(periods), share

    cycles = _number("cycles", "Number of firings of the reference so far.")
    instants = _number("instants", "Number of instants, so far, at which at least one agent fired.")
    firings = _number("firings", "Number of firings of all agents so far.")

    @property
    def order_parameter(self) -> float | None:
        """Order parameter at the last firing of the reference.

        None before its first firing; it may also be None after `run` has reached its limit of periods or pulses.
        """
        order_parameter = self._state["order_parameter"].item()
        return None if math.isnan(order_parameter) else order_parameter

    @property
    def oscillators(self) -> int:
        """Number of agents, which are all oscillators."""
        return self.scenario.agents.count

    @property
    def outcome(self) -> Firing:
        """The last firing of the reference; a trial ends with the one at which the swarm is synchronised."""
        return Firing(self.cycles, self.order_parameter)

    @property
    def is_synchronised(self) -> bool:
        """Whether the order parameter reached its threshold at the last event."""
        return bool(self._state["is_synchronised"].item())

    def phases(self) -> FloatArray:
        """Return (agents,) phases at the present time; an agent that has just fired has phase 0."""
        return self._observe().phases_now.copy()

    @property
    def periods_s(self) -> FloatArray:
        """(agents,) s: time in which each oscillator goes from phase 0 to 1 without pulses and faults; constant."""
        swarm = self._arrays
        return (swarm.base_period if self.scenario.faults else swarm.period) * self.scenario.clocks.period_s

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(agents,) cm/s: speed of each agent at the present time; constant unless a run or a schedule changes it."""
        return self._observe().speed / self.scenario.clocks.period_s

    def positions(self) -> FloatArray:
        """Return (agents, dimensions) cm: positions at the present time."""
        return self._observe().positions_now.T.copy()

    def adjacency(self) -> BoolArray:
        """Return (agents, agents) the adjacency matrix at the present time (eq. 5.6).

        Row i, column j: whether agent j would receive a pulse of agent i, whatever its phase.

        Raises:
            ScenarioError: Receivers are drawn anew for each pulse.
        """
        matrix = np.zeros((self.oscillators, self.oscillators), np.bool_)
        matrix.ravel()[self.neighbour_links()] = True
        return matrix

    def headings(self) -> FloatArray:
        """Return (agents, dimensions) unit vectors: directions of motion at the present time."""
        return self._observe().heading.T.copy()

    def neighbour_links(self) -> IntArray:
        """Return (links,) the links from each agent to those that would receive its pulse at the present time.

        A link is the number sender * agents + receiver; links are ascending.

        Raises:
            ScenarioError: Receivers are drawn anew for each pulse.
        """
        return self._links_by_place(self._observed_state())

    def _observed_state(self) -> ByteArray:
        """Return (1, bytes) the observed state of the swarm, which the next event overwrites."""
        return self._observe().block[None, : len(self._present_rules.beginning)]

    def _links_in(self, states: ByteArray, senders: IntArray, addresses: IntArray) -> IntArray:
        """Return the links from senders in observed states, by the present rules and these functions."""
        if isinstance(self._present.neighbourhood, RandomAgents):
            said = "neighbourhood.kind is 'random', whose receivers are drawn anew for each pulse"
            raise ScenarioError(f"{self.scenario.name}: {said}; there are neighbours only by position")
        if self._scratch is None:
            self._scratch = self._present_rules.new_block()
        return links_in(self._scratch, addresses, states, senders)

    def _links_by_place(self, states: ByteArray) -> IntArray:
        """Return the links from all agents in observed states, whatever faults they have, ascending."""
        addresses = self._addresses.copy()
        addresses[HEAR] = 0
        return np.sort(self._links_in(states, np.arange(self.oscillators), addresses))

    def record(self) -> None:
        """Begin to record cycles, from now on, as long as there is room."""
        cycles = max(1, min(MOST_CYCLES, MOST_LINKS // self.oscillators**2))
        self.room, self.recorded = np.empty((cycles, len(self._present_rules.beginning)), np.uint8), 0

    def end_recording(self) -> None:
        """Record no more; cycles that were not taken are forgotten."""
        self.room, self.recorded = self.room[:0], 0

    def take_batch(self) -> Batch:
        """Return the cycles that have been recorded, one or more."""
        taken, self.recorded = self.room[: self.recorded], 0
        return Batch(self.scenario, taken, partial(self._links_by_place, taken))

    def pulse_links(self) -> IntArray:
        """Return the links of the pulses at the last instant at which agents fired, if no time has passed since.

        Returns:
            (links, 3) agent that fires, agent that receives, and 1 where that shifts its phase, in the order of the
            cascade; with 50 agents or more, only links that shift a phase. There are no links if receivers are
            drawn anew for each pulse: the drawn receivers are not exposed.
        """
        if isinstance(self._present.neighbourhood, RandomAgents):
            return np.empty((0, 3), np.int64)
        event, agents, state = self.last_instant(), self.oscillators, self._observed_state().copy()
        if self.scenario.agents.reorient_on:
            array_in(state, "heading")[:] = array_in(state, "headings_before")
        scene_of(state[0]).instants -= 1  # by which faults tell pulses apart
        found = self._links_in(state, event.fired, self._addresses)
        links = np.zeros((len(found), 3), np.int64)
        links[:, 0], links[:, 1] = np.divmod(found, agents)
        first = np.full(agents, -1)  # link by which each agent receives, as none receives two pulses at one instant
        first[links[::-1, 1]] = np.arange(len(links))[::-1]
        by_link = first[event.received]
        links[by_link[by_link >= 0], 2] = 1
        return links if agents < SHIFTS_ONLY else links[links[:, 2] > 0]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.scenario!r}, seed={self.seed}, time_s={self.time_s:g})"

    def _repr_html_(self) -> str:
        side_cm, dimensions = self.scenario.space.side_cm, self.scenario.space.dimensions
        moving = (self.positions(), self.headings())
        positions, headings = (np.pad(array, ((0, 0), (0, 1)))[:, :2] for array in moving)  # a segment has no y
        poses = np.column_stack([positions, np.arctan2(headings[:, 1], headings[:, 0])])
        is_lit = (self.phases() < GLOW) & (self.firings > 0)
        arena = make_arena(side_cm, side_cm if dimensions > 1 else 0.0, (), ())
        seen = ", a cube seen from above" if dimensions == 3 else ""
        state = f", seed {self.seed}: {self.time_s:.2f} s, {self.cycles} cycles{seen}"
        drawn = draw_arena(arena, poses, side_cm / SIDE_IN_RADII, is_lit)
        return to_html(element("p", element("b", self.scenario.name), state), drawn)
