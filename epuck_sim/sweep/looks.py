"""Looks at the points of a sweep while it runs: trials are added to a point until its interval is narrow enough."""

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

from epuck_sim.display.table import Row, Share, Table
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.runs.reader import FinishedTrials
from epuck_sim.runs.store import Store
from epuck_sim.scenario.axes import group_rows
from epuck_sim.scenario.keys import axis_key
from epuck_sim.scenario.loader import Point, describe_axes
from epuck_sim.statistics.sequential import FIRST_LOOK, Precision, look_contrast, look_interval, look_sizes
from epuck_sim.statistics.statistic import Measured, restrict
from epuck_sim.util.messages import comma_list, counted


class Look(NamedTuple):
    """A look at a point."""

    trials: int  # number of its first trials that were looked at
    mean: Estimate
    """Mean of their T_sync, restricted where trials are censored, with an interval that holds at every look."""
    contrast: Estimate | None
    """Ratio, or difference, of the mean to that of its group's first point; None for that point or without contrast."""
    width: float
    """Width of the interval over the width asked for; a group's first point has the largest. Inf without interval."""

    @property
    def is_narrow(self) -> bool:
        """Whether the interval is narrow enough."""
        return self.width <= 1


class Looks:
    """The last look at each point of a sweep; `run_sweep` asks it at which points trials are missing.

    A point is looked at when its first 20, 30, 45 ... trials have ended, and the decision depends on these trials
    alone: not on workers, on the order in which trials end, or on what else is stored. With a contrast, all points of a
    group, which differ only in the contrast's key, are looked at together.
    """

    def __init__(self, until: str, contrast: str | None = None) -> None:
        """Set the largest half-width of intervals: `10%` of the estimate, or `3` cycles.

        With `contrast`, an axis or an ending of its key, intervals are of ratios, or differences, to its first value.
        """
        self._precision, self._key = Precision.parse(until), contrast
        self.narrow = 0  # number of points whose intervals are narrow enough

    def check(self, points: Sequence[Point]) -> None:
        """Raise EpuckSimError for a sweep without T_sync, with too low a limit of trials, or without the contrast."""
        scenario = points[0].scenario
        if not all(point.scenario.has_t_sync for point in points):
            said = "give stop.order_parameter and an oscillator as reference, or stop.when with stop.gives_t_sync"
            raise EpuckSimError(f"--until needs T_sync: {said}")
        if scenario.trials < FIRST_LOOK:
            said = f"trials is {scenario.trials}, the most that --until may run at a point"
            raise EpuckSimError(f"{said}; allowed: {FIRST_LOOK} or more, such as --trials 1000")
        if self._key is None:
            return
        if "=" in self._key:
            raise EpuckSimError(f"--contrast is {self._key}; allowed: a key alone; give --sweep its values")
        rows = [point.axes for point in points]
        self._key = axis_key(self._key, rows, "--contrast")
        if self._key not in rows[0] or min(map(len, self._groups(points))) == 1:
            said = "allowed: an axis with two values or more, among"
            raise EpuckSimError(f"--contrast is {self._key}; {said} {comma_list(list(rows[0]))}")
        for group in self._groups(points):
            if group[0].axes[self._key] != rows[0][self._key]:
                where = f"point {group[0].number} ({describe_axes(group[0].axes)})"
                raise EpuckSimError(f"--contrast is {self._key}; {where} has no counterpart at the first value")

    def _groups(self, points: Sequence[Point]) -> list[list[Point]]:
        """Return the points that are looked at together: each alone, or those that differ in the contrast's key.

        The one that has the key's first value comes first.
        """
        if (key := self._key) is None:
            return [[point] for point in points]
        groups = [[points[place] for place in places] for _, places in group_rows([each.axes for each in points], key)]
        return [sorted(group, key=lambda point: point.axes[key] != points[0].axes[key]) for group in groups]

    def begin(self, store: Store, points: Sequence[Point], finished: FinishedTrials) -> list[int]:
        """Look at the stored trials, and return the number of trials that each point needs so far."""
        self._store, self._points, self._finished = store, points, finished
        self.narrow = 0
        groups = self._members = self._groups(points)
        self._last = [Look(0, UNDETERMINED, None, math.inf)] * len(points)
        self._trials, self._left = [0] * len(points), [0] * len(groups)
        self._group = {point.number: place for place, group in enumerate(groups) for point in group}
        self._looks = [self._look(group) for group in groups]
        self._go_on(*range(len(groups)))
        return self._trials

    def end_trial(self, number: int) -> Sequence[tuple[int, int]]:
        """Record that a trial of a point has ended, and return point and number of each trial to add now."""
        group = self._group[number]
        self._left[group] -= 1
        return () if self._left[group] else self._go_on(group)

    def _go_on(self, *groups: int) -> Sequence[tuple[int, int]]:
        """Look at groups as long as no trials are missing, store their numbers of trials, and return those missing."""
        missing: list[tuple[int, int]] = []
        for group in groups:
            of_group = next(self._looks[group], ())
            self._left[group] = len(of_group)
            missing += of_group
        planned = (point for group in groups for point in self._members[group])
        self._store.plan({point.key: self._trials[point.number] for point in planned})
        return missing

    def _look(self, group: Sequence[Point]) -> Iterator[Sequence[tuple[int, int]]]:
        """Look at points until all intervals are narrow enough; yield the trials that are missing before a look."""
        limit, before = group[0].scenario.trials, 0
        for size in look_sizes(limit):
            for point in group:
                self._trials[point.number] = size
            missing = [
                (point.number, before + place)
                for point in group
                for place in self._finished.missing(point.number, range(before, size))
            ]
            if missing:
                yield missing
            before = size
            for point, look in zip(group, self._look_at(group, size), strict=True):
                self.narrow += look.is_narrow - self._last[point.number].is_narrow
                self._last[point.number] = look
            if all(self._last[point.number].is_narrow for point in group):
                return

    def _look_at(self, group: Sequence[Point], size: int) -> list[Look]:
        limit, samples = group[0].scenario.trials, []
        for point in group:
            times, observed = self._store.ends(point.key, size)
            samples.append(Measured(times, observed, float(point.scenario.stop.max_cycles), 0, unit="cycles"))
        means = [look_interval(each, limit) for each in samples]
        if self._key is None:
            return [Look(size, mean, None, self._precision.width(mean)) for mean in means]
        first, *others = (look_interval(each, limit) for each in restrict(samples))
        contrasts = [look_contrast(first, mean, is_relative=self._precision.is_relative) for mean in others]
        widths = [*map(self._precision.width, contrasts)]
        return [Look(size, *row) for row in zip(means, [None, *contrasts], [max(widths), *widths], strict=True)]

    def width(self, number: int) -> float:
        """Return the width of a point's interval over the width asked for; inf as long as there is none."""
        return self._last[number].width

    def table(self) -> Table:
        """Return a table of the last look at each point."""
        asked, rows = self._precision, []
        contrast = "ratio" if asked.is_relative else "difference"
        for point, look in zip(self._points, self._last, strict=True):
            reach = look.width * asked.reach
            cells = {
                "point": point.number,
                "trials": look.trials,
                "mean": look.mean,
                **({} if self._key is None else {contrast: look.contrast}),
                "half_width": Share(reach) if asked.is_relative else reach,
                "is_narrow": look.is_narrow,
            }
            rows.append(Row(point.axes, cells))
        title = f"T_sync (cycles), with 95 % intervals that hold at every look; asked for: +- {asked}"
        note = f"Narrow enough: {self.narrow} of {counted(len(rows), 'point')}"
        limit = self._points[0].scenario.trials
        more = "" if self.narrow == len(rows) else f"; the others have reached the limit of {limit} trials"
        headings = {"mean": "mean or restricted mean", "half_width": "half-width", "is_narrow": "narrow enough"}
        headings[contrast] = f"{contrast} to the first"
        return Table(title, rows, [f"{note}{more}."], headings)
