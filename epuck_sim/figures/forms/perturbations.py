"""Maps of how a perturbation spreads: the deviation of every agent from its undisturbed twin (thesis Fig. 5.8)."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.csv_tables import Table, rounded
from epuck_sim.figures.forms.fitness import check_deviates, require_particles
from epuck_sim.figures.labels import distinguishing_labels
from epuck_sim.figures.scales import format_tick
from epuck_sim.figures.style import BAR, BAR_ASPECT, STYLE, finish, make_panels
from epuck_sim.particles.twin import simulate_with_twin
from epuck_sim.runs.reader import PointTrials

MAX_CYCLES = 20_000
"""Largest number of cycles that are shown."""

MIN_DEVIATION = 1e-4
"""Deviation, in cycles, whose colour smaller ones have, too."""

MAX_DEVIATION = 0.5
"""Largest deviation of two phases, cycles."""

LABELS = ("time [cycles]", "agent")
"""Labels of the horizontal and of the vertical axis."""

HEADING = "the first trial of each point"
"""Which trials are shown."""


class Perturbation(NamedTuple):
    """Deviations in one trial of a point of a sweep."""

    axes: dict[str, Any]
    cycle: FloatArray
    """(moments,) periods since the beginning."""
    deviation: FloatArray
    """(moments, agents) deviation from the twin, cycles."""


def read_perturbations(points: Sequence[PointTrials]) -> list[Perturbation]:
    """Simulate the first trial of each point that has any.

    Raises:
        ScenarioError: The model is another than particles.
        EpuckSimError: Nothing can deviate.
    """
    check_deviates(points)
    found = []
    for point in points:
        scenario = require_particles(point)
        if not point.seeds:
            continue
        cycle = np.arange(0.5, min(scenario.stop.max_cycles, MAX_CYCLES))
        comparison = simulate_with_twin(scenario, point.seeds[0], cycle * scenario.clocks.period_s)
        found.append(Perturbation(point.axes, cycle, comparison.deviation))
    return found


def perturbations_table(perturbations: Sequence[Perturbation]) -> Table:
    """Return a table with a row for each agent and moment with a deviation."""
    return Table((*perturbations[0].axes, "cycle", "agent", "deviation"), _perturbation_rows(perturbations))


def _perturbation_rows(perturbations: Sequence[Perturbation]) -> Iterator[list[Any]]:
    for each in perturbations:
        for moment, agent in np.argwhere(each.deviation > 0):
            yield [*each.axes.values(), each.cycle[moment], agent, rounded(each.deviation[moment, agent])]


@rc_context(STYLE)
def draw_perturbations(title: str, perturbations: Sequence[Perturbation], width_cm: float | None = None) -> Figure:
    """Draw a panel for each trial (Fig. 5.8); `plot_perturbations` says how.

    Args:
        title: Title of the figure.
        perturbations: The perturbations, at least one.
        width_cm: Width of the figure; by default that of a column, or of a page for several panels.
    """
    titles = distinguishing_labels([each.axes for each in perturbations])
    figure, panels = make_panels(f"{title}\n{HEADING}", titles, LABELS, width_cm)
    plot_perturbations(panels, perturbations)
    finish(figure, panels)
    return figure


def plot_perturbations(panels: Sequence[Axes], perturbations: Sequence[Perturbation]) -> None:
    """Draw each perturbation into a panel, a row for each agent, white where nothing deviates, and a colour bar."""
    norm = LogNorm(MIN_DEVIATION, MAX_DEVIATION)
    for panel, each in zip(panels, perturbations, strict=True):
        _draw_perturbation(panel, each, norm)
    figure = panels[0].get_figure()
    assert figure is not None
    powers = [10.0**exponent for exponent in range(-4, 0)]
    bar = figure.colorbar(
        panels[0].collections[0],
        ax=list(panels),
        label="|Δϕ| [cycles]",
        extend="min",
        fraction=BAR,
        aspect=BAR_ASPECT,
    )
    bar.set_ticks(powers, labels=[format_tick(power, plain=False) for power in powers])


def _draw_perturbation(panel: Axes, each: Perturbation, norm: LogNorm) -> None:
    cycles = np.arange(len(each.cycle) + 1)
    agents = np.arange(each.deviation.shape[1] + 1) - 0.5
    panel.yaxis.set_major_locator(MaxNLocator(integer=True))
    shown = np.ma.masked_equal(each.deviation.T, 0)
    panel.pcolormesh(cycles, agents, shown, norm=norm, cmap="viridis", rasterized=True)
