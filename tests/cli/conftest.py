from pathlib import Path

import pytest
from matplotlib.figure import Figure

from tests.figures.drawn import note_figures


@pytest.fixture
def here(tmp_path, monkeypatch) -> Path:
    """Return the current folder, which is empty."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def figures_noted(monkeypatch) -> list[Figure]:
    """Return the list of figures that are saved; nothing is rendered."""
    return note_figures(monkeypatch)
