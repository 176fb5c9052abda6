"""Minima and peaks of T_sync, or a measure, in run folders, and the laws that those of T_sync follow (thesis 4.2.2)."""

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.display.table import Row, Share, Table, leaves
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.runs.reader import PointTrials, SweepTrials
from epuck_sim.scenario.axes import SPEED, choose_axis
from epuck_sim.scenario.base import refused_at
from epuck_sim.scenario.keys import axis_key
from epuck_sim.statistics import Statistic, extrema
from epuck_sim.statistics.curves import check_speed_alone, group_by_other_axes, sweep_curves
from epuck_sim.statistics.extrema import FAST_FACTOR, PLACES, Extrema, Place, find_fast_speed, search_extrema
from epuck_sim.statistics.statistic import measure, quantity, student_estimate
from epuck_sim.statistics.survival import fit_log_normal
from epuck_sim.util.messages import counted, shortest_endings

Parameters = Mapping[str, FloatArray]  # values of epsilon, L (cm), N and tau (s), each (C,): one for every curve


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

The laws of 4.2.2 are for robots; those of times hold up to an offset (`fit_offset_law`). Point agents share the laws
of V_m and V_p, which agree with Prignano et al. (2013), but have no size: with V and R in units of L nothing depends on
L. T_p grows exponentially with N, at a rate that 5.4.1 does not give; the law of V_f is Prignano's, too.
"""

LEAST_VARIANCE = 1e-12  # smallest relative variance; keeps fits of values without noise solvable


class PowerLaw(NamedTuple):
    """A fitted law: a product of the parameters' terms."""

    exponents: dict[str, Estimate]  # exponent of each parameter that varies among the curves
    curves: int  # number of curves in which the quantity is known
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


class FittedExponent(NamedTuple):
    """A fitted exponent beside that of the thesis: a row of a table."""

    quantity: str
    parameter: str
    form: str
    exponent: Estimate
    thesis: float | None  # exponent according to the thesis; None where it names none
    curves: int  # number of curves that the whole law is fitted to
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
    weights = 1 / np.maximum(log_resampled.var(axis=0, ddof=1), LEAST_VARIANCE)
    (_, *exponents), unexplained = _least_squares(design, weights, list(varying), logs, log_resampled)
    surplus = len(values) - design.shape[1]
    misfit = math.sqrt(unexplained / surplus) if surplus else math.nan
    return PowerLaw(dict(zip(varying, exponents, strict=True)), len(values), misfit)


def fit_offset_law(parameters: Parameters, values: FloatArray, resampled: FloatArray) -> OffsetLaw:
    """Fit T = A L e^N / tau^2 + K to values, (C,) cycles, as `fit_power_law` fits a power law."""
    known, values, resampled = _without_gaps(values, resampled)
    size, robots, period = (parameters[name][known] for name in ("L", "N", "tau"))
    logs = np.log(size) + robots - 2 * np.log(period)
    highest = logs.max()  # in units of the largest, e^N neither swamps the offset nor overflows
    design = np.column_stack([np.exp(logs - highest), np.ones(len(values))])
    weights = 1 / np.maximum(resampled.var(axis=0, ddof=1), LEAST_VARIANCE * values**2)
    (factor, offset), unexplained = _least_squares(design, weights, ["L e^N / tau^2"], values, resampled)
    total = weights @ (values - np.average(values, weights=weights)) ** 2
    factor = factor.apply(lambda number: number * math.exp(-highest))
    return OffsetLaw(factor, offset, float(1 - unexplained / total) if total else np.nan)


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


def _least_squares(
    design: FloatArray, weights: FloatArray, names: Sequence[str], values: FloatArray, resampled: FloatArray
) -> tuple[list[Estimate], float]:
    """Return the coefficients of a design (C, P), with percentiles over resamples, and the residual sum of squares."""
    _check_determined(design, names, "curve")
    root = np.sqrt(weights / weights.max())
    solution = np.linalg.pinv(root[:, None] * design) * root
    fitted = solution @ values
    low, high = np.percentile(resampled @ solution.T, [2.5, 97.5], axis=0)
    estimates = [Estimate(*numbers) for numbers in np.column_stack([fitted, low, high]).tolist()]
    return estimates, float(weights @ (values - design @ fitted) ** 2)


