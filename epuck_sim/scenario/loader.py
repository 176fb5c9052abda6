"""Scenarios from YAML files: find the file, apply changes, validate, resolve, and write the scenario again."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, overload

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.controllers import replace_controllers
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.overrides import (
    QUICK,
    add_axis,
    add_measures,
    apply_override,
    note_changes,
    quick_version,
    reject_swept_controllers,
    reject_swept_keys,
    without_quick,
)
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.scenario.robot_kind import with_robot
from epuck_sim.scenario.scenario import AnyScenario, Scenario
from epuck_sim.scenario.sensors import spread
from epuck_sim.scenario.validation import validate
from epuck_sim.scenario.yaml_io import read_yaml, write_yaml
from epuck_sim.user_files import Kind
from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files
from epuck_sim.util.messages import natural_order, short_repr


def _shipped() -> dict[str, Path]:
    files = {**builtin_files(ARENAS), **builtin_files(SWEEPS)}
    return {name: files[name] for name in sorted(files, key=natural_order)}


SCENARIO = Kind(
    noun="scenario",
    error=ScenarioError,
    suffixes=(".yaml", ".yml"),
    group="epuck_sim.scenarios",
    shipped=_shipped,
    form="a .yaml file, or a run folder",
)
"""What scenarios are found by."""

RUN_SCENARIO = "scenario.yaml"
"""Name of the file in a run folder that holds its scenario."""


@overload
def load_scenario(
    source: AnyScenario,
    settings: Sequence[str] = (),
    axes: Sequence[str] = (),
    *,
    measures: Sequence[str] = (),
    controller: str | None = None,
    quick: bool = False,
) -> AnyScenario: ...


@overload
def load_scenario(
    source: str | Path | Mapping[str, Any],
    settings: Sequence[str] = (),
    axes: Sequence[str] = (),
    *,
    measures: Sequence[str] = (),
    controller: str | None = None,
    quick: bool = False,
) -> EmbodiedScenario | ParticleScenario: ...


def load_scenario(
    source: Scenario | str | Path | Mapping[str, Any],
    settings: Sequence[str] = (),
    axes: Sequence[str] = (),
    *,
    measures: Sequence[str] = (),
    controller: str | None = None,
    quick: bool = False,
) -> Scenario:
    """Return a validated scenario with every default filled in.

    Args:
        source: A shipped scenario's name, a YAML file, a run folder, a mapping with a scenario's keys, or a Scenario.
        settings: Changes as `key=value`, such as `robots.0.parameters.speed_cm_s=1.0`; later ones win.
        axes: Axes for the grid of the scenario's sweep as `key=value,value,...`.
        measures: Names of measures, added to the scenario's own; see `measures.loader.find_measure`.
        controller: A shipped controller, or a file, relative to the working directory, that runs on all robots instead
            of the scenario's own. Their parameters and memory are kept where it has them; a warning names the others.
        quick: Take the quick version, which the file has under `quick`.

    Returns:
        An `EmbodiedScenario` or a `ParticleScenario`, as its key `model` says; a Scenario keeps its class.

    Raises:
        ScenarioError: The message names the file, the key, the value and what is allowed.

    >>> scenario = load_scenario("thesis", ["arena.width_cm=100"])
    >>> scenario
    EmbodiedScenario(name='thesis', model='embodied', population=10)
    >>> scenario.arena.width_cm
    100.0
    """
    for name, given_texts in (("settings", settings), ("axes", axes), ("measures", measures)):
        if isinstance(given_texts, str):
            raise ScenarioError(f"{name} is {given_texts!r}; allowed: a list of such texts")
    if isinstance(source, Scenario) and not any((settings, axes, measures, controller, quick)):
        return source.resolved(source.name)
    given, origin, folder = _read(source)
    given = _choose_version(given, origin, quick=quick)
    if controller is not None:
        given = note_changes(replace_controllers(given, controller, origin), [f"controller={controller}"], [])
    if measures:
        given = add_measures(given, measures, origin)
    for setting in settings:
        if re.match(r"robots\.\d+\.sensors\.", setting):  # which leads into a sensor that may be given in a list
            given = _expanded(given, origin, folder)
        given = apply_override(given, setting)
    for axis in axes:
        given = add_axis(given, axis)
    options = [*(f"--set {setting}" for setting in settings), *(f"--sweep {axis}" for axis in axes)]
    origin = " ".join([origin, *options])
    given = note_changes(given, settings, axes)
    scenario = validate(_expanded(given, origin, folder), origin)
    reject_swept_keys(settings, scenario.sweep)
    if controller is not None:
        reject_swept_controllers(controller, scenario.sweep)
    return scenario.resolved(origin, folder)


def _expanded(given: Mapping[str, Any], origin: str, folder: Path | None) -> dict[str, Any]:
    """Return a scenario's keys with the path of its robot's file, and with sensors by name in each group."""
    if given.get("model", "embodied") != "embodied":
        return dict(given)
    found, sensors = with_robot(given, origin, folder)
    return spread(found, sensors, origin)


def _read(source: Scenario | str | Path | Mapping[str, Any]) -> tuple[dict[str, Any], str, Path | None]:
    """Return the keys of a scenario, what messages about it begin with, and the folder of its file."""
    if isinstance(source, Scenario):
        return source.model_dump(mode="json"), source.name, None
    if isinstance(source, Mapping):
        return dict(source), "scenario", None
    path = find_scenario(str(source))
    given = read_yaml(path)
    if given is None:
        raise ScenarioError(f"{path}: is empty; a scenario is a mapping of keys to values")
    if not isinstance(given, dict):
        raise ScenarioError(f"{path}: is {short_repr(given)}; a scenario is a mapping of keys to values")
    return {"name": path.stem, **given}, str(path), path.parent


def _choose_version(given: Mapping[str, Any], origin: str, *, quick: bool) -> dict[str, Any]:
    """Return a file's scenario in one of its versions; a quick one that is no scenario is refused in any case."""
    if quick:
        return quick_version(given, origin)
    if given.get(QUICK) is not None:
        validate(quick_version(given, origin), f"{origin}: {QUICK}")
    return without_quick(given)


def find_scenario(name: str) -> Path:
    """Return the file of a shipped scenario, the file `name`, the scenario of a run folder, or an installed package's.

    Raises:
        ScenarioError: There is none, or two of one name.
    """
    shipped = SCENARIO.shipped()
    path = None if name in shipped else _given_file(Path(name), name)
    if path is None:
        stem = Path(name).stem
        if name.endswith(SCENARIO.suffixes):
            named = f"; the shipped one is called {stem!r}" if stem in shipped else ""
            raise ScenarioError(f"{name}: there is no such file{named}")
        path = SCENARIO.named(name).path
        assert path is not None  # scenarios are files
    return path


def _given_file(path: Path, name: str) -> Path | None:
    """Return a file, or the scenario in a run folder; None if there is nothing at this path."""
    try:
        if path.is_file():
            return path
        if path.is_dir() and (path / RUN_SCENARIO).is_file():
            return path / RUN_SCENARIO
        if path.exists():
            raise ScenarioError(f"{name}: is neither a regular file nor a run folder with a {RUN_SCENARIO}")
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read: {error.strerror}") from error
    return None


def write_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML with every key; read again, it is the same scenario."""
    return write_yaml(scenario.model_dump(mode="json"))
