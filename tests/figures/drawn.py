"""What the tests of figures share: a figure that is laid out without being rendered, and the rows of a table."""

from pathlib import Path

from matplotlib.figure import Figure

from epuck_sim.figures.csv_tables import Table, save_table
from tests.runs.made_folders import rows


def laid_out(figure: Figure) -> Figure:
    """Return a figure after everything in it has its place, and every text has been read."""
    figure.draw_without_rendering()
    return figure


def written(folder: Path, table: Table) -> list[dict[str, str]]:
    """Return the rows of a table as they are in its CSV file."""
    save_table(folder / "table.csv", *table)
    return rows(folder / "table.csv")
