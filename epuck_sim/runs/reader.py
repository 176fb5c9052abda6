"""Read a run folder, also while a run is at work on it, and change nothing in it.

What can be read: its results, how far its sweep is, how its trials ended, and whether its files are whole.
"""

import hashlib
import json
import sqlite3
import sys
from array import array
from collections.abc import Callable, Generator, Iterable, Iterator, Sequence
from itertools import repeat, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.errors import EpuckSimError, ScenarioError, StoreError
from epuck_sim.measures.measure import T_SYNC_S, Value
from epuck_sim.runs.compatibility import WHOLE, read_share
from epuck_sim.runs.database import BLOCK, NULL, UNMEASURED, measures_in, read_numbers, reading
from epuck_sim.runs.folder import DATABASE, current_holder, database_of
from epuck_sim.runs.sources import DIGESTS, read_digests
from epuck_sim.scenario.axes import canonical_text, texts_of_values
from epuck_sim.scenario.base import refused_at
from epuck_sim.scenario.changes import TrialEvent
from epuck_sim.scenario.keys import axis_key, parse_axis
from epuck_sim.scenario.loader import RUN_SCENARIO, validate
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.util.messages import comma_list, counted, did_you_mean
from epuck_sim.util.provenance import PROVENANCE

if TYPE_CHECKING:
    import pandas


class PointTrials(NamedTuple):
    """The trials of one point of a sweep that have a result."""

    number: int
    key: str  # the axis values as text
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
    """(trials,) value of the requested measure, or the seconds, of each trial; empty if none was requested."""
    of: str | None = None  # name of the requested measure, or `t_sync_s`; None if none was requested
    events: tuple[tuple[TrialEvent, ...], ...] = ()
    """(trials,) what changed in each trial: entries of the schedule, and faults."""
    has_t_sync: bool = True
    """Whether trials have a T_sync: their reference is an oscillator, and the order parameter has a threshold."""

    @property
    def seed(self) -> int:
        """Seed for resampling this point; it differs from point to point, so that their errors are independent."""
        left_out: dict[str, Any] = {**self.scenario.later_defaults(), **dict.fromkeys(WITHOUT_EFFECT, True)}
        everything = self.key + self.scenario.model_dump_json(exclude=left_out)
        return int.from_bytes(hashlib.sha256(everything.encode()).digest()[:8])


