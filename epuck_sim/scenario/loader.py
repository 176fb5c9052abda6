"""Scenarios from YAML files: find the file, apply changes, validate, resolve, and write the scenario again.

Also the points of a sweep, each a scenario of its own, with the seed of each trial. A point is identified by its axis
values, not by its number: adding points or trials does not change the seeds of the others.
"""

import re
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import numpy as np

from epuck_sim.control.loader import CONTROLLER, find_controller, find_sensor
from epuck_sim.errors import ScenarioError
from epuck_sim.measures.measure import find_measure
from epuck_sim.scenario import keys
from epuck_sim.scenario.arena import find_picture
from epuck_sim.scenario.axes import SweepAxes, canonical_text
from epuck_sim.scenario.base import refused_at, section_classes, whole_key_of
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario, StartSection, find_curve
from epuck_sim.scenario.robot_kind import ROBOT, are_groups, with_robots
from epuck_sim.scenario.robots import replace_controllers, share_parameters
from epuck_sim.scenario.scenario import AnyScenario, Scenario, ScenarioLike, require_model
from epuck_sim.user_files import Kind
from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files
from epuck_sim.util.messages import cut, short_yaml, shortest_endings, storable
from epuck_sim.util.seeds import point_seed
from epuck_sim.util.yaml_io import read_yaml, write_yaml

SCENARIO_TYPES: dict[str, type[Scenario]] = {"embodied": EmbodiedScenario, "particles": ParticleScenario}
"""Class of a scenario by the name that its key `model` gives."""


def validate(given: Mapping[str, Any], origin: str) -> Scenario:
    """Return the scenario, of the class that its key `model` names; each line of a refusal begins with `origin`."""
    if r"\ud" in repr(given):  # as surrogates are written; a hundred times as fast as a look at each text
        _reject_surrogates(given, origin)
    model = given.get("model", "embodied")
    if not isinstance(model, str) or model not in SCENARIO_TYPES:
        allowed = " or ".join(map(repr, SCENARIO_TYPES))
        raise ScenarioError(f"{origin}: model: is {short_yaml(model)}; allowed: {allowed}")
    return SCENARIO_TYPES[model].validated(given, origin)


def _reject_surrogates(value: Any, origin: str, *path: str) -> None:
    """Raise ScenarioError for a text that is not Unicode, which no file and no database would take."""
    parts = value.items() if isinstance(value, Mapping) else enumerate(value) if isinstance(value, list | tuple) else ()
    for key, part in parts:
        _reject_surrogates(key, origin, *path)
        _reject_surrogates(part, origin, *path, str(key))
    if isinstance(value, str) and storable(value) != value:
        where = storable(": ".join([origin, *([".".join(path)] if path else [])]))
        raise ScenarioError(f"{where}: is {short_yaml(value)}; allowed: text in Unicode")


SCENARIO = Kind(
    noun="scenario",
    error=ScenarioError,
    suffixes=(".yaml", ".yml"),
    group="epuck_sim.scenarios",
    shipped=lambda: {**builtin_files(ARENAS), **builtin_files(SWEEPS)},
    form="a .yaml file, or a run folder",
)
"""How scenarios are found."""

MOST_ECHOED = 200  # most characters of an option that messages repeat
RUN_SCENARIO = "scenario.yaml"  # name of the file in a run folder that holds its scenario

if TYPE_CHECKING:
    from typing_extensions import TypeVar  # with a default, which `typing` has from Python 3.13 on

    Loaded = TypeVar("Loaded", bound=Scenario, default=EmbodiedScenario | ParticleScenario)
else:
    Loaded = AnyScenario


