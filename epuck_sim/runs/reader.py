"""Reading a run folder, also while a run is at work on it; nothing in it is changed."""

import hashlib
import json
import sqlite3
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError, ScenarioError, StoreError
from epuck_sim.measures.interface import Value
from epuck_sim.runs.database import DATABASE, has_column, reading
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.scenario.schedule import TrialEvent
from epuck_sim.scenario.validation import validate
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
    seeds: tuple[int, ...]
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
        from epuck_sim.display.html import table, to_html  # noqa: PLC0415 is for notebooks alone

        axes = list(self[0].axes) if self else []
        rows = (
            [
                str(point.number),
                *(str(point.axes[key]) for key in axes),
                str(len(point.times)),
                str(int((~point.observed).sum())) if point.has_t_sync else "-",
                f"{point.times.min():g} to {point.times.max():g}" if len(point.times) else "-",
            ]
            for point in self
        )
        return to_html(table(["point", *axes, "trials", "censored", "cycles"], rows))


def _trial_rows(point: PointTrials) -> Iterator[dict[str, Any]]:
    measured = point.measured if point.of is not None else [None] * len(point.times)
    columns = (point.seeds, point.times.tolist(), point.observed.tolist(), measured)
    for seed, cycles, observed, value in zip(*columns, strict=True):
        ends = {
            "cycles": cycles,
            "censored": not observed if point.has_t_sync else None,
            "t_sync_cycles": cycles if observed else np.nan,
        }
        values = {} if point.of is None else {point.of: value}
        yield {"point": point.number, **point.axes, "seed": seed, **ends, **values}


def read_points(folder: Path | str, of: str | None = None) -> SweepTrials:
    """Return the results of each point, in the sweep's order.

    Args:
        folder: A run folder.
        of: Name of a measure whose values are wanted, too.

    Raises:
        StoreError: The folder is not a run folder, its database is damaged, or there is no such measure in it.
    """
    with reading(database_of(folder)) as connection:
        found = connection.execute("SELECT key, number, axes, scenario FROM points ORDER BY number").fetchall()
        ends: dict[str, list[tuple[int, int]]] = {key: [] for key, *_ in found}
        seeds: dict[str, list[int]] = {key: [] for key, *_ in found}
        events: dict[str, list[tuple[TrialEvent, ...]]] = {key: [] for key, *_ in found}
        values = _read_measured(connection, str(folder), of) if of is not None else {}
        for key, cycles, censored, seed, text in connection.execute(
            f"SELECT point, cycles, censored, seed, {events_column(connection)} FROM trials WHERE error IS NULL "
            "ORDER BY point, trial"
        ):
            ends[key].append((cycles, censored))
            seeds[key].append(seed)
            events[key].append(_read_events(text))
    results = SweepTrials()
    for key, number, axes, scenario in found:
        cycles, censored = np.array(ends[key], np.float64).reshape(-1, 2).T  # NaN for null
        try:
            read = validate(json.loads(scenario), f"point {number}")
        except ScenarioError as error:
            raise StoreError(f"{folder}: the scenario of a point is of another version: {error}") from error
        trials = tuple(seeds[key]), tuple(values.get(key, ()))
        has_t_sync = read.stop.order_parameter is not None and not np.isnan(censored).any()
        changes = tuple(events[key])
        results.append(
            PointTrials(number, key, json.loads(axes), read, cycles, censored == 0, *trials, of, changes, has_t_sync)
        )
    return results


def events_column(connection: sqlite3.Connection) -> str:
    """Return the column of trials that holds events as JSON, as SQL; NULL in earlier folders."""
    return "events" if has_column(connection, "trials", "events") else "NULL"


def _read_events(text: str | None) -> tuple[TrialEvent, ...]:
    events = json.loads(text or "[]")
    return tuple(TrialEvent(**{**event, "robots": tuple(event["robots"])}) for event in events)


def _read_measured(connection: sqlite3.Connection, folder: str, name: str) -> dict[str, list[Value]]:
    """Return the values of a measure in the trials of each point, by the point's key."""
    measured = measures_in(connection)
    if name not in measured:
        raise StoreError(f"{folder}: {did_you_mean(name, measured)}; measured: {comma_list(measured)}")
    found: dict[str, list[Value]] = {}
    for key, text in connection.execute("SELECT point, measured FROM trials WHERE error IS NULL ORDER BY point, trial"):
        found.setdefault(key, []).append(json.loads(text or "{}").get(name))
    return found


def measures_in(connection: sqlite3.Connection) -> list[str]:
    """Return the names of the measures of a folder's points, in their order."""
    if not has_column(connection, "points", "measures"):
        return []
    rows = connection.execute("SELECT measures FROM points ORDER BY number")
    return list(dict.fromkeys(name for (text,) in rows for name in json.loads(text)))


def read_measure_names(folder: Path | str) -> list[str]:
    """Return the names of the measures in a run folder, in their order."""
    with reading(database_of(folder)) as connection:
        return measures_in(connection)


def database_of(folder: Path | str) -> Path:
    """Return the run folder's database; raise StoreError if there is none."""
    if not (Path(folder) / DATABASE).is_file():
        raise StoreError(f"{folder}: is not a run folder: there is no {DATABASE} in it")
    return Path(folder) / DATABASE
