"""One measure of the trials of a point: their values, and which of these are censored."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError, MeasureError, StoreError
from epuck_sim.estimate import MIN_TRIALS, Estimate
from epuck_sim.runs.reader import PointTrials
from epuck_sim.util.messages import comma_list


class Measured(NamedTuple):
    """The values of a measure in n trials."""

    values: FloatArray  # (n,) values; of a censored trial all that is known is that its value is larger than this
    observed: BoolArray  # (n,) whether each value is known; otherwise it is censored
    limit: float  # largest value that a trial can have before it is censored; inf for a measure that is never censored
    seed: int  # seed of resamples
    is_share: bool = False
    """Whether the values are truth values, 1 or 0, whose mean is the share of trials in which they are true."""
    unit: str = ""  # unit of the values; empty if they have none

    @property
    def censored(self) -> float:
        """Share of the trials that is censored."""
        return 1 - float(self.observed.mean()) if len(self.observed) else 0.0

    @property
    def supports_interval(self) -> bool:
        """Whether an interval can be given: there are trials enough, and not all have one value."""
        return len(self.values) >= MIN_TRIALS and len(np.unique(self.values)) > 1

    @property
    def horizon(self) -> float:
        """Value up to which the distribution is known: the limit, or the longest trial where some are censored sooner.

        Trials that ran out of time before they ran out of cycles say nothing about what comes after them.
        """
        return self.limit if self.observed.all() else min(self.limit, float(self.values.max()))

    def described(self, found: Estimate, name: str) -> Estimate:
        """Return an estimate that is of these trials, under its name."""
        return found._replace(name=name, unit=self.unit, n=len(self.values), censored=self.censored)


def cut(measured: Measured, limit: float) -> Measured:
    """Return the values as if trials were censored at a lower limit."""
    observed = measured.observed & (measured.values <= limit)
    return measured._replace(
        values=np.minimum(measured.values, limit), observed=observed, limit=min(limit, measured.limit)
    )


def restrict(samples: Sequence[Measured]) -> list[Measured]:
    """Return samples cut at the lowest of their horizons, if trials of any are censored: then their means compare."""
    if all(each.observed.all() for each in samples):
        return list(samples)
    horizon = min(each.horizon for each in samples)
    return [cut(each, horizon) for each in samples]


def quantity(of: str | None, unit: str = "") -> str:
    """Return the name of T_sync, or of a measure, with its unit if it has one.

    >>> quantity(None), quantity("near_walls"), quantity("way", "cm")
    ('T_sync (cycles)', 'near_walls', 'way (cm)')
    """
    name, unit = ("T_sync", "cycles") if of is None else (of, unit)
    return f"{name} ({unit})" if unit else name


def measure_unit(point: PointTrials) -> str | None:
    """Return the unit of the measure of a point, empty if it has none; None if the measure is not found."""
    sections = [section for section in point.scenario.measures if section.name == point.of]
    try:
        return sections[0].find().unit if sections else None
    except MeasureError:  # its file is gone
        return None


def check_units(points: Sequence[PointTrials]) -> None:
    """Raise EpuckSimError if a measure has several units at points of several folders; one whose file is gone fits."""
    found = map(measure_unit, points)
    units = dict.fromkeys(unit or "none" for unit in found if unit is not None)
    if len(units) > 1:
        raise EpuckSimError(f"the unit of {points[0].of} differs: {comma_list([*units])}; give folders with one")


def measure_t_sync(point: PointTrials) -> Measured:
    """Return T_sync, in cycles, of a point's trials; raise StoreError if they have none."""
    if not point.has_t_sync:
        names = comma_list([section.name for section in point.scenario.measures])
        raise StoreError(
            "trials have no T_sync: their reference is no oscillator, or stop.order_parameter is null; what was "
            f"measured: {names} (--of NAME, or read_points(folder, of=NAME))"
        )
    limit = float(point.scenario.stop.max_cycles)
    return Measured(point.times, point.observed, limit, point.seed, unit="cycles")


def measure(point: PointTrials) -> Measured:
    """Return the values of the measure that `read_points` was asked for; T_sync if it was asked for none.

    Values that are undetermined are left out. Truth values count as 1 and 0, so that their mean is the share of trials
    in which they are true. StoreError is raised for series, and where trials have no T_sync.
    """
    if point.of is None:
        return measure_t_sync(point)
    if any(isinstance(value, list) for value in point.measured):
        raise StoreError(
            f"{point.of} is a series, with a value for each cycle; this takes one value a trial: allowed are plot "
            "--form series and summarize (statistics.series)"
        )
    known = [value for value in point.measured if value is not None and not isinstance(value, list)]
    is_share = bool(known) and all(isinstance(value, bool) for value in known)
    ones = np.ones(len(known), np.bool_)
    return Measured(np.array(known, float), ones, math.inf, point.seed, is_share, measure_unit(point) or "")
