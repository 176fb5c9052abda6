"""The tables of trials in docs/trials give the tests of docs/replication-tests.csv."""

import csv

import pytest

from docs.trials import TABLES, TESTS, find, table_of_tests
from epuck_sim.replication.claims import SHIPPED, read_claims
from epuck_sim.replication.page import describe_check
from epuck_sim.replication.sweeps import Version, sweep_scenario

CLAIMS = read_claims(SHIPPED)
SMALL_BYTES = 20_000
"""Size of the tables that are read in each run of the tests."""

SMALL = sorted(file.name.removesuffix(".csv.gz") for file in TABLES.iterdir() if file.stat().st_size < SMALL_BYTES)


@pytest.mark.parametrize("sweep", SMALL)
def test_a_table_gives_the_effects_of_its_claims(sweep: str) -> None:
    scenarios = {sweep: sweep_scenario(CLAIMS, sweep, Version.QUICK)}
    found = {
        (claim.id, describe_check(check)): find(check, sweep, scenarios).effect.estimate.value
        for claim in CLAIMS.claims
        if claim.sweep == sweep
        for check in claim.checks
        if check.test != "formula"
    }
    with TESTS.open(encoding="utf-8", newline="") as file:
        written = {(row["claim"], row["test"]): float(row["ours"] or "nan") for row in csv.DictReader(file)}
    assert found
    assert found == pytest.approx({key: written[key] for key in found}, rel=1e-3, nan_ok=True)


@pytest.mark.slow
def test_the_tables_give_all_tests_to_the_byte() -> None:
    assert table_of_tests(CLAIMS) == TESTS.read_text(encoding="utf-8")
