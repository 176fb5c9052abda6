"""The controllers that a scenario names: found in their files, with every parameter filled in."""

import re
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

from epuck_sim.control.interface import Controller, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.faults import FaultSection
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.builtin import CONTROLLERS, builtin_files
from epuck_sim.util.messages import short_repr


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
    try:
        controller = find_controller(group.controller, folder)
    except ControllerError as error:
        raise ScenarioError(f"{origin}.controller: {error}") from error
    parameters = resolve_parameters(controller, group.parameters, step_ms, origin)
    return group.model_copy(update={"controller": _stored_name(controller), "parameters": parameters})


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
        first = 0
        for place, group in enumerate(groups):
            known = f"robots.{place}.controller" not in swept
            if fault.needs_oscillator and fault.may_befall(first, group.count) and known:
                controller = find_controller(group.controller)
                if not controller.is_oscillator:
                    raise ScenarioError(
                        f"{origin}: faults.{number}: kind is {fault.kind!r}, but robots.{place} are no oscillators: "
                        f"their controller is {controller.name}; give robots, the numbers of others"
                    )
            first += group.count


def resolve_axes(axes: SweepAxes, origin: str, folder: Path | None) -> SweepAxes:
    """Return the axes with the paths of the users' controllers that they name.

    Raises:
        ScenarioError: There is no such controller.
    """

    def resolve(key: str, value: Any) -> Any:
        try:
            return map_controllers(key, value, lambda name: _stored_name(find_controller(str(name), folder)))
        except ControllerError as error:
            raise ScenarioError(f"{origin}: sweep: {key}: {error}") from error

    columns = {
        name: {key: tuple(resolve(key, value) for value in values) for key, values in getattr(axes, name).items()}
        for name in ("zip", "grid")
    }
    points = axes.points and tuple({key: resolve(key, value) for key, value in row.items()} for row in axes.points)
    return axes.model_copy(update={**columns, "points": points})


def replace_controllers(given: Mapping[str, Any], name: str, origin: str) -> dict[str, Any]:
    """Return the mapping `given` in which all robots have another controller, with those parameters that it knows.

    Args:
        given: A scenario of robots.
        name: A shipped controller, or a file, relative to the working directory.
        origin: Begins every message.

    Raises:
        ScenarioError: There is no such controller, or there are no robots to have it.

    Warns:
        UserWarning: Parameters have been left out.
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
    parameters = [dict(group.get("parameters") or {}) for group in groups]
    unknown = dict.fromkeys(key for each in parameters for key in each if key not in controller.parameters)
    if unknown:
        plural = "parameters" if len(unknown) > 1 else "the parameter"
        warnings.warn(f"{origin}: {controller.name} lacks {plural} {', '.join(unknown)}: left out", stacklevel=3)
    changes = {"controller": _stored_name(controller)}
    return {
        **given,
        "robots": [
            {**group, **changes, "parameters": {key: value for key, value in each.items() if key not in unknown}}
            for group, each in zip(groups, parameters, strict=True)
        ],
    }


def share_parameters(given: Mapping[str, Any], rows: Sequence[Mapping[str, Any]]) -> Callable[[int], dict[str, Any]]:
    """Return a function that gives, by its number, a point's scenario before its axes are set.

    Where the controller of a group is an axis, each of its controllers gets those of the group's parameters that it
    has. One that none of them has stays, and is refused with the point.

    Args:
        given: The scenario without its sweep.
        rows: Values of the axes of each point.
    """
    swept = [number for number in range(len(given.get("robots", ()))) if f"robots.{number}.controller" in rows[0]]
    known = {
        number: {key for row in rows for key in find_controller(str(row[f"robots.{number}.controller"])).parameters}
        for number in swept
    }

    def of_point(point: int) -> dict[str, Any]:
        groups = list(given.get("robots", ()))
        for number in swept:
            group = groups[number]
            controller = find_controller(str(rows[point][f"robots.{number}.controller"]))
            lacking = {key for key in group["parameters"] if key in known[number] and key not in controller.parameters}
            kept = {key: value for key, value in group["parameters"].items() if key not in lacking}
            groups[number] = {**group, "parameters": kept}
        return {**given, "robots": groups} if swept else dict(given)

    return of_point


def _stored_name(controller: Controller) -> str:
    """Return the name of a shipped controller, or the path of another."""
    is_shipped = builtin_files(CONTROLLERS).get(controller.name) == controller.path
    return controller.name if is_shipped else str(controller.path)


def map_controllers(key: str, value: Any, change: Callable[[Any], str]) -> Any:
    """Return the value of an axis in which `change` has replaced every controller that it names."""
    if re.fullmatch(r"robots\.\d+\.controller", key):
        return change(value)
    if re.fullmatch(r"robots\.\d+", key) and isinstance(value, Mapping) and "controller" in value:
        return {**value, "controller": change(value["controller"])}
    if key == "robots" and isinstance(value, list | tuple):
        return [map_controllers("robots.0", group, change) for group in value]
    return value
