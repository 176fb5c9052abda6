"""A trial and its undisturbed twin: how a disturbance spreads, and how much synchrony remains (thesis 5.4)."""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.order_parameter import METRICS
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.loader import load_of_model
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import ScenarioLike


class TwinComparison(NamedTuple):
    """A trial compared with its undisturbed twin at given times."""

    time_s: FloatArray  # (times,) s
    order_parameter: FloatArray  # (times,) complex order parameter (eq. 5.7) of the disturbed trial at these times
    deviation: FloatArray
    """(times, agents) distance of each phase from that of the same agent in the twin, 0 to 0.5 cycles."""


def make_twin(scenario: ParticleScenario, seed: int, displacement: float = 0.0) -> ParticleSimulation:
    """Return the twin of a trial: it continues after synchrony, and its agents move like those of the trial.

    By default no phase of the twin is displaced and no period has jitter (5.4.1, 5.4.2). With a displacement, both are
    as in the trial, but the phase of agent 0 is ahead by that many cycles, at most up to its firing.
    """
    scenario.check_twin()
    if displacement:
        twin = make_endless(scenario, seed)
        twin.displace(0, displacement)
        return twin
    start = scenario.start.model_copy(update={"displacement": 0.0})
    clocks = scenario.clocks.model_copy(update={"jitter": 0.0})
    return make_endless(scenario.model_copy(update={"start": start, "clocks": clocks}), seed)


def make_endless(scenario: ParticleScenario, seed: int) -> ParticleSimulation:
    """Return the simulation of a trial that continues after synchrony, without measures."""
    stop = scenario.stop.model_copy(update={"order_parameter": None, "when": None})
    return ParticleSimulation(scenario.model_copy(update={"stop": stop, "measures": ()}), seed)


def simulate_with_twin(scenario: ScenarioLike, seed: int, time_s: FloatArray | list[float]) -> TwinComparison:
    """Simulate a trial and its undisturbed twin of the same seed, and compare them at times, (times,) s, ascending.

    The scenario has `model: particles`, or is what `load_scenario` takes.
    Agents of both start at the same positions and move alike, unless motion is coupled to pulses (D.1). Both trials
    continue when they are synchronised; see `make_twin`.

    Raises:
        ScenarioError: The scenario is of another model, or entries of the schedule wait for a firing or a condition.
        ValueError: The times are not ascending.
    """
    scenario = load_of_model(scenario, ParticleScenario, "a twin needs model: particles")
    simulations = (make_endless(scenario, seed), make_twin(scenario, seed))
    times = np.asarray(time_s, np.float64)
    phases = np.empty((2, len(times), scenario.agents.count))
    for index, time in enumerate(times.tolist()):
        for simulation, its_phases in zip(simulations, phases, strict=True):
            simulation.run_to(time)
            its_phases[index] = simulation.phases()
    return TwinComparison(times, METRICS["complex"](phases[0], 1.0), deviations(*phases))


def deviations(phases: FloatArray, of_twin: FloatArray) -> FloatArray:
    """Return the distance of each phase from that of the same agent in the twin, 0 to 0.5 cycles."""
    apart = np.abs(phases - of_twin)
    return np.asarray(np.minimum(apart, 1 - apart))
