"""Check whether a run folder belongs to a sweep: everything on which its trials depend must be the same."""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import starmap
from pathlib import Path
from sys import intern
from typing import Any, NamedTuple

from epuck_sim.errors import ScenarioError, StoreError
from epuck_sim.measures.measure import SHIPPED, find_measure
from epuck_sim.runs.sources import measure_sources, name_with_digest, named_sources
from epuck_sim.scenario.loader import Point, validate
from epuck_sim.scenario.scenario import WITHOUT_EFFECT
from epuck_sim.util.messages import short_repr

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


def check_same_sweep(
    folder: Path, stored: Sequence[StoredPoint], given: Sequence[StoredPoint], other: str = "now"
) -> None:
    """Raise StoreError that says what differs, unless stored points belong to the sweep of the given ones.

    The sweep may have more points, trials and measures. `other` says in messages where its values are.
    """
    now = {point.key: point for point in given}
    for point in stored:
        for conflict in _conflicts(point, now, other):
            raise StoreError(f"{folder}: holds {conflict}")


def _conflicts(point: StoredPoint, given: Mapping[str, StoredPoint], other: str) -> Iterator[str]:
    """Yield reasons why a stored point is not of a sweep with these points, by key; do not resume after the first."""
    axes = [list(json.loads(each.axes)) for each in (point, next(iter(given.values())))]
    if set(axes[0]) != set(axes[1]):
        both = " and ".join(", ".join(each) or "none" for each in axes)
        yield f"another sweep; axes in the folder and {other}: {both}; give another folder"
    if not point.trials:
        return  # none has been run
    if point.key not in given:
        yield f"a point that this sweep lacks: {point.key}; add it, or give another folder"
    now = given[point.key]
    is_same = (point.scenario, point.controllers) == (now.scenario, now.controllers)  # looking closer takes 2 ms
    before, after = ({} if is_same else dict(_flat("", _with_effect(each))) for each in (point, now))
    if differences := _differences(before, after, other):
        more = ["..."] if len(differences) > MOST_SHOWN else []
        lines = "\n  ".join([*differences[:MOST_SHOWN], *more])
        yield f"results of another scenario; give another folder:\n  {lines}"
    measures = json.loads(now.measures)
    # measures added since are not compared: stored trials are run again for them
    for name, measure in json.loads(point.measures).items():
        if name not in measures:
            yield f"results of the measure {name}, which is missing {other}; give another folder"
        shipped = measure["measure"]
        defaults = find_measure(shipped).parameters if shipped in SHIPPED else {}  # of parameters that were added since
        for difference in _differences({**defaults, **measure}, measures[name], other):
            yield f"results of another measure {name}; give another folder: {difference}"
    if point.trials > now.trials:
        allowed = f"allowed: {point.trials} or more, or another folder"
        yield f"{point.trials} trials at {point.key}; trials is {now.trials}; {allowed}"


def _differences(before: Mapping[str, Any], after: Mapping[str, Any], other: str) -> list[str]:
    pairs = [(key, before.get(key, MISSING), after.get(key, MISSING)) for key in dict.fromkeys([*before, *after])]
    return [
        f"{key}: {short_repr(old)} in the folder, {short_repr(new)} {other}" for key, old, new in pairs if old != new
    ]


def _with_effect(point: StoredPoint) -> dict[str, Any]:
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
    """Yield the dotted key and the value of every plain value inside `value`, also in lists, which may be long."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if parts is None:
        yield key, value
    else:
        for name, part in parts:
            yield from _flat(f"{key}.{name}" if key else str(name), part)
