"""The controllers that a scenario names: found in their files, with every parameter filled in."""

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim.control.interface import Controller, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.axes import SweepAxes
from epuck_sim.scenario.robots import RobotGroup
from epuck_sim.util.builtin import CONTROLLERS, builtin_files
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
    try:
        controller = find_controller(group.controller, folder)
    except ControllerError as error:
        raise ScenarioError(f"{origin}.controller: {error}") from error
    try:
        parameters = controller.resolve(group.parameters)
    except ValueError as error:
        raise ScenarioError(f"{origin}.parameters: {error}") from error
    if controller.is_oscillator and parameters["period_s"] * 1000 <= step_ms:
        raise ScenarioError(
            f"{origin}.parameters: period_s is {parameters['period_s']}; allowed: longer than a control step, "
            f"{step_ms / 1000:g} s"
        )
    for name, value in group.memory.items():
        try:
            _check_memory(controller, name, value, group.count, parameters)
        except ValueError as error:
            raise ScenarioError(f"{origin}.memory: {error}") from error
    return group.model_copy(update={"controller": _stored_name(controller), "parameters": parameters})


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

    return axes.mapped(resolve)


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
