"""Which sweep a run folder belongs to, and which share of it; folders of one sweep are merged.

A folder belongs to a sweep if everything on which its trials depend is the same. Shares are for machines that know
nothing of each other.
"""

import json
import re
import sqlite3
from collections.abc import Iterator, Mapping, Sequence, Set
from contextlib import suppress
from itertools import chain, starmap
from pathlib import Path
from sys import intern
from typing import Any, NamedTuple, Self

from epuck_sim.errors import EpuckSimError, ScenarioError, StoreError
from epuck_sim.measures.measure import SHIPPED, find_measure
from epuck_sim.runs import sources
from epuck_sim.runs.database import REPEATED, columns_of, file_uri, new_database, quoted, reading, sqlite_errors
from epuck_sim.runs.folder import DATABASE, acquire
from epuck_sim.runs.sources import measure_sources, name_with_digest, named_sources
from epuck_sim.scenario.loader import Point, validate
from epuck_sim.scenario.scenario import WITHOUT_EFFECT
from epuck_sim.util.messages import short_yaml
from epuck_sim.util.provenance import PROVENANCE, format_versions

MOST_SHOWN = 8  # largest number of differences in a message
MISSING = "nothing"  # value that a message shows for a key that is missing on one side


class StoredPoint(NamedTuple):
    """A point as the database stores it; axes, scenario, controllers and measures are JSON."""

    key: str
    number: int
    trials: int
    """Number of trials in the sweep; for a point that is read from a folder, one more than its last stored trial."""
    axes: str
    scenario: str
    controllers: str
    """Controller of each group, by name, for a user's file with the digest of its sources; after them, written alike,
    sensors and the picture of a floor. For agents, a file of robots and a user's response curve."""
    measures: str  # by the name of each measure, its parameters and the measure itself, as controllers are stored
    share: str | None = None  # share of the sweep that the folder is for, as 3/40; None for the whole


def stored_point(point: Point) -> StoredPoint:
    """Return a point as it is stored in a folder for the whole sweep."""
    scenario = point.scenario
    measures = {
        section.name: {**section.parameters, "measure": name_with_digest(*measure_sources(section))}
        for section in scenario.measures
    }
    return StoredPoint(
        point.key,
        point.number,
        scenario.trials,
        json.dumps(point.axes),
        scenario.model_dump_json(),
        json.dumps([*starmap(name_with_digest, named_sources(scenario))]),
        json.dumps(measures),
    )


WITH_VALUES = """
    (SELECT json_group_object(one.key, json(one.value)) FROM json_each(measures) AS one WHERE EXISTS (
        SELECT 1 FROM trials, json_each(measured) AS value WHERE point = points.key AND value.key = one.key))
"""
"""SQL term: those measures of a point for which a trial has a value; the others may be replaced, or left out."""


def read_stored_points(
    connection: sqlite3.Connection, trials: str = "trials", measures: str = "measures"
) -> list[StoredPoint]:
    """Return the points of a database in the order of the sweep; SQL terms give their trials and measures."""
    columns = f"key, number, {trials}, axes, scenario, controllers, {measures}"
    rows = connection.execute(f"SELECT {columns} FROM points ORDER BY number")
    return [StoredPoint(*row[:3], *map(intern, row[3:])) for row in rows]  # shares of a sweep have the same texts


FAILED_MEASURES = """
    SELECT DISTINCT one.key FROM trials JOIN points ON point = points.key, json_each(measures) AS one
    WHERE ifnull(error, measuring_error) IS NOT NULL AND (instr(error, ': measure ' || one.key || ', seed ') OR
            measuring_error IS NOT NULL AND NOT EXISTS (SELECT 1 FROM json_each(measured) WHERE key = one.key))
        AND NOT instr(scenario, '"when":{"measure":"' || one.key || '"')
"""
"""SQL query: measures that failed in a stored trial, or in its repetition, but for those that trials wait for."""


def check_stored_points(folder: Path, connection: sqlite3.Connection, given: Sequence[StoredPoint]) -> set[str]:
    """Raise StoreError unless the points of a folder's database belong to the sweep of the given ones.

    `FAILED_MEASURES` may differ, or be left out: returns the names of those that do, whose values are to be dropped.
    """
    last = "(SELECT ifnull(max(trial) + 1, 0) FROM trials WHERE point = key)"
    stored = read_stored_points(connection, last, WITH_VALUES)
    now = {point.key: point.measures for point in given}
    texts = {(point.measures, now.get(point.key, "{}")) for point in stored}  # many points have the same
    pairs = [(json.loads(before), json.loads(after)) for before, after in texts]
    dropped = {name for before, after in pairs for name in before if before[name] != after.get(name)}
    if dropped:
        dropped &= {name for (name,) in connection.execute(FAILED_MEASURES)}
        stored = [point._replace(measures=without(dropped, point.measures)) for point in stored]
    check_same_sweep(folder, stored, given)
    return dropped


