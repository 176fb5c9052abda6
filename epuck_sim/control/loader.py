"""Controllers from files: finds the file, loads it and checks that it describes a controller.

Each controller is loaded with copies of its own of the files that it imports: two files of one name in two folders are
never mistaken for each other, an edit is noticed, and a trial's outcome depends on files and parameters alone.
"""

import sys
from pathlib import Path

from epuck_sim.control.firmware import load_firmware
from epuck_sim.control.interface import EXTERNAL, Controller, record_type, typed
from epuck_sim.control.names import check_names
from epuck_sim.errors import ControllerError
from epuck_sim.util.builtin import CONTROLLERS, builtin_files, builtin_folder
from epuck_sim.util.messages import comma_list, describe_error, did_you_mean, short_repr
from epuck_sim.util.python_files import (
    AS_LOADED,
    fingerprint,
    line_of_definition,
    line_of_error,
    load_python_file,
)

PARTS = {
    "PARAMETERS": "a mapping of names to default values",
    "MEMORY": "a mapping of names to types",
    "start": "a function start(memory, parameters, random)",
    "step": "a function step(sensors, memory, actuators, parameters, random)",
}

SUFFIXES = (".py", ".c", ".so")
"""Endings of controllers' files: Python, firmware in C, and the library that it was compiled to."""

_loaded: dict[Path, tuple[list[int], Controller]] = {}


def is_file(name: str) -> bool:
    """Return whether a controller's name is that of a file."""
    return name.endswith(SUFFIXES)


def find_controller(name: str, folder: Path | None = None) -> Controller:
    """Return a built-in controller, or the one that a file describes.

    Args:
        name: The name of a built-in controller, or the path of a file, which ends in .py, .c or .so.
        folder: Where a relative path begins; if there is no such file, it begins at the working directory.

    Raises:
        ControllerError: There is no such controller, or the file does not describe one.
    """
    if not is_file(name) and "/" not in name and "\\" not in name:
        shipped = builtin_files(CONTROLLERS)
        if name not in shipped:
            raise ControllerError(
                f"{did_you_mean(name, shipped)}; shipped controllers: {comma_list(shipped)}; "
                f"or give a file that ends in {' or '.join(SUFFIXES)}"
            )
        return load_controller(shipped[name])
    folders = dict.fromkeys([folder or Path(), Path()])
    for place in folders:
        if (place / name).is_file():
            return load_controller(place / name)
    raise ControllerError(f"no controller file {name!r} in {' or '.join(str(place.resolve()) for place in folders)}")


def load_controller(path: Path) -> Controller:
    """Return the controller that a file describes.

    The file is read again only when it, or a file that it imports from its folder, has changed.

    Raises:
        ControllerError: The file does not describe a controller.
    """
    path = path.resolve()
    if path in _loaded:
        stamps, controller = _loaded[path]
        if stamps == _stamps(controller):
            return controller
    controller = _load(path) if path.suffix == ".py" else load_firmware(path)
    _loaded[path] = (_stamps(controller), controller)
    return controller


def _stamps(controller: Controller) -> list[int]:
    return [source.stat().st_mtime_ns for source in controller.sources if source.exists()]


def _load(path: Path) -> Controller:
    try:
        file = load_python_file(path, (builtin_folder(CONTROLLERS),))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever a user's file may raise
        where = line_of_error(error, [path]) or path
        raise ControllerError(f"{where}: cannot be loaded: {describe_error(error)}") from error
    parts = vars(file.module)

    def refusal(part: str, said: str) -> ControllerError:
        where = f"{path}:{line_of_definition(part, file.sources[path])}" if part in parts else path
        return ControllerError(f"{where}: {said}")

    for part, wanted in PARTS.items():
        if not (isinstance(parts.get(part), dict) if part.isupper() else callable(parts.get(part))):
            raise refusal(part, f"a controller needs {part}: {wanted}")
    if not callable(parts.get("check", print)):
        raise refusal("check", "check must be a function check(parameters), or not be there")
    external = parts.get("EXTERNAL", ())
    if not isinstance(external, tuple) or any(part not in EXTERNAL for part in external):
        allowed = comma_list(list(EXTERNAL))
        raise refusal("EXTERNAL", f"EXTERNAL is {short_repr(external)}; allowed: a tuple of {allowed}")
    for name, default in parts["PARAMETERS"].items():
        if not isinstance(default, bool | int | float):
            raise refusal("PARAMETERS", f"PARAMETERS[{name!r}] is {default!r}; allowed: a number, true or false")
    part = "PARAMETERS"
    try:
        parameters = {name: typed(name, default, default) for name, default in parts[part].items()}
        record_type({name: type(default) for name, default in parameters.items()})
        part = "MEMORY"
        memory = record_type(parts[part])
    except (TypeError, ValueError) as error:
        raise refusal(part, f"{part}: {error}") from error
    start, step, check = parts["start"], parts["step"], parts.get("check")
    controller = Controller(
        path.stem, path, parameters, memory, start, step, check, file.sources, file.modules, external
    )
    check_names(controller)
    return controller


def check_imported_copies(controller: Controller) -> None:
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
