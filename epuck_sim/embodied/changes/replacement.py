"""Replaces controllers between two control steps of a running trial, also when their file is saved.

A new controller's memory may have another size, so the swarm moves to a new block. The old one stays as it is: if the
new controller is refused, the trial continues there.
"""

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.arrays import ByteArray
from epuck_sim.control.interface import Controller
from epuck_sim.control.loader import load_controller
from epuck_sim.embodied.swarm import DTYPES, open_block
from epuck_sim.embodied.user_code import GroupControllers
from epuck_sim.errors import ControllerError, EpuckSimError
from epuck_sim.scenario.robots import resolve_parameters
from epuck_sim.user_files import Value
from epuck_sim.util.messages import comma_list

if TYPE_CHECKING:
    from epuck_sim.embodied.simulation import Simulation

_PLACES = {
    "scene": ("at", "reference_phase", "reference_is_float"),
    "groups": ("parameters", "memory", "memory_bytes", "phase", "phase_is_float", "period"),
}
"""Fields that depend on controllers, and on the offsets of their bytes in a block."""


class Replaced(NamedTuple):
    """Fields of memory that robots keep, or begin anew, with a new controller."""

    kept: tuple[str, ...]  # fields whose values are kept
    started: tuple[str, ...]  # fields of the new controller that have begun anew


def check_alike(old: Controller, new: Controller) -> None:
    """Raise ControllerError if controllers differ in `EXTERNAL`, or in being oscillators: a trial relies on both."""
    if not isinstance(new, Controller):
        raise ValueError(f"controller is {new!r}; allowed: what `control.loader.load_controller(path)` returns")  # noqa: TRY004
    if old.external != new.external:
        raise ControllerError(f"{new.path}: EXTERNAL has changed from {old.external} to {new.external}: run again")
    if old.is_oscillator != new.is_oscillator:
        now = "an oscillator, which it was not" if new.is_oscillator else "no oscillator, which it was"
        raise ControllerError(f"{new.path}: has become {now} (phase_ms in MEMORY, period_s in PARAMETERS): run again")


def parameters_for(new: Controller, old: Controller, record: np.void, step_ms: int, origin: str) -> dict[str, Value]:
    """Return a new controller's parameters: its defaults, except where an old value differs from the old default."""
    values = old.parameter_values(record)
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
    """Move a swarm to a new block, in which a group has another controller; the old block stays as it is.

    Fields of memory whose names and types agree are kept, others begin as `start` sets them. The new controller runs
    once on the present readings, so that one that raises, or commands a value that is not a number, is refused at once;
    the changes of this run are undone.
    """
    _move(old_block, block, number)
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
            raise ControllerError(f"{new.controller.path}: sets {name} to a value that is not a number")
    block[:] = begun
    return Replaced(kept, started)


def _move(old_block: ByteArray, block: ByteArray, replaced: int) -> None:
    """Copy a swarm to another block: all but memories and parameters of the group whose controller is replaced."""
    old, new = open_block(old_block), open_block(block)
    for name in DTYPES.keys() - {"bytes"}:
        array, before = getattr(new, name), getattr(old, name).copy()
        for field in _PLACES.get(name, ()):
            before[field] = array[field]
        array[:] = before
    for number, (group, after) in enumerate(zip(old.groups, new.groups, strict=True)):
        if number != replaced:
            size = group.memory - group.parameters + group.count * group.memory_bytes
            block[after.parameters :][:size] = old_block[group.parameters :][:size]


LOOK_S = 0.25  # time between two looks at the files, s
SETTLED_S = 0.1  # time after the last write to a file, s, from which it counts as saved completely

SOURCES = {".py": (".py",), ".c": (".c", ".h"), ".so": (".so",)}
"""Endings of the files beside a controller's file from which it may be made, by the ending of that file."""


class ControllerFiles:
    """An observer of a trial that replaces controllers whose files, or what these import, have changed.

    It changes the trial; without an edit, the outcome is the same to the bit.
    """

    def __init__(self, simulation: "Simulation", announce: Callable[[str], None]) -> None:
        """Watch the files of a simulation's controllers; `announce` is called with one line for each new one."""
        self._simulation, self._announce = simulation, announce
        self._stamps = {controller.path: _stamps(controller) for controller in simulation.controllers}
        self._next_s = 0.0

    def __call__(self, *_: Any) -> None:
        """Look at the files, if it is time to."""
        now = time.monotonic()
        if now < self._next_s:
            return
        for path in self._stamps:
            self._look_at(path)
        self._next_s = time.monotonic() + LOOK_S

    def _look_at(self, path: Path) -> None:
        groups = [number for number, each in enumerate(self._simulation.controllers) if each.path == path]
        old = self._simulation.controllers[groups[0]]
        stamps = _stamps(old)
        if stamps == self._stamps[path] or path not in stamps:
            return
        if 0 <= time.time() - max(stamps.values()) / 1e9 < SETTLED_S:  # it is being written
            return
        self._stamps[path] = stamps
        try:
            new = load_controller(path)
            if new.sources == old.sources:
                return
            replaced = self._simulation.replace_controllers(groups, new)
        except (EpuckSimError, OSError) as error:
            self._announce(f"{error}; the old one goes on")
            return
        self._stamps[path] = _stamps(new)
        kept, started = replaced[0]
        memory = f"memory: {comma_list(started)} started anew" if started else "memory is kept"
        and_kept = f", {comma_list(kept)} kept" if kept and started else ""
        at = f"{path.name}: robots go on with the new one from step {self._simulation.steps}"
        self._announce(f"{at}; {memory}{and_kept}")


def _stamps(controller: Controller) -> dict[Path, int]:
    """Return the time of the last write to each file that a controller is made from, or might be after an edit."""
    folder, endings = controller.path.parent, SOURCES[controller.path.suffix]
    files = dict.fromkeys([*controller.sources, *(file for ending in endings for file in folder.glob(f"*{ending}"))])
    stamps = {}
    for file in files:
        with suppress(OSError):  # an editor is replacing it
            stamps[file] = file.stat().st_mtime_ns
    return stamps
