"""What the tests of figures share: a figure that is laid out without being rendered, and the rows of a table."""

import csv
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from matplotlib.figure import Figure

from tests.runs.made_folders import six_digits


def laid_out(figure: Figure) -> Figure:
    """Return a figure after everything in it has its place, and every text has been read."""
    figure.draw_without_rendering()
    return figure


def note_figures(monkeypatch: pytest.MonkeyPatch) -> list[Figure]:
    """Return the list of figures that are saved into files from now on; their pictures are empty files."""
    figures: list[Figure] = []
    render = Figure.savefig

    def note(figure: Figure, part: Path | StringIO, **settings) -> None:
        if isinstance(part, StringIO):  # a part of a page
            render(figure, part, **settings)
            return
        figures.append(figure)
        part.touch()

    monkeypatch.setattr(Figure, "savefig", note)
    return figures


def legend_texts(figure: Figure) -> list[str]:
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def written(table: str) -> list[dict[str, str]]:
    return list(csv.DictReader(StringIO(table)))


def in_csv(*cells: Any) -> list[str]:
    return [cell if isinstance(cell, str) else six_digits(cell) for cell in cells]
