"""Kinds of robots, of a scenario or of one of its groups: body, wheels and sensors; robots in files.

Sensors in files of their own (docs/sensors.md) are given as a list of files, `[ground.py, {light.py: {range_cm:
30}}]`, or by names: `{left: {file: eye.py}}`. A scenario keeps them by names, which are those of their files, so that
`robots.0.sensors.ground.noise` is a key.
"""

import math
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, ValidationError, model_validator

from epuck_sim import epuck
from epuck_sim.control.interface import SENSORS, Sensor, Wheels
from epuck_sim.control.loader import find_sensor
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.base import ConfigModel, Length, Mount, Number, Positive, check_range, problems_in, refused_at
from epuck_sim.user_files import Kind, Place, Value, kept
from epuck_sim.util.builtin import ROBOTS, builtin_files
from epuck_sim.util.messages import comma_list, did_you_mean, short_yaml
from epuck_sim.util.yaml_io import line_of_key, read_yaml

FILE = "file"  # key of a sensor's file; others are its parameters

_ALLOWED = "allowed: a list of files, such as [ground.py, {light.py: {range_cm: 30}}]"


def sensors_by_name(given: Any) -> dict[str, dict[str, Any]]:
    """Return a group's sensors by their names, each with its file and its parameters."""
    if not isinstance(given, Mapping | list | tuple):
        raise ValueError(f"is {short_yaml(given)}; {_ALLOWED}")  # noqa: TRY004 pydantic gathers ValueErrors
    named: dict[str, dict[str, Any]] = {}
    for each in given.items() if isinstance(given, Mapping) else given:
        name, sensor = each if isinstance(given, Mapping) else _from_list(each)
        sensor = {FILE: sensor} if isinstance(sensor, str) else sensor
        if not isinstance(sensor, Mapping) or not isinstance(sensor.get(FILE), str):
            allowed = f"its file and parameters, {{file: {Path(str(name)).stem}.py}}"
            raise ValueError(f"{name} is {short_yaml(sensor)}; allowed: {allowed}")  # noqa: TRY004
        if not str(name).isidentifier():
            raise ValueError(f"{name!r} is no name for a sensor; allowed: letters, digits and _")
        if name in named:
            raise ValueError(f"{name} is given twice; allowed: each sensor once in a group")
        named[name] = dict(sensor)
    return named


def _from_list(each: Any) -> tuple[str, Any]:
    file, parameters = next(iter(each.items())) if isinstance(each, Mapping) and len(each) == 1 else (each, {})
    if not isinstance(file, str) or not isinstance(parameters, Mapping | None):
        raise ValueError(f"has {short_yaml(each)}; {_ALLOWED}")  # noqa: TRY004
    return Path(file).stem, {FILE: file, **(parameters or {})}


def are_groups(given: Any) -> bool:
    """Return whether the value of `robots` is a list of sections; any other value is refused at validation."""
    return isinstance(given, list | tuple) and all(isinstance(group, Mapping) for group in given)


def check_readings(groups: Sequence[Mapping[str, Mapping[str, Any]]], origin: str) -> None:
    """Raise ScenarioError if a reading's name is used twice in a group, or with different shapes in two groups."""
    shapes: dict[str, tuple[int, tuple[int, ...]]] = {}
    for number, sensors in enumerate(groups):
        told: dict[str, str] = {}
        for name, given in sensors.items():
            where, readings = f"{origin}: robots.{number}.sensors.{name}", find_sensor(given[FILE]).readings
            for reading in readings.names or ():
                other, shape = told.setdefault(reading, name), readings[reading].shape
                if other != name:
                    raise ScenarioError(f"{where}: reading {reading!r} is in {other}, too; rename it in one of them")
                first, expected = shapes.setdefault(reading, (number, shape))
                if shape != expected:
                    said = f"reading {reading!r} has the shape {shape}, but in robots.{first} {expected}"
                    raise ScenarioError(f"{where}: {said}; rename one of them")


