"""Controllers from files: finds the file, loads it and checks that it describes a controller."""

import sys
from functools import partial
from pathlib import Path

from epuck_sim.control.firmware import load_firmware
from epuck_sim.control.interface import EXTERNAL, Controller, Described
from epuck_sim.control.names import check_own_names
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import AS_LOADED, Kind, Place, fingerprint, kept, load_python_file
from epuck_sim.util.builtin import CONTROLLERS, builtin_files, builtin_folder
from epuck_sim.util.messages import comma_list, short_repr

CONTROLLER = Kind(
    noun="controller",
    error=ControllerError,
    suffixes=(".py", ".c", ".so"),  # Python, firmware in C, and the library that it was compiled to
    group="epuck_sim.controllers",
    shipped=partial(builtin_files, CONTROLLERS),
)
"""What controllers are found by."""

PARTS = {
    "PARAMETERS": "a mapping of names to default values",
    "MEMORY": "a mapping of names to types",
    "start": "a function start(memory, parameters, random)",
    "step": "a function step(sensors, memory, actuators, parameters, random)",
}


def find_controller(name: str, folder: Path | None = None) -> Controller:
    """Return a controller: a shipped one, an installed package's, or the one that a file describes.

    Args:
        name: A name, or the path of a file, which ends in .py, .c or .so.
        folder: Where a relative path begins; if there is no such file, it begins at the working directory.

    Raises:
        ControllerError: There is no such controller, or the file does not describe one.
    """
    return _load(CONTROLLER.locate(name, folder))


def load_controller(path: Path) -> Controller:
    """Return the controller that a file describes, read again only when it, or a file that it imports, has changed.

    Raises:
        ControllerError: The file does not describe a controller.
    """
    return _load(CONTROLLER.at(path))


@kept
def _load(place: Place) -> Controller:
    if place.path is not None and place.path.suffix != ".py":
        return load_firmware(place.path)
    file = load_python_file(place, ControllerError, (builtin_folder(CONTROLLERS),))
    parts = file.parts
    for part, wanted in PARTS.items():
        if not (isinstance(parts.get(part), dict) if part.isupper() else callable(parts.get(part))):
            raise file.refusal(part, f"a controller needs {part}: {wanted}")
    external = parts.get("EXTERNAL", ())
    if not isinstance(external, tuple) or any(part not in EXTERNAL for part in external):
        allowed = comma_list(list(EXTERNAL))
        raise file.refusal("EXTERNAL", f"EXTERNAL is {short_repr(external)}; allowed: a tuple of {allowed}")
    controller = Controller(
        place.short_name,
        place.name,
        file.path,
        file.parameters(),
        file.check(),
        file.sources,
        file.modules,
        file.record_type("MEMORY"),
        parts["start"],
        parts["step"],
        external,
    )
    check_own_names(controller)
    return controller


def check_imported_copies(controller: Described) -> None:
    """Reject values that the program set in its own import of a controller's file, which the controller would not see.

    Raises:
        ControllerError: A module in `sys.modules` comes from one of the controller's files, but a value in it is not
            what that file says.
    """
    for path, own in controller.modules.items():
        imported = sys.modules.get(path.stem)
        if imported is None or Path(getattr(imported, "__file__", None) or "").resolve() != path:
            continue
        loaded = vars(own)[AS_LOADED]
        for name, value in vars(imported).items():
            if not name.startswith("__") and name.isidentifier() and fingerprint(value) != loaded.get(name):
                raise ControllerError(
                    f"{path}: {name} is {short_repr(value)} in the module {path.stem!r} of this program, which is not "
                    "what the file says; controllers run a copy of their own, where it would change nothing: make it a "
                    "parameter, or set it in the modules of `epuck_sim.control.loader.find_controller`"
                )
