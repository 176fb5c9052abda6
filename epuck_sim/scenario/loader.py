"""Scenarios from YAML: find the file, apply changes, validate, fill in the controllers' defaults, write it again."""

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from epuck_sim.control.interface import Controller
from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.overrides import add_axis, apply_override, reject_swept_keys, select_version
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.validation import validate
from epuck_sim.scenario.yaml_io import read_yaml, write_yaml
from epuck_sim.util.builtin import ARENAS, CONTROLLERS, SWEEPS, builtin_files, builtin_folder
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

RUN_SCENARIO = "scenario.yaml"
"""In a run folder: what was run."""


def load_scenario(
    source: Scenario | str | Path | Mapping[str, Any],
    settings: Sequence[str] = (),
    axes: Sequence[str] = (),
    *,
    quick: bool = False,
) -> Scenario:
    """Return a validated scenario with every default written out.

    source: a shipped arena's name, a YAML file, a mapping with a scenario's keys, or a Scenario.
    settings: changes as `key=value`, such as `robots.0.parameters.speed_cm_s=1.0`; later ones win.
    axes: axes for the grid of the scenario's sweep as `key=value,value,...`.
    quick: whether to take the quick version that the file has under `quick`.
    Raises ScenarioError, which names the file, the key, the value and what is allowed.

    >>> load_scenario("thesis", ["arena.width_cm=100"]).arena.width_cm
    100.0
    """
    folder = None
    if isinstance(source, Scenario):
        if not settings and not axes and not quick:
            return _resolve(source, source.name, folder)
        given: Any = source.model_dump(mode="json")
        origin = source.name
    elif isinstance(source, Mapping):
        given, origin = dict(source), "scenario"
    else:
        path = find_scenario(str(source))
        given, origin, folder = read_yaml(path), str(path), path.parent
        if given is None:
            raise ScenarioError(f"{path}: is empty; a scenario is a mapping of keys to values")
        if isinstance(given, dict):
            given = {"name": path.stem, **given}
    if not isinstance(given, dict):
        raise ScenarioError(f"{origin}: is {short_repr(given)}; a scenario is a mapping of keys to values")
    given = select_version(given, quick, origin)
    for setting in settings:
        given = apply_override(given, setting)
    for axis in axes:
        given = add_axis(given, axis)
    options = [*(f"--set {setting}" for setting in settings), *(f"--sweep {axis}" for axis in axes)]
    origin = " ".join([origin, *options])
    scenario = validate(given, origin)
    reject_swept_keys(settings, scenario.sweep)
    return _resolve(scenario, origin, folder)


def find_scenario(name: str) -> Path:
    """Return the file of a shipped arena, the file `name`, or the scenario of the run folder `name`.

    Raises ScenarioError where there is none.
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
            raise ScenarioError(f"{name}: is no regular file, nor a run folder with a {RUN_SCENARIO}")
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read: {error.strerror}") from error
    if path.suffix in (".yaml", ".yml"):
        named = f"; the shipped one is called {path.stem!r}" if path.stem in shipped else ""
        raise ScenarioError(f"{name}: there is no such file{named}")
    raise ScenarioError(
        f"{did_you_mean(name, shipped)}; shipped: {comma_list(shipped)}; or give a .yaml file, or a run folder"
    )


def _resolve(scenario: Scenario, origin: str, folder: Path | None) -> Scenario:
    """Return the scenario with controllers found and their parameters complete; raises ScenarioError."""
    if not isinstance(scenario, EmbodiedScenario):
        return scenario
    groups = []
    for place, group in enumerate(scenario.robots):
        key = f"{origin}: robots.{place}"
        if scenario.sweep is not None and f"robots.{place}.controller" in scenario.sweep.keys:
            groups.append(group)  # whose parameters they are is known at each point only
            continue
        try:
            controller = find_controller(group.controller, folder)
        except ControllerError as error:
            raise ScenarioError(f"{key}.controller: {error}") from error
        try:
            parameters = controller.resolve(group.parameters)
        except ValueError as error:
            raise ScenarioError(f"{key}.parameters: {error}") from error
        if controller.is_oscillator and parameters["period_s"] * 1000 <= scenario.timing.step_ms:
            raise ScenarioError(
                f"{key}.parameters: period_s is {parameters['period_s']}; allowed: longer than a control step, "
                f"{scenario.timing.step_ms / 1000:g} s"
            )
        groups.append(group.model_copy(update={"controller": _place_of(controller), "parameters": parameters}))
    sweep = scenario.sweep and _with_controllers_found(scenario.sweep, origin, folder)
    return scenario.model_copy(update={"robots": tuple(groups), "sweep": sweep})


def _place_of(controller: Controller) -> str:
    """Return the name of a shipped controller, or the path of another."""
    shipped = controller.path.parent == builtin_folder(CONTROLLERS)
    return controller.name if shipped else str(controller.path)


def _with_controllers_found(axes: SweepAxes, origin: str, folder: Path | None) -> SweepAxes:
    """Return the axes with the paths of the controllers that they name; raises ScenarioError."""

    def found(key: str, value: Any) -> Any:
        try:
            return map_controllers(key, value, lambda name: _place_of(find_controller(str(name), folder)))
        except ControllerError as error:
            raise ScenarioError(f"{origin}: sweep: {key}: {error}") from error

    columns = {
        name: {key: tuple(found(key, value) for value in values) for key, values in getattr(axes, name).items()}
        for name in ("zip", "grid")
    }
    points = axes.points and tuple({key: found(key, value) for key, value in row.items()} for row in axes.points)
    return axes.model_copy(update={**columns, "points": points})


def map_controllers(key: str, value: Any, change: Callable[[Any], str]) -> Any:
    """Return the value of an axis with every controller that it names changed."""
    if re.fullmatch(r"robots\.\d+\.controller", key):
        return change(value)
    if re.fullmatch(r"robots\.\d+", key) and isinstance(value, Mapping) and "controller" in value:
        return {**value, "controller": change(value["controller"])}
    if key == "robots" and isinstance(value, list | tuple):
        return [map_controllers("robots.0", group, change) for group in value]
    return value


def write_scenario(scenario: Scenario) -> str:
    """Return a scenario as YAML with every key; read again, it is the same scenario."""
    return write_yaml(scenario.model_dump(mode="json"))
