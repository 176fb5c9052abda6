"""How far the sweep in a run folder is, how its trials ended and how long they took; nothing in it is changed."""

import json
import sqlite3
from pathlib import Path
from typing import NamedTuple

from epuck_sim.runs.database import has_column, read_share, reading
from epuck_sim.runs.finished import FinishedTrials
from epuck_sim.runs.reader import database_of, measures_in
from epuck_sim.runs.run_lock import current_holder
from epuck_sim.runs.schema import UNMEASURED
from epuck_sim.runs.share import WHOLE, Share
from epuck_sim.util.provenance import PROVENANCE


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
    """Number of trials in the whole sweep, or in the folder's share of it."""
    stored: int
    """Number of them that have a result."""
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
    share: str | None = None
    """Share of the sweep that the folder is for, as 3/40; None for the whole sweep."""


def read_status(folder: Path) -> Status:
    """Return how far the sweep is.

    Raises:
        StoreError: The folder is not a run folder, or its database is damaged.
    """
    with reading(database_of(folder)) as connection:
        share = read_share(connection)
        points = connection.execute("SELECT number, trials FROM points").fetchall()
        (scenario,) = connection.execute("SELECT scenario FROM points ORDER BY number LIMIT 1").fetchone()
        counts = _count(connection)
        stored = counts.stored if share == WHOLE else _count_of_share(connection, share, points)
        problem = _problem(connection)
        # a query for none would look at all trials
        failed = counts.problems and connection.execute(
            f"SELECT number, trial, seed, {problem} FROM trials JOIN points ON point = key "
            f"WHERE {problem} IS NOT NULL ORDER BY number, trial"
        )
        failures = [Failure(*row) for row in failed or ()]
        unmeasured = count_unmeasured(connection)
        versions = _count_by_origin(connection, counts)
    return Status(
        scenario=json.loads(scenario)["name"],
        points=len(points),
        trials=sum(len(share.trials(*point)) for point in points),
        stored=stored,
        censored=counts.censored if counts.stored else 0,
        failed=failures,
        wall_s=counts.wall_s,
        versions=versions,
        at_work=current_holder(folder),
        unmeasured=unmeasured,
        share=None if share == WHOLE else str(share),
    )


class _Counts(NamedTuple):
    """What one pass over all trials gives."""

    first: tuple[str, ...]
    """Versions and host that have made the first trial."""
    trials: int
    stored: int
    censored: int | None
    wall_s: float
    problems: int
    like_first: int


_ORIGIN = ", ".join(PROVENANCE)
_LIKE_FIRST = f"({_ORIGIN}) = ({', '.join('?' * len(PROVENANCE))})"


def _problem(connection: sqlite3.Connection) -> str:
    """Return why a trial has failed or could not be measured, as SQL; NULL of all others."""
    return "coalesce(error, measuring_error)" if has_column(connection, "trials", "measuring_error") else "error"


def _count(connection: sqlite3.Connection) -> _Counts:
    first = connection.execute(f"SELECT {_ORIGIN} FROM trials LIMIT 1").fetchone() or ("",) * len(PROVENANCE)
    counts = connection.execute(
        "SELECT count(*), ifnull(sum(error IS NULL), 0), sum(censored), total(wall_s), "
        f"ifnull(sum({_problem(connection)} IS NOT NULL), 0), ifnull(sum({_LIKE_FIRST}), 0) FROM trials",
        first,
    ).fetchone()
    return _Counts(first, *counts)


def _count_of_share(connection: sqlite3.Connection, share: Share, points: list[tuple[int, int]]) -> int:
    """Return how many trials of a share have a result; if it got further points, others are stored, too."""
    numbers = dict(connection.execute("SELECT key, number FROM points"))
    finished = FinishedTrials.read(connection, "FROM trials WHERE error IS NULL", numbers)
    return sum(finished.count(number, share.trials(number, trials)) for number, trials in points)


def _count_by_origin(connection: sqlite3.Connection, counts: _Counts) -> list[TrialsByOrigin]:
    """Count trials by what made them; mostly all are like the first, and need not be sorted, which is slow."""
    if not counts.trials:
        return []
    found = [TrialsByOrigin._make((*counts.first, counts.like_first))]
    if counts.like_first < counts.trials:
        query = f"SELECT {_ORIGIN}, count(*) FROM trials WHERE NOT {_LIKE_FIRST} GROUP BY {_ORIGIN}"
        found += (TrialsByOrigin(*row) for row in connection.execute(query, counts.first))
    return sorted(found)


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
