"""Watches the files of controllers while their robots run: saved, and the robots go on with the new ones."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epuck_sim.control.interface import Controller
from epuck_sim.control.loader import load_controller
from epuck_sim.errors import EpuckSimError
from epuck_sim.util.messages import comma_list

if TYPE_CHECKING:
    from epuck_sim.embodied.simulation import Simulation

LOOK_S = 0.25
"""Time between two looks at the files, in seconds."""

SETTLED_S = 0.1
"""Time since a file was last written, in seconds, from which on it is taken as saved completely."""

SOURCES = {".py": (".py",), ".c": (".c", ".h"), ".so": (".so",)}
"""By the ending of a controller's file: endings of the files beside it from which it may be made."""


class ControllerFiles:
    """An observer of a trial that replaces controllers whose files, or what these import, have changed.

    Unlike other observers it changes the trial; without an edit, the outcome is the same to the bit.
    """

    def __init__(self, simulation: "Simulation", announce: Callable[[str], None]) -> None:
        """Watch the files of a simulation's controllers; `announce` is called with one line for each new one."""
        self._simulation = simulation
        self._announce = announce
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
        if stamps == self._stamps[path] or path not in stamps or _is_being_written(stamps):
            return
        self._stamps[path] = stamps
        try:
            new = load_controller(path)
            if new.sources == old.sources:
                return
            replaced = [self._simulation.replace_controller(group, new) for group in groups]
        except (EpuckSimError, OSError) as error:
            self._announce(f"{error}; the old one goes on")
            return
        self._stamps[path] = _stamps(new)
        at = f"{path.name}: robots go on with the new one from step {self._simulation.steps}"
        self._announce(f"{at}; {_of_memory(replaced[0].kept, replaced[0].started)}")


def _of_memory(kept: Sequence[str], started: Sequence[str]) -> str:
    if not started:
        return "memory is kept"
    return f"memory: {comma_list(list(started))} started anew" + (f", {comma_list(list(kept))} kept" if kept else "")


def _stamps(controller: Controller) -> dict[Path, int]:
    """Return when each file was last written that a controller is made from, or might be after an edit."""
    folder, endings = controller.path.parent, SOURCES[controller.path.suffix]
    files = dict.fromkeys([*controller.sources, *(file for ending in endings for file in folder.glob(f"*{ending}"))])
    stamps = {}
    for file in files:
        try:
            stamps[file] = file.stat().st_mtime_ns
        except OSError:  # an editor is replacing it
            continue
    return stamps


def _is_being_written(stamps: dict[Path, int]) -> bool:
    return 0 <= time.time() - max(stamps.values()) / 1e9 < SETTLED_S
