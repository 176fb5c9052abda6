"""Files that users write or installed packages offer: found by name, loaded, and refused with file and line.

Controllers, measures, response curves, rewards and scenarios are each one `Kind`. A function that is `kept` loads the
files of a kind: the object it returns has `sources`, the files it comes from, and is loaded again when one has changed.
"""

import ast
import hashlib
import math
import sys
import traceback
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache, cached_property, wraps
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.metadata import entry_points
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from multiprocessing import parent_process
from pathlib import Path
from threading import RLock
from types import FunctionType, ModuleType, SimpleNamespace
from typing import Any, NamedTuple, Protocol, TypeVar, cast

import numpy as np

from epuck_sim.errors import CODE_CHECKS, EpuckSimError
from epuck_sim.util.messages import comma_list, counted, describe_error, did_you_mean, short_repr

AS_LOADED = "__as_loaded__"  # name in a loaded module of the fingerprints of its values when it was loaded

MAX_WHOLE = 2**53
"""Bound of the absolute value of integer parameters: below it, a float represents every integer exactly."""

MOST_NUMBERS = 1_000_000  # most numbers of an array that a robot remembers
NEAREST = 5  # number of known names that are listed for an unknown one
OWN_PACKAGE = "epuck-sim"  # name of this package, among those that offer something
Value = bool | int | float | tuple[float, ...]  # value of a parameter that compiled code can read

_ALLOWED: Mapping[type, str] = {bool: "true or false", int: "a whole number", float: "a number", str: "text"}

_Parameter = TypeVar("_Parameter", bound=Value | str)


class Place(NamedTuple):
    """Where something that a user has named comes from."""

    name: str  # name by which it is found again: a shipped one's, a plug-in's, or the path of a file
    path: Path | None  # its file; None if it is shipped and has none
    package: str = ""  # the package that it comes from; none for a file that is given by its path

    @property
    def short_name(self) -> str:
        """Name that messages and results show: that of a file has no folder and no ending."""
        return self.name if self.package or self.path is None else self.path.stem


@dataclass(frozen=True, eq=False)
class Kind:
    """A kind of file that users write, that is shipped, and that installed packages offer by entry points."""

    noun: str  # its name in messages
    error: type[EpuckSimError]  # class of the errors about files of this kind
    suffixes: tuple[str, ...]  # endings of its files
    group: str
    """Group of the entry points by which packages offer it; each names a module, whose file has the first ending."""
    shipped: Callable[[], Mapping[str, Path | None]]
    """Returns the shipped files by name; None for a shipped thing that has no file of its own."""
    form: str = ""  # how a file is given, for messages

    def locate(self, name: str, folder: Path | None = None) -> Place:
        """Return the place of a file, looked for in `folder` first, or of a name that is shipped or offered."""
        if not (name.endswith(self.suffixes) or "/" in name or "\\" in name):  # it names no file
            return self.named(name)
        folders = dict.fromkeys([folder or Path(), Path()])
        for each in folders:
            if (each / name).is_file():
                return self.at(each / name)
        tried = " or ".join(str(each.resolve()) for each in folders)
        raise self.error(f"no {self.noun} file {name!r} in {tried}")

    def at(self, path: Path) -> Place:
        """Return the place of a file, under the name by which it is shipped or offered if it is."""
        path = path.resolve()
        for look in reversed(CODE_CHECKS):
            look(path)
        known = (places[0] for places in self.offers.values() if len(places) == 1)
        return next((place for place in known if place.path == path), Place(str(path), path))

    def named(self, name: str) -> Place:
        """Return the place of a name that is shipped, or offered by an installed package."""
        places = self.offers.get(name, [])
        if len(places) == 1:
            return places[0]
        if places:
            packages = " and by ".join(place.package for place in places)
            raise self.error(f"{name!r} is the name of two {self.noun}s: offered by {packages}; uninstall one of these")
        known = list(self.offers)
        more = f" and {len(known) - NEAREST} more" if len(known) > NEAREST else ""
        near = get_close_matches(name, known, NEAREST, cutoff=0) if more else known
        form = self.form or f"a file that ends in {' or '.join(self.suffixes)}"
        raise self.error(f"{did_you_mean(name, self.offers)}; {self.noun}s: {comma_list(near)}{more}; or give {form}")

    @cached_property
    def offers(self) -> Mapping[str, Sequence[Place]]:
        """Places of files, shipped or of installed packages, by name: several where a name is taken twice."""
        found = {name: [Place(name, path, OWN_PACKAGE)] for name, path in self.shipped().items()}
        for point in installed().select(group=self.group):
            package = getattr(point.dist, "name", None) or "a package without a name"
            path = _file_of(point.value, self.suffixes[0])
            if path is not None:
                found.setdefault(point.name, []).append(Place(point.name, path, package))
            elif parent_process() is None:  # each worker would say it once more
                said = f"{package} offers the {self.noun} {point.name!r} as {point.value}, which has no file"
                warnings.warn_explicit(f"{said}: left out; reinstall {package}", UserWarning, package, 0)
        return found


