"""Reading a run folder, also while a run is at work on it; nothing in it is changed."""

import hashlib
import json
import sqlite3
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.errors import ScenarioError, StoreError
from epuck_sim.measures.interface import Value
from epuck_sim.runs.database import DATABASE, UNMEASURED, has_later_columns, reading
from epuck_sim.runs.run_lock import current_holder
from epuck_sim.scenario.base import ConfigModel
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.util.messages import comma_list, did_you_mean
from epuck_sim.util.provenance import PROVENANCE


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
    has_t_sync: bool = True
    """Whether trials have a T_sync: not without oscillators, or without a threshold of the order parameter."""

    @property
    def seed(self) -> int:
        """Seed for resampling this point: if all points were resampled alike, their errors would be the same."""
        left_out: dict[str, Any] = dict.fromkeys(WITHOUT_EFFECT, True)
        for name, section in self.scenario:
            is_list = isinstance(section, tuple)
            kind = section[0] if is_list and section else section
            if isinstance(kind, ConfigModel) and kind.later_keys and name not in WITHOUT_EFFECT:
                keys = dict.fromkeys(kind.later_keys, True)
                left_out[name] = {"__all__": keys} if is_list else keys
        everything = self.key + self.scenario.model_dump_json(exclude=left_out)
        return int.from_bytes(hashlib.sha256(everything.encode()).digest()[:8])


class PointList(list[PointTrials]):
    """The points of a sweep, in its order; a list that notebooks show as a table."""

    def _repr_html_(self) -> str:
        """Return a table of the points, for notebooks; `summarize` gives statistics."""
        from epuck_sim.display.html import table, to_html  # noqa: PLC0415 is for notebooks alone

        axes = list(self[0].axes) if self else []
        rows = (
            [
                str(point.number),
                *(str(point.axes[key]) for key in axes),
                str(len(point.times)),
                str(int((~point.observed).sum())),
                f"{point.times.min():g} to {point.times.max():g}" if len(point.times) else "-",
            ]
            for point in self
        )
        return to_html(table(["point", *axes, "trials", "censored", "cycles"], rows))


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
    censored: int | None
    """Number of trials that are censored; None if those that are stored have no T_sync."""
    failed: list[Failure]
    """Trials that failed, and stored ones for which a measure that was added later failed."""
    wall_s: float
    """Computing time of all trials together."""
    versions: list[TrialsByOrigin]
    """Numbers of trials by the versions and the host that made them."""
    at_work: str | None
    """The process that is running the sweep."""
    unmeasured: int = 0
    """Number of stored trials that lack a measure which was added later."""


def read_points(folder: Path | str, of: str | None = None) -> PointList:
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
    results = PointList()
    for key, number, axes, scenario in found:
        cycles, censored = np.array(ends[key], np.float64).reshape(-1, 2).T  # NaN for null
        try:
            read = validate(json.loads(scenario), f"point {number}")
        except ScenarioError as error:
            raise StoreError(f"{folder}: the scenario of a point is of another version: {error}") from error
        trials = tuple(seeds[key]), tuple(values.get(key, ()))
        has_t_sync = not len(censored) or not np.isnan(censored).any()
        results.append(PointTrials(number, key, json.loads(axes), read, cycles, censored == 0, *trials, of, has_t_sync))
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
    if not has_later_columns(connection, "points"):
        return []
    rows = connection.execute("SELECT measures FROM points ORDER BY number")
    return list(dict.fromkeys(name for (text,) in rows for name in json.loads(text)))


def read_measure_names(folder: Path | str) -> list[str]:
    """Return the names of the measures in a run folder, in their order."""
    with reading(database_of(folder)) as connection:
        return measures_in(connection)


def count_unmeasured(connection: sqlite3.Connection) -> int:
    """Return how many trials with a result lack a measure of their point."""
    if not measures_in(connection):
        return 0
    (count,) = connection.execute(
        f"SELECT count(*) FROM trials JOIN points ON point = key WHERE error IS NULL AND {UNMEASURED}"
    ).fetchone()
    return int(count)


def read_outcome(folder: Path, point: int, trial: int) -> tuple[int, bool | None] | None:
    """Return the cycles of one trial and whether it is censored; None if it has no result."""
    with reading(database_of(folder)) as connection:
        row = connection.execute(
            "SELECT cycles, censored FROM trials JOIN points ON point = key "
            "WHERE number = ? AND trial = ? AND error IS NULL",
            (point, trial),
        ).fetchone()
    return None if row is None else (row[0], None if row[1] is None else bool(row[1]))


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
            "SELECT count(*), sum(censored), total(wall_s) FROM trials WHERE error IS NULL"
        ).fetchone()
        problem = "coalesce(error, measuring_error)" if has_later_columns(connection, "trials") else "error"
        failed = connection.execute(
            f"SELECT number, trial, seed, {problem} FROM trials JOIN points ON point = key "
            f"WHERE {problem} IS NOT NULL ORDER BY number, trial"
        ).fetchall()
        unmeasured = count_unmeasured(connection)
        made = connection.execute(f"SELECT {origin}, count(*) FROM trials GROUP BY {origin}").fetchall()
    return Status(
        scenario=json.loads(scenario)["name"],
        points=points,
        trials=int(trials),
        stored=stored,
        censored=censored if stored else 0,
        failed=[Failure(*row) for row in failed],
        wall_s=wall_s,
        versions=[TrialsByOrigin(*row) for row in made],
        at_work=current_holder(folder),
        unmeasured=unmeasured,
    )


def database_of(folder: Path | str) -> Path:
    """Return the run folder's database; raise StoreError if there is none."""
    if not (Path(folder) / DATABASE).is_file():
        raise StoreError(f"{folder}: is not a run folder: there is no {DATABASE} in it")
    return Path(folder) / DATABASE
