"""Starts point agents where robots start: the same positions, headings and phases, for the same seed."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.elementary import sin_cos
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import robots_like
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario


def start_like(robots: Scenario | str | Path | Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the section `start` of point agents that start like the robots of a trial.

    Args:
        robots: A scenario of robots, all of them oscillators, or what `load_scenario` takes.
        seed: The trial's seed.

    Returns:
        Positions in cm, headings, and phases from 0 to 1 of the robots before their first control step.

    Raises:
        ScenarioError: The scenario is of another model, or robots are no oscillators, or do not fit into the arena.
    """
    simulation = Simulation(robots, seed)
    step = simulation.last_step
    phases = step.phase_ms / simulation.period_ms
    if np.isnan(phases).any():
        raise ScenarioError(f"{simulation.scenario.name}: some robots have no phase; agents are all oscillators")
    x, y, heading = step.poses.T
    return {
        "phases": phases.tolist(),
        "positions_cm": np.column_stack([x, y]).tolist(),
        "headings": [[*sin_cos(angle)[::-1]] for angle in heading.tolist()],
    }


def with_start(scenario: ParticleScenario, seed: int) -> ParticleScenario:
    """Return a scenario of agents with the start that its key `start.like` stands for in the trial with a seed."""
    like = scenario.start.like
    assert like is not None
    start = start_like(robots_like(like, f"{scenario.name}: start.like"), seed)
    return scenario.model_copy(update={"start": type(scenario.start).model_validate(start)})
