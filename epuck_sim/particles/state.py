"""The state of a swarm of point agents, and what compiled code does with it at an address (see `util.addresses`)."""

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.particles.cascade import Instant
from epuck_sim.particles.curve_compilation import trial_error
from epuck_sim.particles.events import UNLIMITED, advance, turn_if_next
from epuck_sim.particles.motion import Trajectories, compute_positions
from epuck_sim.particles.neighbourhood import Neighbourhood
from epuck_sim.particles.oscillators import Oscillators, earliest_firing, phase_at
from epuck_sim.particles.rules import Rules
from epuck_sim.util.addresses import compiled_for
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import jit_no_alloc


class Observed(NamedTuple):
    """Where the present state is written when it is asked for."""

    positions: FloatArray
    """(dimensions, agents) cm."""
    phases: FloatArray
    """(agents,) phases."""


class SwarmState(NamedTuple):
    """All that changes while a swarm's time runs, and its rules."""

    trajectories: Trajectories
    neighbourhood: Neighbourhood
    oscillators: Oscillators
    rules: Rules
    instant: Instant
    observed: Observed


@jit_no_alloc
def observe(trajectories: Trajectories, oscillators: Oscillators, observed: Observed) -> None:
    """Write the positions and phases at the present time; trajectories that have ended by then are continued."""
    now = oscillators.now[0]
    compute_positions(trajectories, now, observed.positions)
    for agent in range(len(observed.phases)):
        # rounding may leave -1e-16 to an agent that has just fired
        observed.phases[agent] = max(phase_at(oscillators, agent, now), 0.0)


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], SwarmState]


def _advance(address: int, pulses: int, cycles: int, last_cycle: int, last_time: float, max_offset: float) -> None:
    """Carry out `events.advance`."""
    state = value_at(address)  # noqa: F821 see `bind`
    advance(
        state.trajectories,
        state.neighbourhood,
        state.oscillators,
        state.rules,
        state.instant,
        pulses,
        cycles,
        last_cycle,
        last_time,
        max_offset,
    )


def _turn_if_next(address: int) -> int:
    """Carry out `events.turn_if_next`."""
    state = value_at(address)  # noqa: F821 see `bind`
    return turn_if_next(state.trajectories, state.neighbourhood, state.oscillators, state.instant)


def _observe(address: int) -> None:
    """Carry out `observe`."""
    state = value_at(address)  # noqa: F821 see `bind`
    observe(state.trajectories, state.oscillators, state.observed)


def _next_firing(address: int) -> float:
    """Carry out `oscillators.earliest_firing`."""
    return earliest_firing(value_at(address).oscillators)  # noqa: F821 see `bind`


class HeldState:
    """A state that compiled code reads at its address: entering that takes a tenth of unpacking the arrays."""

    def __init__(self, state: SwarmState, curve: str) -> None:
        """Hold a state; compile what works on it, before any clock runs.

        Args:
            state: The state.
            curve: Name of the response curve in its rules, for what is raised.
        """
        self._state, self._curve = state, curve
        self._owner, self._address = hold(state)
        self._advance, self._turn_if_next, self._observe, self._next_firing = (
            compiled_for(function, state) for function in (_advance, _turn_if_next, _observe, _next_firing)
        )

    def advance(self, pulses: int, cycles: int, last_cycle: int, last_time: float = 0.0) -> None:
        """Simulate until a limit is reached; see `events.advance`.

        Raises:
            CurveError: A user's response curve raises.
        """
        self._carry_on(pulses, cycles, last_cycle, last_time, self._state.rules.max_offset)

    def advance_to(self, cycle: int, time: float) -> None:
        """Simulate up to a time in a cycle, and measure the order parameter at each firing of the reference.

        Raises:
            CurveError: A user's response curve raises.
        """
        # between events the order parameter at the reference's last firing may be asked for: always measure it
        self._carry_on(UNLIMITED, UNLIMITED, cycle, time, 1.0)

    def _carry_on(self, pulses: int, cycles: int, last_cycle: int, last_time: float, max_offset: float) -> None:
        try:
            self._advance(self._address, pulses, cycles, last_cycle, last_time, max_offset)
        except Exception as error:  # nothing else in the kernel raises
            raise trial_error(self._curve, error) from error

    def turn_if_next(self) -> int:
        """Continue the trajectory that ends before the next firing; return whose it is, or -1."""
        return int(self._turn_if_next(self._address))

    def positions(self) -> FloatArray:
        """Return (agents, dimensions) cm: positions at the present time."""
        self._observe(self._address)
        return self._state.observed.positions.T.copy()

    def phases(self) -> FloatArray:
        """Return (agents,) phases at the present time."""
        self._observe(self._address)
        return self._state.observed.phases.copy()

    def next_firing(self) -> float:
        """Return when the next agent fires, in cycles since the present one began."""
        return float(self._next_firing(self._address))


def make_observed(dimensions: int, agents: int) -> Observed:
    """Return arrays for the state of a swarm."""
    return Observed(np.zeros((dimensions, agents)), np.zeros(agents))
