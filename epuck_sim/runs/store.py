"""Writing to a run folder: the results of a sweep, one row for each trial, on disk as soon as it is known.

A folder belongs to one sweep. Points and trials can be added, and a run that was stopped goes on in it; it never holds
results of two scenarios.
"""

import json
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from epuck_sim.errors import StoreError
from epuck_sim.runs.checksums import Signer, quoted
from epuck_sim.runs.compatibility import StoredPoint, check_same_sweep, read_stored_points, stored_point
from epuck_sim.runs.database import (
    add_later_columns,
    as_column,
    check_database,
    new_database,
    note_trials,
    read_share,
    reading,
    sqlite_errors,
    writing,
)
from epuck_sim.runs.finished import FinishedTrials
from epuck_sim.runs.reader import measures_in
from epuck_sim.runs.records import Outcome
from epuck_sim.runs.remeasured import StoredResult, difference, events_json
from epuck_sim.runs.run_lock import acquire
from epuck_sim.runs.schema import DATABASE, ENTER_POINT, RESULT, UNMEASURED
from epuck_sim.runs.share import WHOLE, Share
from epuck_sim.scenario.loader import RUN_SCENARIO, write_scenario
from epuck_sim.scenario.points import Point
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.atomic_write import atomic_write, sync_folder
from epuck_sim.util.provenance import PROVENANCE

_STORED = "FROM trials WHERE error IS NULL"
_FINISHED = f"FROM trials JOIN points ON point = key WHERE error IS NULL AND NOT {UNMEASURED}"
_UNMEASURED = f"FROM trials JOIN points ON point = key WHERE error IS NULL AND {UNMEASURED}"
_DELETE_FAILED = "DELETE FROM trials WHERE point = ? AND trial = ? AND error IS NOT NULL"