class SweepTrials(list[PointTrials]):
    """The points of a sweep, in its order, with their trials; notebooks show them as a table."""

    folder: Path  # run folder from which they were read

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a DataFrame of pandas with a row for each trial of the points, and the columns that `export` writes.

        Raises:
            EpuckSimError: pandas is not installed.
        """
        try:
            import pandas  # noqa: PLC0415 - few need it
        except ImportError as error:
            raise EpuckSimError("to_pandas needs pandas, which is not installed: pip install pandas") from error
        from epuck_sim.runs.export import read_table  # noqa: PLC0415 takes pyarrow

        frame: pandas.DataFrame = read_table(self.folder).to_pandas()
        return frame[frame["point"].isin([point.number for point in self])].reset_index(drop=True)

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


def read_points(folder: Path | str, of: str | None = None, where: Sequence[str] | None = None) -> SweepTrials:
    """Return the results of each point, in the sweep's order.

    Args:
        folder: A run folder.
        of: Name of a measure whose values are read, too; or `t_sync_s`, T_sync in seconds.
        where: Axes with the values that points must have, such as `count=5,10`; all points by default.

    Raises:
        EpuckSimError: No point has such a value.
        StoreError: The folder is not a run folder, its database is damaged, or there is no such measure in it.
    """
    results = SweepTrials(each_point(folder, of, where))
    results.folder = Path(folder)
    return results


def each_point(folder: Path | str, of: str | None = None, where: Sequence[str] | None = None) -> Generator[PointTrials]:
    """Yield the points of `read_points`, which may not fit into memory; close it, as no run can write until then."""
    with reading(folder) as connection:
        measured = [*measures_in(connection), T_SYNC_S]
        if of is not None and of not in measured:
            known = f"measured: {comma_list(measured)}; to add one, run the sweep again with --measure NAME"
            raise StoreError(f"{folder}: {did_you_mean(of, measured)}; {known}")
        any_events = connection.execute("SELECT 1 FROM trials WHERE events IS NOT NULL LIMIT 1").fetchone()
        found = connection.execute("SELECT axes, key, number, scenario FROM points ORDER BY number").fetchall()
        stored = [(json.loads(axes), *others) for axes, *others in found]
        for text in [where] if isinstance(where, str) else where or ():
            with refused_at(str(folder)):
                stored = _having(stored, text)
        for axes, key, number, scenario in stored:
            try:
                read = validate(json.loads(scenario), f"point {number}")
            except ScenarioError as error:
                made = connection.execute("SELECT max(epuck_sim) FROM trials WHERE point = ?", (key,)).fetchone()
                said = f"the scenario of a point is of another version (its trials: {made[0] or 'none'})"
                raise StoreError(f"{folder}: {said}: {error}") from error
            cycles, censored, seeds = read_ends(connection, key)
            column = ("simulated_s", float) if of == T_SYNC_S else ("measured", lambda text: json.loads(text).get(of))
            events = _read_column(connection, key, "events") if any_events else repeat(None, len(seeds))
            yield PointTrials(
                number=number,
                key=key,
                axes=axes,
                scenario=read,
                times=np.where(cycles == NULL, np.nan, cycles),
                observed=censored == 0,
                seeds=array("q", seeds.tobytes()),
                measured=() if of is None else tuple(_read_column(connection, key, *column)),
                of=of,
                events=tuple(
                    tuple(TrialEvent(**{**event, "robots": tuple(event["robots"])}) for event in each or ())
                    for each in events
                ),
                has_t_sync=read.stop.has_t_sync and not (censored == NULL).any(),
            )


def _having(stored: list[Any], where: str) -> list[Any]:
    """Return the points, each with its axes first, that have one of the values in a text such as `count=5,10`."""
    typed, values = parse_axis(where, "--where")
    rows = [axes for axes, *_ in stored]
    key = axis_key(typed, rows, f"--where {where}")
    texts = texts_of_values(rows, key, values, "--where")
    return [each for each, row in zip(stored, rows, strict=True) if canonical_text({key: row[key]}) in texts]


def read_ends(
    connection: sqlite3.Connection, key: str, trials: int = sys.maxsize
) -> tuple[IntArray, IntArray, IntArray]:
    """Return cycles, whether censored, and seeds of those of a point's first trials that have a result, (n,) each."""
    row = f"ifnull(cycles, {NULL}) || ',' || ifnull(censored, {NULL}) || ',' || seed"
    stored = f"SELECT {row} AS row FROM trials WHERE point = ? AND trial >= ? AND trial < ? AND error IS NULL"
    (last,) = connection.execute("SELECT ifnull(max(trial), 0) FROM trials WHERE point = ?", (key,)).fetchone()
    found = [np.empty((0, 3), np.int64)]
    for first in range(0, min(trials, last + 1), BLOCK):
        block = key, first, min(trials, first + BLOCK)
        (text,) = connection.execute(f"SELECT group_concat(row) FROM ({stored} ORDER BY trial)", block).fetchone()
        found.append(read_numbers(text).reshape(-1, 3))
    cycles, censored, seeds = np.concatenate(found).T
    return cycles, censored, seeds


def _read_column(
    connection: sqlite3.Connection, key: str, column: str, decode: Callable[[Any], Any] = json.loads
) -> list[Any]:
    """Return a column, by default of JSON, decoded, for each trial of a point that has a result, in order."""
    query = f"SELECT {column} FROM trials WHERE point = ? AND error IS NULL ORDER BY trial"
    return [text and decode(text) for (text,) in connection.execute(query, (key,))]