def _check_determined(design: FloatArray, names: Sequence[str], what: str) -> None:
    """Raise ValueError if the rows of a design, (C, P), of C curves or points, do not determine P unknowns."""
    rows, unknowns = design.shape
    if rows < unknowns:
        given = f"{counted(rows, what)} for {unknowns} unknowns"
        raise ValueError(f"{given}, a prefactor and {', '.join(names)}, are too few")
    if np.linalg.matrix_rank(design, rtol=1e-9) < unknowns:
        raise ValueError(f"the {what}s do not distinguish {', '.join(names)}: they vary together")


QUANTITIES = (*PLACES, "V_f")  # what a curve of T_sync may have, in the order of tables


class FittedCurve(NamedTuple):
    """The local minimum and the peak of one curve of a run folder."""

    run: str
    axes: dict[str, Any]  # values of the axes other than speed
    parameters: dict[str, float]  # epsilon, L (cm), N and tau (s)
    others: str  # all other settings of its scenario, as text; only curves that share them can follow one law
    model: str
    names: list[str]  # names of the statistic of T_sync at its points, each once
    places: dict[str, Place]  # by the names in `LAWS`: those that noise could not explain, V_f of point agents alone
    p_value: float | None  # p-value of minimum and peak; None where they cannot be looked for
    reason: str  # why they cannot, and what would be enough; empty where they can

    def record(self) -> dict[str, Any]:
        """Return the fit as JSON holds it; None for estimates that noise could explain."""
        head = {"run": self.run, "axes": self.axes, "statistic": self.names}
        found = {name.lower(): self.places[name].estimate if name in self.places else None for name in QUANTITIES}
        return {**head, "p_value": self.p_value, "reason": self.reason, **found}


class Laws(NamedTuple):
    """Scaling laws of curves that have a minimum and a peak, or V_f, and differ in epsilon, L, N and tau alone."""

    model: str
    axes: dict[str, Any]  # folder and axes that the curves share
    curves: int  # number of the curves
    exponents: list[FittedExponent]
    offset_laws: dict[str, OffsetLaw]  # laws of T_m and T_p, by name
    reason: str  # why there are no laws; empty if there are


def fit_curves(points: SweepTrials, statistic: Statistic = Statistic.MEAN) -> list[FittedCurve]:
    """Find the local minimum, the peak and V_f of each curve of T_sync against speed of a sweep."""
    axis, curves = sweep_curves(points, statistic=statistic)
    if not axis.endswith(SPEED):
        instead = "extrema are those over speed; for others: --of t_sync_s --x KEY"
        raise EpuckSimError(f"{points.folder}: no axis of several values ends in {SPEED}; {instead}")
    with refused_at(str(points.folder)):
        check_speed_alone(curves)
    found = []
    for curve in curves:
        model, (places, p_value, reason) = curve.scenario.model, search_extrema(curve)
        if "V_f" in LAWS.get(model, {}) and (v_f := find_fast_speed(curve)):
            places = {**places, "V_f": v_f}
        scales = curve.scenario.scale_keys
        others = {key: value for key, value in leaves(curve.scenario.trial_keys) if key not in scales}
        found.append(
            FittedCurve(
                run=str(points.folder),
                axes=curve.axes,
                parameters=curve.scenario.scales,
                others=json.dumps(others),
                model=model,
                names=list(dict.fromkeys(curve.names)),
                places=places,
                p_value=p_value,
                reason=reason,
            )
        )
    return found


def fit_laws(curves: Sequence[FittedCurve]) -> list[Laws]:
    """Fit the laws to each group of curves that differ in nothing but speed, epsilon, L, N and tau."""
    groups: dict[str, list[FittedCurve]] = {}
    for curve in curves:
        if curve.places:
            groups.setdefault(curve.others, []).append(curve)
    return [_fit_laws(alike) for alike in groups.values()]


