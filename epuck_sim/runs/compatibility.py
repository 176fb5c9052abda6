"""Whether a run folder belongs to a sweep: it does if everything on which its trials depend is the same."""

import hashlib
import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from epuck_sim.control.loader import find_controller, is_file
from epuck_sim.errors import ScenarioError, StoreError
from epuck_sim.scenario.curves import find_curve
from epuck_sim.scenario.measures import MeasureSection
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.points import Point
from epuck_sim.scenario.scenario import WITHOUT_EFFECT, Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.util.messages import short_repr

MOST_SHOWN = 8
"""Largest number of differences in a message."""

MISSING = "nothing"
"""Value that a message shows for a key that is missing on one side."""


class StoredPoint(NamedTuple):
    """A point as the database stores it; axes, scenario, controllers and measures are JSON."""

    key: str
    number: int
    trials: int
    """Number of trials in the sweep; for a point that is read from a folder, one more than its last stored trial."""
    axes: str
    scenario: str
    controllers: str
    """Controller of each group, a shipped one's name, or the name and the digest of the sources of a user's file; of
    agents, a user's response curve."""
    measures: str
    """By the name of each measure, its parameters and the measure itself, as controllers are stored."""
    share: str | None = None
    """Share of the sweep that the folder is for, as 3/40; None for the whole."""


def stored_point(point: Point) -> StoredPoint:
    """Return a point as it is stored, of the whole sweep."""
    scenario = point.scenario
    return StoredPoint(
        point.key,
        point.number,
        scenario.trials,
        json.dumps(point.axes),
        scenario.model_dump_json(),
        json.dumps([*map(_controller, scenario.controllers), *_own_curve(scenario)]),
        json.dumps(dict(map(_measure, scenario.measures))),
    )


def read_stored_points(connection: sqlite3.Connection, trials: str = "trials") -> list[StoredPoint]:
    """Return the points of a database in the order of the sweep, with the number of trials that an SQL term gives."""
    columns = f"key, number, {trials}, axes, scenario, controllers, measures"
    return [StoredPoint(*row) for row in connection.execute(f"SELECT {columns} FROM points ORDER BY number")]


def own_files(scenario: Scenario) -> tuple[str, ...]:
    """Return what a scenario's trials call by name: controllers, a response curve and measures, with their digests.

    Raises:
        EpuckSimError: One of them is not there.
    """
    measures = (str(_measure(section)[1]["measure"]) for section in scenario.measures)
    return (*map(_controller, scenario.controllers), *_own_curve(scenario), *measures)


def _controller(name: str) -> str:
    return name if not is_file(name) else _with_digest(Path(name).name, find_controller(name).sources)


def _own_curve(scenario: Scenario) -> list[str]:
    """Return the response curve, if it is a user's."""
    curve = scenario.response.curve if isinstance(scenario, ParticleScenario) else ""
    return [_with_digest(Path(curve).name, find_curve(curve).sources)] if curve.endswith(".py") else []


def _measure(section: MeasureSection) -> tuple[str, dict[str, Any]]:
    measure = section.find()
    name = Path(measure.stored_name).name
    shown = _with_digest(name, measure.sources) if measure.sources else name
    return measure.name, {"measure": shown, **section.parameters}


def _with_digest(name: str, sources: Mapping[Path, bytes]) -> str:
    return f"{name} with digest {hashlib.sha256(b''.join(sources.values())).hexdigest()[:12]}"


def check_same_sweep(
    folder: Path, stored: Sequence[StoredPoint], given: Sequence[StoredPoint], other: str = "now"
) -> None:
    """Check that a folder's results belong to a sweep, which may have more points and trials than the folder.

    Args:
        folder: The folder, for the message.
        stored: Its points.
        given: The points of the sweep.
        other: Where the sweep's values are, for the message.

    Raises:
        StoreError: They do not; the message shows the difference.
    """
    now = {point.key: point for point in given}
    for point in stored:
        if set(json.loads(point.axes)) != set(json.loads(given[0].axes)):
            axes = " and ".join(", ".join(json.loads(each.axes)) or "none" for each in (point, given[0]))
            raise StoreError(
                f"{folder}: holds another sweep; axes in the folder and {other}: {axes}; give another folder"
            )
        if not point.trials:
            continue  # none has been run
        if point.key not in now:
            raise StoreError(
                f"{folder}: holds a point that this sweep lacks: {point.key}; add it, or give another folder"
            )
        differences = list(_differences(point, now[point.key], other))
        if differences:
            more = ["..."] if len(differences) > MOST_SHOWN else []
            lines = "\n  ".join([*differences[:MOST_SHOWN], *more])
            raise StoreError(f"{folder}: holds results of another scenario; give another folder:\n  {lines}")
        _check_measures(folder, json.loads(point.measures), json.loads(now[point.key].measures), other)
        if point.trials > now[point.key].trials:
            raise StoreError(
                f"{folder}: holds {point.trials} trials at {point.key}; trials is {now[point.key].trials}; "
                f"allowed: {point.trials} or more, or another folder"
            )


def _check_measures(folder: Path, stored: dict[str, Any], now: dict[str, Any], other: str) -> None:
    """Raise StoreError if trials with results were measured otherwise than those to come would be.

    Measures that were added are none of these: stored trials are run again for them.
    """
    for name, measure in stored.items():
        if name not in now:
            raise StoreError(
                f"{folder}: holds results of the measure {name}, which is lacking {other}; give another folder"
            )
        for key in dict.fromkeys([*measure, *now[name]]):
            old, new = measure.get(key, MISSING), now[name].get(key, MISSING)
            if old != new:
                raise StoreError(
                    f"{folder}: holds results of another measure {name}; give another folder: "
                    f"{key}: {short_repr(old)} in the folder, {short_repr(new)} {other}"
                )


def _differences(stored: StoredPoint, now: StoredPoint, other: str) -> Iterator[str]:
    before, after = (dict(_flat("", _with_effect(point))) for point in (stored, now))
    for key in dict.fromkeys([*before, *after]):
        old, new = before.get(key, MISSING), after.get(key, MISSING)
        if old != new:
            yield f"{key}: {short_repr(old)} in the folder, {short_repr(new)} {other}"


def _with_effect(point: StoredPoint) -> dict[str, Any]:
    scenario = _with_defaults(json.loads(point.scenario))
    stored = json.loads(point.controllers)
    for group, controller in zip(scenario.get("robots", ()), stored, strict="robots" in scenario):
        group["controller"] = controller
    if "response" in scenario and stored:
        (scenario["response"]["curve"],) = stored
    return {key: value for key, value in scenario.items() if key not in WITHOUT_EFFECT}


def _with_defaults(scenario: dict[str, Any]) -> dict[str, Any]:
    """Fill in defaults for keys added since the scenario was stored; return it unchanged if it no longer validates."""
    try:
        return validate(scenario, "stored").model_dump(mode="json")
    except ScenarioError:
        return scenario


def _flat(key: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Yield the dotted key and the value of every plain value inside `value`."""
    parts = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else None
    if parts is None:
        yield key, value
    else:
        for name, part in parts:
            yield from _flat(f"{key}.{name}" if key else str(name), part)
