"""Claims about censored synchronisation times: Appendix A step by step, lifelines, scipy and known distributions."""

import math
from fractions import Fraction

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings, strategies as st
from lifelines import KaplanMeierFitter, LogNormalAFTFitter
from lifelines.utils import median_survival_times
from scipy import stats
from scipy.optimize import curve_fit

from epuck_sim.statistics import survival
from epuck_sim.statistics.survival import confidence_interval, make_curve, median_time, weibull_mean, weibull_resamples

whole_cycles = st.integers(1, 12) | st.integers(0, 10**7)
trials = st.lists(st.tuples(whole_cycles, st.booleans()), min_size=1, max_size=40).map(
    lambda pairs: (np.array([t for t, _ in pairs], float), np.array([o for _, o in pairs]))
)


def appendix_a(times, observed):
    """Return steps 1 to 5: each uncensored trial's time and R, as a fraction, events before censorings."""
    points, r, running = [], Fraction(1), len(times)
    for time, is_censored in sorted(zip(times.tolist(), (~observed).tolist(), strict=True)):
        if not is_censored:
            r *= Fraction(running - 1, running)
            points.append((time, r))
        running -= 1
    return points


def weibull_trials(seed, n=200, scale=50.0, shape=1.2, censored=0.0, whole=False):
    """Return trials of a Weibull distribution, all censored at the time that this part of them would outlast."""
    limit = scale * (-math.log(censored)) ** (1 / shape) if censored else math.inf
    times = scale * np.random.default_rng(seed).weibull(shape, n)
    if whole:
        times, limit = np.ceil(times), np.ceil(limit)
    return np.minimum(times, limit), times <= limit


@given(trials)
def test_the_estimate_is_appendix_a_done_trial_by_trial(given_trials):
    curve = make_curve(*given_trials)
    expected = dict(appendix_a(*given_trials))  # of tied trials the last one's R
    assert curve.times.tolist() == list(expected)
    assert curve.survival[0, 1:] == pytest.approx([float(r) for r in expected.values()], abs=1e-12)


@given(trials)
def test_the_median_is_halfway_from_the_time_when_half_of_the_trials_are_left_to_that_when_fewer_are(given_trials):
    curve = dict(appendix_a(*given_trials)).items()
    halved = min((time for time, r in curve if r <= Fraction(1, 2)), default=math.inf)
    passed = min((time for time, r in curve if r < Fraction(1, 2)), default=math.inf)
    median, lower, upper = median_time(*given_trials)
    assert median == (halved + passed) / 2
    assert lower <= median <= upper


@pytest.mark.parametrize("seed", range(6))
def test_the_median_and_its_interval_are_lifelines(seed):
    """Whole cycles have ties, and are censored at random times and at a limit."""
    random, n = np.random.default_rng(seed), [21, 41, 81][seed % 3]
    ends, limits = np.ceil(30 * random.weibull(1.3, n)), np.minimum(random.integers(1, 80, n), 50)
    times, observed = np.minimum(ends, limits).astype(float), ends <= limits
    fitter = KaplanMeierFitter().fit(times, observed)
    interval = median_survival_times(fitter.confidence_interval_).to_numpy().ravel()
    assert median_time(times, observed) == pytest.approx((fitter.median_survival_time_, *interval))


def test_half_of_the_trials_is_half_however_r_is_rounded_and_what_is_not_reached_is_infinite():
    for n in range(2, 200, 2):
        assert median_time(np.arange(n) + 1, np.ones(n, bool))[0] == (n + 1) / 2
    times, observed = np.array([10, 20, 30, 99, 99, 99, 99.0]), np.arange(7) < 3
    assert median_time(times, observed) == (math.inf, 10, math.inf)
    assert median_time(times, ~observed)[0] == 99
    assert median_time([99], [False]) == (math.inf, math.inf, math.inf)


@given(trials, st.integers(0, 60))
def test_the_restricted_mean_is_the_sum_of_what_is_left_in_each_cycle(given_trials, horizon):
    times, observed = given_trials
    curve = appendix_a(times, observed)
    left = [min([r for time, r in curve if time <= cycle], default=1) for cycle in range(horizon)]
    found = survival.restricted_means(make_curve(times, observed), horizon)[0]
    assert found == pytest.approx(float(sum(left)), rel=1e-12)


def fit_weibull(times, observed) -> tuple[float, float] | None:
    """Return scale and shape of the Weibull distribution that is nearest to the Kaplan-Meier estimate, if one fits."""
    lines = survival.local_fits(make_curve(times, observed))
    if not len(lines):
        return None
    offset, shape = lines[0].tolist()
    with np.errstate(over="ignore"):
        scale = float(np.exp(-offset / shape))
    return (scale, shape) if scale < math.inf else None


