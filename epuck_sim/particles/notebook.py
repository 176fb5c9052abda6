"""How simulations of point agents show themselves in notebooks."""

from typing import TYPE_CHECKING

import numpy as np

from epuck_sim.arena import make_arena
from epuck_sim.display.arena_svg import draw_arena
from epuck_sim.display.html import element, to_html

if TYPE_CHECKING:  # a simulation shows itself by this module
    from epuck_sim.particles.simulation import ParticleSimulation

SIDE_IN_RADII = 60
"""Side of the space of agents, in radii of the disc that is drawn for each."""

GLOW = 0.075
"""Share of a period for which an agent that has fired is drawn lit; the flash of a robot lasts as long."""


def show_simulation(simulation: "ParticleSimulation") -> str:
    """Return the space with the agents as HTML; a cube is seen from above."""
    scenario = simulation.scenario
    side_cm, dimensions = scenario.space.side_cm, scenario.space.dimensions
    moving = (simulation.positions(), simulation.headings())
    positions, headings = (np.pad(array, ((0, 0), (0, 1)))[:, :2] for array in moving)  # a segment has no y
    poses = np.column_stack([positions, np.arctan2(headings[:, 1], headings[:, 0])])
    is_lit = (simulation.phases() < GLOW) & (simulation.firings > 0)
    arena = make_arena(side_cm, side_cm if dimensions > 1 else 0.0, (), ())
    seen = ", a cube seen from above" if dimensions == 3 else ""
    state = f", seed {simulation.seed}: {simulation.time_s:.2f} s, {simulation.cycles} cycles{seen}"
    drawn = draw_arena(arena, poses, side_cm / SIDE_IN_RADII, is_lit)
    return to_html(element("p", element("b", scenario.name), state), drawn)