def load_scenario(
    source: Loaded | str | Path | Mapping[str, Any],
    settings: Sequence[str] = (),
    axes: Sequence[str] = (),
    *,
    measures: Sequence[str | Path] = (),
    controller: str | Path | None = None,
    quick: bool = False,
) -> Loaded:
    """Return a validated scenario with every default filled in.

    Args:
        source: A shipped scenario's name, a YAML file, a run folder, a mapping with a scenario's keys, or a Scenario.
        settings: Changes as `key=value`; later ones win. A key is dotted, `robots.0.parameters.speed_cm_s=1`, or the
            ending of one, `speed_cm_s=1`; one that is the same in several groups of robots stands for all of them.
        axes: Axes for the grid of the scenario's sweep as `key=value,value,...`, or `key=FROM:TO:NUMBER`.
        measures: Names or files of measures, added to the scenario's own; see `measures.measure.find_measure`.
        controller: A shipped controller, or a file, relative to the working directory, that runs on all robots instead
            of the scenario's own. Their parameters and memory are kept where it has them; a warning names the others.
        quick: Take the quick version, which the file has under `quick`.

    Returns:
        An `EmbodiedScenario` or a `ParticleScenario`, as its key `model` says; a Scenario keeps its class.

    Raises:
        ScenarioError: The message names the file, the key, the value and what is allowed.

    Warns:
        UserWarning: An ending stands for keys of several groups, or `controller` lacks parameters of those it replaces.

    >>> scenario = load_scenario("thesis", ["width_cm=100"])
    >>> scenario
    EmbodiedScenario(name='thesis', model='embodied', population=10)
    >>> scenario.arena.width_cm
    100.0
    """
    if isinstance(source, Scenario) and not any((settings, axes, measures, controller, quick)):
        own, known = vars(source), type(source).model_fields
        if own.keys() - known or any(isinstance(each, dict | list) for each in own.values()):
            source = source.validated(own, source.name)  # `model_copy` takes whatever it is given
        return complete(source, source.name)
    for name, texts, kind in (("settings", settings, str), ("axes", axes, str), ("measures", measures, str | Path)):
        if isinstance(texts, str | Path | Mapping) or not all(isinstance(each, kind) for each in texts):
            raise ScenarioError(f"{name} is {texts!r}; allowed: a list of such texts")
    given, origin, folder = read_keys(source)
    given = _choose_version(given, origin, folder, quick=quick)
    if controller is not None:
        given = keys.note_changes(replace_controllers(given, str(controller), origin), [f"controller={controller}"])
    if measures:
        given = keys.add_measures(given, list(map(str, measures)), origin, folder)
    parsed = [keys.parse_axis(axis, "--sweep") for axis in axes]
    changed: list[str] = []
    for setting in settings:
        option = f"--set {setting}"
        typed, value = keys.parse_setting(setting)
        for key in _full_keys(given, typed, value, option, origin, folder, parsed):
            if re.match(r"robots\.\d+\.sensors\.", key):  # a key in a sensor, and sensors may be given as a list
                given = with_robots(given, origin, folder)
            given = keys.set_value(given, key, value, option, folder)
            changed.append(f"{key}={setting.partition('=')[2]}")
    _reject_endings(given, origin, folder)
    swept: list[str] = []
    for axis, (typed, values) in zip(axes, parsed, strict=True):
        found = _full_keys(given, typed, values, f"--sweep {axis}", origin, folder)
        given = keys.add_axis(given, found, values, f"--sweep {axis}")
        swept.extend(f"sweep {key}={axis.partition('=')[2]}" for key in found)
    typed_at = {"--measure": measures, "--set": settings, "--sweep": axes}
    options = [f"{option} {each}" for option, several in typed_at.items() for each in several]
    origin = " ".join([origin, *(cut(option, MOST_ECHOED) for option in options)])
    given = keys.note_changes(given, [*changed, *swept])
    scenario = from_keys(given, origin, folder)
    keys.reject_swept(changed, controller, scenario.swept)
    return cast("Loaded", scenario)  # a Scenario keeps its class


def from_keys(given: Mapping[str, Any], origin: str, folder: Path | None = None) -> Scenario:
    """Return the scenario with these keys, with all that lies in other files filled in; see `load_scenario`."""
    return complete(validate(with_robots(given, origin, folder), origin), origin, folder)


def complete(scenario: AnyScenario, origin: str, folder: Path | None = None) -> AnyScenario:
    """Return a scenario with all that lies in other files filled in; values that its schedule sets are checked."""
    if scenario.sweep is not None:

        def find(key: str, name: str) -> str:
            found = _finder(key)
            assert found is not None  # a key that names files
            with refused_at(f"{origin}: sweep: {key}"):
                return found(name, folder)

        sweep = scenario.sweep.with_values(lambda key, value: _map_files(key, value, find))
        scenario = scenario.model_copy(update={"sweep": sweep})
    found = scenario.resolved(origin, folder)
    if isinstance(found, ParticleScenario) and found.start.like is not None:
        return found.model_copy(update={"start": resolve_like(found, f"{origin}: start.like", folder)})
    return found