class FinishedTrials:
    """The trials that need not be run again, in one byte each; iteration yields numbers of point and trial."""

    def __init__(self, trials: Iterable[tuple[int, Sequence[int] | IntArray]]) -> None:
        """Store the numbers of trials of points, each of which is given once."""
        self._marks = {point: np.bincount(numbers) > 0 for point, numbers in trials}

    def _of(self, point: int, wanted: range) -> BoolArray:
        return self._marks.get(point, np.zeros(0, bool))[wanted.start : wanted.stop : wanted.step]

    def count(self, point: int, wanted: range) -> int:
        """Return how many of the wanted trials of a point are in the set."""
        return int(np.count_nonzero(self._of(point, wanted)))

    def missing(self, point: int, wanted: range) -> Iterator[int]:
        """Yield the indices into `wanted` of those trials of a point that are not in the set."""
        marks = self._of(point, wanted)
        yield from map(int, np.flatnonzero(~marks))
        yield from range(len(marks), len(wanted))

    def __iter__(self) -> Iterator[tuple[int, int]]:
        return ((point, int(trial)) for point, marks in self._marks.items() for trial in np.flatnonzero(marks))


def read_finished(connection: sqlite3.Connection, measured: bool = False) -> FinishedTrials:
    """Return the trials that have a result; with `measured`, those with a value for each measure of their point."""
    condition = f"AND NOT {UNMEASURED}" if measured else ""
    rows = connection.execute(
        "SELECT (SELECT number FROM points WHERE key = point), group_concat(trial) FROM trials "
        f"WHERE error IS NULL {condition} GROUP BY point"
    )
    return FinishedTrials((number, read_numbers(text)) for number, text in rows)


def count_failed(folder: Path) -> int:
    """Return how many trials of a run folder have failed, and have no result."""
    with reading(folder) as connection:
        return int(connection.execute("SELECT count(*) FROM trials WHERE error IS NOT NULL").fetchone()[0])


class Failure(NamedTuple):
    """A trial that failed."""

    point: int
    trial: int
    seed: int
    error: str


class TrialsByOrigin(NamedTuple):
    """Number of trials made by the same versions on the same host."""

    epuck_sim: str
    pymunk: str
    numba: str
    numpy: str
    python: str
    host: str
    trials: int

    @property
    def made_by(self) -> dict[str, str]:
        """Versions, and the host, by name."""
        return {name: getattr(self, name) for name in PROVENANCE}


class PointAtLimit(NamedTuple):
    """A point whose trials have all reached their limit so far, without synchrony."""

    point: int
    axes: dict[str, Any]  # value of each axis by dotted key
    trials: int  # number of these trials


FEW_TRIALS = 20  # number of trials (or all of them, at smaller points) that are taken as representative of their point


class Status(NamedTuple):
    """How far the sweep in a run folder is."""

    scenario: str
    points: int
    trials: int  # number of trials in the whole sweep, or in the folder's share of it
    stored: int  # number of them that have a result
    censored: int | None  # number of censored trials; None if the stored trials have no T_sync
    failed: list[Failure]  # trials that failed, and stored trials that failed when run again for an added measure
    wall_s: float  # computing time of all trials together
    versions: list[TrialsByOrigin]  # numbers of trials by the versions and the host that made them
    at_work: str | None  # the process that is running the sweep
    unmeasured: int = 0  # number of stored trials that lack a measure which was added later
    share: str | None = None  # share of the sweep that the folder is for, as 3/40; None for the whole sweep
    at_limit: Sequence[PointAtLimit] = ()  # points whose trials, `FEW_TRIALS` or more of them, are all censored
    axes: Sequence[str] = ()  # keys of the sweep's axes