def without(names: Set[str], values: str) -> str:
    """Return values by name, as JSON, without those of some names."""
    return json.dumps({name: value for name, value in json.loads(values).items() if name not in names})


def check_same_sweep(
    folder: Path, stored: Sequence[StoredPoint], given: Sequence[StoredPoint], other: str = "now"
) -> None:
    """Raise StoreError that says what differs, unless stored points belong to the sweep of the given ones.

    The sweep may have more points, trials and measures. `other` says in messages where its values are.
    """
    now = {point.key: point for point in given}
    for point in stored:
        _check_point(f"{folder}: holds", point, now, other)


def _check_point(origin: str, point: StoredPoint, given: Mapping[str, StoredPoint], other: str) -> None:
    axes = [list(json.loads(each.axes)) for each in (point, next(iter(given.values())))]
    if set(axes[0]) != set(axes[1]):
        both = " and ".join(", ".join(each) or "none" for each in axes)
        raise StoreError(f"{origin} another sweep; axes in the folder and {other}: {both}; give another folder")
    if not point.trials:  # none has been run
        return
    if point.key not in given:
        raise StoreError(f"{origin} a point that this sweep lacks: {point.key}; add it, or give another folder")
    now = given[point.key]
    if (point.scenario, point.controllers) != (now.scenario, now.controllers):  # looking closer takes 2 ms
        before, after = (dict(_flat("", _keys_with_effect(each))) for each in (point, now))
        if differences := _differences(before, after, other):
            more = ["..."] if len(differences) > MOST_SHOWN else []
            lines = "\n  ".join([*differences[:MOST_SHOWN], *more])
            raise StoreError(f"{origin} results of another scenario; give another folder:\n  {lines}")
    measures = json.loads(now.measures)
    # measures added since are not compared: stored trials are run again for them
    for name, measure in json.loads(point.measures).items():
        if name not in measures:
            said = f"results of the measure {name}, which is missing {other}; give it again, or another folder"
            raise StoreError(f"{origin} {said}")
        shipped = measure["measure"]
        defaults = find_measure(shipped).parameters if shipped in SHIPPED else {}  # of parameters that were added since
        if differences := _differences({**defaults, **measure}, measures[name], other):
            raise StoreError(f"{origin} results of another measure {name}; give another folder: {differences[0]}")
    if point.trials > now.trials:
        allowed = f"allowed: {point.trials} or more, or another folder"
        raise StoreError(f"{origin} {point.trials} trials at {point.key}; trials is {now.trials}; {allowed}")


def _differences(before: Mapping[str, Any], after: Mapping[str, Any], other: str) -> list[str]:
    pairs = [(key, before.get(key, MISSING), after.get(key, MISSING)) for key in dict.fromkeys([*before, *after])]
    return [
        f"{key}: {short_yaml(old)} in the folder, {short_yaml(new)} {other}" for key, old, new in pairs if old != new
    ]


def _keys_with_effect(point: StoredPoint) -> dict[str, Any]:
    scenario = json.loads(point.scenario)
    with suppress(ScenarioError):  # if it no longer validates, it is compared as it was stored
        scenario = validate(scenario, "stored").model_dump(mode="json")  # with defaults of keys that were added since
    stored = iter(json.loads(point.controllers))
    for group in scenario.get("robots", ()):
        group["controller"] = next(stored)
    for sensor in (each for group in scenario.get("robots", ()) for each in group.get("sensors", {}).values()):
        sensor["file"] = next(stored)
    start = scenario.get("start")
    if isinstance(start, dict) and Path(start.get("like") or "").is_absolute():
        start["like"] = next(stored, start["like"])
    for section, key in ((scenario.get("arena", {}).get("floor"), "picture"), (scenario.get("response"), "curve")):
        if section is not None and section.get(key) is not None:
            section[key] = next(stored, section[key])  # a shipped curve is stored with the scenario alone
    kinds = (scenario.get("robot"), *(group.get("kind") for group in scenario.get("robots", ())))
    for section in kinds:
        if isinstance(section, dict) and isinstance(section.get("kind"), str):
            section["kind"] = Path(section["kind"]).name  # files may move
    return {key: value for key, value in scenario.items() if key not in WITHOUT_EFFECT}


def _flat(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if parts is None:
        yield key, value
    else:
        for name, part in parts:
            yield from _flat(f"{key}.{name}" if key else str(name), part)


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
    files = sources.with_trials(sources.read_sources(largest), max(most.values()))
    with acquire(whole):
        if (whole / DATABASE).exists():
            raise StoreError(f"{whole}: holds results already; give a new folder, and this one among those to merge")
        with new_database(whole / DATABASE, list(json.loads(merged[0].axes)), merged) as connection:
            for folder in points:
                _add(connection, folder)
        sources.write_files(whole, files)
        if sources.is_trusted(largest):
            sources.trust(whole)


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
