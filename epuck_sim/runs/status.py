"""How far the sweep in a run folder is, how its trials ended and how long they took; nothing in it is changed."""

import json
import sqlite3
from pathlib import Path
from typing import NamedTuple

from epuck_sim.runs.database import UNMEASURED, has_column, reading
from epuck_sim.runs.reader import database_of, measures_in
from epuck_sim.runs.run_lock import current_holder
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
        problem = "coalesce(error, measuring_error)" if has_column(connection, "trials", "measuring_error") else "error"
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
