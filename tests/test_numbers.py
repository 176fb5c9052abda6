"""Numbers in the docs' pages of results, and in the paper, are those of tables, and these those of tables of trials."""

import csv
import math
import re
from itertools import chain
from pathlib import Path

import numpy as np
import pytest
import yaml

from docs.figures.tables import restore, sweeps
from docs.paper.make import HERE, write_paper
from docs.trials import TABLES, read_table
from epuck_sim.arrays import FloatArray
from tests.cli.commands import call
from tests.figures.drawn import note_figures

DOCS = Path(__file__).parents[1] / "docs"
PAGES = ("results", "particle_results", "open_questions", "neighbour_change", "learning", "overhead", "trust")

NUMBER = r"-?\d[\d,]*(?:\.\d+)?(?:e[+-]\d+)?"
INTERVAL = re.compile(rf"({NUMBER})( %)? [(\[]({NUMBER})(?:\u2013| to |, )({NUMBER})[)\]]")
SPACED = re.compile(rf"({NUMBER}) +({NUMBER} to {NUMBER})")


def number(text: str) -> float:
    try:
        return float(text.replace(",", ""))
    except ValueError:
        return math.nan


def resolution(text: str) -> float:
    """Return the value of the last digit that is not a rounded zero: 0.01 of 0.25, 100 of 1,300."""
    digits = text.replace(",", "").lstrip("-")
    if "." in digits:
        return 10.0 ** -len(digits.partition(".")[2])
    return 10.0 ** (len(digits) - len(digits.rstrip("0"))) if digits.strip("0") else 1.0


@pytest.fixture(scope="module")
def known() -> FloatArray:
    """Return estimates with the ends of their intervals, (n, 3), from all tables, in which they stand side by side."""
    found: list[tuple[float, ...]] = []
    for path in chain(DOCS.glob("figures/*.csv"), DOCS.glob("*.csv")):
        with path.open(encoding="utf-8", newline="") as file:
            for row in csv.reader(file):
                numbers = [*map(number, row)]
                found += zip(numbers, numbers[1:], numbers[2:], strict=False)
    for path in DOCS.glob("figures/*.txt"):
        text = SPACED.sub(r"\1 (\2)", path.read_text(encoding="utf-8"))
        found += [(number(value), number(low), number(high)) for value, _, low, high in INTERVAL.findall(text)]
    return np.array(found)


@pytest.mark.parametrize("page", PAGES)
def test_every_interval_stands_in_a_table(page: str, known: FloatArray) -> None:
    unknown = []
    for found in INTERVAL.finditer((DOCS / f"{page}.md").read_text(encoding="utf-8")):
        value, per_cent, low, high = found.groups()
        unit = 0.01 if per_cent else 1.0
        wanted = np.array([[number(part), 0.501 * resolution(part)] for part in (value, low, high)]) * unit
        if not (abs(known - wanted[:, 0]) <= wanted[:, 1]).all(axis=1).any():
            unknown.append(found[0])
    assert not unknown


TABLE_NAMES = sorted(path.name.removesuffix(".csv.gz") for path in (TABLES / "figures").iterdir())
OTHERWISE = {
    *("fig-4-7", "neighbour-change", "pushing-synchrony", "thesis-speeds"),  # drawn by scripts of their own
    *("consensus", "consensus-robots", "fault-detection", "switching"),  # figures of measures
    *("embodiment-agents", "reflections", "k-nearest", "v-f"),  # tables alone
}
QUICK = ("fig-2-6", "kilobot-ranges")
DRAWN = [  # tables of which `plot` draws T_sync
    pytest.param(name, marks=[pytest.mark.slow] * (name not in QUICK)) for name in TABLE_NAMES if name not in OTHERWISE
]


@pytest.mark.parametrize("name", DRAWN)
def test_the_trials_of_a_table_give_the_figure(tmp_path: Path, name: str, monkeypatch) -> None:
    note_figures(monkeypatch)  # of which pictures are looked at in tests/figures
    restore(name, sweeps()[name], tmp_path / name)
    assert call("plot", tmp_path / name, "--to", tmp_path / "figure").exit_code == 0
    assert (tmp_path / "figure.csv").read_text() == (DOCS / "figures" / f"{name}.csv").read_text()


def test_every_table_has_its_sweep_and_the_paper_has_the_numbers_of_the_tables_and_is_short() -> None:
    assert set(TABLE_NAMES) <= set(sweeps())
    table = read_table("figures/neighbour-change")
    assert max(map(len, table.columns["neighbour_change"])) > 1_000_000
    text = (HERE / "paper.md").read_text(encoding="utf-8")
    assert text == write_paper(), "run `python -m docs.paper.make`"
    assert len(text.split()) <= 2500  # as ReScience C wants it
    metadata = yaml.safe_load((HERE / "metadata.yaml").read_text(encoding="utf-8"))
    assert text.startswith(f"# {metadata['title']}\n")
