"""Controllers from Python files: find the file, load it, check that it is one."""

import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any

from epuck_sim.control.interface import Controller, record_type, typed
from epuck_sim.errors import ControllerError
from epuck_sim.util.builtin import CONTROLLERS, builtin_files, builtin_folder
from epuck_sim.util.messages import comma_list, did_you_mean

PARTS = {
    "PARAMETERS": "a mapping of names to default values",
    "MEMORY": "a mapping of names to types",
    "start": "a function start(memory, parameters, random)",
    "step": "a function step(sensors, memory, actuators, parameters, random)",
}

_loaded: dict[Path, tuple[list[int], Controller]] = {}


def find_controller(name: str, folder: Path | None = None) -> Controller:
    """Return the controller `name`: a shipped one, or a file relative to `folder` or to the working directory.

    Raises ControllerError where there is none, or where its file is no controller.
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
    """Return the controller that the file `path` describes; raises ControllerError where it describes none.

    The file is read anew only when it, or what it imports beside it, has changed.
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
    with _imports_beside(path) as sources:
        try:
            module = _Source(path, sources).load()
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
    return Controller(path.stem, path, parameters, memory, parts["start"], parts["step"], parts.get("check"), sources)


class _Source(Loader):
    """Loads a file from its source, and notes what stood in it; bytecode may be older than it seems."""

    def __init__(self, path: Path, sources: dict[Path, bytes]) -> None:
        self._path = path
        self._sources = sources

    def exec_module(self, module: ModuleType) -> None:
        source = self._sources[self._path] = self._path.read_bytes()
        exec(compile(source, str(self._path), "exec", dont_inherit=True), vars(module))

    def load(self) -> ModuleType:
        """Return the file as a module that nobody else can import."""
        spec = spec_from_file_location(self._path.stem, self._path, loader=self)
        assert spec is not None  # a loader was given
        module = module_from_spec(spec)
        self.exec_module(module)
        return module


class _Beside(MetaPathFinder):
    """Finds files by name in some folders, but for the one that imports them."""

    def __init__(self, path: Path, sources: dict[Path, bytes]) -> None:
        folders = (path.parent, builtin_folder(CONTROLLERS))
        files = [file for folder in reversed(folders) for file in folder.glob("*.py") if file != path]
        self.files: Mapping[str, Path] = {file.stem: file.resolve() for file in files}
        self._sources = sources

    def find_spec(self, name: str, path: Sequence[str] | None, target: Any = None) -> ModuleSpec | None:  # noqa: ARG002
        if name not in self.files:
            return None
        return spec_from_file_location(name, self.files[name], loader=_Source(self.files[name], self._sources))


@contextmanager
def _imports_beside(path: Path) -> Iterator[dict[Path, bytes]]:
    """While it lasts, files beside `path` and shipped controllers can be imported by name.

    Yields what stood in the files that are loaded. Nothing stays in `sys.modules`: two files of one name in two folders
    must not be taken for each other.
    """
    sources: dict[Path, bytes] = {}
    finder = _Beside(path, sources)
    hidden = {name: sys.modules.pop(name) for name in finder.files if name in sys.modules}
    sys.meta_path.insert(0, finder)
    try:
        yield sources
    finally:
        sys.meta_path.remove(finder)
        for name in finder.files:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)
