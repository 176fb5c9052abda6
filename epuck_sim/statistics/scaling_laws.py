"""How do the regimes scale? Power laws of the local minimum and the peak of T_sync (thesis 4.2.2)."""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.statistics.extrema import SpeedExtrema

Parameters = Mapping[str, FloatArray]
"""What each curve (C,) was measured at: epsilon, L (cm), N, tau (s)."""


class Term(NamedTuple):
    """How a parameter enters a law."""

    form: str
    """A power of the parameter, or the exponential of a multiple of it."""
    transform: Callable[[FloatArray], FloatArray]
    """Of the parameter, so that the law is linear in logs."""
    exponent: float
    """The thesis's."""


def _power(exponent: float) -> Term:
    return Term("power", np.log, exponent)


def _exponential(rate: float) -> Term:
    return Term("exponential", np.asarray, rate)


_TIME = {"epsilon": _power(0), "L": _power(1), "N": _exponential(1), "tau": _power(-2)}

LAWS: dict[str, dict[str, Term]] = {
    "V_m": {"epsilon": _power(1), "L": _power(1), "N": _power(-1.5), "tau": _power(0)},
    "T_m": _TIME,
    "V_p": {"epsilon": _power(1), "L": _power(1), "N": _power(-0.5), "tau": _power(0)},
    "T_p": _TIME,
}
"""The thesis's, in the order of a bump's numbers; those of the times hold but for an offset (see `fit_offset_law`)."""

LEAST_VARIANCE = 1e-12  # relative; keeps values without noise solvable


class Estimate(NamedTuple):
    """A number and its 95 % interval."""

    value: float
    low: float
    high: float


class PowerLaw(NamedTuple):
    """A fitted law: the prefactor times the product of the parameters' terms."""

    prefactor: Estimate
    exponents: dict[str, Estimate]
    """Of each parameter that varies among the curves."""
    misfit: float
    """Scatter of the curves about the law over that of their noise: about 1 where the law holds; NaN if none is left.

    The intervals tell of noise alone: where this is much above 1 they are too narrow, and the law is another.
    """


class OffsetLaw(NamedTuple):
    """The thesis's T = A L e^N / tau^2 + K."""

    factor: Estimate
    """A, in cycles s^2 / cm."""
    offset: Estimate
    """K, in cycles."""
    r_squared: float
    """Share of the weighted variance of T that the law explains."""


class Comparison(NamedTuple):
    """An exponent as it is and as the thesis has it: a row of a table."""

    quantity: str
    """V_m, T_m, V_p or T_p."""
    parameter: str
    form: str
    """The term's: `power` or `exponential`."""
    exponent: Estimate
    thesis: float
    misfit: float
    """Of the whole law."""


def fit_power_law(
    law: Mapping[str, Term], parameters: Parameters, values: FloatArray, resampled: FloatArray
) -> PowerLaw:
    """Fit a law by least squares in logs, weighted by the inverse variance of the resamples' logs.

    law: a term for each parameter, as in LAWS. values: (C,), NaN where unknown. resampled: (B, C), NaN where unknown.

    Parameters that do not vary among the curves known are left out. Intervals are percentiles over the fits to each
    resample. Raises ValueError where the curves cannot tell the exponents: too few, or parameters that vary together.
    """
    known, values, resampled = _known(values, resampled)
    varying = {name: array[known] for name, array in parameters.items() if np.ptp(array[known]) > 0}
    design = np.column_stack([np.ones(len(values)), *(law[name].transform(array) for name, array in varying.items())])
    logs, log_resampled = np.log(values), np.log(resampled)
    weights = 1 / np.maximum(log_resampled.var(axis=0, ddof=1), LEAST_VARIANCE)
    solution = _solution(design, weights, list(varying))
    estimates = _estimates(solution @ logs, log_resampled @ solution.T)
    surplus = len(values) - len(estimates)
    deviations = logs - design @ (solution @ logs)
    misfit = float(np.sqrt((weights * deviations**2).sum() / surplus)) if surplus else np.nan
    prefactor = Estimate(*np.exp(estimates[0]).tolist())
    return PowerLaw(prefactor, dict(zip(varying, estimates[1:], strict=True)), misfit)


