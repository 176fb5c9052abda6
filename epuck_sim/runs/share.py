"""Shares of a sweep, for machines that know nothing of each other, and their merging into one run folder."""

import json
import re
import sqlite3
from collections.abc import Sequence
from itertools import chain
from pathlib import Path
from typing import NamedTuple, Self

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.runs.compatibility import StoredPoint, check_same_sweep, read_stored_points
from epuck_sim.runs.database import REPEATED, columns_of, file_uri, new_database, quoted, reading, sqlite_errors
from epuck_sim.runs.folder import DATABASE, acquire
from epuck_sim.runs.sources import is_trusted, read_sources, trust, with_trials, write_files
from epuck_sim.util.provenance import PROVENANCE, format_versions

GOLDEN_RATIO = 0x9E3779B97F4A7C15
"""Fraction of the golden ratio in 64 bits: its multiples modulo 2 ** 64 are spread evenly, at any step of an axis."""

VERSIONS = tuple(name for name in PROVENANCE if name != "host")
"""Columns that must be the same in all trials that are merged."""


class Share(NamedTuple):
    """One of several shares, all of which have about equally many trials of every point."""

    number: int  # from 1 to `of`
    of: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the share that is written as 3/40, for example."""
        match = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text)
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise EpuckSimError(f"--share is {text}; allowed: K/N with K from 1 to N, as in 3/40")
        return cls(int(match[1]), int(match[2]))

    def trials(self, point: int, trials: int) -> range:
        """Return the trials of this share at a point.

        A trial's share depends on the numbers of its point and trial alone: if trials are added, those before stay in
        their shares. Points begin at different shares, which spreads points that have fewer trials than shares.

        >>> [list(Share(number, 3).trials(0, 5)) for number in (1, 2, 3)]
        [[0, 3], [1, 4], [2]]
        """
        begin = (point * GOLDEN_RATIO % 2**64) * self.of >> 64
        return range((self.number - 1 - begin) % self.of, trials, self.of)

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


WHOLE = Share(1, 1)  # the only share of a sweep that is not divided


def read_share(connection: sqlite3.Connection) -> Share:
    """Return the share of its sweep that a folder is for."""
    (text,) = connection.execute("SELECT max(share) FROM points").fetchone()
    return WHOLE if text is None else Share.parse(text)


def merge_folders(folders: Sequence[Path], whole: Path) -> None:
    """Merge run folders into a new or empty one that has each of their trials once; a result replaces a failure.

    `whole` appears with all trials or not at all, and `folders` stay as they are. They may be unfinished, and may share
    trials, whose results must then be the same.

    If some have more points or trials, so has `whole`. StoreError is raised if a folder is damaged, or does not belong
    to the others.
    """
    points: dict[Path, list[StoredPoint]] = {}
    versions: dict[tuple[str, ...], Path] = {}
    for folder in folders:
        with reading(folder) as connection:
            points[folder] = read_stored_points(connection)
            for row in connection.execute(f"SELECT DISTINCT {', '.join(VERSIONS)} FROM trials"):
                versions.setdefault(row, folder)
    if len(versions) > 1:
        (first, here), (second, there) = list(versions.items())[:2]
        one, other = (format_versions(dict(zip(VERSIONS, each, strict=True))) for each in (first, second))
        raise StoreError(f"{there}: holds trials made by {other}, {here} by {one}; merge folders of the same versions")

    def size(folder: Path) -> tuple[int, int, int]:  # the sweep may have grown since the first share was begun
        measures = sum(len(json.loads(point.measures)) for point in points[folder])
        return len(points[folder]), measures, sum(point.trials for point in points[folder])

    largest = max(points, key=size)
    most: dict[str, int] = {}  # at each point, of any folder: the largest folder may not have the most at each
    for point in chain.from_iterable(points.values()):
        most[point.key] = max(point.trials, most.get(point.key, 0))
    merged = [point._replace(trials=most[point.key]) for point in points[largest]]
    for folder, of_folder in points.items():
        check_same_sweep(folder, of_folder, merged, f"in {largest}")
    sources = with_trials(read_sources(largest), max(most.values()))
    with acquire(whole):
        if (whole / DATABASE).exists():
            raise StoreError(f"{whole}: holds results already; give a new folder, and this one among those to merge")
        axes = list(json.loads(points[largest][0].axes))
        with new_database(whole / DATABASE, axes, merged) as connection:
            for folder in points:
                _add(connection, folder)
        write_files(whole, sources)
        if is_trusted(largest):
            trust(whole)


MEASURED_OTHERWISE = """
    EXISTS (SELECT 1 FROM json_each(old.measured) AS one JOIN json_each(new.measured) AS other USING (key)
            WHERE one.value IS NOT other.value)
"""
"""Condition on two rows of a trial: their values of a measure differ."""


def _add(connection: sqlite3.Connection, folder: Path) -> None:
    path = folder / DATABASE
    with sqlite_errors(path):
        connection.execute("ATTACH ? AS share", (file_uri(path, "ro"),))
    try:
        with sqlite_errors(path), connection:
            connection.execute("BEGIN")
            same = ("seed", "censored", "events", *REPEATED)
            differs = " OR ".join([*(f"old.{name} IS NOT new.{name}" for name in same), MEASURED_OTHERWISE])
            double = connection.execute(
                "SELECT point, trial FROM main.trials AS old JOIN share.trials AS new USING (point, trial) "
                f"WHERE old.error IS NULL AND new.error IS NULL AND ({differs}) LIMIT 1"
            ).fetchone()
            if double is not None:
                raise StoreError(f"{folder}: trial {double[1]} at {double[0]} differs from that of another folder")
            names = [quoted(name) for name in columns_of(connection, "trials")]
            updates = ", ".join(f"{name} = excluded.{name}" for name in names)
            connection.execute(
                f"INSERT INTO main.trials ({', '.join(names)}) SELECT {', '.join(names)} FROM share.trials "
                f"WHERE true ON CONFLICT (point, trial) DO UPDATE SET {updates} WHERE trials.error IS NOT NULL "
                "OR excluded.error IS NULL AND length(excluded.measured) > ifnull(length(trials.measured), 0)"
            )
    finally:
        connection.execute("DETACH share")
