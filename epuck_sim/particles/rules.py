"""The rules of a trial: how oscillators and agents respond to pulses, and when it ends (thesis 3.1, 5.1, D.1)."""

import math
from typing import NamedTuple

from epuck_sim.particles.neighbourhood import RANDOM, Neighbourhood
from epuck_sim.particles.order_kernel import METRIC_CODES, max_phase_offset
from epuck_sim.particles.phase_response import Response
from epuck_sim.scenario.particles import ParticleScenario


class Rules(NamedTuple):
    """How oscillators and agents respond to pulses, and when a trial ends."""

    response: Response
    """The phase response curve."""
    reorients_on_emitting: bool
    """Whether agents reorient when they emit a pulse."""
    reorients_on_receiving: bool
    """Whether agents reorient when a pulse shifts their phase."""
    reorients_on_arriving: bool
    """Whether agents reorient when a pulse arrives, whether or not it shifts their phase."""
    sends_every_pulse: bool
    """Whether pulses are sent even when there is no agent left whose phase they could shift: they turn agents, or
    their receivers are drawn, and how many draws there are must not depend on the order of the cascade."""
    reference: int
    """Index of the agent whose firings are counted as cycles."""
    metric: int
    """`COMPLEX` or `REFERENCE`."""
    threshold: float
    """Order parameter at which the swarm is synchronised; inf if there is none."""
    max_offset: float
    """Cycles; if any phase is farther than this from the reference's, the threshold is not reached."""


def make_rules(scenario: ParticleScenario, response: Response, neighbourhood: Neighbourhood) -> Rules:
    """Return the rules of a scenario; `response` and `neighbourhood` are made from its sections."""
    stop, reorient_on = scenario.stop, scenario.agents.reorient_on
    is_single = scenario.agents.count == 1  # a single agent is never synchronised
    threshold = math.inf if is_single or stop.order_parameter is None else stop.order_parameter
    max_offset = max_phase_offset(scenario.agents.count, threshold) if threshold < math.inf else -1.0
    return Rules(
        response,
        "emitting" in reorient_on,
        "receiving" in reorient_on,
        "arriving" in reorient_on,
        "arriving" in reorient_on or neighbourhood.kind == RANDOM,
        stop.reference,
        METRIC_CODES[stop.metric],
        threshold,
        1.0 if stop.max_time_s is not None else max_offset,  # then a trial may end between two firings
    )
