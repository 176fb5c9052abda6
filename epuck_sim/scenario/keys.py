"""Dotted keys of a scenario as people type them, whole or only their endings; and new values for them."""

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from epuck_sim.errors import MeasureError, ScenarioError
from epuck_sim.measures.measure import find_measure
from epuck_sim.scenario.axes import Rows, with_ranges
from epuck_sim.scenario.base import ends_in, refused_at
from epuck_sim.scenario.embodied import noise_keys
from epuck_sim.scenario.robot_kind import are_groups, as_section, without_brought_sensors
from epuck_sim.scenario.scenario import AS, WITHOUT_EFFECT
from epuck_sim.util.messages import short_yaml
from epuck_sim.util.yaml_io import parse_yaml


def full_keys(ending: str, keys: Sequence[str], where: str) -> list[str]:
    """Return the keys that a key, or an ending of one, stands for: one, or one in each group of robots, or none.

    Keys on which trials depend take precedence over others, such as those of `overhead` and `figure`.
    """
    if ending in keys:
        return [ending]
    found = [key for key in keys if ends_in(key, ending)]
    without_effect = WITHOUT_EFFECT | {"robot.height_cm"}  # only films depend on it
    found = [key for key in found if without_effect.isdisjoint((key, key.partition(".")[0]))] or found
    if len({re.sub(r"^robots\.\d+\.", "", key) for key in found}) > 1:
        raise ScenarioError(f"{where}: {ending} is the ending of {len(found)} keys; give one of {', '.join(found)}")
    return found


def axis_key(typed: str, rows: Rows, where: str) -> str:
    """Return the axis of a sweep that a key, or an ending of one, stands for; `typed` itself if there is none.

    If several groups of robots have such an axis, with equal values at each point, it is that of the first group.
    """
    found = full_keys(typed, [*rows[0]], where) or [typed]
    if len(found) > 1 and any(row[key] != row[found[0]] for row in rows for key in found):
        raise ScenarioError(f"{where}: {typed} is the ending of {len(found)} axes; give one of {', '.join(found)}")
    return found[0]


MAX_PARTS = 20  # largest number of parts of a dotted key; those of scenarios have up to six


def parse_setting(setting: str) -> tuple[str, Any]:
    """Return the key and the value of a change given as `key=value`."""
    key, text = _parted(setting, "--set", "key=value, such as max_cycles=100")
    return key, parse_yaml(text, f"--set {setting}")


def parse_axis(axis: str, option: str) -> tuple[str, list[Any]]:
    """Return the dotted key and the values of an axis given as `key=value,value,...`."""
    key, text = _parted(axis, option, "key=value,value,..., such as count=5,10,20, or as key=FROM:TO:NUMBER")
    values: list[Any] = parse_yaml(f"[{text}]", f"{option} {axis}")
    return key, values


def _parted(given: str, option: str, form: str) -> tuple[str, str]:
    key, equals, text = map(str.strip, given.partition("="))
    if not equals or not key:
        raise ScenarioError(f"{option} {given}: give it as {form}")
    return key, text


def set_value(
    given: Mapping[str, Any], key: str, value: Any, origin: str, folder: Path | None = None
) -> dict[str, Any]:
    """Return the mapping `given`, of a file in a folder, with `value` at a dotted key."""
    if re.fullmatch(r"robot\.kind|robots\.\d+\.kind\.kind", key):
        instead = f"{key.removesuffix('.kind')}={value}"
        raise ScenarioError(f"{origin}: another kind of robot has other values for all keys; give {instead} instead")
    if key == "sensors":  # of all robots
        groups = given.get("robots") or [{}]
        if are_groups(groups):
            groups = [{**group, "sensors": value} for group in groups]
        return {**given, "robots": groups, "sensors": None}
    given = without_brought_sensors(given, key)
    parts = _parameter_of_measure(given, key, folder) or key.split(".")
    if len(parts) > MAX_PARTS:
        raise ScenarioError(f"{origin[:60]}...: a key of {len(parts)} parts; allowed: at most {MAX_PARTS}")
    # a scenario has one group of robots by default, and agents reach their nearest neighbour
    defaults: dict[str, Any] = {"robots": [{}], "neighbourhood": {"kind": "nearest"}}
    result = _with({**{name: defaults[name] for name in parts[:1] if name in defaults}, **given}, parts, value, origin)
    assert isinstance(result, dict)  # a mapping changed is a mapping
    return result


