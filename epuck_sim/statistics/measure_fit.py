"""The minimum and the peak of a measure along an axis of a sweep, or why they cannot be looked for."""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.display.table import Row, Table
from epuck_sim.statistics.curves import Curve, folder_curves
from epuck_sim.statistics.extrema import MIN_SPEEDS, MIN_TRIALS, smooth_logs
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.turning_points import TurningPoint, find_minimum, find_peak


class MeasureFit(NamedTuple):
    """The minimum and the peak of a measure on one curve of a run folder."""

    run: str
    """The run folder."""
    of: str
    """Name of the measure."""
    axis: str
    """Dotted key of the axis."""
    axes: dict[str, Any]
    """Values of the other axes."""
    statistic: str
    """Name of what stands for the trials of a point."""
    minimum: TurningPoint | None
    peak: TurningPoint | None
    """None where the curve has none, or where they cannot be looked for."""
    reason: str
    """Why they cannot, and what would be enough; empty where they can."""

    def record(self) -> dict[str, Any]:
        """Return what is found, as JSON holds it."""
        found = {name: point and point.record() for name, point in (("minimum", self.minimum), ("peak", self.peak))}
        return {**self._asdict(), **found}


def fit_measure(
    folder: Path | str, of: str, axis: str | None = None, statistic: Statistic = Statistic.MEAN
) -> list[MeasureFit]:
    """Find the minimum and the peak of each curve of a measure along an axis.

    Args:
        folder: A run folder.
        of: Name of the measure.
        axis: Dotted key of the axis; by default the speed, or the axis with the most numbers.
        statistic: What stands for the trials of a point.

    Raises:
        EpuckSimError: As `curves.folder_curves` does.
    """
    chosen, curves = folder_curves(folder, of, axis, statistic)
    return [_fit_curve(str(folder), of, chosen, curve) for curve in curves]


def _fit_curve(run: str, of: str, axis: str, curve: Curve) -> MeasureFit:
    head = run, of, axis, curve.axes, curve.names[0]
    usable = (curve.x > 0) & (curve.trials >= MIN_TRIALS) & np.isfinite(curve.values)
    reason = _reason_against(curve, int(np.count_nonzero(usable)))
    if reason:
        return MeasureFit(*head, None, None, reason)
    fit = smooth_logs(curve.x[usable], curve.values[usable], curve.resampled[:, usable])
    assert fit is not None  # with so many points
    return MeasureFit(*head, find_minimum(fit), find_peak(fit), "")


def _reason_against(curve: Curve, usable: int) -> str:
    positive = int(np.count_nonzero(curve.x > 0))
    if curve.is_share:
        return "it is a truth value; shares of trials are not looked at in logarithms"
    if (curve.values <= 0).any() or (curve.resampled <= 0).any():
        return "not all of its values are positive, and it is looked at in logarithms"
    if positive < MIN_SPEEDS:
        return f"{positive} positive values of the axis; a minimum and a peak take {MIN_SPEEDS}"
    if usable < MIN_SPEEDS:
        return (
            f"fewer than {MIN_TRIALS} trials with a value at {positive - usable} of {positive} points, which noise "
            f"alone makes rise; --trials {MIN_TRIALS} is the least"
        )
    return ""


def measure_fit_table(fits: Sequence[MeasureFit]) -> Table:
    """Return a table of the minimum and the peak of each curve."""
    keys = list(dict.fromkeys(key for fit in fits for key in fit.axes))
    rows = []
    for fit in fits:
        cells: dict[str, Any] = {}
        for name in ("minimum", "peak"):
            found = fit.record()[name] or {}
            cells |= {f"{name}_{part}": found.get(part) for part in ("place", "value", "p_value")}
        rows.append(Row({"run": fit.run, **{key: fit.axes.get(key, "") for key in keys}}, cells))
    of, axes = fits[0].of, " or ".join(dict.fromkeys(fit.axis for fit in fits))
    statistics = " or ".join(dict.fromkeys(fit.statistic for fit in fits))
    notes = [f"{of}: {statistics}. -: none between the ends of the axis that noise could not explain."]
    reasons = Counter(fit.reason for fit in fits if fit.reason)
    notes += [f"Not looked for on {count} of {len(fits)} curves: {reason}." for reason, count in reasons.items()]
    parts = {"place": "{} at", "value": "{}", "p_value": "p of {}"}
    headings = {f"{name}_{part}": text.format(name) for name in ("minimum", "peak") for part, text in parts.items()}
    return Table(f"Minimum and peak of {of} against {axes}, with 95 % intervals", rows, notes, headings)
