"""Reading a run folder, also while a run is at work on it; nothing in it is changed."""

import hashlib
import json
import sqlite3
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import EpuckSimError, ScenarioError, StoreError
from epuck_sim.measures.interface import Value
from epuck_sim.runs.database import DATABASE, has_later_column, reading
from epuck_sim.runs.run_lock import current_holder
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.util.messages import comma_list, did_you_mean
from epuck_sim.util.provenance import PROVENANCE

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

    @property
    def seed(self) -> int:
        """Seed for resampling this point: if all points were resampled alike, their errors would be the same."""
        everything = self.key + self.scenario.model_dump_json(exclude=WITHOUT_EFFECT)
        return int.from_bytes(hashlib.sha256(everything.encode()).digest()[:8])


class SweepTrials(list[PointTrials]):
    """The points of a sweep, in its order, with their trials."""

    def __init__(self, points: Iterable[PointTrials] = (), of: str | None = None) -> None:
        super().__init__(points)
        self.of = of
        """Name of the measure that was asked for."""

    def to_pandas(self) -> "pandas.DataFrame":
        """Return a DataFrame of pandas with a row for each trial.

        Its columns are `point`, the number of the point; the axes by their dotted keys; `seed`; `cycles`, at which the
        trial ended; `censored`; `t_sync_cycles`, NaN where it is censored; and the measure that was asked for.

        Raises:
            EpuckSimError: pandas is not installed.
        """
        try:
            import pandas  # noqa: PLC0415 - few need it
        except ImportError as error:
            raise EpuckSimError("to_pandas needs pandas, which is not installed: pip install pandas") from error
        return pandas.DataFrame([row for point in self for row in self._rows(point)])

    def _rows(self, point: PointTrials) -> Iterator[dict[str, Any]]:
        for trial, (cycles, observed) in enumerate(zip(point.times.tolist(), point.observed.tolist(), strict=True)):
            ends = {"cycles": cycles, "censored": not observed, "t_sync_cycles": cycles if observed else np.nan}
            measured = {} if self.of is None else {self.of: point.measured[trial]}
            yield {"point": point.number, **point.axes, "seed": point.seeds[trial], **ends, **measured}


class Failure(NamedTuple):
    """A trial that failed."""

    point: int
    trial: int
    seed: int
    error: str


class TrialsByOrigin(NamedTuple):
    """How many trials the same versions on the same host have made."""

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


class Status(NamedTuple):
    """How far the sweep in a run folder is."""

    scenario: str
    points: int
    trials: int
    """Number of trials in the whole sweep."""
    stored: int
    """Number of trials that have a result."""
    censored: int
    failed: list[Failure]
    wall_s: float
    """Computing time of all trials together."""
    versions: list[TrialsByOrigin]
    """Numbers of trials by the versions and the host that made them."""
    at_work: str | None
    """The process that is running the sweep."""


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
        values = _read_measured(connection, str(folder), of) if of is not None else {}
        for key, cycles, censored, seed in connection.execute(
            "SELECT point, cycles, censored, seed FROM trials WHERE error IS NULL ORDER BY point, trial"
        ):
            ends[key].append((cycles, censored))
            seeds[key].append(seed)
    results = SweepTrials(of=of)
    for key, number, axes, scenario in found:
        cycles, censored = np.array(ends[key], np.int64).reshape(-1, 2).T
        try:
            read = validate(json.loads(scenario), f"point {number}")
        except ScenarioError as error:
            raise StoreError(f"{folder}: the scenario of a point is of another version: {error}") from error
        times = cycles.astype(np.float64)
        trials = tuple(seeds[key]), tuple(values.get(key, ()))
        results.append(PointTrials(number, key, json.loads(axes), read, times, censored == 0, *trials))
    return results


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
    if not has_later_column(connection, "points"):
        return []
    rows = connection.execute("SELECT measures FROM points ORDER BY number")
    return list(dict.fromkeys(name for (text,) in rows for name in json.loads(text)))


def read_outcome(folder: Path, point: int, trial: int) -> tuple[int, bool] | None:
    """Return the cycles of one trial and whether it is censored; None if it has no result."""
    with reading(database_of(folder)) as connection:
        row = connection.execute(
            "SELECT cycles, censored FROM trials JOIN points ON point = key "
            "WHERE number = ? AND trial = ? AND error IS NULL",
            (point, trial),
        ).fetchone()
    return None if row is None else (row[0], bool(row[1]))


def read_wall_times(folder: Path) -> dict[int, list[float]]:
    """Return how long each trial with a result took, in seconds, by the number of its point."""
    with reading(database_of(folder)) as connection:
        numbers = connection.execute("SELECT number FROM points ORDER BY number").fetchall()
        found: dict[int, list[float]] = {number: [] for (number,) in numbers}
        for number, wall_s in connection.execute(
            "SELECT number, wall_s FROM trials JOIN points ON point = key WHERE error IS NULL ORDER BY number, trial"
        ):
            found[number].append(wall_s)
    return found


def read_status(folder: Path) -> Status:
    """Return how far the sweep is.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
    """
    origin = ", ".join(PROVENANCE)
    with reading(database_of(folder)) as connection:
        points, trials = connection.execute("SELECT count(*), total(trials) FROM points").fetchone()
        (scenario,) = connection.execute("SELECT scenario FROM points ORDER BY number LIMIT 1").fetchone()
        stored, censored, wall_s = connection.execute(
            "SELECT count(*), total(censored), total(wall_s) FROM trials WHERE error IS NULL"
        ).fetchone()
        failed = connection.execute(
            "SELECT number, trial, seed, error FROM trials JOIN points ON point = key WHERE error IS NOT NULL "
            "ORDER BY number, trial"
        ).fetchall()
        made = connection.execute(f"SELECT {origin}, count(*) FROM trials GROUP BY {origin}").fetchall()
    return Status(
        scenario=json.loads(scenario)["name"],
        points=points,
        trials=int(trials),
        stored=stored,
        censored=int(censored),
        failed=[Failure(*row) for row in failed],
        wall_s=wall_s,
        versions=[TrialsByOrigin(*row) for row in made],
        at_work=current_holder(folder),
    )


def database_of(folder: Path | str) -> Path:
    """Return the run folder's database; raise StoreError if there is none."""
    if not (Path(folder) / DATABASE).is_file():
        raise StoreError(f"{folder}: is not a run folder: there is no {DATABASE} in it")
    return Path(folder) / DATABASE
