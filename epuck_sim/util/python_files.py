"""Loads users' Python files, each with copies of its own of the files beside it that it imports."""

import ast
import hashlib
import sys
import traceback
from collections.abc import Collection, Mapping, Sequence
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
    """Run a file, and return it as a module of its own. Nothing that it imports beside it stays in `sys.modules`.

    Args:
        path: The file.
        more_folders: Files that it may import by name lie beside it, or else in these folders.

    Raises:
        BaseException: Whatever the file raises.
    """
    folders = (*reversed(more_folders), path.parent)
    beside = [file for folder in folders for file in folder.glob("*.py") if file != path]
    importer = _Importer({file.stem: file.resolve() for file in beside})
    hidden = {name: sys.modules.pop(name) for name in importer.files if name in sys.modules}
    sys.meta_path.insert(0, importer)
    try:
        spec = spec_from_file_location(path.stem, path, loader=importer)
        assert spec is not None  # a loader was given
        module = module_from_spec(spec)
        importer.exec_module(module)
    finally:
        sys.meta_path.remove(importer)
        for name in importer.files:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)
    return PythonFile(module, importer.sources, importer.modules)


class _Importer(MetaPathFinder, Loader):
    """Imports files by name from their sources, as cached bytecode may be older than it seems, and records both."""

    def __init__(self, files: Mapping[str, Path]) -> None:
        self.files = files
        self.sources: dict[Path, bytes] = {}
        self.modules: dict[Path, ModuleType] = {}

    def find_spec(self, name: str, path: Sequence[str] | None, target: Any = None) -> ModuleSpec | None:  # noqa: ARG002
        return spec_from_file_location(name, self.files[name], loader=self) if name in self.files else None

    def exec_module(self, module: ModuleType) -> None:
        path = Path(str(module.__file__))
        source = self.sources[path] = path.read_bytes()
        self.modules[path] = module
        exec(compile(source, str(path), "exec", dont_inherit=True), vars(module))
        vars(module)[AS_LOADED] = {name: fingerprint(value) for name, value in vars(module).items()}


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
