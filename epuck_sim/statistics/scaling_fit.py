"""The regimes of run folders, and the scaling laws that they follow (thesis 4.2.2)."""

import json
import math
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.runs.reader import read_points
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.statistics.curves import SPEED, choose_axis, read_curves
from epuck_sim.statistics.extrema import SpeedExtrema, find_minimum_and_peak
from epuck_sim.statistics.scaling_laws import Comparison, OffsetLaw, Parameters, compare_laws, fit_offset_law

SCALES = (
    ("agents", "speed_cm_s"),
    ("response", "coupling"),
    ("space", "side_cm"),
    ("agents", "count"),
    ("clocks", "period_s"),
)
"""Of a particle scenario: V, epsilon, L, N and tau."""


class FittedCurve(NamedTuple):
    """The local minimum and the peak of one curve."""

    run: str
    """Its run folder."""
    axes: dict[str, Any]
    """Values of the axes other than speed."""
    parameters: dict[str, float]
    """epsilon, L (cm), N and tau (s)."""
    others: str
    """All else in its scenario, as text; curves that share it can follow one law."""
    bump: SpeedExtrema | None
    """None if too few speeds are determined."""


class Laws(NamedTuple):
    """The scaling laws of the curves that differ in epsilon, L, N and tau alone and have a bump."""

    curves: int
    """How many those are."""
    exponents: list[Comparison]
    offset_laws: dict[str, OffsetLaw]
    """Of T_m and T_p."""
    reason: str
    """Why there are none, if so."""
    left_out: int = 0
    """Curves with a bump that differ from these in something else."""


def fit_curves(folder: Path) -> list[FittedCurve]:
    """Return the regimes of each curve of T_sync against speed in a run folder.

    Raises StoreError for what is no run folder, EpuckSimError where no axis is a speed.
    """
    points = read_points(folder)
    try:
        axis = choose_axis(points)
    except EpuckSimError as error:
        raise EpuckSimError(f"{folder}: {error}") from error
    if not axis.endswith(SPEED):
        raise EpuckSimError(f"{folder}: no axis ends in {SPEED}; regimes are those of T_sync against speed")
    curves = read_curves(points, axis)
    if not curves:
        raise StoreError(f"{folder}: holds no results yet")
    return [
        FittedCurve(
            run=str(folder),
            axes=curve.axes,
            parameters=_parameters(curve.scenario),
            others=_others(curve.scenario),
            bump=find_minimum_and_peak(curve.x, curve.means, curve.resampled),
        )
        for curve in curves
    ]


def _parameters(scenario: Scenario) -> dict[str, float]:
    if isinstance(scenario, ParticleScenario):
        return {
            "epsilon": scenario.response.coupling,
            "L": scenario.space.side_cm,
            "N": float(scenario.agents.count),
            "tau": scenario.clocks.period_s,
        }
    assert isinstance(scenario, EmbodiedScenario)
    values = scenario.robots[0].parameters
    return {
        "epsilon": float(values.get("coupling", math.nan)),
        "L": math.sqrt(scenario.arena.width_cm * scenario.arena.height_cm),
        "N": float(scenario.robot_count),
        "tau": float(values.get("period_s", math.nan)),
    }


def _others(scenario: Scenario) -> str:
    """Return all that a law does not account for, as text."""
    rest = scenario.model_dump(mode="json", exclude=WITHOUT_EFFECT | {"seed"})
    if isinstance(scenario, ParticleScenario):
        for section, key in SCALES:
            del rest[section][key]
        return json.dumps(rest)
    for name in ("width_cm", "height_cm"):
        del rest["arena"][name]
    for number, group in enumerate(rest["robots"]):
        del group["count"]
        group["parameters"].pop(SPEED.removeprefix("."), None)
        if number == 0:
            group["parameters"].pop("coupling", None)
            group["parameters"].pop("period_s", None)
    return json.dumps(rest)


def fit_laws(curves: Sequence[FittedCurve]) -> Laws:
    """Return the laws of the largest group of curves that differ in nothing but speed, epsilon, L, N and tau."""
    having = [curve for curve in curves if curve.bump is not None and curve.bump.is_found]
    if not having:
        return Laws(0, [], {}, "no curve has a local minimum and a peak")
    ((most, _),) = Counter(curve.others for curve in having).most_common(1)
    alike = [curve for curve in having if curve.others == most]
    parameters = {name: np.array([curve.parameters[name] for curve in alike]) for name in alike[0].parameters}
    bumps = [curve.bump for curve in alike]
    try:
        exponents = compare_laws(parameters, bumps)
    except ValueError as error:
        return Laws(len(alike), [], {}, str(error))
    if not exponents:
        return Laws(len(alike), [], {}, f"{len(alike)} curves with both; none differ in epsilon, L, N or tau")
    return Laws(len(alike), exponents, _offset_laws(parameters, bumps), "", len(having) - len(alike))


def _offset_laws(parameters: Parameters, bumps: Sequence[SpeedExtrema | None]) -> dict[str, OffsetLaw]:
    """Return the laws of T_m and T_p; none where the curves do not vary in what these depend on."""
    found = np.array([bump[:4] for bump in bumps if bump])
    resampled = np.stack([bump.resampled for bump in bumps if bump], axis=1)
    laws = {}
    with suppress(ValueError):
        for name, place in (("T_m", 1), ("T_p", 3)):
            laws[name] = fit_offset_law(parameters, found[:, place], resampled[:, :, place])
    return laws
