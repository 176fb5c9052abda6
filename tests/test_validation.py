"""The comparison with other simulators finds what differs and nothing else; at a tenth of its points, nothing."""

import math

import numpy as np
import pytest

from docs import validation
from docs.validation import LEVEL, PEERS, compare_point, compare_table, findings, main
from epuck_sim.statistics.measured import Measured, cut

LIMIT = 400.0


def sample(mean: float, trials: int, seed: int, limit: float = math.inf) -> Measured:
    times = np.ceil(mean * np.random.default_rng(seed).weibull(1.3, trials))
    return cut(Measured(times, np.ones(trials, bool), math.inf, seed), limit)


def table(factor: float, points: int = 60, limit: float = math.inf, odd: float = 1.0):
    """Return the comparison of samples whose means differ by a factor, and at the last point by another one."""
    factors = [factor] * (points - 1) + [factor * odd]
    compared = [
        compare_point({"V": n}, sample(100, 60, n, limit), sample(100 * each, 60, 1000 + n, limit))
        for n, each in enumerate(factors)
    ]
    return compare_table(PEERS[0], compared)


def test_equal_distributions_are_found_equal_their_z_is_normal_and_trials_at_the_limit_say_nothing() -> None:
    for limit in (math.inf, LIMIT / 4):
        overall = table(1, limit=limit)
        assert min(findings([overall])) > LEVEL
        assert overall.ratio.low < 1 < overall.ratio.high
    z = np.array([compare_point({}, sample(4, 15, n), sample(4, 20, 5000 + n)).z for n in range(400)])
    assert z.mean() == pytest.approx(0, abs=0.1)
    assert (z**2).mean() == pytest.approx(1, abs=0.15)
    same, other = sample(1e6, 20, 1, LIMIT), compare_point({}, sample(9, 9, 1), sample(9, 9, 2))
    assert compare_table(PEERS[0], [compare_point({}, same, same), other]).compared == 1


def test_a_shift_of_all_points_is_found_that_no_single_point_shows_and_one_point_that_differs() -> None:
    single, whole = findings([table(1.12)])
    assert single > LEVEL
    assert whole < LEVEL
    assert table(1.12).ratio.value == pytest.approx(1.12, abs=0.05)
    for limit in (math.inf, LIMIT / 4):
        assert findings([table(1, limit=limit, odd=3.0)])[0] < LEVEL
        assert ("log-rank" in table(1, 2, limit).points[0].p_values) == (limit < math.inf)


def test_tables_have_the_points_and_trials_that_their_page_names() -> None:
    assert [len(peer.read()) for peer in PEERS] == [72, 42, 213]
    assert [sum(map(len, peer.read())) for peer in PEERS] == [14_400, 630, 12_460]
    for peer in PEERS:
        for rows in peer.read():
            limit = peer.axes(rows[0])[validation.LIMIT]
            assert all(float(row["T_sync"]) == limit for row in rows if row["censored"] == "1")


@pytest.mark.slow
def test_nothing_is_found_at_a_tenth_of_the_points(tmp_path) -> None:
    assert main([str(tmp_path), "--every", "10"]) == 0
    assert "**Nothing is found**" in (tmp_path / "validation.md").read_text()
    assert (tmp_path / "figures/validation.png").stat().st_size > 10_000
