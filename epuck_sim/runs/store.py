"""Write the results of a sweep to a run folder: one row for each trial, on disk as soon as it is known.

A folder belongs to one sweep. Points and trials can be added, and a run that was stopped can be continued; a folder
never holds results of two scenarios.
"""

import json
import warnings
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, suppress
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import StoreError
from epuck_sim.runs import database
from epuck_sim.runs.compatibility import WHOLE, Share, check_stored_points, read_share, stored_point, without
from epuck_sim.runs.database import NULL, REPEATED, UNMEASURED, as_column, as_stored, quoted, sign, sqlite_errors
from epuck_sim.runs.folder import DATABASE, acquire, is_at
from epuck_sim.runs.reader import FinishedTrials, read_ends, read_finished
from epuck_sim.runs.sources import write_sources
from epuck_sim.scenario.loader import Point
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.util.atomic_write import sync_folder
from epuck_sim.util.messages import counted, short_yaml
from epuck_sim.util.provenance import PROVENANCE

_OF_TRIAL = "WHERE point = ? AND trial = ?"


class Outcome(NamedTuple):
    """A trial that has ended, with a result or with an error, as its row in the database has it."""

    point: int  # number of its point
    trial: int
    seed: int
    t_sync_cycles: int | None
    censored: int | None
    order_parameter: float | None
    simulated_s: float | None
    wall_s: float | None
    steps: int | None
    cycles: int | None
    error: str | None  # message of the error with which it failed; None if it has a result
    measured: str | None
    events: str | None
    provenance: tuple[str, ...]  # versions, and the host that ran it, in the order of `PROVENANCE`


