"""Firmware in C: compiles a file with the system's compiler, or takes a library, and reads what it says of itself."""

import ctypes
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.control.c_compiler import build_library, keep_library
from epuck_sim.control.interface import Controller, Value, record_type, typed
from epuck_sim.errors import ControllerError

VERSION = 1
"""Version of the header `epuck.h`, which a library states."""

KINDS: Mapping[bytes, type] = {b"f": float, b"i": int, b"b": bool}
"""Types of fields by the letters of the header."""


@dataclass(frozen=True, eq=False)
class Firmware(Controller):
    """A controller in C, as its library describes it."""

    library: ctypes.CDLL
    """The library, loaded into this process."""


class _Field(ctypes.Structure):
    """A parameter, or a part of the memory: `e_field` of the header."""

    _fields_ = (
        ("name", ctypes.c_char * 64),
        ("kind", ctypes.c_char),
        ("count", ctypes.c_int64),
        ("offset", ctypes.c_int64),
        ("value", ctypes.c_double),
    )


def load_firmware(path: Path) -> Firmware:
    """Return the firmware that a file holds.

    Args:
        path: A file in C, or a library that was compiled from one.

    Raises:
        ControllerError: It cannot be compiled or loaded, or is no firmware; the compiler's own words are given.
    """
    built = build_library(path) if path.suffix == ".c" else keep_library(path)
    try:
        library = ctypes.CDLL(str(built.library))
        version = ctypes.c_int64.in_dll(library, "e_version").value
        fields = {part: _read_fields(library, f"e_{part}_fields") for part in ("parameter", "memory")}
    except (OSError, ValueError) as error:
        raise ControllerError(f"{path}: is no firmware, which includes <epuck.h>: {error}") from error
    if version != VERSION:
        raise ControllerError(f"{path}: was compiled with version {version} of epuck.h; this is {VERSION}")
    try:
        defaults = {name: _default(name, field) for name, field in fields["parameter"].items()}
        types = {name: type(default) for name, default in defaults.items()}
        parameters = record_type(types)
        memory = record_type({name: _type_of(field) for name, field in fields["memory"].items()})
    except ValueError as error:
        raise ControllerError(f"{path}: PARAMETERS or MEMORY: {error}") from error
    for record, named in ((parameters, fields["parameter"]), (memory, fields["memory"])):
        offsets = {name: each[1] for name, each in (record.fields or {}).items()}
        assert all(offsets[name] == field.offset for name, field in named.items())
    library.e_check.restype = ctypes.c_char_p
    check = _check_of(library, parameters)
    return Firmware(path.stem, path, defaults, memory, _runs_in_c, _runs_in_c, check, built.sources, {}, (), library)


def _read_fields(library: ctypes.CDLL, name: str) -> dict[str, _Field]:
    """Return the fields of a table, which ends with a field without a name, by their names."""
    first = _Field.in_dll(library, name)
    fields: dict[str, _Field] = {}
    for index in range(10_000):
        field = _Field.from_address(ctypes.addressof(first) + index * ctypes.sizeof(_Field))
        if not field.name:
            return fields
        fields[field.name.decode()] = field
    raise ValueError(f"{name} does not end")


def _type_of(field: _Field) -> Any:
    kind = KINDS[field.kind]
    return (kind, field.count) if field.count else kind


def _default(name: str, field: _Field) -> Value:
    if field.count:
        raise ValueError(f"{name} is an array; parameters are single numbers")
    default: Value = KINDS[field.kind](field.value)
    return typed(name, default, default)


def _check_of(library: ctypes.CDLL, parameters: np.dtype[Any]) -> Callable[[SimpleNamespace], None]:
    """Return a controller's `check` that calls the firmware's."""

    def check(values: SimpleNamespace) -> None:
        record = np.zeros(1, parameters)
        for name, value in vars(values).items():
            record[name] = value
        refusal = library.e_check(ctypes.c_void_p(record.ctypes.data))
        if refusal is not None:
            raise ValueError(refusal.decode(errors="replace"))

    return check


def _runs_in_c(*_: object) -> None:
    """Stand for a function that is not in Python."""
    raise NotImplementedError
