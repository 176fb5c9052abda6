"""Claims about golden values: outcomes are the same to the bit as when golden.json was written (see golden.py).

The bits hold for one kind of machine and one version of each engine. Elsewhere the first second of a trial must agree
to 1e-9, before contacts and firings magnify the last digit, and the times of synchronisation as samples of one
distribution.
"""

import json

import numpy as np
import pytest
from scipy.stats import mannwhitneyu

from epuck_sim.util.builtin import ARENAS, builtin_files
from tests import golden

GOLDEN = json.loads(golden.FILE.read_text())
SAME_PLATFORM = golden.here() == GOLDEN["platform"]
EARLY = {"poses", "phases"}


@pytest.fixture(autouse=True, scope="module")
def _platform(record_testsuite_property) -> None:
    """Say which of the two comparisons this is."""
    record_testsuite_property("golden", "bits" if SAME_PLATFORM else "tolerances")
    if not SAME_PLATFORM:
        print(f"golden values are of {GOLDEN['platform']}, this is {golden.here()}: compared within tolerances")


def test_every_shipped_scenario_has_golden_values() -> None:
    assert set(GOLDEN["scenarios"]) == set(builtin_files(ARENAS))


@pytest.mark.parametrize("name", GOLDEN["scenarios"])
def test_a_shipped_scenario_runs_as_it_did(name: str) -> None:
    found, expected = golden.scenario(name), GOLDEN["scenarios"][name]
    for key in EARLY & set(expected):
        np.testing.assert_allclose(found[key], expected[key], rtol=0, atol=1e-9)
    if SAME_PLATFORM:
        assert found == expected


@pytest.mark.parametrize("name", ["thesis", "obstacles"])
def test_interpreted_controllers_give_the_golden_bits_too(name: str) -> None:
    assert golden.embodied(name, interpret=True) == golden.embodied(name)


@pytest.mark.parametrize("name", GOLDEN["outcomes"])
def test_trials_end_as_they_did(name: str) -> None:
    expected = GOLDEN["outcomes"][name]
    found = golden.outcomes(name, range(len(expected)))
    if SAME_PLATFORM:
        assert found == expected
    assert mannwhitneyu([row[0] for row in found], [row[0] for row in expected]).pvalue > 1e-3


@pytest.mark.parametrize("model", golden.SWEEPS)
def test_a_small_sweep_has_the_same_table_and_statistics(tmp_path, model: str) -> None:
    found, expected = golden.sweep(model, tmp_path / "run"), GOLDEN["sweeps"][model]
    if SAME_PLATFORM:
        assert [row["times"] for row in found] == [row["times"] for row in expected]
        statistics = [[[row["weibull_mean"] or 0, row["median"] or 0] for row in rows] for rows in (found, expected)]
        np.testing.assert_allclose(*statistics, rtol=1e-9)
    assert len(found) == len(expected)


def test_a_recording_and_a_film_hold_the_same(tmp_path) -> None:
    found = golden.pictures(tmp_path)
    assert set(found) == set(GOLDEN["pictures"])
    if SAME_PLATFORM:
        assert found == GOLDEN["pictures"]
