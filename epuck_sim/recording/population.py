"""What recordings need to know of a scenario, whatever its model."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from epuck_sim import epuck
from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import FloatArray
from epuck_sim.errors import RecordingError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import Scenario

FRAMES = 20
"""Rows in a nominal period of point-like agents, beside those at which some fire."""

PATH_S = 10.0
"""So long before the moment at which robots are drawn do their paths begin."""

PATH_CYCLES = 3
"""And those of agents."""

AGENTS_A_SIDE = 60
"""An agent is drawn as a disc, of which so many would cover a side in a row, half over each other."""

SHORTEST_S = 1e-6
"""Times are whole nanoseconds: of a shorter period, few."""


class Population(NamedTuple):
    """Those that are recorded: robots, or point-like agents."""

    noun: str
    """What one of them is called."""
    moment: str
    """What a row is called."""
    size: int
    """How many they are."""
    radius_cm: float
    """Of the disc that is drawn for each."""
    arena: Arena
    """Of agents: their square, the side on which a cube stands, or a segment of no height."""
    is_cyclic: bool
    period_ms: FloatArray
    """(size,) nominal, of the oscillators; NaN for who has none."""
    reference: int
    rows_per_s: float
    """At least so many rows are recorded of a simulated second."""
    path_s: float
    """So long before the moment at which all are drawn on a page do their paths begin."""


def population_of(scenario: Scenario) -> Population:
    """Return a scenario's subject; raises RecordingError for a model, or a period, of which there are no recordings."""
    if scenario.model not in POPULATIONS:
        raise RecordingError(f"{scenario.name}: model: {scenario.model} cannot be recorded")
    return POPULATIONS[scenario.model](scenario)


def _robots(scenario: EmbodiedScenario) -> Population:
    periods = [1000 * group.parameters.get("period_s", math.nan) for group in scenario.robots]
    return Population(
        noun="robot",
        moment="step",
        size=scenario.robot_count,
        radius_cm=epuck.RADIUS_CM,
        arena=scenario.arena.build(),
        is_cyclic=False,
        period_ms=np.repeat(periods, [group.count for group in scenario.robots]),
        reference=scenario.stop.reference_robot,
        rows_per_s=scenario.timing.control_hz,
        path_s=PATH_S,
    )


def _agents(scenario: ParticleScenario) -> Population:
    side_cm, period_s = scenario.space.side_cm, scenario.clocks.period_s
    if period_s < SHORTEST_S:
        raise RecordingError(
            f"{scenario.name}: clocks.period_s is {period_s:g}; recordings, whose times are whole nanoseconds, are of "
            f"{SHORTEST_S:g} or longer"
        )
    return Population(
        noun="agent",
        moment="moment",
        size=scenario.agents.count,
        radius_cm=side_cm / AGENTS_A_SIDE,
        arena=make_arena(side_cm, side_cm if scenario.space.dimensions > 1 else 0.0, (), ()),
        is_cyclic=scenario.space.boundary == "cyclic",
        period_ms=np.full(scenario.agents.count, 1000 * period_s),
        reference=scenario.stop.reference,
        rows_per_s=FRAMES / period_s,
        path_s=PATH_CYCLES * period_s,
    )


POPULATIONS: dict[str, Callable[[Any], Population]] = {"embodied": _robots, "particles": _agents}
"""What is recorded, by model."""