class Store:
    """A run folder that this process has locked; to be used in a `with` block."""

    def __init__(self, folder: Path, scenario: Scenario, points: Sequence[Point], share: Share | None = None) -> None:
        """Lock the folder, which is made if it does not exist, and enter the points that are new.

        Args:
            folder: A run folder, or one that is new or empty.
            scenario: What is run.
            points: All its points.
            share: Share of the trials that the folder is for; by default what it was for before, or the whole sweep.

        Raises:
            StoreError: The folder belongs to another sweep, is damaged, or is in use; nothing in it has been changed.
        """
        self._path = folder / DATABASE
        self._points = points
        rows = [stored_point(point) for point in points]
        if self._path.exists():
            check_database(self._path)
        with ExitStack() as stack:
            stack.enter_context(acquire(folder))
            sync_folder(folder.parent)  # which may have got the folder just now
            if self._path.exists():
                check_same_sweep(folder, _stored_points(self._path), rows)
                share = _check_same_share(self._path, share)
            rows = [row._replace(share=str(share) if share else None) for row in rows]
            if not self._path.exists():
                with new_database(self._path, list(points[0].axes), rows):
                    pass
            # before the points: the folder's own scenario must have all that the database has
            with atomic_write(folder / RUN_SCENARIO) as part:
                part.write_text(write_scenario(scenario), encoding="utf-8")
            stack.enter_context(sqlite_errors(self._path))
            self._connection = stack.enter_context(writing(self._path))
            with self._connection:
                add_later_columns(self._connection)
                self._connection.execute("DELETE FROM points WHERE key NOT IN (SELECT point FROM trials)")
                self._connection.executemany(ENTER_POINT, rows)
                Signer(self._connection, "points").sign()
            self.share = share or WHOLE
            self._measures = measures_in(self._connection)
            self._finished = _FINISHED if self._measures else _STORED
            self._signer = Signer(self._connection, "trials")
            columns = ("point", "trial", *points[0].axes, "seed", *RESULT, *PROVENANCE, "error", "measured", "events")
            self._insert = (
                f"INSERT INTO trials ({', '.join(map(quoted, columns))}) VALUES ({', '.join('?' * len(columns))}) "
                "ON CONFLICT DO NOTHING"
            )
            (self._trials,) = self._connection.execute("SELECT count(*) FROM trials").fetchone()
            note_trials(self._path, self._trials)
            self._resources = stack.pop_all()

    def finished(self) -> FinishedTrials:
        """Return the numbers of point and trial of every trial that has a result, and a value of each measure.

        Failed trials have no result; trials from before a measure was added do not have its value.
        """
        with sqlite_errors(self._path):
            numbers = {point.key: point.number for point in self._points}
            return FinishedTrials.read(self._connection, self._finished, numbers)

    def censored(self) -> int | None:
        """Return how many finished trials were not synchronised; None if none of them has a T_sync."""
        with sqlite_errors(self._path):
            (count,) = self._connection.execute(f"SELECT sum(censored) {self._finished}").fetchone()
        return None if count is None else int(count)

    def add(self, outcome: Outcome) -> bool:
        """Store a trial as `add_all` does; return whether it has a result with all its measures now."""
        return self.add_all([outcome])[0]

    def add_all(self, outcomes: Sequence[Outcome]) -> list[bool]:
        """Store trials on the disk, all or none; an earlier failure is replaced, an earlier result only measured.

        Returns:
            Whether each has a result with all its measures now.
        """
        self._new = 0
        with sqlite_errors(self._path), self._connection:
            put = [self._put(outcome) for outcome in outcomes]
        self._trials += self._new
        note_trials(self._path, self._trials)
        return put

    def _put(self, outcome: Outcome) -> bool:
        stored = self._without_measures(outcome) if self._measures else None
        if stored is None:
            self._enter(outcome)
            self._sign(outcome)
            return outcome.result is not None
        error = outcome.error if outcome.result is None else difference(stored, outcome.result)
        measured = stored.measured if outcome.result is None or error else _measured(outcome.result)
        self._connection.execute(
            "UPDATE trials SET measured = ?, measuring_error = ? WHERE point = ? AND trial = ?",
            (measured, error, self._points[outcome.point].key, outcome.trial),
        )
        self._sign(outcome)
        return error is None

    def _without_measures(self, outcome: Outcome) -> StoredResult | None:
        """Return what is stored of a trial that has a result and lacks measures; None if it is not such a trial."""
        row = self._connection.execute(
            f"SELECT {', '.join(StoredResult._fields)} {_UNMEASURED} AND point = ? AND trial = ?",
            (self._points[outcome.point].key, outcome.trial),
        ).fetchone()
        return row and StoredResult(*row)

    def _enter(self, outcome: Outcome) -> None:
        point, result = self._points[outcome.point], outcome.result
        values = (
            *(point.key, outcome.trial),
            *(as_column(value) for value in point.axes.values()),
            outcome.seed,
            *(None if result is None else getattr(result, name) for name in RESULT),
            *(outcome.provenance[name] for name in PROVENANCE),
            outcome.error,
            None if result is None else _measured(result),
            None if result is None else events_json(result),
        )
        replaced = self._connection.execute(_DELETE_FAILED, values[:2]).rowcount
        self._new += self._connection.execute(self._insert, values).rowcount - replaced

    def _sign(self, outcome: Outcome) -> None:
        row = self._points[outcome.point].key, outcome.trial
        self._signer.sign("point = ? AND trial = ?", row)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._resources.close()


def _measured(result: TrialResult) -> str | None:
    return json.dumps(result.measures) if result.measures else None


def _check_same_share(path: Path, given: Share | None) -> Share | None:
    """Return the share that a folder is for; None for the whole sweep, or raise StoreError if another is given."""
    with reading(path) as connection:
        stored = read_share(connection)
    if given not in (None, stored):
        what = "the whole sweep" if stored == WHOLE else f"share {stored}"
        raise StoreError(f"{path.parent}: is for {what}, --share is {given}; give another folder")
    return None if stored == WHOLE else stored


def _stored_points(path: Path) -> list[StoredPoint]:
    with reading(path) as connection:
        return read_stored_points(connection, "(SELECT ifnull(max(trial) + 1, 0) FROM trials WHERE point = key)")
