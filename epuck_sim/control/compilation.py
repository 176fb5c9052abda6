"""Compiles a controller's functions, and the function that calls them, into a cache that no edit leaves stale."""

import re
import warnings
from collections.abc import Hashable, Iterable, Mapping
from functools import lru_cache
from pathlib import Path
from types import CellType, FunctionType, ModuleType
from typing import Any

import numba
import numpy as np

from epuck_sim.control.names import first_use
from epuck_sim.errors import ControllerError, EpuckSimError
from epuck_sim.user_files import AS_LOADED, fingerprint
from epuck_sim.util.jit import bind, digest, digest_of_room, kernel_digest, name_after
from epuck_sim.util.native import ADDRESSES, BLOCK, INTP, WITHOUT_WRAPPERS, compile_cached

_compiled: dict[Hashable, Any] = {}


def compile_for(
    user: Any,
    function: Any,
    names: Mapping[str, Any],
    contents: str = "",
    takes: tuple[Any, ...] = (),
    error: type[EpuckSimError] = ControllerError,
) -> Any:
    """Compile a function (block, addresses, number) that calls a user's functions, cached by all it is made from.

    `names` has the values of its global names: functions of the file that `user` describes, types of records, or
    kernels, and `contents` a text that identifies what these are made from. A function that takes other arguments has
    their types in `takes`. If the file cannot be compiled, an error of this class is raised.
    """
    instead = "; --interpret runs it as plain Python" if error is ControllerError else ""
    for path, own in user.modules.items():
        loaded = vars(own)[AS_LOADED]
        for name, value in vars(own).items():
            if isinstance(value, FunctionType) and fingerprint(value) != loaded.get(name, value.__code__):
                raise error(f"{path}: {name} was replaced by the program; compiled code has that of the file{instead}")
    types = tuple(value for value in names.values() if isinstance(value, np.dtype))
    made_from = _static_digest(user, types, contents).encode(), digest_of_room(function).encode()
    contents_digest = digest([*made_from, *frozen_values(user.modules.values())])
    key = user, function, contents_digest
    if key not in _compiled:
        own = {name: value for name, value in names.items() if isinstance(value, FunctionType)}
        compiled = jit_functions(own.values(), user.modules, contents_digest)
        bound = bind(function, **{**names, **dict(zip(own, compiled, strict=True))})
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", numba.NumbaWarning)
                to_call = compile_cached(name_after(bound, contents_digest), contents_digest, careful=True)
                to_call.compile(takes or (BLOCK, ADDRESSES, INTP))
                _compiled[key] = to_call
        except Exception as refusal:  # numba's own errors, and what escapes it
            raise error(explain_refusal(refusal, user.sources, instead)) from refusal
    return _compiled[key]


@lru_cache  # it takes long, and nothing here changes in a loaded file
def _static_digest(user: Any, types: tuple[np.dtype[Any], ...], contents: str) -> str:
    own = user.modules.values()
    imported = {value: None for module in own for value in vars(module).values() if isinstance(value, ModuleType)}
    made_from = [kernel_digest().encode(), *user.sources.values(), *frozen_values(imported)]
    return digest([*made_from, repr(types).encode(), contents.encode()])


def frozen_values(modules: Iterable[ModuleType]) -> list[bytes]:
    """Return names and contents of the global values that numba may copy into compiled code."""
    return [
        repr((module.__name__, name, fingerprint(value))).encode()
        for module in modules
        for name, named in vars(module).items()
        if not name.startswith("__")
        for value in (_bound_values(named) if isinstance(named, FunctionType) else [named])
        if _can_be_frozen(value)
    ]


def _bound_values(function: FunctionType) -> list[object]:
    cells = [cell.cell_contents for cell in function.__closure__ or () if cell != CellType()]
    return [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values(), *cells]


def _can_be_frozen(value: object) -> bool:
    if isinstance(value, tuple):
        return all(map(_can_be_frozen, value))
    return isinstance(value, bool | int | float | complex | str | bytes | np.ndarray | np.generic)


