"""The tables of trials in docs/trials/figures give the tables beside the figures of the docs."""

from pathlib import Path

import pytest

from docs.figures.tables import restore, sweeps
from docs.trials import TABLES
from tests.cli.commands import call

FIGURES = Path(__file__).parents[1] / "docs" / "figures"
OWN_SCRIPT = ("fig-4-7", "neighbour-change", "pushing-synchrony", "switching")
QUICK = ("fig-2-6", "kilobot-ranges")
DRAWN = [
    pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK))
    for name in sorted(sweeps())
    if (FIGURES / f"{name}.csv").exists() and name not in OWN_SCRIPT
]
"""Sweeps of which `plot` draws a figure; scripts of their own draw the others."""


@pytest.mark.parametrize("name", DRAWN)
def test_the_trials_of_a_table_give_the_figure(tmp_path: Path, name: str) -> None:
    restore(name, sweeps()[name], tmp_path / name)
    assert call("plot", tmp_path / name, "--to", tmp_path / "figure").exit_code == 0
    assert (tmp_path / "figure.csv").read_text() == (FIGURES / f"{name}.csv").read_text()


def test_every_sweep_has_its_table() -> None:
    assert {path.name.removesuffix(".csv.gz") for path in (TABLES / "figures").iterdir()} <= set(sweeps())