def squares(scale, shape, times, observed):
    """Return the sums of squares of distributions over all uncensored trials, one point each."""
    time, r = np.array(appendix_a(times, observed), float).T
    with np.errstate(over="ignore"):
        return ((np.exp(-((time / scale[..., None]) ** shape[..., None])) - r) ** 2).sum(axis=-1)


@pytest.mark.parametrize("censored", [0, 0.3, 0.8])
@pytest.mark.parametrize("shape", [0.4, 1.2, 6])
@pytest.mark.parametrize("whole", [False, True])
def test_the_fit_is_scipys_on_every_uncensored_trials_point(censored, shape, whole):
    times, observed = weibull_trials(1, 150, 50, shape, censored, whole)
    time, r = np.array(appendix_a(times, observed), float).T
    assert (len(np.unique(time)) < len(time)) == whole  # tied trials are several points

    def cdf(t, log_scale, log_shape):
        return 1 - np.exp(-((t / math.exp(log_scale)) ** math.exp(log_shape)))

    precise = {"ftol": 1e-14, "xtol": 1e-14, "gtol": 1e-14}
    logs, _ = curve_fit(cdf, time, 1 - r, p0=(math.log(50), math.log(shape)), **precise)
    assert fit_weibull(times, observed) == pytest.approx(np.exp(logs), rel=1e-5)


@pytest.mark.parametrize(
    "times",
    [
        [4, *range(1020, 1070, 3)],
        [2, 9, 1009, 1041, 1057, 1061, 1078],
        [25, *[38] * 5, 55, 58],
        [1, 1, 2, 2, 2, 3, 10**5, 10**6, 10**7],
        [10**6, 10**6 + 1, 10**6 + 1, 10**6 + 2, 10**6 + 2, 10**6 + 3],
        [1, 3, 3, 3, 4],  # in a flat valley, which Gauss and Newton's steps do not get out of
        [1024, 1042, 1048, 1048, 1061, 1061, 1063, 1063, 1092, 1092, 1095],
    ],
)
@pytest.mark.parametrize("censored", [0, 3])
def test_no_distribution_of_a_wide_grid_is_nearer_than_the_fit(times, censored):
    # one or a few trials far from all others make local minima, which a single start may end in
    times = np.sort(np.array(times, float))
    observed = np.arange(len(times)) < len(times) - censored
    fit = fit_weibull(times, observed)
    gaps = np.diff(np.unique(times[observed]))
    scales = (np.unique(times)[:, None] * np.exp(np.linspace(-1, 1, 41) * gaps.min() / times.max())).ravel()
    scales = np.concatenate([scales, np.geomspace(times.min() / 3, times.max() * 10, 100)])
    shapes = np.geomspace(0.02, 20 * times.max() / gaps.min(), 60)
    grid = squares(scales[:, None], shapes, times, observed)
    assert squares(*np.array(fit), times, observed) <= grid.min()


@given(trials)
@settings(max_examples=30)
def test_there_is_a_fit_just_if_two_event_times_leave_some_trials(given_trials):
    times, observed = given_trials
    n, events = len(times), np.unique(times[observed & (times > 0)])
    if len(events) and (times == events[-1]).sum() == 1 and times.max() == events[-1]:
        events = events[:-1]  # a lone last trial: F = 1, which no Weibull distribution reaches
    with np.errstate(all="raise", under="ignore"):
        fit, mean = fit_weibull(times, observed), weibull_mean(times, observed)
    assert (fit is not None) == (len(events) >= 2)
    if fit is not None:
        assert 0 < min(fit) <= max(fit) < math.inf
    if fit is None or observed.mean() < survival.MIN_UNCENSORED:
        assert math.isnan(mean) or (observed.all() and np.ptp(times) == 0 and mean == times[0]), n
    else:
        assert mean == pytest.approx(stats.weibull_min.mean(fit[1], scale=fit[0]), rel=1e-6)


@pytest.mark.parametrize("tens", [2, 29])
def test_the_mean_is_determined_with_a_tenth_of_the_trials_uncensored_and_not_with_fewer(tens):
    n = 10 * tens
    times = np.minimum(np.arange(n) + 1.0, tens)
    assert math.isfinite(weibull_mean(times, np.arange(n) < tens))
    assert math.isnan(weibull_mean(times, np.arange(n) < tens - 1))
    assert math.isnan(weibull_mean(np.append(times, tens), np.arange(n + 1) < tens))


def means_one_by_one(times, observed, resamples, seed):
    """Return what weibull_resamples should, by a fit with many starts of each resample."""
    n, order = len(times), np.lexsort((~observed, times))
    draws = order[np.random.Generator(np.random.PCG64(seed)).integers(n, size=(resamples, n))]
    means = np.array([weibull_mean(times[draw], observed[draw]) for draw in draws])
    means[np.isnan(means) & ~observed[draws].all(axis=1)] = math.inf
    return means


