"""Scaling laws of the local minimum and the peak of T_sync against speed (thesis 4.2.2), and of V_f (5.4.1)."""

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.estimate import Estimate

Parameters = Mapping[str, FloatArray]
"""Values of epsilon, L (cm), N and tau (s), each (C,): one for every curve."""


class Term(NamedTuple):
    """How a parameter enters a law."""

    exponent: float | None  # exponent, or multiple, according to the thesis; None where it names none
    form: str = "power"  # `power`: a power of the parameter; `exponential`: the exponential of a multiple of it

    def transform(self, parameter: FloatArray) -> FloatArray:
        """Return the parameter, or its logarithm, in which the logarithm of the law is linear."""
        return np.log(parameter) if self.form == "power" else parameter


Law = Mapping[str, Term]  # A term for each parameter

_V_M = {"epsilon": Term(1), "L": Term(1), "N": Term(-1.5), "tau": Term(0)}
_V_P = {"epsilon": Term(1), "L": Term(1), "N": Term(-0.5), "tau": Term(0)}
_T_OF_ROBOTS = {"epsilon": Term(0), "L": Term(1), "N": Term(1, "exponential"), "tau": Term(-2)}
_T_OF_AGENTS = {"epsilon": Term(None), "L": Term(0), "N": Term(None, "exponential"), "tau": Term(None)}
_V_F = {"epsilon": Term(None), "L": Term(1), "N": Term(-0.5), "tau": Term(None)}

LAWS: dict[str, dict[str, Law]] = {
    "embodied": {"V_m": _V_M, "T_m": _T_OF_ROBOTS, "V_p": _V_P, "T_p": _T_OF_ROBOTS},
    "particles": {"V_m": _V_M, "T_m": _T_OF_AGENTS, "V_p": _V_P, "T_p": _T_OF_AGENTS, "V_f": _V_F},
}
"""Laws of the thesis for each model, by quantity.

Those of 4.2.2 are of robots, and of times they hold up to an offset (`fit_offset_law`). Point agents share those of
V_m and V_p, which agree with Prignano et al. (2013), but have no size: with V and R in units of L nothing depends on L.
T_p grows exponentially with N, at a rate that 5.4.1 does not give; V_f is Prignano's too.
"""

MIN_VARIANCE = 1e-12  # relative; keeps values without noise solvable


class PowerLaw(NamedTuple):
    """A fitted law: a product of the parameters' terms."""

    exponents: dict[str, Estimate]  # exponent of each parameter that varies among the curves
    misfit: float
    """Scatter of the curves about the law, relative to that of their noise; NaN if no degree of freedom is left.

    It is about 1 where the law holds. Where it is much larger, the law does not hold, and the intervals, which account
    for noise alone, are too narrow.
    """


class OffsetLaw(NamedTuple):
    """The law T = A L e^N / tau^2 + K of the thesis, fitted."""

    factor: Estimate  # A, in cycles s^2 / cm
    offset: Estimate  # K, in cycles
    r_squared: float  # share of the weighted variance of T that the law explains


class Quantity(NamedTuple):
    """A quantity of C curves, for a law to explain."""

    values: FloatArray  # (C,) NaN where unknown
    resampled: FloatArray  # (B, C) resamples, NaN where unknown


class Comparison(NamedTuple):
    """A fitted exponent beside that of the thesis: a row of a table."""

    quantity: str
    parameter: str
    form: str
    exponent: Estimate
    thesis: float | None  # exponent according to the thesis; None where it names none
    misfit: float  # misfit of the whole law (see `PowerLaw`)


def fit_power_law(law: Law, parameters: Parameters, values: FloatArray, resampled: FloatArray) -> PowerLaw:
    """Fit a law to values, (C,), by least squares in logs, weighted by the inverse variance of the resamples' logs.

    Parameters that do not vary among the known curves are left out. Intervals are percentiles over the fits to each
    resample, (B, C). ValueError is raised if the curves do not determine the exponents: they are too few, or parameters
    vary together.
    """
    known, values, resampled = _without_gaps(values, resampled)
    varying = {name: array[known] for name, array in parameters.items() if np.ptp(array[known]) > 0}
    design = np.column_stack([np.ones(len(values)), *(law[name].transform(array) for name, array in varying.items())])
    logs, log_resampled = np.log(values), np.log(resampled)
    weights = 1 / np.maximum(log_resampled.var(axis=0, ddof=1), MIN_VARIANCE)
    solution = _least_squares(design, weights, list(varying))
    _, *exponents = _estimates(solution @ logs, log_resampled @ solution.T)
    surplus = len(values) - design.shape[1]
    deviations = logs - design @ (solution @ logs)
    misfit = float(np.sqrt((weights * deviations**2).sum() / surplus)) if surplus else np.nan
    return PowerLaw(dict(zip(varying, exponents, strict=True)), misfit)