def _parameter_of_measure(given: Mapping[str, Any], key: str, folder: Path | None) -> list[str]:
    """Return the parts of a key such as measures.0.mine.gap, with the measure's name as listed; none for others."""
    found = re.fullmatch(r"measures\.(\d+)\.(.+)\.(\w+)", key)
    listed = given.get("measures")
    if found is None or not isinstance(listed, list | tuple) or int(found[1]) >= len(listed):
        return []
    measure = listed[int(found[1])]
    is_one = isinstance(measure, Mapping) and len(measure) == 1
    ((name, parameters),) = measure.items() if is_one else ((measure, None),)
    if isinstance(name, str):
        file = Path(name).name.partition(":")[0]
        shown_as = parameters.get(AS) if isinstance(parameters, Mapping) else None
        names = name, name.rpartition(":")[2], file, Path(file).stem, shown_as
        if found[2] in names or (found[2],) == _contents(name, folder)[:1]:
            return ["measures", found[1], name, found[3]]
    return []


def keys_of_measures(given: Mapping[str, Any], ending: str, folder: Path | None) -> list[str]:
    """Return the keys that an ending stands for if it names a measure, or its file, and a parameter, known or not."""
    listed = given.get("measures")
    numbers = range(len(listed)) if isinstance(listed, list | tuple) else ()
    keys = [f"measures.{number}.{ending}" for number in numbers]
    return [key for key in keys if _parameter_of_measure(given, key, folder)]


def set_values(given: Mapping[str, Any], values: Mapping[str, Any], origin: str) -> dict[str, Any]:
    """Return the mapping `given` with values at dotted keys; whole sections are set before keys inside them."""
    for key in sorted(values, key=lambda key: key.count(".")):
        given = set_value(given, key, values[key], origin)
    return dict(given)


def _with(container: Any, parts: list[str], value: Any, origin: str, path: str = "") -> Any:
    """Return `container`, which is at `path`, with `value` at the path `parts` in it; missing sections are added.

    A word given for a section, such as a kind of robot or noise, becomes the section that it stands for.
    """
    if not parts:
        return value
    has_dotted_keys = re.fullmatch(r"schedule\.\d+\.set|figure\.(labels|base_case)", path)
    first, *rest = [".".join(parts)] if has_dotted_keys else parts
    if re.fullmatch(r"robot|robots\.\d+\.kind", path):
        container = as_section(container)
    elif path == "noise":
        container = noise_keys(container)
    elif re.fullmatch(r"measures\.\d+", path) and isinstance(container, str):
        container = {container: {}}
    below = f"{path}.{first}".removeprefix(".")
    if isinstance(container, list | tuple):
        if first not in map(str, range(len(container))):
            such = f", as in {path}.0" if container and not first.isdecimal() else ""
            said = f"{first!r} is not an index into a list of {len(container)}, counted from 0{such}"
            raise ScenarioError(f"{origin}: {said}")
        index = int(first)
        return [*container[:index], _with(container[index], rest, value, origin, below), *container[index + 1 :]]
    if container is not None and not isinstance(container, Mapping):
        raise ScenarioError(f"{origin}: {first!r} is inside {short_yaml(container)}, which has no keys")
    here = dict(container or {})
    here[first] = _with(here.get(first), rest, value, origin, below)
    return here


NOT_DESCRIBED = {"name", "description", "trials", "seed", "figure", "measures"}
"""Keys of a scenario that its description says nothing about."""

QUICK = "quick"  # key in a scenario's file that holds the keys in which its quick version differs


