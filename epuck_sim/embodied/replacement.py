"""Replaces the controllers of robots that are at work by new ones, between two control steps."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.control.interface import Controller
from epuck_sim.control.runner import ControllerRunner, Records
from epuck_sim.embodied.group import RobotGroupState
from epuck_sim.errors import ControllerError
from epuck_sim.scenario.controllers import resolve_parameters


class Replaced(NamedTuple):
    """A group of robots with a new controller."""

    group: RobotGroupState
    kept: tuple[str, ...]
    """Fields that robots still remember."""
    started: tuple[str, ...]
    """Fields of the new controller that have begun anew."""


def replace_controller(
    group: RobotGroupState, controller: Controller, step_ms: int, origin: str, *, interpret: bool
) -> Replaced:
    """Return a group of robots that goes on with another controller; the old group is as it was.

    Fields of memory whose names and types agree are kept, others begin as `start` sets them. Parameters keep their
    values where the new controller has them, unless these are the old defaults. The new controller runs once on what
    robots sense now, so that one that raises at once is refused; what that changes is set back.

    Args:
        group: The group.
        controller: What is to run on its robots.
        step_ms: Length of a control step.
        origin: Begins messages about parameters.
        interpret: Whether controllers run as plain Python.

    Raises:
        EpuckSimError: The controller cannot be compiled, raises, does not take the parameters, or differs in what a
            running trial relies on.
    """
    _check_alike(group.controller, controller)
    arrays = group.runner.arrays
    present, first = (
        _parameters_for(controller, group.controller, record, step_ms, origin)
        for record in (arrays.parameters[0], group.first_parameters[0])
    )
    parameters = np.repeat(present, len(arrays.memory))
    runner = ControllerRunner(controller, parameters, arrays.random, arrays.senses, arrays.actuators, interpret)
    fields, old_fields = runner.memory.dtype, arrays.memory.dtype
    names = fields.names or ()
    kept = tuple(name for name in names if name in (old_fields.names or ()) and fields[name] == old_fields[name])
    started = tuple(name for name in names if name not in kept)
    _begin(runner, arrays.memory, kept, is_started=bool(started))
    return Replaced(group._replace(controller=controller, first_parameters=first, runner=runner), kept, started)


def _check_alike(old: Controller, new: Controller) -> None:
    """Raise ControllerError if controllers differ in what a trial relies on while it runs."""
    if old.external != new.external:
        raise ControllerError(f"{new.path}: EXTERNAL has changed from {old.external} to {new.external}: run again")
    if old.is_oscillator != new.is_oscillator:
        now = "an oscillator, which it was not" if new.is_oscillator else "no oscillator, which it was"
        raise ControllerError(f"{new.path}: has become {now} (phase_ms in MEMORY, period_s in PARAMETERS): run again")


def _parameters_for(
    controller: Controller, old: Controller, record: np.void, step_ms: int, origin: str
) -> npt.NDArray[np.void]:
    """Return (1,) the record of a new controller's parameters, from that of the old one's."""
    values = old.parameter_values(record)
    given = {
        name: value for name, value in values.items() if name in controller.parameters and value != old.parameters[name]
    }
    return controller.parameter_record(resolve_parameters(controller, given, step_ms, origin))


def _begin(runner: ControllerRunner, old_memory: Records, kept: Sequence[str], *, is_started: bool) -> None:
    """Set what robots remember, and try a step; raise ControllerError if that fails, with all else as it was."""
    memory, random, actuators = (
        array.view(np.ndarray) for array in (runner.memory, runner.arrays.random, runner.arrays.actuators)
    )
    random_before, commanded = random.copy(), actuators.copy()
    try:
        if is_started:
            runner.start()
        for name in kept:
            memory[name] = old_memory.view(np.ndarray)[name]
        begun, drawn = memory.copy(), random.copy()
        runner.step()
        for name in ("left_cm_s", "right_cm_s", "turn_rad"):
            if np.isnan(actuators[name]).any():
                raise ControllerError(f"{runner.controller.path}: sets {name} to what is not a number")
        memory[:], random_before = begun, drawn
    finally:
        random[:], actuators[:] = random_before, commanded
