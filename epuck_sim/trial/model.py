"""The table of models: how each is simulated, and how a trial of it is run.

A further model is one more entry: `register_model`. What depends on a scenario alone is a property of the scenario.
"""

import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import ContextDecorator
from typing import Any, NamedTuple, Protocol

import numpy as np

from epuck_sim.arena import clearance_cm
from epuck_sim.arrays import FloatArray
from epuck_sim.epuck import GRID_SPACING_CM
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import SCENARIO_TYPES, robots_like
from epuck_sim.scenario.particles import ParticleScenario, StartSection
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.measuring import Measuring
from epuck_sim.trial.result import Observer, Progress, TrialResult


class Simulated(Protocol):
    """The interface of simulations of all models."""

    @property
    def scenario(self) -> Scenario:
        """The simulated scenario."""

    @property
    def seed(self) -> int:
        """Seed with which the same scenario is simulated again to the same outcome."""


class Model(NamedTuple):
    """A model: a kind of scenario, and how its trials are run."""

    scenario: type[Scenario]
    simulate: Callable[[Any, int, bool], Simulated]
    """Returns a fresh simulation; takes the scenario, a seed, and whether to interpret controllers."""
    run: Callable[[Any, Sequence[Observer], Progress | None, Measuring], TrialResult]
    """Returns the outcome of a trial; takes a fresh simulation, observers of every event, a function that shows
    progress, and the trial's `Measuring`."""
    check_room: Callable[[Any], None]  # raises ScenarioError for a scenario whose population finds no room


# Each model is imported when it is used: a sweep of agents needs no pymunk, and `check` of agents no numba.


def _simulate_robots(scenario: EmbodiedScenario, seed: int, interpret: bool) -> Simulated:
    from epuck_sim.embodied.simulation import Simulation

    return Simulation(scenario, seed, interpret=interpret)


def _run_robots(*given: Any) -> TrialResult:
    from epuck_sim.trial.embodied import run_robots

    return run_robots(*given)


def _check_room_of_robots(scenario: EmbodiedScenario) -> None:
    if not _has_room(scenario):  # this check needs no compiled code
        from epuck_sim.trial.embodied import start_poses

        start_poses(scenario, [scenario.seed])


