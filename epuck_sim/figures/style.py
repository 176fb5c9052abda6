"""Panels, legends and scales that figures have in common."""

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.figure_axes import SPEED

LOG_RATIO = 10.0
"""Ratio of the largest to the smallest value from which an axis has a logarithmic scale."""

MAX_PANELS = 64
"""Largest number of panels of a figure; one with more is neither legible nor quickly drawn."""


def make_panels(
    title: str, titles: Sequence[str], labels: tuple[str, str], size: tuple[float, float]
) -> tuple[Figure, list[Axes]]:
    """Make a figure with a panel for each title, row by row; the panels share their scales.

    Args:
        title: Title of the figure.
        titles: Titles of the panels.
        labels: Labels of the horizontal and of the vertical axis.
        size: Width and height of a panel, inches.

    Returns:
        The figure, and its panels in the order of `titles`.

    Raises:
        EpuckSimError: There are more than `MAX_PANELS` titles.
    """
    count = len(titles)
    if count > MAX_PANELS:
        raise EpuckSimError(
            f"there would be {count} panels, one for each combination of the other axes; allowed: up to {MAX_PANELS}; "
            "draw against other axes, or --form curves"
        )
    columns = count if count <= 3 else math.ceil(math.sqrt(count))
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(columns * size[0] + 1, rows * size[1] + 1), layout="constrained")
    figure.suptitle(title, parse_math=False)
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for unused in grid[count:]:
        unused.remove()
    panels = list(grid[:count])
    for panel, text in zip(panels, titles, strict=True):
        panel.tick_params(labelsize="medium" if count == 1 else "small")
        panel.set_title(text, fontsize="medium", parse_math=False)
    for panel in panels[::columns]:
        panel.set_ylabel(labels[1])
    for panel in panels[-columns:]:  # the lowest of each column, though the last row may be shorter
        panel.set_xlabel(labels[0])
        panel.tick_params(labelbottom=True)
    return figure, panels


def add_shared_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """Add a legend below the panels that names each label of any of them once."""
    handles: dict[str, Any] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        legend = figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize="small")
        disable_mathtext(legend)


def disable_mathtext(legend: Legend) -> None:
    """Show dollar signs in a legend as they are, instead of taking them for formulas."""
    for text in legend.get_texts():
        text.set_parse_math(False)


def is_logarithmic(key: str, values: FloatArray) -> bool:
    """Return whether an axis with these values, (n,), is logarithmic: they are positive, and speeds or far apart.

    >>> import numpy as np
    >>> is_logarithmic("space.side_cm", np.array([10.0, 100.0])), is_logarithmic("agents.count", np.array([5.0, 40.0]))
    (True, False)
    """
    return bool(values.min() > 0 and (key.endswith(SPEED) or values.max() / values.min() >= LOG_RATIO))


def make_logarithmic(axes: Axes, *names: str) -> None:
    """Make the named scales, of "x" and "y", logarithmic, with plain numbers as labels."""
    for name in names:
        axes.set(**{f"{name}scale": "log"})
        axis = axes.xaxis if name == "x" else axes.yaxis
        axis.set_major_locator(_LogLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: format_tick(value)))
        axis.set_minor_formatter(NullFormatter())


class _LogLocator(LogLocator):
    """Ticks at 1, 2 and 5 of each decade, or at 1 alone where these numbers would overlap."""

    axis: Axis  # matplotlib sets it

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Return the ticks between two ends."""
        has_room = 0 < vmax <= vmin * 10 ** (self.axis.get_tick_space() / 3)
        self.set_params(subs=(1, 2, 5) if has_room else (1,))
        return super().tick_values(vmin, vmax)


def format_tick(number: float) -> str:
    """Return a number as figures show it.

    >>> format_tick(0.05), format_tick(1e6)
    ('0.05', '$10^{6}$')
    """
    digits, _, exponent = f"{number:g}".partition("e")
    if not exponent:
        return digits
    factor = "" if digits == "1" else rf"{digits}\cdot"
    return f"${factor}10^{{{int(exponent)}}}$"