def jit_functions(
    functions: Iterable[Any], modules: Mapping[Path, ModuleType], contents_digest: str
) -> tuple[Any, ...]:
    """Return functions of a user's file as numba's dispatchers, for other compiled functions.

    Each module of the file gets a twin, in which dispatchers stand in for functions and twins for modules, so
    that the two find compiled helpers under the names that their sources use. The modules themselves do not change.
    """
    twins = {id(vars(module)): ModuleType(module.__name__) for module in modules.values()}
    dispatchers: dict[FunctionType, Any] = {}
    compiler: Any = numba.njit

    def twin(value: Any) -> Any:
        if isinstance(value, ModuleType):
            return twins.get(id(vars(value)), value)
        if not isinstance(value, FunctionType) or id(value.__globals__) not in twins:
            return value
        if value not in dispatchers:
            namespace = vars(twins[id(value.__globals__)])
            copy = FunctionType(value.__code__, namespace, value.__name__, value.__defaults__, value.__closure__)
            copy.__kwdefaults__ = value.__kwdefaults__
            copy.__module__ = __name__  # numba's cache imports this module, and the controller's cannot be imported
            named = name_after(copy, contents_digest)
            dispatchers[value] = compiler(boundscheck=True, forceinline=True, **WITHOUT_WRAPPERS)(named)
        return dispatchers[value]

    for module in modules.values():
        vars(twins[id(vars(module))]).update({name: twin(value) for name, value in vars(module).items()})
    return tuple(map(twin, functions))


INTERNALS = ("During: Pass", "During: lowering", "During: resolving", "raised from", "File ")
"""Beginnings of lines in numba's messages that say how it works rather than what is wrong."""

NOT_KNOWN = "numba knows no {}; of your own modules it compiles those beside the file, imported by name alone"

PLAIN_WORDS = {
    r"^(Cannot cast .*?): .*|^Cannot bind .* due to \"(.*)\"\.?$": r"\1\2",  # without LLVM's value, or all types
    r"^.* '(\w+)'(?:: .* list| in globals|.*'dict'>).*": r"\1 is a list or dictionary of the file; make it a tuple",
    r"^Unknown attribute '(\w+)' .*<module '([\w.]+)'.*": NOT_KNOWN.format(r"\2.\1"),
    r"^Untyped .*'(\w+)': Cannot determine.*": NOT_KNOWN.format(r"\1"),
    r"^Unknown attribute 'shape' of type \w+$": "a number in place of an array; for np.clip write min(max(x, a), b)",
    r"^.*\(IMPORT_NAME\).*": "an import within a function; import at the beginning of the file",
    r"^The use of yield .*": "a generator, (... for ...); write a loop",
    r"^Type of variable .* unknown operation.*": "an assignment by := in an expression; assign in a line of its own",
}
"""Patterns of numba's messages, and what users read instead."""


def explain_refusal(error: Exception, sources: Mapping[Path, bytes], instead: str) -> str:
    """Return the message about a file that numba cannot compile: place, what to do instead, reason, and the line."""
    _, _, innermost = f"{type(error).__name__}: {error}".rpartition("raised a specific error:")
    lines = [line.strip() for line in innermost.splitlines()]
    reason = next((line for line in lines if line and "pipeline" not in line and not line.startswith(INTERNALS)), "")
    for pattern, words in PLAIN_WORDS.items():
        reason = re.sub(pattern, words, reason)
    place = _place(reason, innermost, sources)
    if place is None:
        return f"{next(iter(sources))}: cannot be compiled{instead}: {reason}"
    file, line = place
    code = sources[file].decode(errors="replace").splitlines()[line - 1].strip()
    return f"{file}:{line}: cannot be compiled{instead}: {reason}\n    {code}"


def _place(reason: str, message: str, sources: Mapping[Path, bytes]) -> tuple[Path, int] | None:
    """Return file and line that numba cannot compile: of the name in its error, or else the first place it mentions."""
    lacking = re.match(r"(?:Name|Key|Attribute)Error:.*'(\w+)'[^']*$", reason)
    if lacking and (place := first_use(lacking[1], sources)):
        return place
    named = re.findall(r'(?:File "|" at |Raised from )(.+?)(?:", line | \()(\d+)', message)
    own = [(path, int(line)) for file, line in named if (path := Path(file).resolve()) in sources]
    return own[0] if own else None
