"""The tables of trials in docs/trials/figures give the tables beside the figures of the docs."""

from pathlib import Path

import pytest

from docs.figures.tables import restore, sweeps
from docs.trials import TABLES, read_table
from tests.cli.commands import call
from tests.figures.drawn import note_figures

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
TABLE_NAMES = sorted(path.name.removesuffix(".csv.gz") for path in (TABLES / "figures").iterdir())
OTHERWISE = {
    *("fig-4-7", "neighbour-change", "pushing-synchrony", "thesis-speeds"),  # drawn by scripts of their own
    *("consensus", "consensus-robots", "fault-detection", "switching"),  # figures of measures
    *("embodiment-agents", "reflections", "k-nearest", "v-f"),  # tables alone
}
QUICK = ("fig-2-6", "kilobot-ranges")
DRAWN = [
    pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in TABLE_NAMES if name not in OTHERWISE
]
"""Tables of which `plot` draws T_sync."""


@pytest.mark.parametrize("name", DRAWN)
def test_the_trials_of_a_table_give_the_figure(tmp_path: Path, name: str, monkeypatch) -> None:
    note_figures(monkeypatch)  # of which pictures are looked at in tests/figures
    restore(name, sweeps()[name], tmp_path / name)
    assert call("plot", tmp_path / name, "--to", tmp_path / "figure").exit_code == 0
    assert (tmp_path / "figure.csv").read_text() == (FIGURES / f"{name}.csv").read_text()


def test_a_table_may_have_long_series() -> None:
    table = read_table("figures/neighbour-change")
    assert max(map(len, table.columns["neighbour_change"])) > 1_000_000


def test_every_table_has_its_sweep() -> None:
    assert set(TABLE_NAMES) <= set(sweeps())