def _fit_laws(alike: Sequence[FittedCurve]) -> Laws:
    model, rows = alike[0].model, [{"run": curve.run, **curve.axes} for curve in alike]
    shared = {key: value for key, value in rows[0].items() if all(row.get(key) == value for row in rows)}
    parameters = {name: np.array([curve.parameters[name] for curve in alike]) for name in alike[0].parameters}
    resamples = max(len(place.resampled) for curve in alike for place in curve.places.values())
    missing = Place(UNDETERMINED, np.full(resamples, math.nan))
    quantities = {}  # values, (C,), of curves, and resamples, (B, C); NaN where unknown
    for name in QUANTITIES:
        places = [curve.places.get(name, missing) for curve in alike]
        if any(place is not missing for place in places):
            values = np.array([place.estimate.value for place in places])
            quantities[name] = values, np.stack([place.resampled for place in places], axis=1)
    laws, exponents = LAWS.get(model, LAWS["embodied"]), list[FittedExponent]()
    try:
        for name, numbers in quantities.items():
            fit = fit_power_law(laws[name], parameters, *numbers)
            for parameter, exponent in fit.exponents.items():
                term, known = laws[name][parameter], (fit.curves, fit.misfit)
                exponents.append(FittedExponent(name, parameter, term.form, exponent, term.exponent, *known))
    except ValueError as error:
        return Laws(model, shared, len(alike), [], {}, str(error))
    several = f"{counted(len(alike), 'curve')} with a minimum and a peak{', or V_f' * ('V_f' in laws)}"
    reason = "" if exponents else f"{several}, none of which differ in epsilon, L, N or tau"
    offset_laws: dict[str, OffsetLaw] = {}
    if model != "particles" and not reason:
        with suppress(ValueError):  # the curves do not vary in what these laws depend on
            for name in ("T_m", "T_p"):
                offset_laws[name] = fit_offset_law(parameters, *quantities[name])
    return Laws(model, shared, len(alike), exponents, offset_laws, reason)


NOUNS = {"embodied": "robots", "particles": "point agents"}  # names of the models

NOTES = {
    "embodied": "Thesis 4.2.2. The exponents of T_m and T_p ignore its offset K; the larger K, the closer to 0.",
    "particles": "The thesis's laws of T_m and T_p (4.2.2) are for robots. Agents are points: T_sync does not depend "
    "on L where V and R grow with it, and T_p grows exponentially with N (5.4.1). V_m and V_p: 4.2.2; V_f: 5.4.1.",
}
"""The laws of the thesis, by model."""

NOISE_ALONE = (
    "Intervals account for the noise of the trials alone; where a misfit is far above 1, the law does not hold."
)


def fit_tables(curves: Sequence[FittedCurve], laws: Sequence[Laws]) -> list[Table]:
    """Return the table of the minimum and the peak of each curve, and those of the laws."""
    has_v_f = any("V_f" in LAWS.get(curve.model, {}) for curve in curves)
    wanted = ["v_m", "t_m", "v_p", "t_p", "p_value", *["v_f"] * has_v_f]
    none = dict.fromkeys(wanted, UNDETERMINED) | {"p_value": None, "reason": ""}
    rows = _rows(curves, [{name: curve.record()[name] or each for name, each in none.items()} for curve in curves])
    units = {"v": "cm/s", "t": "cycles"}
    headings = {name: f"{name.capitalize()} ({units[name[0]]})" for name in wanted if name != "p_value"}
    headings |= {"p_value": "p", "reason": ""}
    statistics = " or ".join(dict.fromkeys(name for curve in curves for name in curve.names))
    notes = [f"T_m and T_p: {statistics}. -: no minimum and peak that stand out from noise."]
    notes += _reasons(curves)
    notes += [f"V_f: from there on T_sync is less than {FAST_FACTOR:g} times that at the largest speed."] * has_v_f
    places = Table("Local minimum and peak, with 95 % intervals", rows, notes, headings)
    if any(each.exponents for each in laws):
        return [places, *_laws_tables(laws)]
    reasons = dict.fromkeys(each.reason for each in laws) or ["no curve has a local minimum and a peak"]
    return [places, Table(f"No laws: {'; '.join(reasons)}.", [])]


def _rows(found: "Sequence[FittedCurve | MeasureFit | PowersFit]", cells: Iterable[Mapping[str, Any]]) -> list[Row]:
    """Return rows of curves of any folders, with an empty cell for an axis that a folder does not have."""
    return [Row({"run": each.run, **axes}, row) for each, axes, row in zip(found, _filled(found), cells, strict=True)]


def _filled(found: "Sequence[FittedCurve | MeasureFit | PowersFit | Laws]") -> list[dict[str, Any]]:
    keys = list(dict.fromkeys(key for each in found for key in each.axes))
    return [{key: each.axes.get(key, "") for key in keys} for each in found]