def without_quick(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a file's scenario in its full version."""
    return {key: value for key, value in given.items() if key != QUICK}


def quick_version(given: Mapping[str, Any], origin: str) -> dict[str, Any]:
    """Return a file's scenario in its quick version."""
    changes = given.get(QUICK)
    if changes is None:
        raise ScenarioError(f"{origin}: has no quick version; leave --quick out")
    if not isinstance(changes, Mapping):
        raise ScenarioError(f"{origin}: {QUICK}: is {short_yaml(changes)}; allowed: a mapping of keys to values")
    return merge(without_quick(given), changes)


def merge(given: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Return `given` with `changes`: sections are merged key by key, other values are replaced.

    >>> merge({"stop": {"max_cycles": 9}, "trials": 5}, {"stop": {"order_parameter": 0.9}})
    {'stop': {'max_cycles': 9, 'order_parameter': 0.9}, 'trials': 5}
    """
    merged = dict(given)
    for key, value in changes.items():
        old = given.get(key)
        merged[key] = merge(old, value) if isinstance(old, Mapping) and isinstance(value, Mapping) else value
    return merged


def add_measures(
    given: Mapping[str, Any], names: Sequence[str], origin: str, folder: Path | None = None
) -> dict[str, Any]:
    """Return the mapping `given` with more measures after those that it has; parameters of any can then be set.

    A measure is given by its name, or as in a file: `coverage: {cells: 4}`. One that is there already is not added, so
    that a command that was killed can be repeated.
    """
    own = given.get("measures") or []
    if not isinstance(own, list | tuple):
        raise ScenarioError(f"{origin}: measures: is {short_yaml(own)}; allowed: a list")
    there = [{each: {}} if isinstance(each, str) else each for each in own]
    added: list[Any] = [parse_yaml(name, f"--measure {name}") if ": " in name else {name: {}} for name in names]
    known = {_contents(name, folder): name for each in there if isinstance(each, Mapping) for name in each}
    for place, each in enumerate(added):
        if isinstance(each, Mapping):  # a run folder has files of its own
            added[place] = {known.get(_contents(name, None), name): given for name, given in each.items()}
    return {**given, "measures": [*own, *(each for each in added if not any(_includes(old, each) for old in there))]}


def _contents(measure: Any, folder: Path | None) -> Any:
    """Return a value that is equal for equal measures, wherever their files lie."""
    with suppress(MeasureError):
        found = find_measure(str(measure), folder)
        return found.name, tuple(found.sources.values())
    return measure


def _includes(measure: Any, other: Any) -> bool:
    """Return whether a measure, as in a file, is the same as another one and has at least its parameters."""
    if not (isinstance(measure, Mapping) and isinstance(other, Mapping)):
        return bool(measure == other)
    return all(name in measure and _includes(measure[name] or {}, given or {}) for name, given in other.items())


def add_axis(given: Mapping[str, Any], keys: Sequence[str], values: Sequence[Any], option: str) -> dict[str, Any]:
    """Return a scenario's keys with one more axis in the grid of its sweep, whose values may be ranges.

    Several keys become rows of the sweep's `points`, with the same value at each point. An axis that is there already
    is replaced.
    """
    sweep = given.get("sweep") or {}
    grid = sweep.get("grid", {}) if isinstance(sweep, Mapping) else None
    if not isinstance(grid, Mapping):
        raise ScenarioError(f"{option}: the scenario's own sweep is {short_yaml(sweep)}; allowed: a mapping")
    own = sweep.get("points") or [{}]
    for name, tied in ("zip", sweep.get("zip")), ("points", own[0] if len(keys) == 1 and isinstance(own, list) else ()):
        if isinstance(tied, Mapping) and (key := next((key for key in keys if key in tied), None)):
            raise ScenarioError(f"{option}: {key} is in {name} of the scenario's own sweep; change it there")
    if len(keys) == 1:
        return {**given, "sweep": {**sweep, "grid": {**grid, keys[0]: values}}}
    with refused_at(option):
        together = [dict.fromkeys(keys, value) for value in with_ranges(keys[0], values)]
    if not (isinstance(own, list | tuple) and all(isinstance(row, Mapping) for row in own)):
        return dict(given)  # which is refused where it is validated
    others = [{key: value for key, value in row.items() if key not in keys} for row in own]
    rows = [{**row, **added} for row in {repr(row): row for row in others}.values() for added in together]
    others_in_grid = {"grid": {key: each for key, each in grid.items() if key not in keys}} if grid else {}
    return {**given, "sweep": {**sweep, **others_in_grid, "points": rows}}


def note_changes(given: Mapping[str, Any], changes: Sequence[str]) -> dict[str, Any]:
    """Return the mapping `given` with its description followed by the changes that may have made it untrue.

    >>> note_changes({"description": "ten robots"}, ["robots.0.count=5", "trials=3", "sweep arena.width_cm=50,60"])
    {'description': 'ten robots; with robots.0.count=5, sweep arena.width_cm=50,60'}
    """
    text = given.get("description")
    changed = [key.partition("=")[0].partition(".")[0] for key in changes]
    notes = [change for change, key in zip(changes, changed, strict=True) if key not in NOT_DESCRIBED]
    if not text or not notes or "description" in changed:
        return dict(given)
    return {**given, "description": f"{text}; with {', '.join(notes)}"}


def reject_swept(settings: Sequence[str], controller: str | Path | None, swept: Sequence[str]) -> None:
    """Raise ScenarioError for a setting, or a controller of all robots, that the points of a sweep override."""
    for axis in swept:
        for setting in settings:
            if f"{setting.partition('=')[0]}.".startswith(f"{axis}."):
                raise ScenarioError(f"--set {setting}: {axis} is an axis of the sweep; use --sweep {axis}=... instead")
        if controller is not None and re.fullmatch(r"robots(\.\d+(\.controller)?)?", axis):
            raise ScenarioError(f"--controller {controller}: {axis} is an axis of the sweep")
