"""The controllers that a scenario names: found in their files, with every parameter filled in."""

import re
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.control.interface import Controller
from epuck_sim.control.loader import find_controller
from epuck_sim.control.names import check_sensed
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.arena import find_picture, map_pictures
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.faults import FaultSection
from epuck_sim.scenario.robots import RobotGroup, members
from epuck_sim.scenario.sensors import resolve_sensors
from epuck_sim.user_files import Value
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr


def resolve_group(group: RobotGroup, step_ms: int, origin: str, folder: Path | None) -> RobotGroup:
    """Return the group with the path of its controller, if that is a user's, and with all parameters.

    Args:
        group: A group of robots.
        step_ms: Length of a control step, which must be shorter than an oscillator's period.
        origin: Begins every error message.
        folder: The controller is looked for here first, then in the working directory.

    Raises:
        ScenarioError: There is no such controller, or it does not take these parameters.
    """
    sensors, readings = resolve_sensors(group.sensors, origin, folder)
    try:
        controller = find_controller(group.controller, folder)
        check_sensed(controller, readings)
    except ControllerError as error:
        raise ScenarioError(f"{origin}.controller: {error}") from error
    parameters = resolve_parameters(controller, group.parameters, step_ms, origin)
    for name, value in group.memory.items():
        try:
            _check_memory(controller, name, value, group.count, parameters)
        except ValueError as error:
            raise ScenarioError(f"{origin}.memory: {error}") from error
    found = {"controller": controller.stored_name, "parameters": parameters, "sensors": sensors}
    return group.model_copy(update=found)


def resolve_parameters(
    controller: Controller, given: Mapping[str, object], step_ms: int, origin: str
) -> dict[str, Value]:
    """Return all parameters of a controller, as given or by default; see `resolve_group`.

    Raises:
        ScenarioError: The controller does not take these parameters.
    """
    try:
        parameters = controller.resolve(given)
    except ValueError as error:
        raise ScenarioError(f"{origin}.parameters: {error}") from error
    if controller.is_oscillator and parameters["period_s"] * 1000 <= step_ms:
        raise ScenarioError(
            f"{origin}.parameters: period_s is {parameters['period_s']}; allowed: longer than a control step, "
            f"{step_ms / 1000:g} s"
        )
    return parameters


def _check_memory(controller: Controller, name: str, given: Any, robots: int, parameters: Mapping[str, Value]) -> None:
    """Raise ValueError if what robots are to remember at the start does not fit what the controller remembers."""
    known = list(controller.memory.names or ())
    if name not in known:
        raise ValueError(f"{did_you_mean(name, known)}; {controller.name} has {comma_list(known)}")
    field = controller.memory[name]
    try:
        values = np.asarray(given, np.float64)
    except (TypeError, ValueError):
        values = np.full(1, np.nan)
    shapes = {(): "a number", (robots, *field.shape): f"a list of {robots}, one for each robot"}
    is_whole = np.issubdtype(field.base, np.integer)
    if values.shape not in shapes or not np.isfinite(values).all() or (is_whole and (values % 1).any()):
        numbers = "whole numbers" if is_whole else "numbers"
        raise ValueError(f"{name} is {short_repr(given)}; allowed: {' or '.join(shapes.values())}, {numbers}")
    if name == "phase_ms" and controller.is_oscillator:
        period_ms = parameters["period_s"] * 1000
        if not ((values >= 0) & (values < period_ms)).all():
            raise ValueError(f"phase_ms is {short_repr(given)}; allowed: 0 to below the period, {period_ms:g}")


def check_oscillators(
    faults: Sequence[FaultSection], groups: Sequence[RobotGroup], swept: Sequence[str], origin: str
) -> None:
    """Check that faults of oscillators befall oscillators only.

    Args:
        faults: The scenario's faults.
        groups: Its groups of robots; nothing is known yet of those whose controller is an axis of a sweep.
        swept: Keys of the axes.
        origin: Begins every error message.

    Raises:
        ScenarioError: A robot that may have such a fault is no oscillator.
    """
    for number, fault in enumerate(faults):
        for place, group, robots in members(groups):
            known = f"robots.{place}.controller" not in swept
            if fault.changes == "phase" and fault.may_befall(robots) and known:
                controller = find_controller(group.controller)
                if not controller.is_oscillator:
                    raise ScenarioError(
                        f"{origin}: faults.{number}: kind is {fault.kind!r}, but robots.{place} are no oscillators: "
                        f"their controller is {controller.name}; give robots, the numbers of others"
                    )


