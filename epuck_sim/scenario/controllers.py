"""The controllers that a scenario names: found in their files, with every parameter filled in."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from epuck_sim.control.interface import Controller, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.builtin import CONTROLLERS, builtin_files


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