def _reasons(
    found: "Sequence[FittedCurve | MeasureFit | PowersFit | Laws]", said: str = "Not looked for on {} of {} curves: {}."
) -> list[str]:
    reasons = Counter(each.reason for each in found if each.reason)
    return [said.format(count, len(found), reason) for reason, count in reasons.items()]


def _laws_tables(laws: Sequence[Laws]) -> Iterator[Table]:
    """Yield the table of the exponents of all groups of curves, and that of the laws of T_m and T_p with an offset."""
    fitted = [each for each in laws if each.exponents]
    groups = list(zip(_filled(fitted), fitted, strict=True))
    rows = [Row(axes, row._asdict()) for axes, each in groups for row in each.exponents]
    notes = [
        NOISE_ALONE,
        *dict.fromkeys(NOTES.get(each.model, NOTES["embodied"]) for _, each in groups),
        *_reasons(laws, "No laws of {} of {} groups of curves that differ in more: {}."),
    ]
    nouns = " and ".join(dict.fromkeys(NOUNS.get(each.model, each.model) for _, each in groups))
    yield Table(f"Scaling laws of {sum(each.curves for _, each in groups)} curves of {nouns}", rows, notes)
    offsets = [(axes, name, law) for axes, each in groups for name, law in each.offset_laws.items()]
    if offsets:
        found = [Row(axes, {"quantity": name, **law._asdict()}) for axes, name, law in offsets]
        headings = {"factor": "A (cycles s^2/cm)", "offset": "K (cycles)", "r_squared": "R^2"}
        yield Table("T = A L e^N / tau^2 + K, with 95 % intervals", found, [], headings)


class MeasureFit(NamedTuple):
    """The minimum and the peak of a measure on one curve of a run folder."""

    run: str
    of: str
    axis: str
    axes: dict[str, Any]  # values of the other axes
    statistic: str
    minimum: Extrema | None
    peak: Extrema | None  # None where they cannot be looked for
    reason: str  # why they cannot, and what would be enough; empty where they can

    def record(self) -> dict[str, Any]:
        """Return the fit as JSON holds it: place and value are None where they may be noise."""
        record = self._asdict()
        for name, found in (("minimum", self.minimum), ("peak", self.peak)):
            if found is not None:
                place, value = [each.estimate for each in found.places] or (None, None)
                extremum = {"place": place, "value": value, "p_value": found.p_value}
                record[name] = None if math.isnan(found.values[0]) else extremum
        return record


def fit_measure(
    points: SweepTrials, axis: str | None = None, statistic: Statistic = Statistic.MEAN
) -> list[MeasureFit]:
    """Find the minimum and the peak of each curve of a measure along an axis, by default the speed."""
    chosen, curves = sweep_curves(points, axis, statistic)
    found = []
    for curve in curves:
        head = str(points.folder), curve.of or "T_sync", chosen, curve.axes, curve.names[0]
        found.append(MeasureFit(*head, *extrema.search_measure(curve)))
    return found


def measure_fit_table(fits: Sequence[MeasureFit]) -> Table:
    """Return a table of the minimum and the peak of each curve."""
    texts = {"place": "{} at", "value": "{}", "p_value": "p of {}"}
    parts = [(f"{name}_{part}", name, part) for name in ("minimum", "peak") for part in texts]
    none = {"place": UNDETERMINED, "value": UNDETERMINED, "p_value": None}
    cells = [
        {key: (found[name] or none)[part] or none[part] for key, name, part in parts} | {"reason": found["reason"]}
        for found in map(MeasureFit.record, fits)
    ]
    of, axes = fits[0].of, " or ".join(dict.fromkeys(fit.axis for fit in fits))
    statistics = " or ".join(dict.fromkeys(fit.statistic for fit in fits))
    notes = [f"{of}: {statistics}. -: none between the ends of the axis that stands out from noise.", *_reasons(fits)]
    headings = {key: texts[part].format(name) for key, name, part in parts} | {"reason": ""}
    return Table(f"Minimum and peak of {of} against {axes}, with 95 % intervals", _rows(fits, cells), notes, headings)


