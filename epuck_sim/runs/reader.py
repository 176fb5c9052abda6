"""Reading a run folder, also while a run is at work on it; nothing in it is changed."""

import hashlib
import json
import sqlite3
import sys
from array import array
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import EpuckSimError, ScenarioError, StoreError
from epuck_sim.measures.interface import Value
from epuck_sim.runs.database import NULL, UNMEASURED, read_numbers, reading
from epuck_sim.runs.records import FinishedTrials
from epuck_sim.scenario.changes import TrialEvent
from epuck_sim.scenario.loader import validate
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.util.messages import comma_list, did_you_mean

if TYPE_CHECKING:
    import pandas


class PointTrials(NamedTuple):
    """The trials of one point of a sweep that have a result."""

    number: int
    key: str
    """The axis values as text."""
    axes: dict[str, Any]
    """Value of each axis by dotted key."""
    scenario: Scenario
    times: FloatArray
    """(trials,) cycles at which each trial ended."""
    observed: BoolArray
    """(trials,) whether each trial was synchronised then; otherwise it is censored."""
    seeds: Sequence[int]
    """(trials,) seed of each trial."""
    measured: tuple[Value, ...] = ()
    """(trials,) value in each trial of the measure that was asked for; empty if none was."""
    of: str | None = None
    """Name of the measure that was asked for; None if none was."""
    events: tuple[tuple[TrialEvent, ...], ...] = ()
    """(trials,) what changed in each trial: entries of the schedule, and faults."""
    has_t_sync: bool = True
    """Whether trials have a T_sync: not without oscillators, or without a threshold of the order parameter."""

    @property
    def seed(self) -> int:
        """Seed for resampling this point: if all points were resampled alike, their errors would be the same."""
        left_out: dict[str, Any] = {**self.scenario.later_defaults(), **dict.fromkeys(WITHOUT_EFFECT, True)}
        everything = self.key + self.scenario.model_dump_json(exclude=left_out)
        return int.from_bytes(hashlib.sha256(everything.encode()).digest()[:8])


