"""The levels of colour of maps, of logarithms or of values themselves, and the bar that names them."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import BoundaryNorm

from epuck_sim.arrays import FloatArray
from epuck_sim.figures.scales import format_tick, is_plain
from epuck_sim.figures.style import BAR, BAR_ASPECT

COLOURS = colormaps["viridis"]

MAX_LEVELS = 20
"""Largest number of levels; more colours are hard to distinguish."""

STEPS = (0.02, 0.05, 0.1, 0.2, 0.25, 0.5, 1.0)
"""Distances from one level to the next, in decades; the smallest that needs at most `MAX_LEVELS` is taken."""


def choose_levels(values: FloatArray) -> FloatArray:
    """Return the ends of the ranges of one colour, log10 of cycles, ascending; all values, (n,), lie between them.

    >>> choose_levels(np.array([20.0, 70.0, np.nan])).tolist()
    [1.3, 1.35, 1.4, 1.45, 1.5, 1.55, 1.6, 1.65, 1.7, 1.75, 1.8, 1.85]
    """
    known = np.log10(values[~np.isnan(values)])
    low, high = (known.min(), known.max()) if len(known) else (0.0, 1.0)
    for step in STEPS:
        first, last = math.floor(low / step), math.floor(high / step) + 1
        if last - first <= MAX_LEVELS:
            break
    return np.round(np.arange(first, last + 1) * step, 9)


def choose_linear_levels(values: FloatArray) -> FloatArray:
    """Return the ends of the ranges of one colour, ascending; all values, (n,), lie between them.

    >>> choose_linear_levels(np.array([0.1, 0.32, np.nan])).round(9).tolist()
    [0.1, 0.12, 0.14, 0.16, 0.18, 0.2, 0.22, 0.24, 0.26, 0.28, 0.3, 0.32, 0.34]
    """
    known = values[~np.isnan(values)]
    low, high = (float(known.min()), float(known.max())) if len(known) else (0.0, 1.0)
    span = (high - low) or abs(high) or 1.0
    unit = 10 ** math.floor(math.log10(span / MAX_LEVELS))
    step = unit * next(factor for factor in (1, 2, 5, 10, 20) if span / (unit * factor) <= MAX_LEVELS - 2)
    return np.arange(math.floor(low / step + 1e-9), math.floor(high / step + 1e-9) + 2) * float(step)


def add_colour_bar(panels: Sequence[Axes], levels: FloatArray, label: str, *, is_log: bool) -> None:
    """Add a colour bar beside panels; if levels are logarithms, their powers of ten are its numbers."""
    figure = panels[0].get_figure()
    assert figure is not None
    bar = figure.colorbar(
        ScalarMappable(BoundaryNorm(levels, COLOURS.N), COLOURS),
        ax=list(panels),
        label=label,
        spacing="proportional",
        fraction=BAR,
        aspect=BAR_ASPECT,
    )
    if is_log:
        plain = is_plain(10 ** levels[0], 10 ** levels[-1])
        logs = _log_ticks(levels)
        bar.set_ticks(logs, labels=[format_tick(float(f"{10**each:.3g}"), plain=plain) for each in logs])
    bar.ax.minorticks_off()


def _log_ticks(levels: FloatArray) -> list[float]:
    """Return the powers of ten within levels, as logarithms, or numbers between where there is one at most."""
    powers = [float(power) for power in range(math.ceil(levels[0]), math.floor(levels[-1]) + 1)]
    if len(powers) > 1:
        return powers
    decades = range(math.floor(levels[0]), math.ceil(levels[-1]))
    between = [power + math.log10(factor) for power in decades for factor in range(1, 10)]
    within = [each for each in between if levels[0] <= each <= levels[-1]]
    return within if len(within) > 1 else levels.tolist()