def sensor_parameters(
    sensors: Mapping[str, Mapping[str, Any]], name: str, values: Mapping[str, Any], origin: str
) -> dict[str, Value]:
    """Return all parameters of one of a group's sensors, with new values for some."""
    if name not in sensors:
        known = comma_list(sensors)
        raise ScenarioError(f"{origin}: {did_you_mean(name, sensors)}; sensors in files of their own: {known}")
    return resolve_sensor({**sensors[name], **values}, f"{origin}.{name}")[1]


def resolve_sensor(
    given: Mapping[str, Any], origin: str, folder: Path | None = None
) -> tuple[Sensor, dict[str, Value]]:
    """Return the sensor that a section names, and all its parameters."""
    with refused_at(origin):
        sensor = find_sensor(given[FILE], folder)
        return sensor, sensor.resolve({key: value for key, value in given.items() if key != FILE})


ROUNDING_CM = 1e-9  # distance by which a sensor may lie beyond the body's edge

ROBOT = Kind(
    noun="robot",
    error=ScenarioError,
    suffixes=(".yaml",),
    group="epuck_sim.robots",
    shipped=partial(builtin_files, ROBOTS),
)
"""How robots are found."""


class RobotFile(NamedTuple):
    """A robot as its file describes it."""

    name: str  # name by which it is found again
    keys: dict[str, Any]  # values of the keys of a `RobotKind`
    sensors: Mapping[str, Any]  # its sensors in files of their own, as a scenario gives them
    sources: Mapping[Path, bytes]  # contents of the file, at the time of loading


def find_robot(name: str, folder: Path | None = None) -> RobotFile:
    """Return a robot: a shipped one, an installed package's, or the one in a file."""
    return _load(ROBOT.locate(name, folder))


@kept
def _load(place: Place) -> RobotFile:
    assert place.path is not None  # each has a file
    given = read_yaml(place.path)
    if not isinstance(given, Mapping):
        raise ScenarioError(f"{place.path}: is {short_yaml(given)}; a robot is a mapping of keys to values")
    if "kind" in given:
        raise ScenarioError(f"{place.path}: kind: a robot's file has no such key; keys it leaves out are the e-puck's")
    keys = {key: value for key, value in given.items() if key not in ("description", "sensors")}
    try:
        RobotKind.model_validate(keys)
    except ValidationError as error:
        problems = ((key, said.replace("allowed: kind, ", "allowed: ")) for key, said in problems_in(RobotKind, error))
        said = (f"{place.path}:{line_of_key(place.path, key)}: {said}" for key, said in problems)
        raise ScenarioError("\n".join(said)) from error
    folder = place.path.parent
    with refused_at(f"{folder}: sensors"):
        sensors = sensors_by_name(given.get("sensors") or [])
    for sensor in sensors.values():
        if (folder / sensor[FILE]).is_file():
            sensor[FILE] = str(folder / sensor[FILE])
    return RobotFile(place.name, keys, sensors, {place.path: place.path.read_bytes()})


def with_robots(given: Mapping[str, Any], origin: str, folder: Path | None) -> dict[str, Any]:
    """Return a scenario's keys with the paths of its robots' files, and with sensors by name in each group.

    A group's sensors are its own; or else those given for all groups, by `sensors`; or else those of its robots.
    """
    if given.get("model", "embodied") != "embodied":
        return dict(given)
    robot, of_robot = _with_file(given.get("robot"), f"{origin}: robot.kind", folder)
    found = {**given, "robot": robot} if "robot" in given else dict(given)
    for_all, groups = found.pop("sensors", None), given.get("robots", [{}])
    if not are_groups(groups):
        return found
    if for_all is not None and all("sensors" in group for group in groups):
        raise ScenarioError(f"{origin}: sensors: each group of robots has sensors of its own; leave sensors out")
    found["robots"] = []
    for number, group in enumerate(groups):
        kind, brought = _with_file(group.get("kind"), f"{origin}: robots.{number}.kind", folder)
        where, sensors = f"{origin}: sensors", of_robot if kind is None else brought
        if "sensors" in group:
            where, sensors = f"{origin}: robots.{number}.sensors", group["sensors"] or {}
        elif for_all is not None:
            sensors = for_all
        with refused_at(where):
            named = sensors_by_name(sensors)
        found["robots"].append({**group, **({} if kind is None else {"kind": kind}), "sensors": named})
    return found


