"""Write the tables of docs/statistics.md: how far to trust intervals, marks and estimators; `make figures` runs it.

Give it run folders: the distributions of T_sync at their uncensored points are fitted, and the largest points stand for
the truth from which samples are drawn. It takes a quarter of an hour of one core.
"""

import math
import sys
from collections.abc import Callable, Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import numpy as np
from scipy import stats

from epuck_sim import read_points
from epuck_sim.display.table import csv_text
from epuck_sim.replication.criteria import FITTED_TRIALS, FITTED_VALUES, LAWS as FITTED
from epuck_sim.statistics.comparison import Pair, contrast, permute, studentised
from epuck_sim.statistics.extrema import Extrema, find_minimum_and_peak
from epuck_sim.statistics.sequential import Precision, look_interval, look_sizes
from epuck_sim.statistics.statistic import Measured, cut, estimate_mean, measure_t_sync, resample_means
from epuck_sim.statistics.survival import median_time, weibull_mean

OUT = Path(__file__).parent
LAWS: dict[str, Callable[[np.random.Generator, Any], Any]] = {
    "Weibull 1.35": lambda random, shape: random.weibull(1.35, shape),
    "exponential": lambda random, shape: random.exponential(1, shape),
    "log-normal 0.8": lambda random, shape: random.lognormal(0, 0.8, shape),
    "Weibull 0.7": lambda random, shape: random.weibull(0.7, shape),
}
TRUE_MEANS = {"Weibull 1.35": math.gamma(1 + 1 / 1.35), "exponential": 1.0, "log-normal 0.8": math.exp(0.32)}
SIZES = (10, 20, 100, 200)
CENSORED = (0.0, 0.3, 0.6)
SPEEDS = np.geomspace(0.05, 12.8, 20)
X = np.log10(SPEEDS)
FALLING = {
    "plateau": 4 - 1.6 * np.minimum(X + 0.5, 0) - 1.3 * np.maximum(X - 0.3, 0),
    "power law": 4 - 0.8 * X,
    "level": np.full(20, 4.0),
}
RISING = {"wide": (1.1, 0.6), "narrow": (0.9, 0.35)}  # height and width, in decades, of a hump on a falling curve
MANY_TRIALS = 1000  # fewest of a point that stands for the truth


def write(name: str, columns: str, rows: Iterator[Sequence[Any]]) -> None:
    """Write a table, and print it."""
    cells = []
    for row in rows:
        cells.append([f"{cell:.3g}" if isinstance(cell, float) else cell for cell in row])
        print(name, *cells[-1], flush=True)
    (OUT / f"statistics-{name}.csv").write_text(csv_text(columns.split(), cells))


def sample(law: str, trials: int, seed: Sequence[int], limit: float) -> Measured:
    """Return trials of a law in whole cycles, a hundredth of its unit, censored at a limit."""
    times = np.ceil(100 * LAWS[law](np.random.default_rng(seed), trials))
    return cut(Measured(times, np.ones(trials, bool), math.inf, seed[-1]), limit)


def limit_and_truth(times: np.ndarray, censored: float) -> tuple[float, float]:
    """Return the limit at which a share of many trials is censored, and their mean up to it."""
    limit = float(np.quantile(times, 1 - censored)) if censored else math.inf
    return limit, float(np.minimum(times, limit).mean())


def coverage(samples: int = 1000) -> Iterator[Sequence[Any]]:
    """Yield how often intervals of the mean hold the truth, in per cent, and how wide they are."""
    for censored, trials, law in product(CENSORED, (5, 10, 20, 50, 200), LAWS):
        found = limit_and_truth(sample(law, 400_000, [0], math.inf).values, censored)
        yield law, trials, censored, *_coverage(law, trials, *found, samples)


def _coverage(law: str, trials: int, limit: float, truth: float, samples: int) -> Sequence[float]:
    held, widths, by_percentiles = [], [], []
    for seed in range(samples):
        made = sample(law, trials, [trials, seed], limit)
        _, low, high = estimate_mean(made).ends
        if math.isfinite(low):
            held.append(low <= truth <= high)
            widths.append((high - low) / truth)
        if seed < samples // 4 and made.observed.any():
            low, high = np.quantile(resample_means(made, 400), (0.025, 0.975))
            by_percentiles.append(low <= truth <= high)
    return 100 * float(np.mean(held)), float(np.median(widths)), 100 * float(np.mean(by_percentiles))


