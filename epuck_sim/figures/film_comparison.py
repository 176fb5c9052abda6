"""The figure of a film compared with simulated trials: a panel for each quantity, and the table of what it shows."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.display.table import csv_cell
from epuck_sim.figures.saving import Table, parse_target, save_figure
from epuck_sim.overhead.compare import QuantityComparison

ACROSS = 3
"""Number of panels in a row."""

TRIALS, FILM = "0.6", "#d62728"


def save_comparison_figure(path: Path, rows: Sequence[QuantityComparison]) -> list[Path]:
    """Draw a film beside trials, and write a table of all values; raise EpuckSimError if a file cannot be written."""
    return save_figure(parse_target(path), lambda: draw_comparison(rows), {".csv": comparison_table(rows)})


def comparison_table(rows: Sequence[QuantityComparison]) -> Table:
    """Return a table with a row for each quantity and trial, and one, whose trial is `film`, for the film.

    The column `status` says why there is no value: it is `beyond` the film's end, or `unknown`.
    """
    cells: list[list[Any]] = []
    for row in rows:
        values = [("film", row.film), *enumerate(row.trials.tolist())]
        cells += [
            [row.quantity.name, row.quantity.unit, trial, csv_cell(value), _status(value)] for trial, value in values
        ]
    return Table(("quantity", "unit", "trial", "value", "status"), cells)


def _status(value: float) -> str:
    if math.isnan(value):
        return "unknown"
    return "beyond" if math.isinf(value) else "known"


def draw_comparison(rows: Sequence[QuantityComparison]) -> Figure:
    """Return the figure: a histogram of the trials for each quantity that is known, and a line where the film is."""
    rows = [row for row in rows if not math.isnan(row.percentile) and np.isfinite(row.trials).any()]
    down = max(math.ceil(len(rows) / ACROSS), 1)
    figure = Figure(figsize=(3.6 * ACROSS, 2.3 * down), dpi=300, layout="constrained")
    panels = figure.subplots(down, ACROSS, squeeze=False).ravel()
    for panel, row in zip(panels, rows, strict=False):
        _draw_quantity(panel, row)
    for panel in panels[len(rows) :]:
        panel.set_axis_off()
    return figure


def _draw_quantity(panel: Axes, row: QuantityComparison) -> None:
    values = row.trials[np.isfinite(row.trials)]
    spread = float(np.ptp(np.append(values, row.film if math.isfinite(row.film) else values[0])))
    edges = 12 if spread > 0 else [values[0] - 0.5, values[0] + 0.5]
    panel.hist(values, edges, color=TRIALS)
    notes = [f"{row.beyond} trials beyond the film's end"] * (row.beyond > 0)
    if math.isfinite(row.film):
        panel.axvline(row.film, color=FILM, linewidth=2)
    else:
        notes.append("film: beyond its end")
    notes.append(f"film at {row.percentile:.0f} %")
    panel.set_title("\n".join(notes), fontsize="small", loc="left")
    panel.set(xlabel=f"{row.quantity.name} ({row.quantity.unit})", ylabel="trials")