def read_status(folder: Path) -> Status:
    """Return how far the sweep is."""
    with reading(folder) as connection:
        share = read_share(connection)
        points = connection.execute("SELECT number, trials FROM points ORDER BY number").fetchall()
        scenario, axes = connection.execute("SELECT scenario, axes FROM points ORDER BY number LIMIT 1").fetchone()
        first = connection.execute(f"SELECT {_ORIGIN} FROM trials LIMIT 1").fetchone() or ("",) * len(PROVENANCE)
        trials, censored, wall_s, like_first = connection.execute(
            f"SELECT count(*), sum(censored), total(wall_s), ifnull(sum({_LIKE_FIRST}), 0) FROM trials", first
        ).fetchone()
        # usually all are like the first; grouping them takes four times as long
        grouped = f"SELECT {_ORIGIN}, count(*) FROM trials GROUP BY {_ORIGIN}"
        origins = [(*first, trials)] if 0 < like_first == trials else connection.execute(grouped).fetchall()
        failed = connection.execute(
            "SELECT number, trial, seed, coalesce(error, measuring_error) AS problem FROM trials "
            "JOIN points ON point = key WHERE problem IS NOT NULL ORDER BY number, trial"
        ).fetchall()
        unmeasured = 0
        if measures_in(connection):
            query = f"SELECT count(*) FROM trials WHERE error IS NULL AND {UNMEASURED}"
            (unmeasured,) = connection.execute(query).fetchone()
        at_limit = censored and connection.execute(
            "SELECT number, axes, count(*) FROM trials JOIN points ON point = key WHERE error IS NULL GROUP BY key "
            f"HAVING min(censored) = 1 AND count(*) >= min(trials, {FEW_TRIALS}) ORDER BY number"
        )
        points_at_limit = tuple(PointAtLimit(number, json.loads(axes), count) for number, axes, count in at_limit or ())
        finished = read_finished(connection)  # if points were added, a share may have trials that now belong to others
    stored = sum(finished.count(number, share.trials(number, count)) for number, count in points)
    return Status(
        scenario=json.loads(scenario)["name"],
        points=len(points),
        trials=sum(len(share.trials(*point)) for point in points),
        stored=stored,
        censored=censored if stored else 0,
        failed=list(starmap(Failure, failed)),
        wall_s=wall_s,
        versions=sorted(starmap(TrialsByOrigin, origins)),
        at_work=current_holder(folder),
        unmeasured=unmeasured,
        share=None if share == WHOLE else str(share),
        at_limit=points_at_limit,
        axes=tuple(json.loads(axes)),
    )


_ORIGIN = ", ".join(PROVENANCE)
_LIKE_FIRST = f"({_ORIGIN}) = ({', '.join('?' * len(PROVENANCE))})"


def read_outcome(folder: Path, point: int, trial: int) -> tuple[int, bool | None] | None:
    """Return the cycles of one trial and whether it is censored; None if it has no result."""
    with reading(folder) as connection:
        row = connection.execute(
            "SELECT cycles, censored FROM trials JOIN points ON point = key "
            "WHERE number = ? AND trial = ? AND error IS NULL",
            (point, trial),
        ).fetchone()
    return None if row is None else (row[0], None if row[1] is None else bool(row[1]))


def read_wall_times(folder: Path) -> dict[int, list[float]]:
    """Return how long each trial with a result took, in seconds, by the number of its point."""
    trials = "LEFT JOIN trials ON point = key AND error IS NULL ORDER BY number, trial"
    found: dict[int, list[float]] = {}
    with reading(folder) as connection:
        for number, wall_s in connection.execute(f"SELECT number, wall_s FROM points {trials}"):
            found.setdefault(number, []).extend([] if wall_s is None else [wall_s])
    return found


class Verdict(NamedTuple):
    """Verdict on one file of a run folder."""

    file: str
    is_whole: bool
    says: str


def verify(folder: Path) -> list[Verdict]:
    """Check every file of a run folder, and return a verdict on each; nothing in it is run or changed."""
    database_of(folder)
    try:
        status = read_status(folder)
    except StoreError as error:
        found = [Verdict(DATABASE, False, str(error).removeprefix(f"{folder / DATABASE}: "))]
    else:
        rows = f"{status.stored} of {counted(status.trials, 'trial')} of {status.scenario}, each with its checksum"
        found = [Verdict(DATABASE, True, rows)]
    try:
        digests = read_digests(folder)
    except StoreError as error:
        return [*found, Verdict(DIGESTS, False, str(error).removeprefix(f"{folder / DIGESTS}: "))]
    if digests is None:
        is_there = (folder / RUN_SCENARIO).is_file()
        says = "has no digest: an earlier version wrote it" if is_there else "is missing"
        return [*found, Verdict(RUN_SCENARIO, is_there, says)]
    for name, digest in digests.items():
        try:
            is_whole = hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
            says = "is as it was written" if is_whole else "is damaged, or was changed"
        except OSError as error:
            is_whole, says = False, f"cannot be read: {error.strerror}"
        found.append(Verdict(name, is_whole, says))
    return found