@cache
def installed() -> Any:
    """Return the `EntryPoints` of all installed packages, which are looked for once a process."""
    return entry_points()


def _file_of(module: str, suffix: str) -> Path | None:
    """Return the file of a module, or of what has its dotted name, without importing a package; None if there is none.

    >>> _file_of("epuck_sim.errors", ".py").name, _file_of("epuck_sim", ".py").name, _file_of("epuck_sim.lost", ".py")
    ('errors.py', '__init__.py', None)
    """
    top, *inner = module.split(".")
    try:
        spec = find_spec(top)
    except (ImportError, ValueError):  # where it has been imported, and says nothing of its file
        spec = None
    if spec is None:
        return None
    folders = spec.submodule_search_locations or [str(spec.origin).removesuffix(".py")]
    endings = ("/__init__.py", ".py") if suffix == ".py" else (suffix,)
    files = [Path("/".join([folder, *inner]) + ending) for folder in folders for ending in endings]
    return next((file.resolve() for file in files if file.is_file()), None)


class HasSources(Protocol):
    """An object that was loaded from files."""

    @property
    def sources(self) -> Mapping[Path, bytes]:
        """Contents of every file that it comes from, at the time of loading."""


_Loaded = TypeVar("_Loaded", bound=HasSources)

_loading = RLock()  # files are loaded one at a time: `sys.modules` is that of all threads


def kept(load: Callable[[Place], _Loaded]) -> Callable[[Place], _Loaded]:
    """Return a function that loads a file again only when one of its sources has changed."""
    loaded: dict[Place, tuple[list[int], _Loaded]] = {}

    @wraps(load)
    def load_if_new(place: Place) -> _Loaded:
        with _loading:
            stamps, found = loaded.get(place, ([], None))
            if found is None or stamps != _stamps(found):
                found = load(place)
                stamps, sources = _stamps(found), found.sources.items()
                # stamps of a file that was edited while it was loaded count for nothing
                is_edited = any(path.exists() and path.read_bytes() != contents for path, contents in sources)
                loaded[place] = [] if is_edited else stamps, found
            return found

    return load_if_new


def _stamps(loaded: HasSources) -> list[int]:
    return [source.stat().st_mtime_ns for source in loaded.sources if source.exists()]