def _with_file(robot: Any, where: str, folder: Path | None) -> tuple[Any, Mapping[str, Any]]:
    """Return a section `robot` with the path of its file, and the sensors that the file brings."""
    section = as_section(robot)
    if not _needs_file(section):
        return section, {}
    with refused_at(where):
        found = find_robot(section["kind"], folder)
    return {**section, "kind": found.name}, found.sensors


def without_brought_sensors(given: Mapping[str, Any], key: str) -> Mapping[str, Any]:
    """Return a scenario's keys without the sensors that came with the robot at `key`: a new robot brings its own."""
    groups, of_group = given.get("robots"), re.fullmatch(r"robots\.(\d+)\.kind", key)
    if not are_groups(groups) or not (key == "robot" or of_group):
        return given
    found = [dict(group) for group in groups or ()]
    for number, group in enumerate(found):
        sensors, own = group.get("sensors"), group.get("kind")
        if isinstance(sensors, Mapping) and (number == int(of_group[1]) if of_group else own is None):
            robot = as_section(given.get("robot") if own is None else own)
            brought = set[str]()
            with suppress(ScenarioError):
                if isinstance(robot, Mapping) and "kind" in robot:
                    brought = {*find_robot(str(robot["kind"])).sensors}
            if sensors.keys() in (set(), brought):
                del group["sensors"]
    return {**given, "robots": found}


def as_section(robot: Any) -> Any:
    """Return a section `robot`, also if only a name is given."""
    return {"kind": robot} if isinstance(robot, str) else robot


def _needs_file(section: Any) -> bool:
    """Return whether a section `robot` needs the file of its robot: not if it has all keys, as in stored scenarios."""
    named = isinstance(section, Mapping) and isinstance(section.get("kind"), str)
    return named and not RobotKind.model_fields.keys() - set(RobotKind.later_keys) <= section.keys()


class ProximitySection(ConfigModel):
    """The infrared proximity sensors of a robot, `null` for one without any; what is left out is the e-puck's."""

    sensors: Annotated[tuple[Mount, ...], Field(min_length=1, max_length=SENSORS)] = epuck.INFRARED_SENSORS
    """`x_cm, y_cm, direction_deg` of each: x ahead and y left of the axle's centre, directions counter-clockwise."""
    spread_deg: Annotated[Number, Field(gt=0, le=80)] = epuck.INFRARED_SPREAD_DEG
    """Angle between a sensor's centre ray and each of its two side rays."""
    range_cm: Annotated[Length, Field(le=100)] = epuck.INFRARED_RANGE_CM
    """Range of a ray."""
    peak_counts: Positive = epuck.INFRARED_PEAK_COUNTS
    """Largest reading: m of the response m (c - x0^2) / (x^2 - 2 x0 x + c) to a surface at a distance of x cm."""
    peak_cm: Annotated[Number, Field(ge=0, le=100)] = epuck.INFRARED_PEAK_CM
    """Distance of the largest reading, x0; nearer surfaces read as much."""
    width_cm2: Positive = epuck.INFRARED_WIDTH_CM2
    """Width of the peak, c; above x0^2."""

    def _check_together(self) -> None:
        if self.width_cm2 <= self.peak_cm**2:
            raise ValueError(f"width_cm2 is {self.width_cm2:g}; allowed: above peak_cm squared, {self.peak_cm**2:g}")
        if self.peak_cm >= self.range_cm:
            raise ValueError(f"peak_cm is {self.peak_cm:g}; allowed: below range_cm, {self.range_cm:g}")


