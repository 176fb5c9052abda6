"""Controllers from Python files: finds the file, loads it and checks that it describes a controller.

Each controller is loaded with copies of its own of the files that it imports: two files of one name in two folders are
never mistaken for each other, an edit is noticed, and a trial's outcome depends on files and parameters alone.
"""

import hashlib
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from epuck_sim.control.interface import Controller, record_type, typed
from epuck_sim.errors import ControllerError
from epuck_sim.util.builtin import CONTROLLERS, builtin_files, builtin_folder
from epuck_sim.util.messages import comma_list, did_you_mean, short_repr

PARTS = {
    "PARAMETERS": "a mapping of names to default values",
    "MEMORY": "a mapping of names to types",
    "start": "a function start(memory, parameters, random)",
    "step": "a function step(sensors, memory, actuators, parameters, random)",
}

_loaded: dict[Path, tuple[list[int], Controller]] = {}


def find_controller(name: str, folder: Path | None = None) -> Controller:
    """Return a built-in controller, or the one that a file describes.

    Args:
        name: The name of a built-in controller, or the path of a file, which ends in .py.
        folder: Where a relative path begins; if there is no such file, it begins at the working directory.

    Raises:
        ControllerError: There is no such controller, or the file does not describe one.
    """
    if not name.endswith(".py") and "/" not in name and "\\" not in name:
        shipped = builtin_files(CONTROLLERS)
        if name not in shipped:
            raise ControllerError(
                f"{did_you_mean(name, shipped)}; shipped controllers: {comma_list(shipped)}; "
                "or give a file that ends in .py"
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
    controller = _load(path)
    _loaded[path] = (_stamps(controller), controller)
    return controller


def _stamps(controller: Controller) -> list[int]:
    return [source.stat().st_mtime_ns for source in controller.sources if source.exists()]


def _load(path: Path) -> Controller:
    with _imports_beside(path) as (sources, modules):
        try:
            module = _Source(path, sources, modules).load()
        except (Exception, SystemExit) as error:  # whatever a user's file may raise
            raise ControllerError(f"{path}: cannot be loaded: {type(error).__name__}: {error}") from error
    parts = vars(module)
    for part, wanted in PARTS.items():
        if not (isinstance(parts.get(part), dict) if part.isupper() else callable(parts.get(part))):
            raise ControllerError(f"{path}: a controller needs {part}: {wanted}")
    if not callable(parts.get("check", print)):
        raise ControllerError(f"{path}: check must be a function check(parameters), or not be there")
    for name, default in parts["PARAMETERS"].items():
        if not isinstance(default, bool | int | float):
            raise ControllerError(f"{path}: PARAMETERS[{name!r}] is {default!r}; allowed: a number, true or false")
    try:
        parameters = {name: typed(name, default, default) for name, default in parts["PARAMETERS"].items()}
        record_type({name: type(default) for name, default in parameters.items()})
        memory = record_type(parts["MEMORY"])
    except (TypeError, ValueError) as error:
        raise ControllerError(f"{path}: PARAMETERS or MEMORY: {error}") from error
    start, step, check = parts["start"], parts["step"], parts.get("check")
    return Controller(path.stem, path, parameters, memory, start, step, check, sources, modules)


class _Source(Loader):
    """Loads a module from its source, as cached bytecode may be older than it seems, and records both."""

    def __init__(self, path: Path, sources: dict[Path, bytes], modules: dict[Path, ModuleType]) -> None:
        self._path = path
        self._sources = sources
        self._modules = modules

    def exec_module(self, module: ModuleType) -> None:
        source = self._sources[self._path] = self._path.read_bytes()
        self._modules[self._path] = module
        exec(compile(source, str(self._path), "exec", dont_inherit=True), vars(module))
        vars(module)[_AS_LOADED] = {name: fingerprint(value) for name, value in vars(module).items()}

    def load(self) -> ModuleType:
        """Return the file as a module that no `import` statement finds."""
        spec = spec_from_file_location(self._path.stem, self._path, loader=self)
        assert spec is not None  # a loader was given
        module = module_from_spec(spec)
        self.exec_module(module)
        return module


class _Beside(MetaPathFinder):
    """Finds modules in the folder of a controller and among the built-in ones, except the controller itself."""

    def __init__(self, path: Path, sources: dict[Path, bytes], modules: dict[Path, ModuleType]) -> None:
        folders = (path.parent, builtin_folder(CONTROLLERS))
        files = [file for folder in reversed(folders) for file in folder.glob("*.py") if file != path]
        self.files: Mapping[str, Path] = {file.stem: file.resolve() for file in files}
        self._sources = sources
        self._modules = modules

    def find_spec(self, name: str, path: Sequence[str] | None, target: Any = None) -> ModuleSpec | None:  # noqa: ARG002
        if name not in self.files:
            return None
        loader = _Source(self.files[name], self._sources, self._modules)
        return spec_from_file_location(name, self.files[name], loader=loader)


@contextmanager
def _imports_beside(path: Path) -> Iterator[tuple[dict[Path, bytes], dict[Path, ModuleType]]]:
    """Make files beside `path` and built-in controllers importable by name while the block lasts.

    Yields the sources and the modules of the files that are loaded, which fill up. Nothing stays in `sys.modules`.
    """
    sources: dict[Path, bytes] = {}
    modules: dict[Path, ModuleType] = {}
    finder = _Beside(path, sources, modules)
    hidden = {name: sys.modules.pop(name) for name in finder.files if name in sys.modules}
    sys.meta_path.insert(0, finder)
    try:
        yield sources, modules
    finally:
        sys.meta_path.remove(finder)
        for name in finder.files:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)


_AS_LOADED = "__as_loaded__"
"""Name in a controller's module of the fingerprints of its values when it was loaded."""


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
        loaded = vars(own)[_AS_LOADED]
        for name, value in vars(imported).items():
            if not name.startswith("__") and name.isidentifier() and fingerprint(value) != loaded.get(name):
                raise ControllerError(
                    f"{path}: {name} is {short_repr(value)} in the module {path.stem!r} of this program, which is not "
                    "what the file says; controllers run a copy of their own, where it would change nothing: make it a "
                    "parameter, or set it in the modules of `epuck_sim.control.loader.find_controller`"
                )


def fingerprint(value: object) -> object:
    """Return the contents of numbers, text, arrays, functions and containers, and the type of anything else."""
    if isinstance(value, FunctionType):
        return value.__code__
    if isinstance(value, bool | int | float | complex | str | bytes | np.generic):
        return type(value), repr(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return value.dtype, value.shape, hashlib.sha256(value.tobytes()).digest()
    if isinstance(value, dict):
        return dict, tuple((fingerprint(key), fingerprint(each)) for key, each in value.items())
    if isinstance(value, list | tuple):
        return type(value), tuple(map(fingerprint, value))
    return type(value)
