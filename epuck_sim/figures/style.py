"""Figures on paper and on the screen: their panels and scales, and every figure written twice, as PNG and as SVG."""

import math
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.statistics.curves import SPEED
from epuck_sim.util.atomic_write import atomic_write, check_target

DECADE = 10.0
"""Values that span so much have a logarithmic scale."""

MOST_PANELS = 64
"""A page with more is neither read nor quickly drawn."""


def make_panels(
    title: str, titles: Sequence[str], labels: tuple[str, str], size: tuple[float, float]
) -> tuple[Figure, list[Axes]]:
    """Return a page with a panel for each of the titles, row by row, and the panels, which share their scales.

    labels: of the horizontal and the vertical axis; size: width and height of a panel, inches.
    Raises EpuckSimError for more than `MOST_PANELS`.
    """
    count = len(titles)
    if count > MOST_PANELS:
        raise EpuckSimError(
            f"there would be {count} panels, one for each combination of the other axes; allowed: up to {MOST_PANELS}; "
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
    for panel, words in zip(panels, titles, strict=True):
        panel.tick_params(labelsize="medium" if count == 1 else "small")
        panel.set_title(words, fontsize="medium", parse_math=False)
    for panel in panels[::columns]:
        panel.set_ylabel(labels[1])
    for panel in panels[-columns:]:  # the lowest of each column, though the last row may be shorter
        panel.set_xlabel(labels[0])
        panel.tick_params(labelbottom=True)
    return figure, panels


def add_shared_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """Write below the panels what has a label in any of them, once."""
    handles: dict[str, Any] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if handles:
        legend = figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=3, fontsize="small")
        disable_mathtext(legend)


def disable_mathtext(legend: Legend) -> None:
    """Have a dollar sign in a legend be one, and not begin a formula."""
    for text in legend.get_texts():
        text.set_parse_math(False)


def is_logarithmic(key: str, values: FloatArray) -> bool:
    """Return whether an axis with these values, (n,), has a logarithmic scale: positive, and a speed or far apart.

    >>> is_logarithmic("space.side_cm", np.array([10.0, 100.0])), is_logarithmic("agents.count", np.array([5.0, 40.0]))
    (True, False)
    """
    return bool(values.min() > 0 and (key.endswith(SPEED) or values.max() / values.min() >= DECADE))


def make_logarithmic(axes: Axes, *names: str) -> None:
    """Make the scales "x" and "y", as named, logarithmic with plain numbers."""
    for name in names:
        axes.set(**{f"{name}scale": "log"})
        axis = axes.xaxis if name == "x" else axes.yaxis
        axis.set_major_locator(_LogLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: format_tick(value)))
        axis.set_minor_formatter(NullFormatter())


class _LogLocator(LogLocator):
    """Ticks at 1, 2 and 5 of each decade, or at 1 alone where so many numbers would overlap."""

    axis: Axis  # matplotlib sets it

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Return where ticks are between two ends, as matplotlib asks."""
        has_room = 0 < vmax <= vmin * 10 ** (self.axis.get_tick_space() / 3)
        self.set_params(subs=(1, 2, 5) if has_room else (1,))
        return super().tick_values(vmin, vmax)


def format_tick(number: float) -> str:
    """Return a number as figures show it.

    >>> in_figures(0.05), in_figures(1e6)
    ('0.05', '$10^{6}$')
    """
    digits, _, exponent = f"{number:g}".partition("e")
    if not exponent:
        return digits
    factor = "" if digits == "1" else rf"{digits}\cdot"
    return f"${factor}10^{{{int(exponent)}}}$"


def output_paths(stem: Path, *endings: str) -> list[Path]:
    """Return STEM with each of the endings; raises EpuckSimError where one of these files cannot be written."""
    if stem.name in ("", ".."):
        raise EpuckSimError(f"{stem}: is no file's name; give FOLDER/NAME, to which .png and so on are added")
    files = [stem.with_name(f"{stem.name}{ending}") for ending in endings]
    for file in files:
        check_target(file)
    return files


def save_drawing(figure: Figure, png: Path, svg: Path) -> None:
    """Write a figure into two files; nothing in them tells when: the same results give the same files."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # of a name in letters that the font lacks
        with atomic_write(png) as part:
            figure.savefig(part, format="png", dpi=120)
        with atomic_write(svg) as part, rc_context({"svg.hashsalt": "epuck-sim"}):
            figure.savefig(part, format="svg", metadata={"Date": None})