def _has_room(scenario: EmbodiedScenario) -> bool:
    """Return whether robots surely fit: apart at given poses, at most one a point of a grid, or at random places.

    Random places are found if a twentieth of all places is free for the last robot: the 10,000 draws of one
    (`start.MAX_DRAWS`) all fail once in 10 ** 222 trials. Where less is free, up to 300 robots are placed to try.
    """
    radius_cm, arena = max(kind.radius_cm for kind in scenario.group_kinds), scenario.arena.build()
    if all(group.poses for group in scenario.robots):
        places = np.array([pose[:2] for group in scenario.robots for pose in group.poses or ()])
        return all(
            clearance_cm(arena, *place) >= radius_cm
            and bool((np.hypot(*(places[:number] - place).T) >= 2 * radius_cm).all())
            for number, place in enumerate(places)
        )
    sides_cm = np.array([scenario.arena.width_cm, scenario.arena.height_cm]) - 2 * radius_cm
    taken = scenario.population * math.pi * (2 * radius_cm) ** 2
    taken += math.pi * sum((circle[2] + radius_cm) ** 2 for circle in arena.circles)
    taken += sum(float(np.prod(np.ptp(corners, axis=0) + 2 * radius_cm)) for corners in arena.polygons)
    placements, is_bare = {group.placement for group in scenario.robots}, not len(arena.circles) + len(arena.polygons)
    if placements == {"grid"}:
        points = np.maximum((sides_cm + 2 * radius_cm) // GRID_SPACING_CM - 1, 1)
        return is_bare and bool(scenario.population <= np.prod(points))
    if placements != {"random"} or (sides_cm <= 0).any():
        return False
    is_free = taken <= 0.95 * float(np.prod(sides_cm))
    return is_free or (is_bare and _is_placed(scenario.population, 2 * radius_cm, sides_cm))


def _is_placed(robots: int, diameter_cm: float, sides_cm: FloatArray) -> bool:
    """Try to place robots at random, one after the other; return whether all fit, False for too many to try."""
    draws, places = np.random.default_rng(0), np.empty((0, 2))
    while len(places) < robots <= 300:  # more take too long
        tried = draws.uniform(0, sides_cm, (1000, 2))
        are_apart = (np.hypot(*(tried[:, None] - places).T) >= diameter_cm).all(axis=0)
        if not are_apart.any():
            return False
        places = np.vstack([places, tried[are_apart][:1]])
    return len(places) == robots


def _simulate_agents(scenario: ParticleScenario, seed: int, interpret: bool) -> Simulated:
    from epuck_sim.particles.simulation import ParticleSimulation

    if interpret:
        check_interpretable(scenario)
    if scenario.start.like is not None:
        from epuck_sim.trial.embodied import start_like

        start = start_like(robots_like(scenario.start.like, f"{scenario.name}: start.like"), seed)
        scenario = scenario.model_copy(update={"start": StartSection.model_validate(start)})
    return ParticleSimulation(scenario, seed)


def _run_agents(simulation: Any, *given: Any) -> TrialResult:
    from epuck_sim.trial.particles import run_agents

    try:
        return run_agents(simulation, *given)
    finally:
        simulation.end_recording()


MODELS: dict[str, Model] = {}  # the models by the name that a scenario's key `model` gives


def register_model(name: str, model: Model) -> None:
    """Add a model: from then on scenarios with `model: NAME` are read, run, swept and stored.

    Worker processes must register it, too: do so in the module that defines the scenario's class.
    """
    SCENARIO_TYPES[name] = model.scenario
    MODELS[name] = model


register_model("embodied", Model(EmbodiedScenario, _simulate_robots, _run_robots, _check_room_of_robots))
register_model("particles", Model(ParticleScenario, _simulate_agents, _run_agents, lambda _: None))


def simulate(scenario: Scenario, seed: int, *, interpret: bool = False) -> Simulated:
    """Return a fresh simulation of a scenario, with everything compiled that it needs.

    Raises ScenarioError if controllers are to be interpreted but there are none, and whatever the model raises.
    """
    return MODELS[scenario.model].simulate(scenario, seed, interpret)


def run_trial(
    simulation: Simulated, observers: Iterable[Observer] = (), progress: Progress | None = None
) -> TrialResult:
    """Run a fresh simulation of any model to the end of its trial.

    The trial ends when the swarm is synchronised, when the scenario's condition on a measure holds, or at its limits.

    Args:
        simulation: A `Simulation`, a `ParticleSimulation`, or one of a registered model.
        observers: Each is called as `observer(event, state)` after every event; only commands change the outcome.
        progress: Called with the state of the trial now and then.

    Returns:
        The outcome, which depends on the scenario and the seed alone.

    Raises:
        TypeError: `simulation` is not a simulation.
        ValueError: The simulation has already run, so that its earlier cycles would not count; an observer is not in
            its `with` block, or has a `trial_seed`, or a `trial_scenario`, that is not the trial's.
        EpuckSimError: An observer or a measure takes steps; a measure raises an error, or returns what is no value.

    >>> from epuck_sim import Simulation
    >>> run_trial(Simulation("thesis", seed=1)).t_sync_cycles
    24
    """
    if not isinstance(getattr(simulation, "scenario", None), Scenario):
        raise TypeError(f"a trial needs a simulation, such as Simulation('thesis', seed=1), not {simulation!r}")
    observers, own = tuple(observers), simulation.scenario
    for each in observers:
        if isinstance(each, ContextDecorator) or not getattr(each, "is_open", True):
            raise ValueError("an observer needs its block: with record(...) as recorder: run_trial(..., [recorder])")
        if (kept := getattr(each, "trial_seed", simulation.seed)) != simulation.seed:
            raise ValueError(f"an observer is for seed {kept}, but the trial has seed {simulation.seed}")
        meant, start = getattr(each, "trial_scenario", own), {"start": None}
        # agents that start like robots are given their poses
        if meant is not own and meant.trial_keys | start != own.trial_keys | start:
            raise ValueError(f"an observer is for {meant}; the trial is of {own}, or has other values")
    measuring = Measuring(simulation)
    result = MODELS[own.model].run(simulation, (*observers, *measuring.at_events), progress, measuring)
    return result._replace(measures=measuring.values())


def check_interpretable(scenario: Scenario) -> None:
    """Raise ScenarioError for a scenario without controllers to interpret."""
    if not scenario.controllers:
        said = f"model: {scenario.model} has no controllers to interpret"
        raise ScenarioError(f"{scenario.name}: {said}; leave --interpret out")
