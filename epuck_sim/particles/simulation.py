"""A swarm of point-like agents, from one event to the next (thesis chapters 3 and 5)."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import ScenarioError
from epuck_sim.order_parameter import Firing
from epuck_sim.particles.events import (
    CYCLES,
    ENDLESS,
    FIRINGS,
    INSTANTS,
    SYNCHRONISED,
    advance,
    make_instant,
    make_rules,
    turn_if_next,
)
from epuck_sim.particles.initial_conditions import place_agents, set_clocks
from epuck_sim.particles.motion import locate
from epuck_sim.particles.neighbourhood import make_neighbourhood
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario, require_model


class Event(NamedTuple):
    """An agent reaches a wall, or some fire at one instant."""

    time_s: float
    turned: int | None
    """Who reached a wall, or the edge of a cyclic space."""
    fired: IntArray
    """Who fired, in the order of the cascade."""
    heard: IntArray
    """Whose phase was shifted by a pulse; who fired by that is among them."""


class ParticleSimulation:
    """Agents and their oscillators; iterating goes from event to event, without end.

    >>> swarm = Swarm("particles", seed=1)
    >>> event = next(event for event in swarm if len(event.fired))
    >>> f"{event.time_s:.3f} s: {event.fired} fired, {event.heard} heard"
    '0.020 s: [6] fired, [19] heard'
    """

    scenario: ParticleScenario
    seed: int

    def __init__(self, scenario: Scenario | str | Path | Mapping[str, Any], seed: int | None = None) -> None:
        """Place the agents.

        scenario: of particles, or what `load_scenario` takes; seed: the scenario's own if None.
        Raises ScenarioError for another model, and for a sweep.
        """
        why = "a ParticleSimulation needs model: particles"
        loaded = require_model(load_scenario(scenario), ParticleScenario, why)
        if loaded.sweep is not None:
            raise ScenarioError(
                f"{loaded.name}: is a sweep; simulate one of its points: `points(scenario)[0].scenario`"
            )
        self.scenario = loaded
        self.seed = loaded.seed if seed is None else seed
        if self.seed < 0:
            raise ScenarioError(f"{loaded.name}: seed is {self.seed}; allowed: whole numbers from 0")
        placing, starting, moving = np.random.SeedSequence(self.seed).spawn(3)
        self._flights = place_agents(loaded, placing, moving)
        self._clocks = set_clocks(loaded, starting)
        self._instant = make_instant(loaded.agents.count)
        hood = make_neighbourhood(loaded, float(self._flights.speed.max()))
        self._state = self._flights, hood, self._clocks, make_rules(loaded), self._instant
        self.run(0)  # which has compiled, before any clock runs, what a trial takes that nobody watches

    def __iter__(self) -> Iterator[Event]:
        """Go on from where the swarm stands."""
        return self

    def __next__(self) -> Event:
        """Go to the next event."""
        flights, hood, clocks, _, instant = self._state
        turned = turn_if_next(flights, hood, clocks, instant)
        if turned >= 0:
            nobody = np.empty(0, np.int64)
            return Event(self.time_s, turned, nobody, nobody)
        advance(*self._state, self.instants + 1, ENDLESS, ENDLESS, 0.0)
        fired, heard = self._instant.counts
        return Event(self.time_s, None, self._instant.fired[:fired].copy(), self._instant.heard[:heard].copy())

    def run(self, cycles: int, periods: int | None = None) -> None:
        """Go on until the reference has fired so many times in all, or until synchrony.

        periods: but for no longer than so many nominal periods, 1 or more, from the beginning of this one. Without,
        it takes for ever if others hold the reference back for ever.
        """
        last = ENDLESS if periods is None else int(self._clocks.cycle[0]) + periods
        advance(*self._state, ENDLESS, cycles, last, 0.0)

    def run_to(self, time_s: float) -> None:
        """Go on to a time; or to synchrony, if that is earlier. Raises ValueError for a time that is over."""
        period_s = self.scenario.clocks.period_s
        if not self.time_s - 1e-9 * period_s <= time_s < math.inf:
            raise ValueError(f"time_s is {time_s}; the swarm is at {self.time_s} s and cannot go back")
        cycle, time = divmod(time_s / period_s, 1.0)
        flights, hood, clocks, rules, instant = self._state
        # whoever stops at any time wants to know the order parameter at the reference's last firing before
        measuring = rules._replace(near=1.0)
        advance(flights, hood, clocks, measuring, instant, ENDLESS, ENDLESS, int(cycle), time)
        if not self.is_synchronised:
            clocks.now[0] = int(cycle) - clocks.cycle[0] + time

    @property
    def time_s(self) -> float:
        """Simulated time."""
        return float(self._clocks.cycle[0] + self._clocks.now[0]) * self.scenario.clocks.period_s

    @property
    def period(self) -> int:
        """The number of the present nominal period, from 0."""
        return int(self._clocks.cycle[0])

    @property
    def next_period(self) -> int:
        """The number of the nominal period, from 0, in which the next agent fires."""
        return int(self._clocks.cycle[0] + np.floor(self._clocks.due.min()))

    @property
    def cycles(self) -> int:
        """Firings of the reference so far."""
        return int(self._instant.tally[CYCLES])

    @property
    def instants(self) -> int:
        """Instants at which somebody fired, so far."""
        return int(self._instant.tally[INSTANTS])

    @property
    def firings(self) -> int:
        """Firings of all agents so far."""
        return int(self._instant.tally[FIRINGS])

    @property
    def order_parameter(self) -> float | None:
        """As it was at the last firing of the reference; None before the first, and where `run` ended by periods."""
        return None if math.isnan(self._instant.order[0]) else float(self._instant.order[0])

    @property
    def outcome(self) -> Firing:
        """The last firing of the reference; a trial ends with the one at which the swarm is synchronised."""
        return Firing(self.cycles, self.order_parameter)

    @property
    def is_synchronised(self) -> bool:
        """Whether the order parameter reached its threshold at the last event."""
        return bool(self._instant.tally[SYNCHRONISED])

    def phases(self) -> FloatArray:
        """Return (agents,) the phases at this time; who fires at this instant has phase 0."""
        phases: FloatArray = 1 - (self._clocks.due - self._clocks.now[0]) / self._clocks.period
        return np.maximum(phases, 0.0)  # of one who fires it may be 1e-16 less

    @property
    def periods_s(self) -> FloatArray:
        """(agents,) how long each oscillator takes from phase 0 to 1 if it hears nothing; the same for ever."""
        periods: FloatArray = self._clocks.period * self.scenario.clocks.period_s
        return periods

    @property
    def speeds_cm_s(self) -> FloatArray:
        """(agents,) how fast each agent is; the same for ever."""
        speeds: FloatArray = self._flights.speed / self.scenario.clocks.period_s
        return speeds

    def positions(self) -> FloatArray:
        """Return (agents, dimensions) cm where everybody is."""
        places = np.empty_like(self._flights.origin)
        locate(self._flights, self._clocks.now[0], places)
        return places.T

    def headings(self) -> FloatArray:
        """Return (agents, dimensions) unit vectors: where everybody goes."""
        self.positions()  # which carries on flights that have ended
        return self._flights.heading.T.copy()
