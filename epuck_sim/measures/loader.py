"""Finds measures: shipped ones by name, users' as FILE.py:NAME, or as FILE.py if that holds a single one."""

import inspect
from collections.abc import Callable, Mapping
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from epuck_sim.errors import MeasureError
from epuck_sim.measures.interface import Measure, default_parameters
from epuck_sim.measures.shipped import SHIPPED, UNITS
from epuck_sim.util.messages import comma_list, describe_error, did_you_mean, short_repr
from epuck_sim.util.python_files import PythonFile, line_of_definition, line_of_error, load_python_file

_loaded: dict[Path, tuple[list[int], PythonFile]] = {}


def find_measure(name: str, folder: Path | None = None) -> Measure:
    """Return a measure.

    Args:
        name: The name of a shipped measure; or FILE.py:NAME, or FILE.py, for a class or function in a file.
        folder: Where a relative path begins; if there is no such file, it begins at the working directory.

    Raises:
        MeasureError: There is no such measure, or it is none.
    """
    file, _, member = name.rpartition(":") if not name.endswith(".py") else (name, "", "")
    if not file:
        return _shipped_measure(name)
    if not file.endswith(".py"):
        raise MeasureError(f"{name!r} names no file; give FILE.py:NAME, or FILE.py")
    folders = dict.fromkeys([folder or Path(), Path()])
    for place in folders:
        if (place / file).is_file():
            return _measure_in((place / file).resolve(), member)
    raise MeasureError(f"no measure file {file!r} in {' or '.join(str(place.resolve()) for place in folders)}")


@cache
def _shipped_measure(name: str) -> Measure:
    if name not in SHIPPED:
        raise MeasureError(
            f"{did_you_mean(name, dict(SHIPPED))}; shipped measures: {comma_list(SHIPPED)}; or give FILE.py:NAME"
        )
    module, _, member = SHIPPED[name].partition(":")
    make = getattr(import_module(f"epuck_sim.instruments.{module}"), member)
    return Measure(name, name, make, default_parameters(make), {}, UNITS.get(name, ""))


def _measure_in(path: Path, member: str) -> Measure:
    file = _load(path)
    found = _measures_of(file, path)
    if not member:
        if len(found) != 1:
            raise MeasureError(f"{path}: holds {comma_list(found)}; give one of them as {path.name}:NAME")
        (member,) = found
    if member not in vars(file.module):
        raise MeasureError(f"{path}: {did_you_mean(member, dict(found))}; it holds {comma_list(found)}")
    make = vars(file.module)[member]
    where = f"{path}:{line_of_definition(member, file.sources[path])}: {member}"
    if not callable(make):
        raise MeasureError(f"{where} is {short_repr(make)}; a measure is a class or a function")
    if inspect.isclass(make) and not callable(getattr(make, "value", None)):
        raise MeasureError(f"{where} has no method value(self), which returns what was measured")
    try:
        parameters = default_parameters(make)
    except ValueError as error:
        raise MeasureError(f"{where} {error}") from error
    unit = getattr(make, "UNIT", getattr(file.module, "UNIT", ""))
    if not isinstance(unit, str):
        raise MeasureError(f"{where} has UNIT = {short_repr(unit)}; a unit is text")
    return Measure(member, f"{path}:{member}", make, parameters, file.sources, unit)


def _load(path: Path) -> PythonFile:
    """Return a file as it was loaded; it is loaded again when it, or a file that it imports, has changed."""
    if path in _loaded:
        stamps, file = _loaded[path]
        if stamps == _stamps(file):
            return file
    try:
        file = load_python_file(path)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever a user's file may raise
        where = line_of_error(error, [path]) or path
        raise MeasureError(f"{where}: cannot be loaded: {describe_error(error)}") from error
    _loaded[path] = _stamps(file), file
    return file


def _stamps(file: PythonFile) -> list[int]:
    return [source.stat().st_mtime_ns for source in file.sources if source.exists()]


def _measures_of(file: PythonFile, path: Path) -> Mapping[str, Callable[..., Any]]:
    """Return the measures that a file defines: its classes with a method `value`, or else its public functions."""
    own = {
        name: value
        for name, value in vars(file.module).items()
        if not name.startswith("_") and getattr(value, "__module__", None) == path.stem
    }
    classes = {name: value for name, value in own.items() if inspect.isclass(value) and hasattr(value, "value")}
    return classes or {name: value for name, value in own.items() if inspect.isfunction(value)}
