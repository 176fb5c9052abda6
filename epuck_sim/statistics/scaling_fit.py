"""Local minima and peaks of T_sync in run folders, and the scaling laws that they follow (thesis 4.2.2)."""

import json
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.runs.reader import read_points
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.statistics.curves import SPEED, choose_axis, read_curves
from epuck_sim.statistics.extrema import SpeedExtrema, find_minimum_and_peak
from epuck_sim.statistics.scaling_laws import Comparison, OffsetLaw, Parameters, compare_laws, fit_offset_law


class FittedCurve(NamedTuple):
    """The local minimum and the peak of one curve of a run folder."""

    run: str
    """The run folder."""
    axes: dict[str, Any]
    """Values of the axes other than speed."""
    parameters: dict[str, float]
    """epsilon, L (cm), N and tau (s)."""
    others: str
    """All other settings of its scenario, as text; only curves that share them can follow one law."""
    extrema: SpeedExtrema | None
    """None if too few speeds are determined."""


class Laws(NamedTuple):
    """Scaling laws of the curves that have a minimum and a peak and differ in epsilon, L, N and tau alone."""

    curves: int
    """Number of these curves."""
    exponents: list[Comparison]
    offset_laws: dict[str, OffsetLaw]
    """Laws of T_m and T_p, by name."""
    reason: str
    """Why there are no laws, or nothing."""
    left_out: int = 0
    """Number of curves with a minimum and a peak that differ from these in another setting."""


def fit_curves(folder: Path) -> list[FittedCurve]:
    """Find the local minimum and the peak of each curve of T_sync against speed in a run folder.

    Raises:
        StoreError: The folder is not a run folder.
        EpuckSimError: None of its axes is a speed.
    """
    points = read_points(folder)
    try:
        axis = choose_axis(points)
    except EpuckSimError as error:
        raise EpuckSimError(f"{folder}: {error}") from error
    if not axis.endswith(SPEED):
        raise EpuckSimError(f"{folder}: no axis ends in {SPEED}; extrema are those of T_sync against speed")
    curves = read_curves(points, axis)
    if not curves:
        raise StoreError(f"{folder}: holds no results yet")
    return [
        FittedCurve(
            run=str(folder),
            axes=curve.axes,
            parameters=curve.scenario.scales,
            others=_other_settings(curve.scenario),
            extrema=find_minimum_and_peak(curve.x, curve.means, curve.resampled),
        )
        for curve in curves
    ]


def _other_settings(scenario: Scenario) -> str:
    """Return all settings that a law does not account for, as text."""
    rest = scenario.model_dump(mode="json", exclude=WITHOUT_EFFECT | {"seed"})
    for key in scenario.scale_keys:
        *path, name = key.split(".")
        section: Any = rest
        for part in path:
            section = section[int(part)] if isinstance(section, list) else section[part]
        section.pop(name, None)
    return json.dumps(rest)


def fit_laws(curves: Sequence[FittedCurve]) -> Laws:
    """Fit the laws to the largest group of curves that differ in nothing but speed, epsilon, L, N and tau."""
    found = [curve for curve in curves if curve.extrema is not None and curve.extrema.is_found]
    if not found:
        return Laws(0, [], {}, "no curve has a local minimum and a peak")
    ((most, _),) = Counter(curve.others for curve in found).most_common(1)
    alike = [curve for curve in found if curve.others == most]
    parameters = {name: np.array([curve.parameters[name] for curve in alike]) for name in alike[0].parameters}
    extrema = [curve.extrema for curve in alike]
    try:
        exponents = compare_laws(parameters, extrema)
    except ValueError as error:
        return Laws(len(alike), [], {}, str(error))
    if not exponents:
        several = f"{len(alike)} curves with a minimum and a peak"
        return Laws(len(alike), [], {}, f"{several}, none of which differ in epsilon, L, N or tau")
    return Laws(len(alike), exponents, _offset_laws(parameters, extrema), "", len(found) - len(alike))


def _offset_laws(parameters: Parameters, extrema: Sequence[SpeedExtrema | None]) -> dict[str, OffsetLaw]:
    """Return the laws of T_m and T_p; none where the curves do not vary in what these depend on."""
    values = np.array([each[:4] for each in extrema if each])
    resampled = np.stack([each.resampled for each in extrema if each], axis=1)
    laws = {}
    with suppress(ValueError):
        for name, column in (("T_m", 1), ("T_p", 3)):
            laws[name] = fit_offset_law(parameters, values[:, column], resampled[:, :, column])
    return laws