class PythonFile(NamedTuple):
    """A file that has been loaded."""

    path: Path
    parts: Mapping[str, Any]  # what it defines, by name, in a module that no `import` statement returns
    sources: Mapping[Path, bytes]
    """Contents of the file, and of every file beside it that it imports, at the time of loading."""
    modules: Mapping[Path, ModuleType]  # the module made from each of these files
    error: type[EpuckSimError]  # class of the errors about it

    def refusal(self, part: str, said: str) -> EpuckSimError:
        """Return the error about a part of the file, with the line of the part's definition if it has one."""
        where = f"{self.path}:{line_of_definition(part, self.sources[self.path])}" if part in self.parts else self.path
        return self.error(f"{where}: {said}")

    def parameters(self) -> dict[str, Value]:
        """Return the parameters and their defaults, as `PARAMETERS` gives them; none if it is not there."""
        given = self.parts.get("PARAMETERS", {})
        if not isinstance(given, dict):
            said = f"PARAMETERS is {short_repr(given)}; allowed: a mapping of names to default values"
            raise self.refusal("PARAMETERS", said)
        for name, default in given.items():
            if not isinstance(default, bool | int | float | list | tuple) or default in ([], ()):
                said = f"PARAMETERS[{name!r}] is {default!r}; allowed: a number, a list of numbers, true or false"
                raise self.refusal("PARAMETERS", said)
        try:
            parameters = {name: typed(name, default, default) for name, default in given.items()}
            parameter_type(parameters)
        except (TypeError, ValueError) as error:
            raise self.refusal("PARAMETERS", f"PARAMETERS: {error}") from error
        return parameters

    def check(self) -> Callable[[SimpleNamespace], None] | None:
        """Return the function `check(parameters)`, if there is one; raise EpuckSimError if it is no function."""
        check: Callable[[SimpleNamespace], None] | None = self.parts.get("check")
        if "check" in self.parts and not callable(check):
            raise self.refusal("check", "check must be a function check(parameters), or be left out")
        return check

    def record_type(self, part: str, most: int = MOST_NUMBERS) -> np.dtype[Any]:
        """Return the record type whose fields a mapping of the file declares, see `record_type`."""
        try:
            return record_type(self.parts[part], most)
        except (TypeError, ValueError) as error:
            raise self.refusal(part, f"{part}: {error}") from error


def load_python_file(place: Place, error: type[EpuckSimError], more_folders: Sequence[Path] = ()) -> PythonFile:
    """Run a file as a module of its own, and return it. Files beside it that it imports do not stay in `sys.modules`.

    It gets its own copies of the files that it imports: two files of one name in two folders are never confused, an
    edit is noticed, and its behaviour depends on files alone.
    """
    path = place.path
    assert path is not None
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
    except KeyboardInterrupt:
        raise
    except BaseException as raised:  # whatever a user's file may raise
        where = line_of_error(raised, importer.sources) or path
        raise error(f"{where}: cannot be loaded: {describe_error(raised)}") from raised
    finally:
        sys.meta_path.remove(importer)
        for name in importer.files:
            sys.modules.pop(name, None)
        sys.modules.update(hidden)
    return PythonFile(path, vars(module), importer.sources, importer.modules, error)


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
        own = {name: value for name, value in vars(module).items() if not name.startswith("__")}  # not Python's own
        vars(module)[AS_LOADED] = {name: fingerprint(value) for name, value in own.items()}


def fingerprint(value: object, inside: Collection[int] = ()) -> object:
    """Return the contents of numbers, text, arrays, functions and containers, and the type of anything else.

    A container that is inside of itself is not opened again; `inside` are the `id`s of those around a value.
    """
    if isinstance(value, FunctionType):
        return value.__code__
    if isinstance(value, bool | int | float | complex | str | bytes | np.generic):
        return type(value), repr(value)
    if isinstance(value, np.ndarray) and not value.dtype.hasobject:
        return value.dtype, value.shape, hashlib.sha256(value.tobytes()).digest()
    if isinstance(value, dict | list | tuple) and id(value) not in inside:
        parts = value.items() if isinstance(value, dict) else value
        return type(value), tuple(fingerprint(each, (*inside, id(value))) for each in parts)
    return type(value)


def line_of_error(error: BaseException, files: Collection[Path]) -> str | None:
    """Return FILE:LINE of the last line in some files that an error has passed; None if it has passed none."""
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


def with_defaults(owner: str, given: Mapping[str, object], defaults: Mapping[str, _Parameter]) -> dict[str, _Parameter]:
    """Return every parameter with its given value, converted to its default's type, or its default."""
    for name in given:
        if name not in defaults:
            raise ValueError(f"{did_you_mean(name, dict(defaults))}; {owner} has {comma_list(defaults)}")
    return {name: typed(name, given[name], own) if name in given else own for name, own in defaults.items()}