class SweepTrials(list[PointTrials]):
    """The points of a sweep, in its order, with their trials; notebooks show them as a table."""

    @property
    def of(self) -> str | None:
        """Name of the measure that was asked for; None if none was."""
        return self[0].of if self else None

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a DataFrame of pandas with a row for each trial.

        Its columns are `point`, the number of the point; the axes by their dotted keys; `seed`; `cycles`, at which the
        trial ended; `censored`, None without T_sync; `t_sync_cycles`, NaN where it is censored, and without T_sync; and
        the measure that was asked for.

        Raises:
            EpuckSimError: pandas is not installed.
        """
        try:
            import pandas  # noqa: PLC0415 - few need it
        except ImportError as error:
            raise EpuckSimError("to_pandas needs pandas, which is not installed: pip install pandas") from error
        return pandas.DataFrame([row for point in self for row in _trial_rows(point)])

    def _repr_html_(self) -> str:
        """Return a table of the points, for notebooks; `summarize` gives statistics."""
        from epuck_sim.display.table import Row, Table  # noqa: PLC0415 is for notebooks alone

        rows = []
        for point in self:
            censored = int((~point.observed).sum()) if point.has_t_sync else None
            cycles = f"{point.times.min():g} to {point.times.max():g}" if len(point.times) else None
            cells = {"point": point.number, "trials": len(point.times), "censored": censored, "cycles": cycles}
            rows.append(Row(point.axes, cells))
        return Table("", rows)._repr_html_()


def _trial_rows(point: PointTrials) -> Iterator[dict[str, Any]]:
    measured = point.measured if point.of is not None else [None] * len(point.times)
    columns = (point.seeds, point.times.tolist(), point.observed.tolist(), measured)
    for seed, cycles, observed, value in zip(*columns, strict=True):
        censored = not observed if point.has_t_sync else None
        ends = {"cycles": cycles, "censored": censored, "t_sync_cycles": cycles if observed else np.nan}
        yield {"point": point.number, **point.axes, "seed": seed, **ends, **({point.of: value} if point.of else {})}


def read_points(folder: Path | str, of: str | None = None) -> SweepTrials:
    """Return the results of each point, in the sweep's order.

    Args:
        folder: A run folder.
        of: Name of a measure whose values are wanted, too.

    Raises:
        StoreError: The folder is not a run folder, its database is damaged, or there is no such measure in it.
    """
    with reading(folder) as connection:
        measured = measures_in(connection)
        if of is not None and of not in measured:
            raise StoreError(f"{folder}: {did_you_mean(of, measured)}; measured: {comma_list(measured)}")
        any_events = connection.execute("SELECT 1 FROM trials WHERE events IS NOT NULL LIMIT 1").fetchone()
        found = connection.execute("SELECT key, number, axes, scenario FROM points ORDER BY number").fetchall()
        results = SweepTrials()
        for key, number, axes, scenario in found:
            try:
                read = validate(json.loads(scenario), f"point {number}")
            except ScenarioError as error:
                raise StoreError(f"{folder}: the scenario of a point is of another version: {error}") from error
            cycles, censored, seeds = read_ends(connection, key)
            values = () if of is None else _read_json(connection, key, "measured")
            events = _read_json(connection, key, "events") if any_events else [None] * len(seeds)
            results.append(
                PointTrials(
                    number=number,
                    key=key,
                    axes=json.loads(axes),
                    scenario=read,
                    times=np.where(cycles == NULL, np.nan, cycles),
                    observed=censored == 0,
                    seeds=array("q", seeds.tobytes()),
                    measured=tuple((each or {}).get(of) for each in values),
                    of=of,
                    events=tuple(tuple(map(_event, each or ())) for each in events),
                    has_t_sync=read.stop.order_parameter is not None and not (censored == NULL).any(),
                )
            )
    return results


def read_ends(
    connection: sqlite3.Connection, key: str, trials: int = sys.maxsize
) -> tuple[IntArray, IntArray, IntArray]:
    """Return cycles, whether it is censored, and the seed of each of a point's first trials that has a result."""
    row = f"ifnull(cycles, {NULL}) || ',' || ifnull(censored, {NULL}) || ',' || seed"
    stored = f"SELECT {row} AS row FROM trials WHERE point = ? AND trial < ? AND error IS NULL ORDER BY trial"
    (text,) = connection.execute(f"SELECT group_concat(row) FROM ({stored})", (key, trials)).fetchone()
    cycles, censored, seeds = read_numbers(text).reshape(-1, 3).T
    return cycles, censored, seeds


def _read_json(connection: sqlite3.Connection, key: str, column: str) -> list[Any]:
    """Return a column of JSON, decoded, for each trial of a point that has a result, in order."""
    query = f"SELECT {column} FROM trials WHERE point = ? AND error IS NULL ORDER BY trial"
    return [text and json.loads(text) for (text,) in connection.execute(query, (key,))]


def _event(stored: dict[str, Any]) -> TrialEvent:
    return TrialEvent(**{**stored, "robots": tuple(stored["robots"])})


def measures_in(connection: sqlite3.Connection) -> list[str]:
    """Return the names of the measures of a folder's points, in their order."""
    rows = connection.execute("SELECT measures FROM points ORDER BY number")
    return list(dict.fromkeys(name for (text,) in rows for name in json.loads(text)))


def read_finished(connection: sqlite3.Connection, measured: bool = False) -> FinishedTrials:
    """Return the trials that have a result, and if that is asked for a value of each measure of their point."""
    condition = f"AND NOT {UNMEASURED}" if measured else ""
    rows = connection.execute(
        "SELECT (SELECT number FROM points WHERE key = point), group_concat(trial) FROM trials "
        f"WHERE error IS NULL {condition} GROUP BY point"
    )
    return FinishedTrials((number, read_numbers(text)) for number, text in rows)