class PowersFit(NamedTuple):
    """A product of powers of axes, fitted to trials: the median of T_sync, or a measure, whose logarithm is normal."""

    run: str
    of: str  # T_sync, or the measure, with its unit
    axes: dict[str, Any]  # values of the other axes
    trials: int
    censored: Share  # share of the trials that is censored
    points: int  # number of points that have trials
    factor: Estimate  # median where all axes are 1
    exponents: dict[str, Estimate]  # by axis
    misfit: float = math.nan  # scatter of the points about the product, as in `PowerLaw`
    reason: str = ""  # why all of this is undetermined; empty where it is not


def fit_powers(points: SweepTrials, keys: Sequence[str]) -> list[PowersFit]:
    """Fit powers of axes, given by their keys or endings, to the trials for each combination of the other axes.

    Raises:
        EpuckSimError: An axis does not have several numbers, all positive, or nothing can be fitted.
    """
    rows = [point.axes for point in points]
    with refused_at(str(points.folder)):
        axes = [choose_axis(rows, axis_key(key, rows, "--power"), "--power") for key in keys]
        for axis in axes:
            if axes.count(axis) > 1:
                raise EpuckSimError(f"--power: {axis} is given twice")
            values = sorted({row[axis] for row in rows})
            if values[0] <= 0 or len(values) == 1:
                raise EpuckSimError(f"--power: {axis} is {values[0]}; allowed: axes of several values, all positive")
        groups = group_by_other_axes(points, *axes)
        fits = [_fit_powers(str(points.folder), group, axes, others) for others, group in groups]
        if all(fit.reason for fit in fits):
            raise EpuckSimError(fits[0].reason if fits else "holds no results yet")
    return fits


def _fit_powers(run: str, points: Sequence[PointTrials], axes: Sequence[str], others: dict[str, Any]) -> PowersFit:
    measured = [measure(point) for point in points]
    of = quantity(points[0].of, measured[0].unit)
    if any(each.is_share or not each.is_positive for each in measured):
        raise EpuckSimError(f"{of} is not positive in all trials, and powers are fitted to logarithms")
    values, observed = (np.concatenate([getattr(each, name) for each in measured]) for name in ("values", "observed"))
    place = np.repeat(np.arange(len(points)), [len(each.values) for each in measured])
    censored = Share(np.count_nonzero(~observed) / max(len(values), 1))
    nothing = dict.fromkeys(axes, UNDETERMINED)
    found = PowersFit(run, of, others, len(values), censored, len(np.unique(place)), UNDETERMINED, nothing)
    tells = values > 0  # a trial that is censored at 0 says nothing
    values, observed, place = values[tells], observed[tells], place[tells]
    logs = np.log([[point.axes[axis] for axis in axes] for point in points])
    design = np.column_stack([np.ones(len(points)), logs])
    try:
        _check_determined(design[np.unique(place[observed])], axes, "known point")
        _check_determined(np.column_stack([design[place], np.log(values)])[observed], [*axes, of], "trial")
    except ValueError as error:
        return found._replace(reason=str(error))
    fit = fit_log_normal(design[place], values, observed)
    ends = zip(fit.coefficients.tolist(), fit.errors.tolist(), strict=True)
    factor, *exponents = (student_estimate(*each, fit.freedom) for each in ends)
    surplus = found.points - design.shape[1]
    squares = np.bincount(place, fit.slopes) ** 2 / np.maximum(np.bincount(place, fit.weights), LEAST_VARIANCE)
    return found._replace(
        factor=factor.apply(np.exp),
        exponents=dict(zip(axes, exponents, strict=True)),
        misfit=math.sqrt(float(squares.sum()) / surplus) if surplus else math.nan,
    )


def powers_table(fits: Sequence[PowersFit]) -> Table:
    """Return a table of the factor and the exponents for each combination of the other axes."""
    keys = list(dict.fromkeys(key for fit in fits for key in fit.exponents))
    others = ("trials", "censored", "points", "misfit")
    cells = [
        {"factor": fit.factor, **dict.fromkeys(keys), **fit.exponents, **{name: getattr(fit, name) for name in others}}
        for fit in fits
    ]
    notes = [
        "Median: the factor times each axis to its exponent. Trials are taken as log-normal about it, censored ones as "
        "longer than their limit.",
        NOISE_ALONE,
        *_reasons(fits, "Not fitted to {} of {} combinations of the other axes: {}."),
    ]
    headings = {key: f"exponent of {ending}" for key, ending in shortest_endings(keys).items()}
    return Table(f"{fits[0].of} as a product of powers, with 95 % intervals", _rows(fits, cells), notes, headings)