def fit_offset_law(parameters: Parameters, values: FloatArray, resampled: FloatArray) -> OffsetLaw:
    """Fit T = A L e^N / tau^2 + K to values, (C,) cycles, as `fit_power_law` fits a power law."""
    known, values, resampled = _without_gaps(values, resampled)
    size, robots, period = (parameters[name][known] for name in ("L", "N", "tau"))
    logs = np.log(size) + robots - 2 * np.log(period)
    highest = logs.max()  # in units of the largest, e^N neither swamps the offset nor overflows
    design = np.column_stack([np.exp(logs - highest), np.ones(len(values))])
    weights = 1 / np.maximum(resampled.var(axis=0, ddof=1), MIN_VARIANCE * values**2)
    solution = _least_squares(design, weights, ["L e^N / tau^2"])
    factor, offset = _estimates(solution @ values, resampled @ solution.T)
    unexplained = weights @ (values - design @ (solution @ values)) ** 2
    total = weights @ (values - np.average(values, weights=weights)) ** 2
    factor = factor.apply(lambda number: number * math.exp(-highest))
    return OffsetLaw(factor, offset, float(1 - unexplained / total) if total else np.nan)


def compare_laws(
    laws: Mapping[str, Law], parameters: Parameters, quantities: Mapping[str, Quantity]
) -> list[Comparison]:
    """Fit the law of each quantity, and return the exponents beside those of the thesis."""
    rows: list[Comparison] = []
    for name, quantity in quantities.items():
        fit = fit_power_law(laws[name], parameters, *quantity)
        for parameter, exponent in fit.exponents.items():
            term = laws[name][parameter]
            rows.append(Comparison(name, parameter, term.form, exponent, term.exponent, fit.misfit))
    return rows


def _without_gaps(values: FloatArray, resampled: FloatArray) -> tuple[BoolArray, FloatArray, FloatArray]:
    """Return which curves are known, (C,), their values, (K,), and their resamples, (B, K), without gaps.

    Curves are resampled independently of one another, so that a gap may be filled by another resample of the same
    curve; few resamples would remain if each with a gap in any curve were left out.
    """
    is_finite = np.isfinite(resampled)
    known = np.isfinite(values) & (is_finite.sum(axis=0) > 1)
    if not known.any():
        raise ValueError("no curve is known")
    filled = resampled.copy()
    for column in np.flatnonzero(known):
        gaps = ~is_finite[:, column]
        filled[gaps, column] = np.resize(resampled[~gaps, column], np.count_nonzero(gaps))
    return known, values[known], filled[:, known]


def _least_squares(design: FloatArray, weights: FloatArray, names: Sequence[str]) -> FloatArray:
    """Return the matrix (P, C) that takes values to the least-squares coefficients of a design (C, P)."""
    curves, unknowns = design.shape
    if curves < unknowns:
        raise ValueError(f"{curves} curves do not determine {unknowns} unknowns: a prefactor and {', '.join(names)}")
    if np.linalg.matrix_rank(design, rtol=1e-9) < unknowns:
        raise ValueError(f"the curves do not distinguish {', '.join(names)}: they vary together")
    root = np.sqrt(weights / weights.max())
    return np.asarray(np.linalg.pinv(root[:, None] * design) * root)


def _estimates(values: FloatArray, resampled: FloatArray) -> list[Estimate]:
    """Return estimates of values (P,) from their resamples (B, P)."""
    low, high = np.percentile(resampled, [2.5, 97.5], axis=0)
    return [Estimate(*numbers) for numbers in np.column_stack([values, low, high]).tolist()]
