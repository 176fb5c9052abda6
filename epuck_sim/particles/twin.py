"""The course of a trial beside its undisturbed twin: how a disturbance spreads, and what is left of synchrony (5.4)."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.order_parameter import METRICS
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.particles import ParticleScenario


class TwinComparison(NamedTuple):
    """A trial at some times."""

    time_s: FloatArray
    """(times,)"""
    order_parameter: FloatArray
    """(times,) of all agents at these times, which are not those at which the reference fires."""
    deviation: FloatArray
    """(times, agents) how far each phase is from that of the undisturbed twin, 0 to 0.5 cycles."""


def simulate_with_twin(scenario: ParticleScenario, seed: int, time_s: FloatArray) -> TwinComparison:
    """Return a trial's course, to its end or beyond synchrony, at ascending times, (times,) s.

    The twin has the same seed, and so begins at the same places and moves alike, unless motion is coupled to pulses
    (D.1). Its agents are not displaced and their clocks do not jitter (5.4.1, 5.4.2).
    """
    endless = scenario.model_copy(update={"stop": scenario.stop.model_copy(update={"order_parameter": None})})
    undisturbed = {
        "start": scenario.start.model_copy(update={"displacement": 0.0}),
        "clocks": scenario.clocks.model_copy(update={"jitter": 0.0}),
    }
    swarms = ParticleSimulation(endless, seed), ParticleSimulation(endless.model_copy(update=undisturbed), seed)
    phases = np.empty((2, len(time_s), scenario.agents.count))
    for place, time in enumerate(time_s.tolist()):
        for swarm, of_one in zip(swarms, phases, strict=True):
            swarm.run_to(time)
            of_one[place] = swarm.phases()
    apart = np.abs(phases[0] - phases[1])
    return TwinComparison(time_s, METRICS["complex"](phases[0], 1.0), np.minimum(apart, 1 - apart))
