"""Sensors in files of their own that a scenario names, for a group of robots or for all (see `control.sensors`).

They are given as a list of files, `[ground.py, {light.py: {range_cm: 30}}]`, or by names: `{left: {file: eye.py}}`. A
scenario keeps them by names, which are those of their files, so that `robots.0.sensors.ground.noise` is a key.
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from epuck_sim.control.sensors import find_sensor
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.user_files import Value
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

FILE = "file"
"""Key of a sensor's file; others are its parameters."""

_ALLOWED = "allowed: a list of files, such as [ground.py, {light.py: {range_cm: 30}}]"


def by_name(given: Any) -> dict[str, dict[str, Any]]:
    """Return a group's sensors by their names, each with its file and its parameters.

    Raises:
        ValueError: They are given in another way, or two have one name.
    """
    if isinstance(given, Mapping):
        items = [(str(name), {FILE: each} if isinstance(each, str) else each) for name, each in given.items()]
    elif isinstance(given, list | tuple):
        items = [_from_list(each) for each in given]
    else:
        raise ValueError(f"is {short_repr(given)}; {_ALLOWED}")  # noqa: TRY004 pydantic gathers ValueErrors
    named: dict[str, dict[str, Any]] = {}
    for name, sensor in items:
        if not isinstance(sensor, Mapping) or not isinstance(sensor.get(FILE), str):
            raise ValueError(  # noqa: TRY004 pydantic gathers ValueErrors
                f"{name} is {short_repr(sensor)}; allowed: its file and parameters, {{file: {name}.py}}"
            )
        if not name.isidentifier():
            raise ValueError(f"{name!r} is no name for a sensor; allowed: letters, digits and _")
        if name in named:
            raise ValueError(f"{name} is there twice; allowed: each sensor once in a group")
        named[name] = dict(sensor)
    return named


def _from_list(each: Any) -> tuple[str, Any]:
    file, parameters = next(iter(each.items())) if isinstance(each, Mapping) and len(each) == 1 else (each, {})
    if not isinstance(file, str) or not isinstance(parameters, Mapping | None):
        raise ValueError(f"has {short_repr(each)}; {_ALLOWED}")  # noqa: TRY004
    return Path(file).stem, {FILE: file, **(parameters or {})}


def beside(given: Any, folder: Path) -> dict[str, dict[str, Any]]:
    """Return sensors by their names, with the paths of those files that lie in a folder.

    Raises:
        ScenarioError: They are given in another way than a scenario gives them.
    """
    named = _named(given, f"{folder}: sensors")
    for sensor in named.values():
        if (folder / sensor[FILE]).is_file():
            sensor[FILE] = str(folder / sensor[FILE])
    return named


def spread(given: Mapping[str, Any], of_robots: Sequence[Any], origin: str) -> dict[str, Any]:
    """Return a scenario's keys with the sensors of all robots in each group, and with names for those of each.

    Args:
        given: The keys; `sensors` stands for all groups that have no sensors of their own.
        of_robots: Sensors that come with each group's robots; those that are given take their place.
        origin: Begins every message.

    Raises:
        ScenarioError: They are given in another way, or for all robots where each group has its own.
    """
    others, groups = {key: value for key, value in given.items() if key != "sensors"}, given.get("robots") or [{}]
    for_all = given.get("sensors")
    if not are_groups(groups):
        return others
    has_own = ["sensors" in group for group in groups]
    if for_all is not None and all(has_own):
        raise ScenarioError(f"{origin}: sensors: each group of robots has sensors of its own; leave sensors out")
    if not for_all and not any(of_robots) and not any(has_own):
        return others
    named = [
        {**group, "sensors": _named(group["sensors"] or {}, f"{origin}: robots.{number}.sensors")}
        if "sensors" in group
        else {**group, "sensors": _named(of_robot if for_all is None else for_all, f"{origin}: sensors")}
        for number, (group, of_robot) in enumerate(zip(groups, of_robots, strict=True))
    ]
    return {**others, "robots": named}


def _named(given: Any, where: str) -> dict[str, dict[str, Any]]:
    """Do what `by_name` does; raise ScenarioError, with where they are given."""
    try:
        return by_name(given)
    except ValueError as error:
        raise ScenarioError(f"{where}: {error}") from error


def are_groups(given: Any) -> bool:
    """Return whether what is given as `robots` is a list of sections; else it is refused when it is validated."""
    return isinstance(given, list | tuple) and all(isinstance(group, Mapping) for group in given)


def given_to_all(groups: Any, sensors: Any) -> Any:
    """Return groups of robots which all have these sensors, and none of their own."""
    if not are_groups(groups):
        return groups
    return [{**group, "sensors": sensors} for group in groups]


def check_readings(groups: Sequence[Mapping[str, Mapping[str, Any]]], origin: str) -> None:
    """Raise ScenarioError if sensors of two groups tell readings of one name and of different shapes."""
    shapes: dict[str, tuple[int, tuple[int, ...]]] = {}
    for number, sensors in enumerate(groups):
        for name, given in sensors.items():
            readings = find_sensor(given[FILE]).readings
            for reading in readings.names or ():
                first, shape = shapes.setdefault(reading, (number, readings[reading].shape))
                if shape != readings[reading].shape:
                    raise ScenarioError(
                        f"{origin}: robots.{number}.sensors.{name}: tells {reading!r} with the shape "
                        f"{readings[reading].shape}, and robots.{first} with {shape}; rename one of them"
                    )


def sensor_parameters(
    sensors: Mapping[str, Mapping[str, Any]], name: str, values: Mapping[str, Any], origin: str
) -> dict[str, Value]:
    """Return all parameters of one of a group's sensors, some of which have new values.

    Raises:
        ScenarioError: There is no such sensor, or it does not take these values.
    """
    if name not in sensors:
        raise ScenarioError(
            f"{origin}: {did_you_mean(name, sensors)}; sensors in files of their own: {comma_list(sensors)}"
        )
    given = {key: value for key, value in sensors[name].items() if key != FILE}
    try:
        return find_sensor(sensors[name][FILE]).resolve({**given, **values})
    except ValueError as error:
        raise ScenarioError(f"{origin}.{name}: {error}") from error


def resolve_sensors(
    sensors: Mapping[str, Mapping[str, Any]], origin: str, folder: Path | None
) -> tuple[dict[str, dict[str, Any]], tuple[str, ...]]:
    """Return sensors with their files' paths and with all parameters, and the names of their readings.

    Raises:
        ScenarioError: There is no such sensor, it does not take these parameters, or two have a reading of one name.
    """
    resolved: dict[str, dict[str, Any]] = {}
    told: dict[str, str] = {}
    for name, given in sensors.items():
        where = f"{origin}.sensors.{name}"
        try:
            sensor = find_sensor(given[FILE], folder)
            parameters = sensor.resolve({key: value for key, value in given.items() if key != FILE})
        except (ControllerError, ValueError) as error:
            raise ScenarioError(f"{where}: {error}") from error
        for reading in sensor.readings.names or ():
            if reading in told:
                raise ScenarioError(
                    f"{where}: tells {reading!r}, and {told[reading]} does, too; rename it in READINGS of one of them"
                )
            told[reading] = name
        resolved[name] = {FILE: sensor.stored_name, **parameters}
    return resolved, tuple(told)
