import pytest
from matplotlib.figure import Figure

from tests.figures.drawn import note_figures


@pytest.fixture
def figures_noted(monkeypatch) -> list[Figure]:
    """Return the list of figures that are saved; nothing is rendered."""
    return note_figures(monkeypatch)