@pytest.mark.parametrize("censored", [0, 0.9])
def test_bootstrap_means_are_the_means_of_trials_drawn_with_replacement(censored):
    given_trials = weibull_trials(4, 400, censored=censored, whole=True)
    expected = means_one_by_one(*given_trials, 250, seed=11)  # several blocks
    assert np.isinf(expected).any() == (censored == 0.9)
    np.testing.assert_allclose(weibull_resamples(*given_trials, 250, seed=11), expected, rtol=1e-6)


EARLY_AND_LATE = [([2, 3, 4, 9, *range(1009, end, 7)], censored) for end, censored in ((1100, 0), (1200, 3))]


@pytest.mark.parametrize(
    ("times", "censored"), [*EARLY_AND_LATE, ([21, 49, 18211, 25530, 16369, 65775], 2), ([7, 7, 9], 0)]
)
def test_resamples_that_little_resemble_the_sample_are_fitted_as_well(times, censored):
    given_trials = np.array(times, float), np.arange(len(times)) >= censored
    expected = means_one_by_one(*given_trials, 100, seed=0)
    np.testing.assert_allclose(weibull_resamples(*given_trials, 100), expected, rtol=1e-5)


def test_resamples_without_a_fit_are_infinite_if_any_of_their_trials_is_censored():
    for times, observed, expected in [
        ([7], [True], {7}),
        ([7, 7, 7], [True, True, True], {7}),
        ([7], [False], {math.inf}),
        ([7, 9, 9], [False, False, False], {math.inf}),
        ([7, 9], [True, True], {7, 9, "nan"}),  # a resample with both has no fit, but is not long
        ([7, 9], [True, False], {7, math.inf}),
        ([0, 0, 9], [True, True, False], {0, math.inf}),
    ]:
        means = weibull_resamples(times, observed, 200)
        assert {"nan" if math.isnan(mean) else mean for mean in means.tolist()} == expected


@given(trials)
@settings(max_examples=30)
def test_bootstrap_means_of_any_trials_are_not_negative_and_raise_no_warning(given_trials):
    times, observed = given_trials
    with np.errstate(all="raise", under="ignore"):
        means = weibull_resamples(times, observed, 20)
    assert (np.isnan(means) | (means >= 0)).all()
    assert not (observed.all() and np.isinf(means).any())


def test_an_interval_lies_between_two_of_the_means_that_are_numbers():
    thousand = np.arange(1000.0)
    for means, interval in (
        (thousand[::-1], (24, 975)),
        *((np.where(thousand < n, thousand, math.inf), (24, high)) for n, high in ((976, 975), (975, math.inf))),
        ([math.nan, 3, 1, math.nan, 2], (1, 3)),
        ([math.nan], (math.nan, math.nan)),
    ):
        np.testing.assert_equal(confidence_interval(np.array(means)), interval)


def test_resamples_of_very_many_trials_are_drawn_by_kind_and_vary_as_those_drawn_one_by_one():
    cells = np.repeat([0, 1, 2], [20_000, 9_000, 1_000])
    counts = np.concatenate([*survival.resample_counts(cells, 3, 4000, 1)])
    assert counts.shape == (4000, 3)
    assert (counts.sum(axis=1) == len(cells)).all()
    shares = np.bincount(cells) / len(cells)
    variance = len(cells) * shares * (1 - shares)
    np.testing.assert_allclose(counts.mean(axis=0), len(cells) * shares, atol=5 * math.sqrt(variance.max() / 4000))
    np.testing.assert_allclose(counts.var(axis=0), variance, rtol=0.15)
    np.testing.assert_array_equal(np.concatenate([*survival.resample_counts(cells, 3, 4000, 1)]), counts)


@pytest.mark.parametrize("censored", [0, 0.4, 0.9])
def test_a_regression_of_log_normal_times_is_lifelines(censored: float) -> None:
    random = np.random.default_rng(0)
    x, z = np.log(random.choice([5, 10, 20], 400)), np.log(random.choice([0.5, 1, 2], 400))
    times = np.exp(5 - 1.2 * x + 0.5 * z + 0.7 * random.standard_normal(400))
    limit = np.quantile(times, 1 - censored)
    columns = {"x": x, "z": z, "Intercept": np.ones(400)}
    fit = survival.fit_log_normal(np.column_stack(list(columns.values())), np.minimum(times, limit), times <= limit)
    frame = pd.DataFrame({**columns, "times": np.minimum(times, limit), "observed": times <= limit})
    theirs = LogNormalAFTFitter(fit_intercept=False).fit(frame, "times", "observed", ancillary=frame[["Intercept"]])
    summary = theirs.summary.loc["mu_"].loc[list(columns)]
    assert fit.coefficients == pytest.approx(summary["coef"].to_numpy(), rel=1e-3)
    assert fit.errors == pytest.approx(summary["se(coef)"].to_numpy(), rel=0.25)  # of trials that scatter alike
