"""Scenarios from YAML files: find the file, apply changes, validate, resolve, and write the scenario again."""

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
from epuck_sim.scenario.scenario import Kind, Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.scenario.yaml_io import read_yaml, write_yaml
from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files
from epuck_sim.util.messages import comma_list, did_you_mean, natural_order, short_repr

RUN_SCENARIO = "scenario.yaml"
"""Name of the file in a run folder that holds its scenario."""


@overload
def load_scenario(
    source: Kind,
    settings: Sequence[str] = (),
    axes: Sequence[str] = (),
    *,
    measures: Sequence[str] = (),
    controller: str | None = None,
    quick: bool = False,
) -> Kind: ...


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
        given = apply_override(given, setting)
    for axis in axes:
        given = add_axis(given, axis)
    options = [*(f"--set {setting}" for setting in settings), *(f"--sweep {axis}" for axis in axes)]
    origin = " ".join([origin, *options])
    given = note_changes(given, settings, axes)
    scenario = validate(given, origin)
    reject_swept_keys(settings, scenario.sweep)
    if controller is not None:
        reject_swept_controllers(controller, scenario.sweep)
    return scenario.resolved(origin, folder)


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
    """Return the file of the shipped scenario `name`, the file `name`, or the scenario of the run folder `name`.

    Raises:
        ScenarioError: There is none.
    """
    shipped = {**builtin_files(ARENAS), **builtin_files(SWEEPS)}
    if name in shipped:
        return shipped[name]
    path = Path(name)
    try:
        if path.is_file():
            return path
        if path.is_dir() and (path / RUN_SCENARIO).is_file():
            return path / RUN_SCENARIO
        if path.exists():
            raise ScenarioError(f"{name}: is neither a regular file nor a run folder with a {RUN_SCENARIO}")
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read: {error.strerror}") from error
    if path.suffix in (".yaml", ".yml"):
        named = f"; the shipped one is called {path.stem!r}" if path.stem in shipped else ""
        raise ScenarioError(f"{name}: there is no such file{named}")
    names = sorted(shipped, key=natural_order)
    raise ScenarioError(
        f"{did_you_mean(name, shipped)}; shipped: {comma_list(names)}; or give a .yaml file, or a run folder"
    )


def write_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML with every key; read again, it is the same scenario."""
    return write_yaml(scenario.model_dump(mode="json"))
