"""What a controller is: one Python file with `PARAMETERS`, `MEMORY`, `start` and `step`. Found, loaded, checked.

    PARAMETERS = {"speed_cm_s": 6.0}     name -> default; the default's type is the parameter's type
    MEMORY = {"turns": int}              name -> type, or (type, shape): what a robot remembers between two steps

    def start(memory, parameters, random): ...
    def step(sensors, memory, actuators, parameters, random): ...
    def check(parameters): ...           optional: raises ValueError on values that make no sense

`step` reads `sensors` (see `Sensors`), keeps what it likes in `memory`, and sets `actuators.left_cm_s`,
`actuators.right_cm_s` and `actuators.ring_on`. `random` is the robot's own stream for `epuck_sim.randomness`.
A robot whose memory has `phase_ms` and whose parameters have `period_s` is an oscillator: its synchrony is measured.
A controller may import others that lie beside it, and shipped ones, by their file's name.
"""

import difflib
import importlib.util
import math
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.errors import ControllerError
from epuck_sim.shipped import shipped_folder, shipped_names

Value = bool | int | float


class Sensors(NamedTuple):
    """What one robot senses at the start of a control step."""

    step_ms: int
    """Milliseconds from one control step to the next."""
    infrared: npt.NDArray[np.float64]
    """(8,) counts: raw readings of the proximity sensors."""
    distance_mm: npt.NDArray[np.int64]
    """(8,) mm: distances that belong to the readings; `epuck.OUT_OF_RANGE_MM` where nothing is in range."""
    camera: npt.NDArray[np.uint8]
    """(pixels,): 1 where a lit ring is seen, 0 where not; index 0 is the left edge of the picture."""


ACTUATORS = np.dtype(
    [("left_cm_s", np.float64), ("right_cm_s", np.float64), ("ring_on", np.int64)], align=True
)
"""What a controller sets, one record a robot; it keeps its values until they are set anew."""


@dataclass(frozen=True, eq=False)
class Controller:
    """A controller as its file describes it."""

    name: str
    path: Path
    parameters: Mapping[str, Value]
    """Name and default of each parameter."""
    memory: np.dtype[Any]
    """The record of what a robot remembers."""
    start: Callable[..., None]
    step: Callable[..., None]
    check: Callable[[SimpleNamespace], None] | None
    sources: tuple[Path, ...]
    """Every file that the controller's code comes from."""

    @property
    def is_oscillator(self) -> bool:
        """Whether its robots have a phase and a period."""
        return "phase_ms" in (self.memory.names or ()) and "period_s" in self.parameters

    def resolve(self, given: Mapping[str, object]) -> dict[str, Value]:
        """Return every parameter with its given value or its default.

        Raises ValueError, which names the parameter, the value and what is allowed.
        """
        for name in given:
            if name not in self.parameters:
                raise ValueError(f"{unknown(name, self.parameters)}; {self.name} has {listed(self.parameters)}")
        values = {
            name: typed(name, given[name], default) if name in given else default
            for name, default in self.parameters.items()
        }
        if self.check is not None:
            self.check(SimpleNamespace(**values))
        return values

    def parameter_record(self, values: Mapping[str, Value]) -> npt.NDArray[np.void]:
        """Return a record array of length 1 that holds `values`."""
        record = np.zeros(1, record_type({name: type(value) for name, value in self.parameters.items()}))
        for name, value in values.items():
            record[name] = value
        return record


def typed(name: str, given: object, default: Value) -> Value:
    """Return `given` as a value of the default's type, or raise ValueError."""
    if isinstance(default, bool):
        if isinstance(given, bool):
            return given
        raise ValueError(f"{name} is {given!r}; allowed: true or false")
    wanted = "a whole number" if isinstance(default, int) else "a number"
    if isinstance(given, int | float) and not isinstance(given, bool) and math.isfinite(given):
        if isinstance(default, float):
            return float(given)
        if given == int(given) and abs(given) < 2**53:
            return int(given)
    raise ValueError(f"{name} is {given!r}; allowed: {wanted}")


def unknown(name: str, known: Mapping[str, object] | list[str]) -> str:
    """Return the words for an unknown `name`, with the nearest known one."""
    nearest = difflib.get_close_matches(name, list(known), n=1)
    return f"unknown {name!r}" + (f", did you mean {nearest[0]!r}?" if nearest else "")