class CameraMount(ConfigModel):
    """Where a robot's camera is, `null` for one without any; the view is set in each group of robots."""

    forward_cm: Annotated[Number, Field(ge=0)] | None = None
    """Distance ahead of the axle's centre; by default at the front of the body, where the e-puck's is."""


class RobotKind(ConfigModel):
    """Kind of all robots of the scenario: one in a file, or one that differs from it in some keys."""

    kind: str = "epuck"
    """A shipped robot, an installed package's, or a file (.yaml), whose values the other keys have by default."""
    radius_cm: Annotated[Number, Field(ge=0.5, le=50)] = epuck.RADIUS_CM
    """Radius of the body, a disc around the axle's centre."""
    height_cm: Length = epuck.HEIGHT_CM
    """Height of the body; only films depend on it."""
    mass_g: Positive = epuck.MASS_G
    """Mass; among robots of one mass it matters only where there are `arena.movables`."""
    wheel_base_cm: Length = epuck.WHEEL_BASE_CM
    """Distance between the wheels."""
    wheel_limit_cm_s: Positive = epuck.WHEEL_LIMIT_CM_S
    """Largest speed of a wheel, forwards or backwards; commands are limited to it."""
    ring_radius_cm: Length = epuck.RING_RADIUS_CM
    """Radius of the ring of LEDs; only films depend on it."""
    ring_height_cm: Length = epuck.RING_HEIGHT_CM
    """Height of the ring above the floor; only films depend on it."""
    infrared: ProximitySection | None = ProximitySection.model_construct()
    camera: CameraMount | None = CameraMount.model_construct()

    @model_validator(mode="before")
    @classmethod
    def _start_from_kind(cls, given: Any) -> Any:
        section = as_section(given)
        is_section = isinstance(section, Mapping | ConfigModel)
        if not is_section:
            raise ValueError("a robot's name, such as kilobot, or a mapping of keys to values")
        return {**find_robot(section["kind"]).keys, **section} if _needs_file(section) else section

    def _check_together(self) -> None:
        check_range("wheel_base_cm", self.wheel_base_cm, 0, 2 * self.radius_cm, ", the body's diameter")
        if self.camera is not None:
            check_range("camera.forward_cm", self.camera_forward_cm, 0, self.radius_cm, ", the body's radius")
        for number, (x, y, _) in enumerate(self.infrared.sensors if self.infrared else ()):
            why = " cm from the axle's centre, the body's radius; give infrared: null for a robot without such sensors"
            check_range(f"infrared.sensors.{number}", math.hypot(x, y), 0, self.radius_cm + ROUNDING_CM, why)

    @property
    def wheels(self) -> Wheels:
        """Constants of the wheels for controllers."""
        return Wheels(limit_cm_s=float(self.wheel_limit_cm_s), base_cm=float(self.wheel_base_cm))

    @property
    def camera_forward_cm(self) -> float:
        """Distance of the camera ahead of the axle's centre, cm; at the front of the body if there is no camera."""
        forward = self.camera.forward_cm if self.camera else None
        return float(self.radius_cm if forward is None else forward)

    @property
    def ray_reach_cm(self) -> float:
        """Largest distance of the end of an infrared ray from the axle's centre, cm; 0 without such sensors."""
        if self.infrared is None:
            return 0.0
        positions = np.array(self.infrared.sensors)[:, :2]
        return float(np.sqrt((positions**2).sum(axis=1)).max()) + self.infrared.range_cm


def cell_cm(kinds: Sequence[RobotKind]) -> float:
    """Return the least side of a cell, cm: robots that sense or touch a robot are in its cell or in one around it."""
    largest_cm = max(kind.radius_cm for kind in kinds)
    return max(3 * largest_cm, *(kind.ray_reach_cm for kind in kinds)) + largest_cm


EPUCK = RobotKind.model_construct()
