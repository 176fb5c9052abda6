"""Looks at the points of a sweep while it runs: trials are added to a point until its interval is narrow enough."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from epuck_sim.display.table import Row, Share, Table
from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.estimate import UNDETERMINED, Estimate
from epuck_sim.runs.records import FinishedTrials
from epuck_sim.runs.share import WHOLE
from epuck_sim.runs.store import Store
from epuck_sim.scenario.points import Point
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.sequential import FIRST_LOOK, Precision, look_interval, look_sizes
from epuck_sim.util.messages import counted


class Look(NamedTuple):
    """A look at a point."""

    trials: int
    """Number of its first trials that were looked at."""
    estimate: Estimate
    """Mean of their T_sync, restricted where trials are censored, with an interval that holds at every look."""
    width: float
    """Width of the interval relative to what is asked; inf as long as there is none."""

    @property
    def is_narrow(self) -> bool:
        """Whether the interval is narrow enough."""
        return self.width <= 1


class Looks:
    """The last look at each point of a sweep that `run_sweep` is given, which asks it where trials are missing.

    A point is looked at when its first 20, 30, 45 ... trials have ended, and what is decided of it depends on these
    alone: not on workers, on the order in which trials end, or on what else is stored.
    """

    def __init__(self, until: str) -> None:
        """Take what is asked, as 10% of the estimate, or 3 cycles; half of an interval's width is to be at most that.

        Raises:
            EpuckSimError: It is neither.
        """
        self._precision = Precision.parse(until)
        self._last: list[Look] = []
        self.narrow = 0
        """Number of points whose intervals are narrow enough."""

    def check(self, points: Sequence[Point]) -> None:
        """Raise EpuckSimError for a sweep whose trials have no T_sync, or that may have too few of them."""
        scenario = points[0].scenario
        if any(point.scenario.stop.order_parameter is None for point in points):
            raise EpuckSimError("--until is about T_sync, which trials have none of: stop.order_parameter is null")
        if scenario.trials < FIRST_LOOK:
            raise EpuckSimError(
                f"trials is {scenario.trials}, the most that --until may run at a point, and it begins with "
                f"{FIRST_LOOK}; give --trials 1000, say"
            )

    def begin(self, store: Store, points: Sequence[Point], finished: FinishedTrials) -> list[int]:
        """Look at what is stored, and return the number of trials that each point is for so far.

        Raises:
            StoreError: The folder is for a share of the sweep, or its trials have no T_sync.
        """
        if store.share != WHOLE:
            raise StoreError(f"the folder is for share {store.share}; --until looks at all trials of a point: merge")
        self._store, self._points, self._finished = store, points, finished
        self.narrow = 0
        self._last = [Look(0, UNDETERMINED, self._precision.width(UNDETERMINED))] * len(points)
        self._trials, self._left = [0] * len(points), [0] * len(points)
        self._looks = [self._look(point) for point in points]
        for point in points:
            self._go_on(point.number)
        store.plan({point.key: self._trials[point.number] for point in points})
        return self._trials

    def end_trial(self, number: int) -> Sequence[int]:
        """Take note that a trial of a point has ended, and return the trials to be added to the point now."""
        self._left[number] -= 1
        if self._left[number]:
            return ()
        added = self._go_on(number)
        self._store.plan({self._points[number].key: self._trials[number]})
        return added

    def _go_on(self, number: int) -> Sequence[int]:
        missing = next(self._looks[number], ())
        self._left[number] = len(missing)
        return missing

    def _look(self, point: Point) -> Iterator[Sequence[int]]:
        """Look at a point until its interval is narrow enough; yield the trials that are missing before a look."""
        number, limit = point.number, point.scenario.trials
        for size in look_sizes(limit):
            before, self._trials[number] = self._trials[number], size
            if missing := [before + place for place in self._finished.missing(number, range(before, size))]:
                yield missing
            times, observed = self._store.ends(point.key, size)
            measured = Measured(times, observed, float(point.scenario.stop.max_cycles), 0, unit="cycles")
            found = look_interval(measured, limit)
            self._last[number] = Look(size, found, self._precision.width(found))
            if self._last[number].is_narrow:
                self.narrow += 1
                return

    def width(self, number: int) -> float:
        """Return the width of a point's interval relative to what is asked; inf as long as there is none."""
        return self._last[number].width

    def table(self) -> Table:
        """Return a table of the last look at each point."""
        rows = []
        for point, look in zip(self._points, self._last, strict=True):
            asked = self._precision
            reach = look.width * asked.reach
            cells = {
                "point": point.number,
                "trials": look.trials,
                "mean": look.estimate,
                "half_width": Share(reach) if asked.is_relative else reach,
                "is_narrow": look.is_narrow,
            }
            rows.append(Row(point.axes, cells))
        title = f"T_sync (cycles), with 95 % intervals that hold at every look; asked for: +- {self._precision}"
        note = f"Narrow enough: {self.narrow} of {counted(len(rows), 'point')}"
        limit = self._points[0].scenario.trials
        more = "" if self.narrow == len(rows) else f"; the others have {limit} trials, the most that they may"
        headings = {"mean": "mean or restricted mean", "half_width": "half-width", "is_narrow": "narrow enough"}
        return Table(title, rows, [f"{note}{more}."], headings)
