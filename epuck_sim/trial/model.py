"""Trials of any model: what is simulated, and how it is run."""

from collections.abc import Callable, Iterable
from typing import Any, Protocol

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.errors import ScenarioError
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.embodied import run_trial
from epuck_sim.trial.particles import run_swarm
from epuck_sim.trial.result import TrialResult
from epuck_sim.trial.synchrony import SynchronyWatch


class Progress(Protocol):
    """Shows how far a trial is."""

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        """Look at robots, at every step."""

    def of_swarm(self, swarm: ParticleSimulation) -> None:
        """Look at point-like agents, now and then."""


def make_model(scenario: Scenario, seed: int, *, interpret: bool = False) -> Simulation | ParticleSimulation:
    """Return what a scenario's trial simulates; what it needs is compiled then.

    Raises ScenarioError where controllers are to be interpreted and there are none, and what its model raises.
    """
    if not isinstance(scenario, ParticleScenario):
        return Simulation(scenario, seed, interpret=interpret)
    if interpret:
        check_interpretable(scenario)
    return ParticleSimulation(scenario, seed)


def check_interpretable(scenario: Scenario) -> None:
    """Raise ScenarioError for a scenario without controllers to interpret."""
    if isinstance(scenario, ParticleScenario):
        raise ScenarioError(f"{scenario.name}: model: particles has no controllers to interpret; leave --interpret out")


def run_model(
    model: Simulation | ParticleSimulation,
    onlookers: Iterable[Callable[[Any, Any], None]] = (),
    progress: Progress | None = None,
) -> TrialResult:
    """Run a trial to its end; onlookers: of the model's own kind, see `run_trial` and `run_swarm`."""
    if isinstance(model, ParticleSimulation):
        return run_swarm(model, onlookers, progress.of_swarm) if progress else run_swarm(model, onlookers)
    return run_trial(model, [progress, *onlookers] if progress else onlookers)