def looks(samples: int = 1000, limit: int = 1000) -> Iterator[Sequence[Any]]:
    """Yield how often intervals hold the truth where `--until` ends, and the mean number of trials; in per cent.

    Beside them are those that `summarize` prints of these trials, and how often the intervals of all looks hold it.
    """
    for censored, law, asked in product(CENSORED, LAWS, ("20%", "10%")):
        cut_at, truth = limit_and_truth(sample(law, 400_000, [0], math.inf).values, censored)
        found = [_end(sample(law, limit, [1, seed], cut_at), asked, truth) for seed in range(samples)]
        held, plain, all_looks, trials = np.mean(found, axis=0).tolist()
        yield law, censored, asked, 100 * held, 100 * plain, 100 * all_looks, trials


def _end(trials: Measured, asked: str, truth: float) -> tuple[bool, bool, bool, int]:
    """Return whether the intervals at the last look hold the truth, the plain one and all, and its trials."""
    are_held = []
    for size in look_sizes(len(trials.values)):
        first = trials._replace(values=trials.values[:size], observed=trials.observed[:size])
        found = look_interval(first, len(trials.values))
        are_held.append(found.low <= truth <= found.high)
        if Precision.parse(asked).width(found) <= 1:
            break
    plain = estimate_mean(first)
    return are_held[-1], plain.low <= truth <= plain.high, all(are_held), size


def false_alarms(curves: int = 80) -> Iterator[Sequence[Any]]:
    """Yield how often a minimum and a peak are found on curves without any, in per cent."""
    for trials, law, name in product((2, 5, 10, 15, 20, 100), ("Weibull 1.35", "log-normal 0.8"), FALLING):
        found = [_is_found(law, FALLING[name], trials, seed) for seed in range(curves)]
        yield trials, law, name, 100 * float(np.mean(found))


def peaks(curves: int = 150) -> Iterator[Sequence[Any]]:
    """Yield how often a minimum and a peak are found on curves that have them, and then held, in per cent."""
    fine = np.linspace(X[0], X[-1], 20_001)
    for trials, (name, (height, width)) in product((30, 100, 200), RISING.items()):
        logs, at_speeds = (4.8 - 0.7 * x + height * np.exp(-(((x - 0.7) / width) ** 2)) for x in (fine, X))
        ends = np.flatnonzero(np.diff(logs) > 0)[[0, -1]] + [0, 1]
        truth = np.column_stack([10 ** fine[ends], TRUE_MEANS["Weibull 1.35"] * np.exp(logs[ends])]).ravel()
        pairs = [_search("Weibull 1.35", at_speeds, trials, seed, 1000) for seed in range(curves)]
        found = [pair.intervals for pair in pairs if pair is not None and pair.is_found]
        held = np.mean([(low <= truth) & (truth <= high) for low, high in (each.T for each in found)], axis=0)
        yield trials, name, 100 * len(found) / curves, *(100 * held).tolist()


def _is_found(law: str, logs: np.ndarray, trials: int, seed: int) -> bool:
    pair = _search(law, logs, trials, seed, 200)
    return pair is not None and pair.is_found


def _search(law: str, logs: np.ndarray, trials: int, seed: int, resamples: int) -> Extrema | None:
    """Return the minimum and the peak of a curve of trials whose unit has these logarithms."""
    random = np.random.default_rng([trials, seed])
    times = LAWS[law](random, (20, trials)) * np.exp(logs)[:, None]
    made = [Measured(row, np.ones(trials, bool), math.inf, seed * 20 + n) for n, row in enumerate(times)]
    resampled = np.stack([resample_means(each, resamples) for each in made], axis=1)
    return find_minimum_and_peak(SPEEDS, times.mean(axis=1), resampled)


def levels(samples: int = 6000) -> Iterator[Sequence[Any]]:
    """Yield how often tests find a mean longer than a second one that is as long, as a multiple of how often they may.

    The one test permutes studentised logarithms, the other takes Welch's for Student-distributed. The second mean has
    the distribution of the first, or the next of the three.
    """
    laws = list(LAWS)[:3]
    for law, other in [*zip(laws, laws, strict=True), *pairwise(laws)]:
        for sizes in ((10, 10), (15, 15), (20, 20), (10, 20)):
            found = np.array([_p_values(law, other, sizes, seed) for seed in range(samples)])
            for level in (0.05, 0.01, 0.001):
                below = (found <= level * (1 + 1e-9)).mean(axis=0) / level
                yield law, other, *sizes, level, *below.tolist()