def resolve_axes(axes: SweepAxes, origin: str, folder: Path | None) -> SweepAxes:
    """Return the axes with the paths of the users' controllers, and of the pictures of floors, that they name.

    Raises:
        ScenarioError: There is no such controller or picture.
    """

    def resolve(key: str, value: Any) -> Any:
        where = f"{origin}: sweep: {key}"
        value = map_pictures(key, value, lambda name: find_picture(name, where, folder))
        try:
            return map_controllers(key, value, lambda name: find_controller(str(name), folder).stored_name)
        except ControllerError as error:
            raise ScenarioError(f"{where}: {error}") from error

    return axes.mapped(resolve)


def replace_controllers(given: Mapping[str, Any], name: str, origin: str) -> dict[str, Any]:
    """Return the mapping `given` in which all robots have another controller, with what it knows of theirs.

    Args:
        given: A scenario of robots.
        name: A shipped controller, or a file, relative to the working directory.
        origin: Begins every message.

    Raises:
        ScenarioError: There is no such controller, or there are no robots to have it.

    Warns:
        UserWarning: Parameters or memory have been left out.
    """
    if given.get("model", "embodied") != "embodied":
        raise ScenarioError(f"{origin}: --controller {name}: model is {given['model']}; controllers run on robots")
    groups = given.get("robots", [{}])
    if not isinstance(groups, list | tuple) or not all(isinstance(group, Mapping) for group in groups):
        raise ScenarioError(f"{origin}: robots is {short_repr(groups)}; allowed: a list of groups")
    try:
        controller = find_controller(name)
    except ControllerError as error:
        raise ScenarioError(f"{origin}: --controller {name}: {error}") from error
    lacking = {
        section: dict.fromkeys(key for group in groups for key in group.get(section) or {} if key not in names)
        for section, names in _own_names(controller).items()
    }
    for section, unknown in lacking.items():
        if unknown:
            kind = "memory" if section == "memory" else "parameters" if len(unknown) > 1 else "the parameter"
            warnings.warn(f"{origin}: {controller.name} lacks {kind} {', '.join(unknown)}: left out", stacklevel=3)
    changes = {"controller": controller.stored_name}
    return {**given, "robots": [{**_without(group, lacking), **changes} for group in groups]}


def share_parameters(given: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Callable[[int], dict[str, Any]]:
    """Return a function that gives, by its number, a point's scenario before its axes are set.

    Where the controller of a group is an axis, each of its controllers gets those of the group's parameters and memory
    that it has. One that none of them has stays, and is refused with the point.

    Args:
        given: The scenario without its sweep.
        rows: Values of the axes of each point.
    """
    swept = [number for number in range(len(given.get("robots", ()))) if f"robots.{number}.controller" in rows[0]]
    own = {
        number: [_own_names(find_controller(str(row[f"robots.{number}.controller"]))) for row in rows]
        for number in swept
    }
    of_any = {
        number: {section: set().union(*(names[section] for names in own[number])) for section in own[number][0]}
        for number in swept
    }

    def of_point(point: int) -> dict[str, Any]:
        groups = list(given.get("robots", ()))
        for number in swept:
            lacking = {section: of_any[number][section] - names for section, names in own[number][point].items()}
            groups[number] = _without(groups[number], lacking)
        return {**given, "robots": groups} if swept else dict(given)

    return of_point


def _own_names(controller: Controller) -> dict[str, set[str]]:
    """Return the names that a controller has in each section of a group where it has its own."""
    return {"parameters": set(controller.parameters), "memory": set(controller.memory.names or ())}


def _without(group: Mapping[str, Any], lacking: Mapping[str, Collection[str]]) -> dict[str, Any]:
    kept = {
        section: {name: value for name, value in (group[section] or {}).items() if name not in names}
        for section, names in lacking.items()
        if section in group
    }
    return {**group, **kept}


def map_controllers(key: str, value: Any, change: Callable[[Any], str]) -> Any:
    """Return the value of an axis in which `change` has replaced every controller that it names."""
    if re.fullmatch(r"robots\.\d+\.controller", key):
        return change(value)
    if re.fullmatch(r"robots\.\d+", key) and isinstance(value, Mapping) and "controller" in value:
        return {**value, "controller": change(value["controller"])}
    if key == "robots" and isinstance(value, list | tuple):
        return [map_controllers("robots.0", group, change) for group in value]
    return value