def typed(name: str, given: object, default: _Parameter) -> _Parameter:
    """Return `given`, which may be one of numpy's numbers, converted to the default's type."""
    value: Any = given.tolist() if isinstance(given, np.generic | np.ndarray) else given
    if isinstance(default, list | tuple):
        if not isinstance(value, list | tuple) or len(value) != len(default):
            raise ValueError(f"{name} is {short_repr(value)}; allowed: a list of {counted(len(default), 'number')}")
        return cast("_Parameter", tuple(typed(f"{name}.{n}", number, 0.0) for n, number in enumerate(value)))
    kind, allowed = next((kind, allowed) for kind, allowed in _ALLOWED.items() if isinstance(default, kind))
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if kind is float:
        fits = is_number and abs(value) <= sys.float_info.max
    elif kind is int:
        fits = is_number and abs(value) < MAX_WHOLE and value == int(value)
        allowed = f"{allowed}, like its default, {default}"
        if is_number and abs(value) >= MAX_WHOLE:
            allowed = f"{allowed}, above -2^53 and below 2^53"
    else:
        fits = isinstance(value, kind)
    if not fits:
        raise ValueError(f"{name} is {short_repr(value)}; allowed: {allowed}")
    return cast("_Parameter", kind(value))


def by_attribute(values: Mapping[str, object]) -> SimpleNamespace:
    """Return parameters as compiled functions of a file read them: `parameters.name`; lists of numbers are arrays."""
    arrays = {name: np.array(value) for name, value in values.items() if isinstance(value, tuple)}
    return SimpleNamespace(**{**values, **arrays})


def run_check(
    check: Callable[[SimpleNamespace], object] | None, values: Mapping[str, object], sources: Collection[Path]
) -> None:
    """Call the function `check(parameters)` of a file, if there is one; ValueError says what it raises or returns."""
    if check is None:
        return
    try:
        refusal = check(by_attribute(values))
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # whatever a user's file may raise
        said = describe_error(error)
        where = line_of_error(error, sources) or "check"
        text = said.partition(": ")[2] or f"{where}: refuses the parameters"
        raise ValueError(text if isinstance(error, ValueError) else f"{where}: {said}") from error
    if refusal is not None:
        instead = f"check returned {short_repr(refusal)}; allowed: None, or text that says what is wrong"
        raise ValueError(refusal if refusal and isinstance(refusal, str) else instead)


def parameter_type(values: Mapping[str, Value]) -> np.dtype[Any]:
    """Return the type of records that hold these parameters."""
    kinds = ((float, len(value)) if isinstance(value, tuple) else type(value) for value in values.values())
    return record_type(dict(zip(values, kinds, strict=True)))


def record_type(fields: Mapping[str, Any], most: int = MOST_NUMBERS) -> np.dtype[Any]:
    """Return the record type with these fields, name -> type or (type, shape); truth values are kept as 0 and 1.

    ValueError is raised for a field without numbers, or with more than `most`.
    """
    columns: list[tuple[Any, ...]] = []
    for name, field in fields.items():
        kind, *shape = field if isinstance(field, tuple) and field else (field,)
        if kind not in (bool, int, float) or len(shape) > 1:
            allowed = "int, float, bool, or one of them and a shape, as in (float, 3) or (float, (2, 3))"
            raise ValueError(f"{name!r} is {field!r}; allowed: {allowed}")
        if not isinstance(name, str) or not name.isidentifier() or hasattr(np.recarray, name):
            raise ValueError(f"{name!r} is not a name that a record can have, or numpy needs it; choose another")
        own = np.dtype((np.float64 if kind is float else np.int64, *(shape or [()])))
        if not 0 < math.prod(own.shape) <= most:
            raise ValueError(f"{name!r} has the shape {own.shape}; allowed: 1 to {most} numbers")
        columns.append((name, own))
    return np.dtype(columns or [("nothing", np.int64)], align=True)
