"""How a perturbation spreads: the deviation of every agent from its undisturbed twin over time (thesis Fig. 5.8)."""

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.courses import particles_of
from epuck_sim.figures.csv_tables import rounded, save_table
from epuck_sim.figures.labels import format_axis_values
from epuck_sim.figures.style import make_panels, output_paths, save_drawing
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.curves import distinguishing_axes

MOST_CYCLES = 20_000
"""That are shown."""

LEAST = 1e-4
"""Smaller deviations, in cycles, have the colour of this one."""


class Perturbation(NamedTuple):
    """What happened in one trial of a point of a sweep."""

    axes: dict[str, Any]
    cycle: FloatArray
    """(moments,) periods since the beginning."""
    deviation: FloatArray
    """(moments, agents) cycles."""


def read_perturbations(points: Sequence[PointTrials]) -> list[Perturbation]:
    """Return the first trial of each point that has any; raises EpuckSimError for another model than particles."""
    found = []
    for point in points:
        scenario = particles_of(point)
        if not point.seeds:
            continue
        cycle = np.arange(0.5, min(scenario.stop.max_cycles, MOST_CYCLES))
        course = simulate_with_twin(scenario, point.seeds[0], cycle * scenario.clocks.period_s)
        found.append(Perturbation(point.axes, cycle, course.deviation))
    return found


def save_perturbations(stem: Path, title: str, perturbations: Sequence[Perturbation]) -> list[Path]:
    """Write the maps as STEM.png and STEM.svg, and what deviates as STEM.csv; return the files."""
    files = output_paths(stem, ".png", ".svg", ".csv")
    save_drawing(draw_perturbations(title, perturbations), *files[:2])
    columns = (*perturbations[0].axes, "cycle", "agent", "deviation")
    save_table(files[2], columns, _perturbation_rows(perturbations))
    return files


def _perturbation_rows(perturbations: Sequence[Perturbation]) -> Iterator[list[Any]]:
    for each in perturbations:
        for moment, agent in np.argwhere(each.deviation > 0):
            yield [*each.axes.values(), each.cycle[moment], agent, rounded(each.deviation[moment, agent])]


def draw_perturbations(title: str, perturbations: Sequence[Perturbation]) -> Figure:
    """Return the figure: a panel for each trial, a row for each agent; white where nothing deviates (Fig. 5.8)."""
    labels = [format_axis_values(each) for each in distinguishing_axes([each.axes for each in perturbations])]
    figure, panels = make_panels(title, labels, ("time [cycles]", "agent"), (3.4, 3.6))
    norm = LogNorm(LEAST, 0.5)
    for panel, each in zip(panels, perturbations, strict=True):
        _draw_perturbation(panel, each, norm)
    colours = panels[0].collections[0]
    figure.colorbar(colours, ax=panels, label="|Δϕ| [cycles]", extend="min")
    return figure


def _draw_perturbation(panel: Axes, each: Perturbation, norm: LogNorm) -> None:
    cycles = np.arange(len(each.cycle) + 1)
    agents = np.arange(each.deviation.shape[1] + 1) - 0.5
    panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    shown = np.ma.masked_equal(each.deviation.T, 0)
    panel.pcolormesh(cycles, agents, shown, norm=norm, cmap="viridis", rasterized=True)
