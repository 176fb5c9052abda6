"""Replaces the controllers of robots that are at work by new ones, between two control steps.

What robots remember may take another number of bytes, so the swarm goes on in a new block. The old one stays as it is:
if the new controller is refused, the trial goes on there.
"""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import ByteArray
from epuck_sim.control.interface import Controller
from epuck_sim.embodied.controllers import GroupControllers
from epuck_sim.embodied.swarm import Swarm, open_block
from epuck_sim.errors import ControllerError
from epuck_sim.scenario.robots import resolve_parameters
from epuck_sim.user_files import Value

_PLACES = {
    "scene": ("at", "reference_phase", "reference_is_float"),
    "groups": ("parameters", "memory", "memory_bytes", "phase", "phase_is_float", "period"),
}
"""Fields that depend on controllers, and on where a block has their bytes."""


class Replaced(NamedTuple):
    """What the robots of a group remember that have a new controller."""

    kept: tuple[str, ...]
    """Fields that robots still remember."""
    started: tuple[str, ...]
    """Fields of the new controller that have begun anew."""


def check_alike(old: Controller, new: Controller) -> None:
    """Raise ControllerError if controllers differ in what a trial relies on while it runs."""
    if old.external != new.external:
        raise ControllerError(f"{new.path}: EXTERNAL has changed from {old.external} to {new.external}: run again")
    if old.is_oscillator != new.is_oscillator:
        now = "an oscillator, which it was not" if new.is_oscillator else "no oscillator, which it was"
        raise ControllerError(f"{new.path}: has become {now} (phase_ms in MEMORY, period_s in PARAMETERS): run again")


def parameters_for(
    new: Controller, old: Controller, values: Mapping[str, Value], step_ms: int, origin: str
) -> dict[str, Value]:
    """Return the parameters of a new controller: the old ones, values, where it has them and they are no old defaults.

    Raises:
        ScenarioError: The new controller does not take them; the message begins with `origin`.
    """
    given = {name: value for name, value in values.items() if name in new.parameters and value != old.parameters[name]}
    return resolve_parameters(new, given, step_ms, origin)


def replace_controller(
    old_block: ByteArray,
    block: ByteArray,
    number: int,
    old: GroupControllers,
    new: GroupControllers,
    parameters: Mapping[str, Value],
) -> Replaced:
    """Have a swarm go on in a new block, in which a group has another controller; the old block stays as it is.

    Fields of memory whose names and types agree are kept, others begin as `start` sets them. The new controller runs
    once on what robots sense now, so that one that raises at once is refused; what that changes is set back.

    Raises:
        RobotError: The new controller raises.
        ControllerError: It sets what is not a number.
    """
    move(old_block, block, number)
    new.parameters[:] = new.controller.parameter_record(parameters)
    actuators = open_block(block).robots.actuators[new.robots]
    fields, old_fields = new.controller.memory, old.controller.memory
    names = fields.names or ()
    kept = tuple(name for name in names if name in (old_fields.names or ()) and fields[name] == old_fields[name])
    started = tuple(name for name in names if name not in kept)
    if started:
        commanded = actuators.copy()
        new.start()
        actuators[:] = commanded
    for name in kept:
        new.memory[name] = old.memory[name]
    begun = block.copy()
    new.step()
    for name in ("left_cm_s", "right_cm_s", "turn_rad"):
        if np.isnan(actuators[name]).any():
            raise ControllerError(f"{new.controller.path}: sets {name} to what is not a number")
    block[:] = begun
    return Replaced(kept, started)


def move(old_block: ByteArray, block: ByteArray, replaced: int) -> None:
    """Copy a swarm to another block: all but memories and parameters of the group whose controller is replaced."""
    old, new = open_block(old_block), open_block(block)
    for name in Swarm._fields:
        if name == "bytes":
            continue
        array, before = getattr(new, name), getattr(old, name).copy()
        for field in _PLACES.get(name, ()):
            before[field] = array[field]
        array[:] = before
    for number, (group, after) in enumerate(zip(old.groups, new.groups, strict=True)):
        if number != replaced:
            size = group.memory - group.parameters + group.count * group.memory_bytes
            block[after.parameters :][:size] = old_block[group.parameters :][:size]