def find_like(name: str, folder: Path | None) -> str:
    """Return a shipped scenario's name as it is, or the path of a user's file, which may be in a folder."""
    if folder is not None and (folder / name).is_file():
        return str((folder / name).resolve())
    return str(find_scenario(name).resolve()) if Path(name).suffix else name


FILE_FINDERS: Mapping[str, Callable[[str, Path | None], str]] = {
    r"robots\.\d+\.controller": lambda name, folder: find_controller(name, folder).stored_name,
    r"(robots\.\d+\.)?sensors\.\w+(\.file)?": lambda name, folder: find_sensor(name, folder).stored_name,
    r"(robot|robots\.\d+\.kind)(\.kind)?": lambda name, folder: ROBOT.locate(name, folder).name,
    r"response\.curve": lambda name, folder: find_curve(name, folder).stored_name,
    r"measures\.\d+": lambda name, folder: find_measure(name, folder).stored_name,
    r"arena\.floor\.picture": find_picture,
    r"start\.like": find_like,
}
"""Functions that find the file named by a value on an axis, by patterns of keys; each returns the name to store."""


def _finder(key: str) -> Callable[[str, Path | None], str] | None:
    return next((find for pattern, find in FILE_FINDERS.items() if re.fullmatch(pattern, key)), None)


