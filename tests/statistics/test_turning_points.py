"""The minimum and the peak of a measure along an axis: where they are known, and where there is only noise."""

import numpy as np
import pytest

from epuck_sim.statistics.extrema import find_minimum, find_peak, most_prominent, smooth_logs
from epuck_sim.statistics.fit import fit_measure
from tests.runs.made_folders import COUPLING, SPEED, store_measured, sweep

X = np.array([0.1, 0.2, 0.4, 0.8, 1.5, 3.0, 6.0, 12.0])
LOG_X = np.log10(X)


def curve(logs, noise=0.01, seed=0, resamples=1000):
    """Return the smoother of a curve whose logarithms are known, with noisy resamples."""
    random = np.random.default_rng(seed)
    observed = logs + random.normal(0, noise, len(logs))
    return smooth_logs(X, np.exp(observed), np.exp(observed + random.normal(0, noise, (resamples, len(logs)))))


def test_the_peak_of_a_parabola_is_found_and_there_is_no_minimum():
    fit = curve(2 - (LOG_X - 0.3) ** 2)
    peak = find_peak(fit)
    (at, height) = (place.estimate for place in peak.places)
    assert at.value == pytest.approx(10**0.3, rel=0.05)
    assert height.value == pytest.approx(np.e**2, rel=0.02)
    assert at.low < 10**0.3 < at.high
    assert height.low < np.e**2 < height.high
    assert not find_minimum(fit).is_found
    lost = peak.resampled.copy()
    lost[round(0.94 * len(lost)) :] = np.nan
    assert peak._replace(resampled=lost).places == []


def test_a_curve_with_both_has_both_and_its_inverse_has_them_turned_over():
    logs = -4 * (LOG_X**3 / 3 - 0.15 * LOG_X**2 - 0.18 * LOG_X)  # minimum at 10 ** -0.3, peak at 10 ** 0.6
    for fit, minimum_at, peak_at in ((curve(logs), -0.3, 0.6), (curve(-logs), 0.6, -0.3)):
        for found, place in ((find_minimum(fit), minimum_at), (find_peak(fit), peak_at)):
            at, value = (each.estimate for each in found.places)
            assert at.value == pytest.approx(10**place, rel=0.05)
            assert value.low < value.value < value.high


@pytest.mark.parametrize("slope", [-1.0, 1.0])
def test_a_steep_curve_has_neither(slope):
    for found in (find_peak(curve(slope * LOG_X)), find_minimum(curve(slope * LOG_X))):
        assert (found.p_value, found.places) == (1, [])
        assert np.isnan(found.values).all()


@pytest.mark.parametrize("shape", [lambda x: 0 * x, lambda x: np.minimum(x, 0), lambda x: -np.clip(x, -0.5, 0.5)])
def test_noise_makes_few_of_them(shape):
    fits = [curve(shape(LOG_X), noise=0.2, seed=seed, resamples=200) for seed in range(60)]
    assert np.mean([find(fit).is_found for fit in fits for find in (find_minimum, find_peak)]) < 0.08


def test_the_most_prominent_peak_is_not_always_the_highest():
    curves = np.array([[5, 6, 5.9, 0, 3, 0.5, 4], [0, 1, 2, 3, 4, 5, 6], [3, 1, 2, 1, 0, 0, 0]], float)
    peaks, prominences, _ = most_prominent(np.arange(7.0), curves)
    assert prominences.tolist() == [2.5, 0.0, 1.0]
    assert peaks[[0, 2]] == pytest.approx(np.array([[4, np.exp(3)], [2, np.exp(2)]]))


def folder_of(path, law, measures=("near_walls",), axis=SPEED, trials=30, **grid):
    scenario = sweep({axis: X.tolist(), **grid}, measures=list(measures))
    random = np.random.default_rng(4)

    def values(point):
        return [law(point.axes[axis], random) for _ in range(trials)]

    return store_measured(path / "run", scenario, values)


def bump(x, random):
    return float(np.exp(1 - (np.log10(x) - 0.3) ** 2 + random.normal(0, 0.05)))


def test_a_folder_has_one_for_each_curve(tmp_path):
    folder = folder_of(tmp_path, bump, **{COUPLING: [0.1, 0.2]})
    fits = fit_measure(folder, "near_walls")
    assert [fit.axes for fit in fits] == [{COUPLING: 0.1}, {COUPLING: 0.2}]
    for fit in fits:
        assert (fit.axis, fit.of, fit.statistic, fit.reason) == (SPEED, "near_walls", "mean", "")
        assert fit.peak.places[0].estimate.value == pytest.approx(10**0.3, rel=0.1)
        assert not fit.minimum.is_found


@pytest.mark.parametrize(
    ("law", "trials", "said"),
    [
        (lambda x, _: x - 1, 30, "not all of its values are positive"),
        (lambda x, random: bool(random.random() < x / 20), 30, "it is a truth value"),
        (bump, 19, "fewer than 20 trials with a value at 8 of 8 points, which noise alone makes rise; --trials 20"),
        (lambda x, random: bump(x, random) if x > 1 else None, 30, "fewer than 20 trials with a value at 4 of 8"),
    ],
)
def test_where_it_makes_no_sense_it_says_why(law, trials, said, tmp_path):
    (fit,) = fit_measure(folder_of(tmp_path, law, trials=trials), "near_walls")
    assert (fit.minimum, fit.peak) == (None, None)
    assert said in fit.reason
