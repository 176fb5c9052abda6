"""The tables of trials in docs/trials give the page docs/replication.md, its tables and its tests."""

import csv
from pathlib import Path

import pytest

from docs.trials import DOCS, PAGE, TABLES, Tables, write_page
from epuck_sim.replication.claims import SHIPPED, read_claims
from epuck_sim.replication.page import describe_check
from epuck_sim.replication.sweeps import check_claim, needed_sweeps, sweep_scenario

CLAIMS = read_claims(SHIPPED)
SMALL_BYTES = 20_000  # size of the tables that are read in each run of the tests

SMALL = sorted(file.name.removesuffix(".csv.gz") for file in TABLES.glob("*.gz") if file.stat().st_size < SMALL_BYTES)


@pytest.mark.parametrize("sweep", SMALL)
def test_a_table_gives_the_effects_of_its_claims(sweep: str) -> None:
    tables = Tables({sweep: sweep_scenario(CLAIMS, sweep)})
    found = {
        (claim.id, describe_check(finding.check)): finding.effect.estimate.value
        for claim in CLAIMS.claims
        if claim.sweep == sweep
        for finding in check_claim(claim, tables)
        if finding.check.test != "formula"
    }
    with (DOCS / "replication-tests.csv").open(encoding="utf-8", newline="") as file:
        written = {(row["claim"], row["test"]): float(row["ours"] or "nan") for row in csv.DictReader(file)}
    assert found
    assert found == pytest.approx({key: written[key] for key in found}, rel=1e-3, nan_ok=True)


@pytest.mark.slow
def test_the_tables_give_the_page_to_the_byte(tmp_path: Path) -> None:
    write_page(CLAIMS, needed_sweeps(CLAIMS, CLAIMS.claims), tmp_path)
    for file in PAGE:
        assert (tmp_path / file.name).read_text(encoding="utf-8") == file.read_text(encoding="utf-8")