class Store(AbstractContextManager["Store"]):
    """A run folder that this process has locked; to be used in a `with` block."""

    def __init__(self, folder: Path, scenario: Scenario, points: Sequence[Point], share: Share | None = None) -> None:
        """Lock the folder, which is made if it does not exist, and add the points that are new."""
        self._path = folder / DATABASE
        self._points = points
        self._axes = [tuple(as_stored(as_column(value)) for value in point.axes.values()) for point in points]
        rows = [stored_point(point) for point in points]
        if self._path.exists():
            database.check_database(self._path)
        with ExitStack() as stack:
            is_held = stack.enter_context(acquire(folder))
            sync_folder(folder.parent)  # in which the folder may be new
            is_new = not self._path.exists()
            dropped: set[str] = set()  # names of measures
            if not is_new:
                with database.reading(folder) as connection:
                    dropped = check_stored_points(folder, connection, rows)
                    was = read_share(connection)
                if share not in (None, was):
                    what = "the whole sweep" if was == WHOLE else f"share {was}"
                    whole = "not for the whole sweep, as --until and --share 1/1 are; merge shares, or"
                    asked = whole if share == WHOLE else f"--share is {share};"
                    raise StoreError(f"{folder}: is for {what}, {asked} give another folder")
                share = was
            self.share = share or WHOLE
            rows = [row._replace(share=None if self.share == WHOLE else str(self.share)) for row in rows]
            if is_new:
                with database.new_database(self._path, list(points[0].axes), rows):
                    pass
            # before the points: the folder's own scenario must cover all that the database has
            used = {(row.controllers, row.measures): point.scenario for row, point in zip(rows, points, strict=True)}
            self._sources = write_sources(folder, scenario, used.values())
            stack.enter_context(sqlite_errors(self._path))
            self._connection = stack.enter_context(database.writing(self._path))
            opened = self._path.stat()
            self._is_ours: Callable[[], bool] = lambda: is_held() and is_at(self._path, opened)
            with self._connection:
                if dropped:
                    self._drop(dropped)
                self._connection.execute("DELETE FROM points WHERE key NOT IN (SELECT point FROM trials)")
                self._connection.executemany(database.ENTER_POINT, rows)
                sign(self._connection, "points")
                measured = f"measuring_error IS NOT NULL AND NOT {UNMEASURED}"
                mended = f"UPDATE trials SET measuring_error = NULL WHERE {measured} RETURNING point, trial"
                sign(self._connection, "trials", self._connection.execute(mended).fetchall())
            self._has_measures = bool(database.measures_in(self._connection))
            columns = ("point", "trial", *points[0].axes, *Outcome._fields[2:-1], *PROVENANCE)
            self._with_sum = database.summing(self._connection, "trials", columns)
            self._insert = (
                f"INSERT INTO trials ({', '.join(map(quoted, columns))}, checksum) "
                f"VALUES ({', '.join('?' * len(columns))}, ?) ON CONFLICT DO NOTHING"
            )
            self._rows, self._failed = self._connection.execute("SELECT count(*), count(error) FROM trials").fetchone()
            database.note_trials(self._path, self._rows)
            self._resources = stack.pop_all()

    def _drop(self, measures: set[str]) -> None:
        stored = self._connection.execute("SELECT measured, point, trial FROM trials WHERE measured IS NOT NULL")
        rows = [(without(measures, values), *at) for values, *at in stored if measures & json.loads(values).keys()]
        self._connection.executemany(f"UPDATE trials SET measured = nullif(?, '{{}}') {_OF_TRIAL}", rows)
        sign(self._connection, "trials", [place for _, *place in rows])
        warnings.warn(
            f"{self._path.parent}: {' and '.join(sorted(measures))} failed in some trials, and was changed or left "
            f"out since: its values of {counted(len(rows), 'trial')} are dropped",
            stacklevel=3,
        )

    def finished(self) -> FinishedTrials:
        """Return the numbers of point and trial of every trial that has a result, and a value of each measure.

        Failed trials have no result; trials from before a measure was added do not have its value.
        """
        with sqlite_errors(self._path):
            return read_finished(self._connection, measured=self._has_measures)

    def censored(self) -> int | None:
        """Return how many finished trials were not synchronised; None if none of them has a T_sync."""
        measured = f"AND NOT {UNMEASURED}" if self._has_measures else ""
        with sqlite_errors(self._path):
            query = f"SELECT sum(censored) FROM trials WHERE error IS NULL {measured}"
            (count,) = self._connection.execute(query).fetchone()
        return None if count is None else int(count)

    def ends(self, key: str, trials: int) -> tuple[FloatArray, BoolArray]:
        """Return the cycles of each of a point's first trials that has a result, and whether it was synchronised."""
        with sqlite_errors(self._path):
            cycles, censored, _ = read_ends(self._connection, key, trials)
        if (censored == NULL).any():
            raise StoreError(f"{self._path.parent}: trials have no T_sync: their reference is no oscillator")
        return cycles.astype(float), censored == 0

    def plan(self, trials: Mapping[str, int]) -> None:
        """Store the planned number of trials of points, by their keys; it is at least that of their stored trials."""
        count = "max(?, (SELECT ifnull(max(trial) + 1, 0) FROM trials WHERE point = key))"
        rows = [(number, key) for key, number in trials.items()]
        with sqlite_errors(self._path), self._connection:
            self._connection.executemany(f"UPDATE points SET trials = {count} WHERE key = ?", rows)
            sign(self._connection, "points", [(key,) for key in trials])

    def add(self, outcomes: Sequence[Outcome]) -> list[bool]:
        """Store trials on the disk, all or none; replace earlier failures, and only add measures to earlier results."""
        places = [(self._points[outcome.point].key, outcome.trial) for outcome in outcomes]
        self._new = 0
        self._check_ours()
        for path, contents in self._sources.items():
            with suppress(OSError):  # an editor is replacing it
                if path.read_bytes() != contents:
                    said = "was changed while this run was at work; the run has ended"
                    advice = "has trials of the old file; restore that to go on, or give another folder"
                    raise StoreError(f"{path}: {said}: {self._path.parent} {advice}")
        with sqlite_errors(self._path), self._connection:
            if self._has_measures:
                are_stored = [self._put(outcome, place) for outcome, place in zip(outcomes, places, strict=True)]
            else:
                self._enter(outcomes, places)
                are_stored = [outcome.error is None for outcome in outcomes]
        self._check_ours()
        self._rows += self._new
        database.note_trials(self._path, self._rows)
        return are_stored

    def _check_ours(self) -> None:
        if not self._is_ours():
            said = "was moved, deleted, replaced or taken over while this run was at work on it"
            where = "its results are where the folder is now: go on there"
            raise StoreError(f"{self._path.parent}: {said}; the run has ended, and {where}")

    def _put(self, outcome: Outcome, place: tuple[str, int]) -> bool:
        columns = (*REPEATED, "measured", "events")
        query = f"SELECT {', '.join(columns)} FROM trials {_OF_TRIAL} AND error IS NULL AND {UNMEASURED}"
        stored = self._connection.execute(query, place).fetchone()
        if not stored:
            self._enter([outcome], [place])
            return outcome.error is None
        before = dict(zip(columns, stored, strict=True))
        error = outcome.error if outcome.error is not None else difference(before, outcome)
        measured = outcome.measured if error is None else before["measured"]
        update = f"UPDATE trials SET measured = ?, measuring_error = ? {_OF_TRIAL}"
        self._connection.execute(update, (measured, error, *place))
        sign(self._connection, "trials", [place])
        return error is None

    def _enter(self, outcomes: Sequence[Outcome], places: Sequence[tuple[str, int]]) -> None:
        rows = [
            self._with_sum((*place, *self._axes[outcome.point], *outcome[2:-1], *outcome.provenance))
            for outcome, place in zip(outcomes, places, strict=True)
        ]
        if self._failed:
            failed = self._connection.executemany(f"DELETE FROM trials {_OF_TRIAL} AND error IS NOT NULL", places)
            self._new -= failed.rowcount
        self._new += self._connection.executemany(self._insert, rows).rowcount
        self._failed += sum(outcome.error is not None for outcome in outcomes)

    def __exit__(self, *_: object) -> None:
        self._resources.close()


def difference(stored: Mapping[str, Any], outcome: Outcome) -> str | None:
    """Return a message on how a repeated trial differs from its stored columns, by name; None if it does not."""
    pairs = [(name, stored[name], getattr(outcome, name)) for name in (*REPEATED, "events")]
    before, now = (json.loads(measured or "{}") for measured in (stored["measured"], outcome.measured))
    pairs += [(name, value, now[name]) for name, value in before.items()]
    for name, before, now in pairs:
        if json.dumps(before) != json.dumps(now):  # 1, 1.0 and true are equal, but not the same
            said = "differs from the stored trial, so new measures do not belong to it"
            values = f"{name} is {short_yaml(before)} in the folder, {short_yaml(now)} now"
            return f"{said}: {values}; another version or host made it, or code that draws numbers of its own"
    return None