def fit_offset_law(parameters: Parameters, values: FloatArray, resampled: FloatArray) -> OffsetLaw:
    """Fit T = A L e^N / tau^2 + K by least squares, weighted by the inverse variance of the resamples.

    parameters: L, N and tau, of which one varies at least. values: (C,) cycles. resampled: (B, C). NaN where unknown.
    """
    known, values, resampled = _known(values, resampled)
    size, robots, period = (parameters[name][known] for name in ("L", "N", "tau"))
    logs = np.log(size) + robots - 2 * np.log(period)
    highest = logs.max()  # in units of the largest, e^N neither swamps the offset nor overflows
    design = np.column_stack([np.exp(logs - highest), np.ones(len(values))])
    weights = 1 / np.maximum(resampled.var(axis=0, ddof=1), LEAST_VARIANCE * values**2)
    solution = _solution(design, weights, ["L e^N / tau^2"])
    factor, offset = _estimates(solution @ values, resampled @ solution.T)
    unexplained = weights @ (values - design @ (solution @ values)) ** 2
    total = weights @ (values - np.average(values, weights=weights)) ** 2
    factor = Estimate(*(number * math.exp(-highest) for number in factor))
    return OffsetLaw(factor, offset, float(1 - unexplained / total) if total else np.nan)


def compare_laws(parameters: Parameters, bumps: Sequence[SpeedExtrema | None]) -> list[Comparison]:
    """Return the exponents of all four laws next to the thesis's, from the curves (C,) that have a bump."""
    having = [(number, bump) for number, bump in enumerate(bumps) if bump is not None and bump.is_found]
    if not having:
        raise ValueError("no curve has a bump")
    used = {name: np.asarray(array)[[number for number, _ in having]] for name, array in parameters.items()}
    rows: list[Comparison] = []
    for column, (quantity, law) in enumerate(LAWS.items()):
        values = np.array([bump[column] for _, bump in having])
        fit = fit_power_law(law, used, values, np.column_stack([bump.resampled[:, column] for _, bump in having]))
        for name, exponent in fit.exponents.items():
            rows.append(Comparison(quantity, name, law[name].form, exponent, law[name].exponent, fit.misfit))
    return rows


def _known(values: FloatArray, resampled: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Return which curves (C,) are known, their values (K,), and their resamples (B, K) without gaps.

    Curves are resampled apart from one another, so a gap may be filled by another resample of the same curve; leaving
    out every resample with a gap in any curve would leave few.
    """
    there = np.isfinite(resampled)
    known = np.isfinite(values) & (there.sum(axis=0) > 1)
    if not known.any():
        raise ValueError("no curve is known")
    filled = resampled.copy()
    for column in np.flatnonzero(known):
        gaps = ~there[:, column]
        filled[gaps, column] = np.resize(resampled[~gaps, column], np.count_nonzero(gaps))
    return known, values[known], filled[:, known]


def _solution(design: FloatArray, weights: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return the matrix (P, C) that takes values to the least-squares coefficients of a design (C, P)."""
    curves, unknowns = design.shape
    if curves < unknowns:
        raise ValueError(f"{curves} curves cannot tell {unknowns} unknowns: a prefactor and {', '.join(names)}")
    if np.linalg.matrix_rank(design, rtol=1e-9) < unknowns:
        raise ValueError(f"the curves cannot tell {', '.join(names)} apart: they vary together")
    root = np.sqrt(weights / weights.max())
    return np.asarray(np.linalg.pinv(root[:, None] * design) * root)


def _estimates(values: FloatArray, resampled: FloatArray) -> list[Estimate]:
    """Return estimates of values (P,) from their resamples (B, P)."""
    low, high = np.percentile(resampled, [2.5, 97.5], axis=0)
    return [Estimate(*numbers) for numbers in np.column_stack([values, low, high]).tolist()]
