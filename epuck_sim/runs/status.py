"""How far the sweep in a run folder is, how its trials ended, and whether its files are whole; nothing is changed."""

import hashlib
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.errors import StoreError
from epuck_sim.runs.database import UNMEASURED, reading
from epuck_sim.runs.folder import DATABASE, current_holder, database_of
from epuck_sim.runs.reader import measures_in, read_finished
from epuck_sim.runs.share import WHOLE, read_share
from epuck_sim.runs.sources import DIGESTS, read_digests
from epuck_sim.scenario.loader import RUN_SCENARIO
from epuck_sim.util.messages import counted
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


class PointAtLimit(NamedTuple):
    """A point whose trials have all reached their limit so far, without synchrony."""

    point: int
    axes: dict[str, Any]
    """Value of each axis by dotted key."""
    trials: int
    """Number of these trials."""


FEW_TRIALS = 20
"""Number of trials, or all of a point's if it has fewer, from which on they stand for the others of their point."""


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
    at_limit: Sequence[PointAtLimit] = ()
    """Points whose trials, `FEW_TRIALS` or more of them, are all censored."""


def read_status(folder: Path) -> Status:
    """Return how far the sweep is."""
    with reading(folder) as connection:
        share = read_share(connection)
        points = connection.execute("SELECT number, trials FROM points ORDER BY number").fetchall()
        (scenario,) = connection.execute("SELECT scenario FROM points ORDER BY number LIMIT 1").fetchone()
        first = connection.execute(f"SELECT {_ORIGIN} FROM trials LIMIT 1").fetchone() or ("",) * len(PROVENANCE)
        trials, stored, censored, wall_s, like_first = connection.execute(
            "SELECT count(*), ifnull(sum(error IS NULL), 0), sum(censored), total(wall_s), "
            f"ifnull(sum({_LIKE_FIRST}), 0) FROM trials",
            first,
        ).fetchone()
        # mostly all are like the first: to group them takes four times as long
        versions = [TrialsByOrigin._make((*first, like_first))] if trials else []
        if like_first < trials:
            others = f"SELECT {_ORIGIN}, count(*) FROM trials WHERE NOT {_LIKE_FIRST} GROUP BY {_ORIGIN}"
            versions += (TrialsByOrigin(*row) for row in connection.execute(others, first))
        failed = connection.execute(
            f"SELECT number, trial, seed, {_PROBLEM} AS problem FROM trials JOIN points ON point = key "
            "WHERE problem IS NOT NULL ORDER BY number, trial"
        )
        failures = [Failure(*row) for row in failed]
        unmeasured = 0
        if measures_in(connection):
            query = f"SELECT count(*) FROM trials WHERE error IS NULL AND {UNMEASURED}"
            (unmeasured,) = connection.execute(query).fetchone()
        at_limit = censored and connection.execute(
            "SELECT number, axes, count(*) FROM trials JOIN points ON point = key WHERE error IS NULL GROUP BY key "
            f"HAVING min(censored) = 1 AND count(*) >= min(trials, {FEW_TRIALS}) ORDER BY number"
        )
        points_at_limit = tuple(PointAtLimit(number, json.loads(axes), count) for number, axes, count in at_limit or ())
        if share != WHOLE:  # one that got further points may have trials that now belong to others
            finished = read_finished(connection)
            ours = sum(finished.count(number, share.trials(number, count)) for number, count in points)
    return Status(
        scenario=json.loads(scenario)["name"],
        points=len(points),
        trials=sum(len(share.trials(*point)) for point in points),
        stored=stored if share == WHOLE else ours,
        censored=censored if stored else 0,
        failed=failures,
        wall_s=wall_s,
        versions=sorted(versions),
        at_work=current_holder(folder),
        unmeasured=unmeasured,
        share=None if share == WHOLE else str(share),
        at_limit=points_at_limit,
    )


_ORIGIN = ", ".join(PROVENANCE)
_LIKE_FIRST = f"({_ORIGIN}) = ({', '.join('?' * len(PROVENANCE))})"
_PROBLEM = "coalesce(error, measuring_error)"


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
    with reading(folder) as connection:
        numbers = connection.execute("SELECT number FROM points ORDER BY number").fetchall()
        found: dict[int, list[float]] = {number: [] for (number,) in numbers}
        for number, wall_s in connection.execute(
            "SELECT number, wall_s FROM trials JOIN points ON point = key WHERE error IS NULL ORDER BY number, trial"
        ):
            found[number].append(wall_s)
    return found


class Verdict(NamedTuple):
    """What was found of one file of a run folder."""

    file: str
    is_whole: bool
    says: str


def verify(folder: Path) -> list[Verdict]:
    """Look at every file of a run folder, and return what each is; nothing in it is run or changed."""
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
        says = "has no digest: an earlier version has written it" if is_there else "is missing"
        return [*found, Verdict(RUN_SCENARIO, is_there, says)]
    for name, digest in digests.items():
        try:
            is_whole = hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest
            says = "is as it was written" if is_whole else "is damaged, or was changed"
        except OSError as error:
            is_whole, says = False, f"cannot be read: {error.strerror}"
        found.append(Verdict(name, is_whole, says))
    return found
