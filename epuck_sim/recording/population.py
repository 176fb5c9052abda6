"""What recordings need to know of a scenario, whatever its model."""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arena import Arena, make_arena
from epuck_sim.arrays import FloatArray
from epuck_sim.errors import RecordingError
from epuck_sim.scenario.embodied import EmbodiedScenario, arena_entries, largest_cm
from epuck_sim.scenario.particles import ParticleScenario

ROWS_PER_PERIOD = 20
"""Regular rows in a nominal period of point-like agents; there are further rows at the instants at which some fire."""

PATH_S = 10.0
"""Length of the drawn paths of robots in seconds."""

PATH_CYCLES = 3
"""Length of the drawn paths of agents in nominal periods."""

SIDE_IN_RADII = 60
"""Side of the space of agents, in radii of the disc that is drawn for each."""

SHORTEST_S = 1e-6
"""Shortest period that can be recorded, in seconds: recordings store whole nanoseconds."""


class Population(NamedTuple):
    """The robots, or point-like agents, of a scenario."""

    noun: str
    """What one of them is called: robot or agent."""
    moment: str
    """What a row is called: step or moment."""
    size: int
    """Number of robots or agents."""
    radii_cm: FloatArray
    """(size,) radius of the disc that is drawn for each, cm."""
    arena: Arena
    """Arena of the robots at the start; for agents their square, the base of their cube, or a segment of height 0."""
    largest_cm: tuple[float, float]
    """Largest width and height that the arena has."""
    arena_changes: bool
    """Whether its walls or obstacles may change."""
    is_cyclic: bool
    """Whether the space is cyclic."""
    period_ms: FloatArray
    """(size,) nominal periods of the oscillators, ms; NaN for a robot that is none."""
    reference: int
    """Number of the reference robot or agent."""
    rows_per_s: float
    """Fewest rows that are recorded of a simulated second."""
    path_s: float
    """Length of the drawn paths in seconds."""


def robot_population(scenario: EmbodiedScenario) -> Population:
    """Return the robots of a scenario."""
    periods = [1000 * group.parameters.get("period_s", math.nan) for group in scenario.robots]
    return Population(
        noun="robot",
        moment="step",
        size=scenario.robot_count,
        radii_cm=np.array([kind.radius_cm for kind in scenario.robot_kinds]),
        arena=scenario.arena.build(),
        largest_cm=largest_cm(scenario),
        arena_changes=bool(arena_entries(scenario)),
        is_cyclic=False,
        period_ms=np.repeat(periods, [group.count for group in scenario.robots]),
        reference=scenario.stop.reference_robot,
        rows_per_s=scenario.timing.control_hz,
        path_s=PATH_S,
    )


def agent_population(scenario: ParticleScenario) -> Population:
    """Return the point-like agents of a scenario; raise RecordingError if their period is too short to be recorded."""
    side_cm, period_s = scenario.space.side_cm, scenario.clocks.period_s
    if period_s < SHORTEST_S:
        raise RecordingError(
            f"{scenario.name}: clocks.period_s is {period_s:g}, which is too short for a recording, whose times are "
            f"whole nanoseconds; allowed: {SHORTEST_S:g} or longer"
        )
    height_cm = side_cm if scenario.space.dimensions > 1 else 0.0
    return Population(
        noun="agent",
        moment="moment",
        size=scenario.agents.count,
        radii_cm=np.full(scenario.agents.count, side_cm / SIDE_IN_RADII),
        arena=make_arena(side_cm, height_cm, (), ()),
        largest_cm=(side_cm, height_cm),
        arena_changes=False,
        is_cyclic=scenario.space.boundary == "cyclic",
        period_ms=np.full(scenario.agents.count, 1000 * period_s),
        reference=scenario.stop.reference,
        rows_per_s=ROWS_PER_PERIOD / period_s,
        path_s=PATH_CYCLES * period_s,
    )
