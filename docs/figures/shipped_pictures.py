"""Draw the pictures of shipped scenarios, controllers and measures in the reference; `make figures` runs this script.

A scenario or controller is shown by one trial: the paths of its robots, and the raster of their flashes. A measure is
shown by a small sweep over speed: its mean, or its course over the cycles.
"""

import io
from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from PIL import Image

from epuck_sim import Simulation, figures, load_scenario, run_sweep
from epuck_sim.arena import Arena
from epuck_sim.cli.listing import list_measures
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.scenario import require_model
from epuck_sim.util.builtin import ARENAS, CONTROLLERS, builtin_files

OUT = Path(__file__).parent / "shipped"

SECONDS = 40  # length of the trials shown, in s

COLOURS = 32  # number of colours in a picture: few make small files

WIDTH_CM = 14.0  # width of the pictures of measures

PARAMETERS: dict[str, dict[str, Any]] = {"constant": {"left_cm_s": 3.0, "right_cm_s": 4.0, "ring_on": True}}
"""Parameters with which a controller is shown, where its defaults show nothing."""

SPEED = "robots.0.parameters.speed_cm_s"

ROBOTS: dict[str, Any] = {
    "sweep": {"grid": {SPEED: [0.4, 3.0, 12.8]}},
    "stop": {"order_parameter": None, "max_cycles": 40},
    "trials": 20,
}
"""The thesis's ten robots at three speeds."""

OTHERS: tuple[tuple[dict[str, Any], tuple[str, ...]], ...] = (
    ({**ROBOTS, "faults": [{"kind": "ring_dead", "robots": [3], "at_s": 50}]}, ("detection_delay", "false_alarms")),
    (
        {**ROBOTS, "arena": {"movables": [{"x_cm": 30, "y_cm": 30, "radius_cm": 5, "mass_kg": 0.1, "friction": 0.05}]}},
        ("moved",),
    ),
    (
        {
            "model": "particles",
            "sweep": {"grid": {"agents.speed_cm_s": [0.2, 20, 100]}},
            "start": {"phases": "synchronised", "displacement": 0.001},
            "stop": {"order_parameter": None, "max_cycles": 40},
            "trials": 20,
        },
        ("perturbation", "perturbation_exponent", "perturbation_growth", "perturbation_transient"),
    ),
)
"""Sweeps for measures that say nothing of the thesis's robots: keys of a scenario, and the measures."""


def draw_trial(name: str, scenario: EmbodiedScenario) -> None:
    """Draw where the robots of a scenario drive, and when they flash."""
    simulation = Simulation(scenario, seed=1)
    count = round(SECONDS / simulation.step_s)
    poses, lit = np.empty((count, scenario.population, 3)), np.empty((count, scenario.population), dtype=bool)
    for number in range(count):
        step = next(simulation)
        poses[number], lit[number] = step.poses, step.ring_on
    figure = Figure(figsize=(7, 2.8), layout="constrained")
    places, raster = figure.subplots(1, 2, width_ratios=(1, 1.7))
    draw_floor(places, scenario.arena.build())
    for robot in range(scenario.population):
        path = places.plot(*poses[:, robot, :2].T, linewidth=0.7)[0]
        places.plot(*poses[-1, robot, :2], "o", color=path.get_color(), markersize=5)
        times = np.flatnonzero(lit[:, robot]) * simulation.step_s
        raster.plot(times, np.full(len(times), robot), "|", color="#dc2828", markersize=6)
    raster.set(xlim=(0, SECONDS), ylim=(-0.7, scenario.population - 0.3), xlabel="time [s]", ylabel="robot")
    raster.set_title("ring lit", fontsize="medium")
    save(figure, name)


def draw_floor(axes: Axes, arena: Arena) -> None:
    """Draw the walls and obstacles of an arena."""
    axes.add_patch(Rectangle((0, 0), arena.width_cm, arena.height_cm, fill=False, linewidth=1.5))
    for x, y, radius in arena.circles:
        axes.add_patch(Circle((x, y), radius, facecolor="0.8"))
    for corners in arena.polygons:
        axes.add_patch(Polygon(corners, facecolor="0.8"))
    axes.set(aspect="equal", xlabel="x [cm]", ylabel="y [cm]")
    axes.set_title(f"paths of {SECONDS} s", fontsize="medium")
    axes.margins(0.02)


def draw_measures(keys: Mapping[str, Any], measures: tuple[str, ...]) -> None:
    """Run a sweep, and draw each of its measures."""
    with TemporaryDirectory() as folder:
        run_sweep(load_scenario({**keys, "measures": list(measures)}), folder)
        for name in measures:
            save(figures.plot(folder, of=name, width_cm=WIDTH_CM), f"measure-{name}")


def save(figure: Figure, name: str) -> None:
    """Write a figure as a picture of few colours."""
    drawn = io.BytesIO()
    figure.savefig(drawn, dpi=100)
    with Image.open(drawn) as picture:
        picture.convert("RGB").quantize(COLOURS).save(OUT / f"{name}.png", optimize=True)


def main() -> None:
    """Draw all pictures."""
    OUT.mkdir(exist_ok=True)
    for name in builtin_files(ARENAS):
        scenario = load_scenario(name)
        if isinstance(scenario, EmbodiedScenario):
            draw_trial(f"scenario-{name}", scenario)
    for name in builtin_files(CONTROLLERS):
        robots = [{"count": 10, "controller": name, "parameters": PARAMETERS.get(name, {})}]
        scenario = load_scenario({"robots": robots})
        draw_trial(f"controller-{name}", require_model(scenario, EmbodiedScenario, "controllers are for robots"))
    others = {name for _, measures in OTHERS for name in measures}
    for keys, measures in ((ROBOTS, tuple(set(list_measures()["measures"]) - others)), *OTHERS):
        draw_measures(keys, measures)


if __name__ == "__main__":  # workers import this file
    main()