def _map_files(key: str, value: Any, change: Callable[[str, str], str]) -> Any:
    """Return the value of an axis with each name of a file in it, at any depth, replaced by `change(key, name)`."""
    names_files = _finder(key) is not None
    if names_files and isinstance(value, str):
        return change(key, value)
    if names_files and isinstance(value, Mapping) and re.search(r"(sensors|measures)\.\d+$", key):  # with parameters
        return {change(key, str(name)): each for name, each in value.items()}
    if isinstance(value, Mapping):
        return {name: _map_files(f"{key}.{name}", each, change) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return [_map_files(f"{key}.{number}", each, change) for number, each in enumerate(value)]
    return value


def with_values(scenario: AnyScenario, values: Mapping[str, Any], origin: str) -> AnyScenario:
    """Return a scenario with new values of dotted keys, and with a note of them in its description."""
    given = keys.set_values(scenario.model_dump(mode="json"), values, origin)
    changed = from_keys(keys.note_changes(given, [f"{key}={value}" for key, value in values.items()]), origin)
    assert isinstance(changed, type(scenario)), "model is no key of these"
    return changed


def _full_keys(
    given: Mapping[str, Any],
    typed: str,
    value: Any,
    where: str,
    origin: str,
    folder: Path | None,
    axes: Sequence[tuple[str, Sequence[Any]]] = (),
) -> list[str]:
    """Return the keys that a typed key stands for in a scenario with further axes, or itself; see `keys.full_keys`."""
    model = given.get("model", "embodied")
    kind = SCENARIO_TYPES.get(model) if isinstance(model, str) else None
    if typed == "sensors" and are_groups(groups := given.get("robots") or ()) and len(groups) > 1:
        warnings.warn(f"{where}: sensors stands for those of all {len(groups)} groups of robots", stacklevel=3)
    if kind is None or typed == "sensors":
        return [typed]
    field = kind.model_fields.get(typed.partition(".")[0])
    several = value if isinstance(value, list | tuple) else [value]
    is_number = any(isinstance(each, int | float) and not isinstance(each, bool) for each in several)
    # a section takes no numbers: a parameter that is named like it is meant
    if field and not (is_number and typed in kind.model_fields and section_classes(field.annotation)):
        return [typed]
    at_points = _with_controllers(given, [*_dotted(given.get("sweep"), *SweepAxes.model_fields), *axes])
    known = dict.fromkeys(key for each in at_points for key in kind.all_keys(with_robots(each, origin, folder), folder))
    meant = [key for key in known if not field or re.search(r"\.(parameters|sensors)\.", key)]
    found = keys.full_keys(typed, meant, where)
    found = found or keys.full_keys(typed, keys.keys_of_measures(given, typed, folder), where)
    if (len(found) > 1 or (found and field)) and where.startswith("--"):  # a file is refused
        warnings.warn(f"{where}: {typed} stands for {' and '.join(found)}", stacklevel=3)
    if found:
        return found
    if typed.startswith("sensors."):
        return [f"robots.0.{typed}"]  # it is refused there, with the names of the group's sensors
    from_keys(given, origin, folder)  # a missing file hides its parameters, and is refused first
    return [typed]


def _with_controllers(given: Mapping[str, Any], axes: Iterable[tuple[Any, Any]]) -> Iterator[Mapping[str, Any]]:
    yield given
    groups = given.get("robots") or [{}]
    known = [f"robots.{number}.controller" for number in range(len(groups))] if are_groups(groups) else []
    for typed, values in axes:
        for key in keys.full_keys(str(typed), known, str(typed)):
            several = values if isinstance(values, list | tuple) else [values]
            yield from (keys.set_value(given, key, value, key) for value in several)


def _reject_endings(given: Mapping[str, Any], origin: str, folder: Path | None) -> None:
    """Raise ScenarioError for a dotted key in a file that is the ending of one: endings are for typing only."""
    for section, *parts in ("sweep", *SweepAxes.model_fields), ("schedule", "set"):
        for key, value in _dotted(given.get(section), *parts):
            found = _full_keys(given, str(key), value, f"{origin}: {section}", origin, folder)
            if found != [str(key)]:
                raise ScenarioError(f"{origin}: {section}: {whole_key_of(key, found)}")


def _dotted(value: Any, *parts: str) -> Iterator[tuple[Any, Any]]:
    """Yield keys and values of a mapping, or in parts of it, or of each in a list; what is invalid is refused later."""
    if isinstance(value, list | tuple):
        for each in value:
            yield from _dotted(each, *parts)
    elif isinstance(value, Mapping):
        yield from (pair for part in parts for pair in _dotted(value.get(part))) if parts else value.items()


def read_keys(source: ScenarioLike) -> tuple[dict[str, Any], str, Path | None]:
    """Return the keys of a scenario, the origin for messages about it, and the folder of its file."""
    if isinstance(source, Scenario):
        return source.model_dump(mode="json"), source.name, None
    if isinstance(source, Mapping):
        return _plain(source), "scenario", None
    path = find_scenario(str(source))
    given = read_yaml(path)
    if not isinstance(given, dict):
        said = "empty" if given is None else short_yaml(given)
        raise ScenarioError(f"{path}: is {said}; a scenario is a mapping of keys to values")
    place = SCENARIO.at(path)
    return {"name": path.stem, **given}, place.name if place.package else str(path), path.parent


def _plain(value: Any) -> Any:
    """Return a value as a file would have it: numpy's numbers become plain numbers, and paths become text."""
    if isinstance(value, Mapping):
        return {key: _plain(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return list(map(_plain, value))
    if isinstance(value, np.generic | np.ndarray):
        return value.tolist()
    return str(value) if isinstance(value, Path) else value


def _choose_version(given: Mapping[str, Any], origin: str, folder: Path | None, *, quick: bool) -> dict[str, Any]:
    if quick:
        return keys.quick_version(given, origin)
    if given.get(keys.QUICK) is not None:
        other, where = keys.quick_version(given, origin), f"{origin}: {keys.QUICK}"
        _reject_endings(other, where, folder)
        validate(with_robots(other, where, folder), where)
    return keys.without_quick(given)


def find_scenario(name: str) -> Path:
    """Return the file of a scenario: a shipped one, a file, that of a run folder, or an installed package's."""
    shipped, path = SCENARIO.shipped(), Path(name)
    try:
        if name in shipped or not path.exists():
            stem = path.stem
            if name.endswith(SCENARIO.suffixes):
                named = f"; the shipped one is called {stem!r}" if stem in shipped else ""
                raise ScenarioError(f"{name}: there is no such file{named}")
            found = SCENARIO.named(name).path
            assert found is not None  # scenarios are files
            return found
        if path.suffix in CONTROLLER.suffixes:
            raise ScenarioError(f"{name}: is code, no scenario; of a controller: run thesis --controller {name}")
        for file in (path, path / RUN_SCENARIO):
            if file.is_file():
                return file
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read: {error.strerror}") from error
    raise ScenarioError(f"{name}: is neither a regular file nor a run folder with a {RUN_SCENARIO}")


def write_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML with every key; read again, it is the same scenario."""
    return write_yaml(scenario.model_dump(mode="json"))


def load_of_model(scenario: ScenarioLike, kind: type[AnyScenario], why: str = "") -> AnyScenario:
    """Return a scenario, or what `load_scenario` takes, which must be of class `kind`."""
    return require_model(load_scenario(scenario), kind, why)


def robots_like(name: str, origin: str) -> EmbodiedScenario:
    """Return the scenario of robots with this name or file, without its sweep."""
    with refused_at(origin):
        scenario = require_model(load_scenario(name), EmbodiedScenario, "allowed: embodied", name)
    return scenario.model_copy(update={"sweep": None})


def resolve_like(scenario: ParticleScenario, origin: str, folder: Path | None) -> StartSection:
    """Return the start of agents with the path of its scenario of robots, if that is a user's."""
    assert scenario.start.like is not None
    with refused_at(origin):
        like = find_like(scenario.start.like, folder)
    robots = robots_like(like, origin)
    width_cm, height_cm = robots.arena.width_cm, robots.arena.height_cm
    checks = {
        "agents.count": (scenario.agents.count, robots.population),
        "space.dimensions": (scenario.space.dimensions, 2),
        "space.side_cm": (scenario.space.side_cm, width_cm if width_cm == height_cm else (width_cm, height_cm)),
    }
    for key, (given, needed) in checks.items():
        if given != needed and not {key, key.partition(".")[0]} & set(scenario.swept):
            said = f"{key} is {given}, but the robots in {like} have {needed}"
            raise ScenarioError(f"{origin}: {said}; give the same")
    if not all("period_s" in group.parameters for group in robots.robots) or not all(robots.present):
        raise ScenarioError(f"{origin}: some robots in {like} are no oscillators, or are not present at the start")
    return scenario.start.model_copy(update={"like": like})


class Point(NamedTuple):
    """One combination of a sweep's axis values."""

    number: int
    """Index in the sweep."""
    key: str
    """The axis values as text."""
    axes: dict[str, Any]
    """Value of each axis by dotted key; for a user's file, such as a controller, its name."""
    scenario: Scenario
    """The scenario with these values, and without a sweep."""

    def seed(self, trial: int) -> int:
        """Return the seed of trial number `trial`, which follows from the master seed, the axis values and `trial`."""
        return point_seed(self.scenario.seed, self.key, trial)


def points(scenario: ScenarioLike) -> tuple[Point, ...]:
    """Return the points of a scenario's sweep, in order; a scenario without a sweep is one point without axes.

    Args:
        scenario: A Scenario, or what `load_scenario` takes.

    Raises:
        ScenarioError: The values of a point make no valid scenario, or two points are the same.

    >>> sweep = load_scenario("thesis", axes=["robots.0.count=2,3", "robots.0.parameters.speed_cm_s=1,5"])
    >>> [tuple(point.axes.values()) for point in points(sweep)]
    [(2, 1), (2, 5), (3, 1), (3, 5)]
    """
    loaded = load_scenario(scenario)
    if loaded.sweep is None:
        return (Point(0, canonical_text({}), {}, loaded),)
    base = loaded.model_copy(update={"sweep": None}).model_dump(mode="json")
    rows = loaded.sweep.rows()
    names = _short_names(rows)
    found: dict[str, Point] = {}
    for number, (row, given) in enumerate(zip(rows, share_parameters(base, rows), strict=True)):
        origin = f"{loaded.name}: sweep: point {number} ({describe_axes(row)})"
        at_point = from_keys(keys.set_values(given, row, origin), origin)
        axes = {key: _map_files(key, value, lambda _, name: names[name]) for key, value in row.items()}
        point = Point(number, canonical_text(axes), axes, at_point)
        if (first := found.setdefault(point.key, point)) is not point:
            said = f"points {first.number} and {number} are the same: {describe_axes(axes)}"
            raise ScenarioError(f"{loaded.name}: sweep: {said}")
    return tuple(found.values())


def _short_names(rows: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Return the short name of each controller, response curve and picture in the rows.

    The name of a file has only the folders that distinguish it from the others. It does not depend on the folders that
    all files share, so that a sweep can move to another machine.
    """
    names: dict[str, str] = {}
    for row in rows:
        for key, value in row.items():
            _map_files(key, value, lambda _, name: names.setdefault(name, Path(name).as_posix()))
    endings = shortest_endings(names.values(), "/")
    return {name: endings[path] for name, path in names.items()}


def describe_axes(row: dict[str, Any]) -> str:
    """Return axis values as messages show them."""
    return ", ".join(f"{key} = {short_yaml(value)}" for key, value in row.items())