def listed(names: Mapping[str, object] | list[str]) -> str:
    """Return names as a readable list."""
    return ", ".join(names) or "none"


def record_type(fields: Mapping[str, Any]) -> np.dtype[Any]:
    """Return the record with `fields`, name -> type or (type, shape); truth values are kept as 0 and 1."""
    columns: list[tuple[Any, ...]] = []
    for name, field in fields.items():
        kind, *shape = field if isinstance(field, tuple) else (field,)
        columns.append((name, np.int64 if kind in (bool, int) else kind, *shape))
    return np.dtype(columns or [("nothing", np.int64)], align=True)


def find_controller(name: str, folder: Path | None = None) -> Controller:
    """Return the controller `name`: a shipped one, or a file relative to `folder` or to the working directory.

    Raises ControllerError where there is none, or where its file is no controller.
    """
    if not name.endswith(".py") and "/" not in name and "\\" not in name:
        names = shipped_names("controllers", ".py")
        if name not in names:
            raise ControllerError(
                f"{unknown(name, names)}; shipped controllers: {listed(names)}; or give a file that ends in .py"
            )
        return load_controller(shipped_folder("controllers") / f"{name}.py")
    for path in ([folder / name] if folder else []) + [Path(name)]:
        if path.is_file():
            return load_controller(path.resolve())
    raise ControllerError(f"no controller file {name!r}, looked in {folder or Path.cwd()}")


_loaded: dict[Path, tuple[list[int], Controller]] = {}


def load_controller(path: Path) -> Controller:
    """Return the controller that the file `path` describes; raises ControllerError where it describes none.

    The file is read anew only when it, or what it imports beside it, has changed.
    """
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
    with _imports_beside(path) as loaded:
        try:
            module = _execute(path)
        except Exception as error:  # whatever a user's file may raise
            raise ControllerError(f"{path}: cannot be loaded: {type(error).__name__}: {error}") from error
    parts = vars(module)
    for part, is_right, wanted in (
        ("PARAMETERS", lambda part: isinstance(part, dict), "a mapping of names to default values"),
        ("MEMORY", lambda part: isinstance(part, dict), "a mapping of names to types"),
        ("start", callable, "a function start(memory, parameters, random)"),
        ("step", callable, "a function step(sensors, memory, actuators, parameters, random)"),
    ):
        if not is_right(parts.get(part)):
            raise ControllerError(f"{path}: a controller needs {part}: {wanted}")
    for name, default in parts["PARAMETERS"].items():
        if not isinstance(default, bool | int | float):
            raise ControllerError(f"{path}: PARAMETERS[{name!r}] is {default!r}; allowed: a number, true or false")
    try:
        memory = record_type(parts["MEMORY"])
    except (TypeError, ValueError) as error:
        raise ControllerError(f"{path}: MEMORY: name -> int, float, bool, or (type, shape): {error}") from error
    return Controller(
        name=path.stem,
        path=path,
        parameters=parts["PARAMETERS"],
        memory=memory,
        start=parts["start"],
        step=parts["step"],
        check=parts.get("check"),
        sources=(path, *loaded),
    )


def _execute(path: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(path.stem, path)
    if spec is None or spec.loader is None:
        raise ControllerError(f"{path}: is no Python file")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@contextmanager
def _imports_beside(path: Path) -> Iterator[list[Path]]:
    """While it lasts, files beside `path` and shipped controllers can be imported by name.

    Yields a list that holds, afterwards, the files that were imported so. Nothing stays in `sys.modules`: two files of
    one name in two folders must not be taken for each other.
    """
    folders = [path.parent, shipped_folder("controllers")]
    names = {file.stem for folder in folders for file in folder.glob("*.py")}
    hidden = {name: sys.modules.pop(name) for name in names if name in sys.modules}
    loaded: list[Path] = []
    sys.path[:0] = map(str, folders)
    try:
        yield loaded
    finally:
        for folder in folders:
            sys.path.remove(str(folder))
        for name in names:
            module = sys.modules.pop(name, None)
            if module is not None and module.__file__:
                loaded.append(Path(module.__file__))
        sys.modules.update(hidden)