def _p_values(law: str, other: str, sizes: tuple[int, int], seed: int) -> tuple[float, float]:
    """Return the p-values of the second mean's being longer: permuted, and Welch's."""
    one, two = (
        LAWS[name](np.random.default_rng([seed, side]), size) / TRUE_MEANS[name]
        for side, (name, size) in enumerate(zip((law, other), sizes, strict=True))
    )
    pair = Pair(*(Measured(each, np.ones(len(each), bool), math.inf, 0) for each in (one, two)))
    statistics = studentised([permute(pair, seed, of_logarithms=True, count=1999)])
    freedom = contrast(pair, of_logarithms=True).freedom
    return float((statistics >= statistics[0] * (1 - 1e-9)).mean()), float(stats.t.sf(statistics[0], freedom))


def fits(folders: Sequence[str]) -> Iterator[Sequence[Any]]:
    """Yield for each folder which distribution describes most uncensored points best, and how well."""
    for folder in folders:
        points = [point for point in read_points(folder) if len(point.times) >= FITTED_TRIALS and point.observed.all()]
        results = np.array([_fit(point.times) for point in points if len(np.unique(point.times)) >= FITTED_VALUES])
        for place, name in enumerate(FITTED if len(results) else ()):
            aic, distance, p_value = results[:, place].T
            least = results[:, :, 0].min(axis=1)
            best = int((results[:, :, 0].argmin(axis=1) == place).sum())
            middle = float(np.median(aic - least)), float(np.median(distance))
            yield Path(folder).name, name, len(results), best, *middle, int((p_value < 0.05).sum())


def _fit(times: np.ndarray) -> list[tuple[float, float, float]]:
    """Return the AIC, the Kolmogorov-Smirnov distance and its p-value of each distribution."""
    found = []
    for law in FITTED.values():
        parameters = law.fit(times, floc=0)
        test = stats.kstest(times, law(*parameters).cdf)
        found.append((4 - 2 * law.logpdf(times, *parameters).sum(), test.statistic, test.pvalue))
    return found


def biases(folders: Sequence[str], samples: int = 150) -> Iterator[Sequence[Any]]:
    """Yield the bias of each estimator, in per cent of what it estimates, and how often its interval holds that."""
    sources = {f"{law} (law)": np.ceil(100 * LAWS[law](np.random.default_rng(0), 400_000)) for law in LAWS}
    for folder in folders:
        for point in read_points(folder):
            if len(point.times) >= MANY_TRIALS and point.observed.all():
                text = ", ".join(f"{key.rpartition('.')[2]} {value}" for key, value in point.axes.items())
                sources[f"{Path(folder).name}: {text}"] = measure_t_sync(point).values
    for source, censored, trials in product(sources, CENSORED, SIZES):
        yield source, trials, censored, *_bias(sources[source], trials, censored, samples)


def _bias(times: np.ndarray, trials: int, censored: float, samples: int) -> Sequence[Any]:
    limit, restricted = limit_and_truth(times, censored)
    truth, middle = times.mean(), float(np.median(times))
    rows = []
    for seed in range(samples):
        drawn = np.random.default_rng([trials, seed]).choice(times, trials)
        made = cut(Measured(drawn, np.ones(trials, bool), math.inf, seed), limit)
        median = median_time(made.values, made.observed)[0] / middle
        ratios = estimate_mean(made).value / restricted, median, weibull_mean(made.values, made.observed) / truth
        rows.append([ratio if math.isfinite(ratio) else math.nan for ratio in ratios])
    own = 100 * (np.array(rows) - 1)
    known = 100 * np.isfinite(own).mean(axis=0)
    bias = [float(np.nanmean(column)) if share > 50 else math.nan for column, share in zip(own.T, known, strict=True)]
    return *bias, float(np.nanmedian(own[:, 2])), float(known[2])


def main() -> None:
    """Make all tables from the run folders on the command line."""
    folders = sys.argv[1:]
    write("fits", "folder distribution points best median_aic_gap median_ks rejected", fits(folders))
    write("biases", "source trials censored mean median weibull weibull_typical weibull_known", biases(folders))
    write("coverage", "law trials censored held width held_by_percentiles", coverage())
    write("looks", "law censored asked held held_by_plain all_looks trials", looks())
    write("levels", "law other n n_other level permuted welch", levels())
    write("false-alarms", "trials law curve found", false_alarms())
    write("peaks", "trials curve found v_m t_m v_p t_p", peaks())


if __name__ == "__main__":
    main()
