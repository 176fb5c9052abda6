"""Changes to a scenario by dotted key: single values (`--set`) and axes of a sweep (`--sweep`)."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.robot_kind import sensors_of_robot
from epuck_sim.scenario.sensors import given_to_all, without_those_of
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util.messages import short_repr

MAX_PARTS = 20
"""Largest number of parts of a dotted key; those of scenarios have up to six."""


def apply_override(given: Mapping[str, Any], setting: str) -> dict[str, Any]:
    """Return the mapping `given` with one change, `key=value` with a dotted key.

    Raises:
        ScenarioError: The setting is malformed, or its key leads nowhere.
    """
    option = f"--set {setting}"
    key, equals, text = setting.partition("=")
    if not equals or not key:
        raise ScenarioError(f"{option}: give it as key=value, such as stop.max_cycles=100")
    return set_value(given, key, parse_yaml(text, option), option)


def set_value(given: Mapping[str, Any], key: str, value: Any, origin: str) -> dict[str, Any]:
    """Return the mapping `given` with `value` at a dotted key.

    Raises:
        ScenarioError: The key leads nowhere; the message begins with `origin`.
    """
    if key == "robot.kind":
        raise ScenarioError(f"{origin}: another kind of robot has other values in all keys; give robot={value} instead")
    if key == "sensors":  # of all robots
        return {**given, "robots": given_to_all(given.get("robots") or [{}], value), "sensors": None}
    if key == "robot" and "robots" in given:
        given = {**given, "robots": without_those_of(sensors_of_robot(given.get("robot")), given["robots"])}
    parts = key.split(".")
    if len(parts) > MAX_PARTS:
        raise ScenarioError(f"{origin[:60]}...: a key of {len(parts)} parts; allowed: at most {MAX_PARTS}")
    # a scenario has one group of robots by default
    default: dict[str, Any] = {"robots": [{}]} if key.startswith("robots.") else {}
    result = _with({**default, **given}, parts, value, origin)
    assert isinstance(result, dict)  # a mapping changed is a mapping
    return result


def _with(container: Any, parts: list[str], value: Any, origin: str) -> Any:
    """Return `container` with `value` at the path `parts`; missing sections are added."""
    if not parts:
        return value
    first, *rest = parts
    if isinstance(container, list | tuple):
        if first not in map(str, range(len(container))):
            raise ScenarioError(f"{origin}: {first!r} is not an index into a list of {len(container)}, counted from 0")
        index = int(first)
        return [*container[:index], _with(container[index], rest, value, origin), *container[index + 1 :]]
    if container is not None and not isinstance(container, Mapping):
        raise ScenarioError(f"{origin}: {first!r} is inside {short_repr(container)}, which has no keys")
    here = dict(container or {})
    here[first] = _with(here.get(first), rest, value, origin)
    return here


NOT_DESCRIBED = {"name", "description", "trials", "seed", "figure", "measures"}
"""Keys of a scenario that its description says nothing about."""

QUICK = "quick"
"""Key in a scenario's file that holds the keys in which its quick version differs."""


def without_quick(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return a file's scenario in its full version."""
    return {key: value for key, value in given.items() if key != QUICK}


def quick_version(given: Mapping[str, Any], origin: str) -> dict[str, Any]:
    """Return a file's scenario in its quick version.

    Raises:
        ScenarioError: There is no quick version, or it is not a mapping.
    """
    changes = given.get(QUICK)
    if changes is None:
        raise ScenarioError(f"{origin}: has no quick version; leave --quick out")
    if not isinstance(changes, Mapping):
        raise ScenarioError(f"{origin}: {QUICK}: is {short_repr(changes)}; allowed: a mapping of keys to values")
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


def add_measures(given: Mapping[str, Any], names: Sequence[str], origin: str) -> dict[str, Any]:
    """Return the mapping `given` with more measures after those that it has; parameters of any can then be set.

    Raises:
        ScenarioError: The scenario's own measures are no list; the message begins with `origin`.
    """
    own = given.get("measures") or []
    if not isinstance(own, list | tuple):
        raise ScenarioError(f"{origin}: measures: is {short_repr(own)}; allowed: a list")
    return {**given, "measures": [*own, *({name: {}} for name in names)]}


def add_axis(given: Mapping[str, Any], axis: str) -> dict[str, Any]:
    """Return the mapping `given` with one axis, `key=value,value,...`, in the grid of its sweep.

    Raises:
        ScenarioError: The axis is malformed, or the scenario's own sweep is.
    """
    option = f"--sweep {axis}"
    key, values = parse_axis(axis, "--sweep")
    sweep = given.get("sweep") or {}
    grid = sweep.get("grid", {}) if isinstance(sweep, Mapping) else None
    if not isinstance(grid, Mapping):
        raise ScenarioError(f"{option}: the scenario's own sweep is {short_repr(sweep)}; allowed: a mapping")
    return {**given, "sweep": {**sweep, "grid": {**grid, key: values}}}


def parse_axis(axis: str, option: str) -> tuple[str, list[Any]]:
    """Return the dotted key and the values of an axis given as `key=value,value,...`.

    Raises:
        ScenarioError: The axis is malformed; the message begins with the option and the axis.
    """
    key, equals, text = axis.partition("=")
    if not equals or not key:
        raise ScenarioError(f"{option} {axis}: give it as key=value,value,..., such as robots.0.count=5,10,20")
    values: list[Any] = parse_yaml(f"[{text}]", f"{option} {axis}")
    return key, values


def note_changes(given: Mapping[str, Any], settings: Sequence[str], axes: Sequence[str]) -> dict[str, Any]:
    """Return the mapping `given` with its description followed by the changes that may have made it untrue.

    >>> note_changes({"description": "ten robots"}, ["robots.0.count=5", "trials=3"], [])
    {'description': 'ten robots; with robots.0.count=5'}
    """
    text = given.get("description")
    changed = [key.partition("=")[0].partition(".")[0] for key in settings]
    notes = [setting for setting, key in zip(settings, changed, strict=True) if key not in NOT_DESCRIBED]
    notes += [f"sweep {axis}" for axis in axes]
    if not text or not notes or "description" in changed:
        return dict(given)
    return {**given, "description": f"{text}; with {', '.join(notes)}"}


def reject_swept_keys(settings: Sequence[str], axes: SweepAxes | None) -> None:
    """Raise ScenarioError for a setting that every point of the sweep overrides."""
    for setting in settings:
        key = setting.partition("=")[0]
        for axis in axes.keys if axes else ():
            if f"{key}.".startswith(f"{axis}."):
                raise ScenarioError(f"--set {setting}: {axis} is an axis of the sweep; use --sweep {axis}=... instead")


def reject_swept_controllers(controller: str, axes: SweepAxes | None) -> None:
    """Raise ScenarioError for a controller of all robots that the points of the sweep override."""
    for axis in axes.keys if axes else ():
        if axis == "robots" or re.fullmatch(r"robots\.\d+(\.controller)?", axis):
            raise ScenarioError(f"--controller {controller}: {axis} is an axis of the sweep")
