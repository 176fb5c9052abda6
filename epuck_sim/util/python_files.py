"""Loads users' Python files, each with copies of its own of the files beside it that it imports."""

import ast
import hashlib
import sys
import traceback
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

import numpy as np

AS_LOADED = "__as_loaded__"
"""Name in a loaded module of the fingerprints of its values when it was loaded."""


class PythonFile(NamedTuple):
    """A file that has been loaded."""

    module: ModuleType
    """The module made from it, which no `import` statement returns."""
    sources: Mapping[Path, bytes]
    """Contents of the file, and of every file beside it that it imports, at the time of loading."""
    modules: Mapping[Path, ModuleType]
    """The module made from each of these files."""


def load_python_file(path: Path, more_folders: Sequence[Path] = ()) -> PythonFile:
    """Run a file, and return it as a module of its own.

    Args:
        path: The file.
        more_folders: Files that it may import by name lie beside it, or else in these folders.

    Raises:
        BaseException: Whatever the file raises.
    """
    with _imports_beside(path, more_folders) as (sources, modules):
        return PythonFile(_Source(path, sources, modules).load(), sources, modules)


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
        vars(module)[AS_LOADED] = {name: fingerprint(value) for name, value in vars(module).items()}

    def load(self) -> ModuleType:
        """Return the file as a module that no `import` statement finds."""
        spec = spec_from_file_location(self._path.stem, self._path, loader=self)
        assert spec is not None  # a loader was given
        module = module_from_spec(spec)
        self.exec_module(module)
        return module


class _Beside(MetaPathFinder):
    """Finds modules beside a file and in further folders, except the file itself."""

    def __init__(
        self, path: Path, folders: Sequence[Path], sources: dict[Path, bytes], modules: dict[Path, ModuleType]
    ) -> None:
        folders = (path.parent, *folders)
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
def _imports_beside(path: Path, folders: Sequence[Path]) -> Iterator[tuple[dict[Path, bytes], dict[Path, ModuleType]]]:
    """Make files beside `path`, and those in `folders`, importable by name while the block lasts.

    Yields the sources and the modules of the files that are loaded, which fill up. Nothing stays in `sys.modules`.
    """
    sources: dict[Path, bytes] = {}
    modules: dict[Path, ModuleType] = {}
    finder = _Beside(path, folders, sources, modules)
    hidden = {name: sys.modules.pop(name) for name in finder.files if name in sys.modules}
    sys.meta_path.insert(0, finder)
    try:
        yield sources, modules
    finally:
        sys.meta_path.remove(finder)
        for name in finder.files:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)


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


def line_of_error(error: BaseException, files: Collection[Path]) -> str | None:
    """Return FILE:LINE of the last of some files that an error has passed through; None if it has passed none."""
    if isinstance(error, SyntaxError) and error.filename is not None and Path(error.filename) in files:
        return f"{error.filename}:{error.lineno}"
    passed = [frame for frame in traceback.extract_tb(error.__traceback__) if Path(frame.filename) in files]
    return f"{passed[-1].filename}:{passed[-1].lineno}" if passed else None


def line_of_definition(name: str, source: bytes) -> int:
    """Return the number of the line at which a file's source last defines a name; 1 if it does not."""
    line = 1
    for node in ast.parse(source).body:
        targets = getattr(node, "targets", [getattr(node, "target", None)])
        named = [getattr(node, "name", None), *(getattr(target, "id", None) for target in targets)]
        if name in named:
            line = node.lineno
    return line
