"""Runs a controller for a group of robots: compiled by numba, or interpreted for breakpoints and any library.

Both run the same source, the controller's file and `_step_all` below, with equal results bit for bit.
"""

import warnings
from bdb import BdbQuit
from collections.abc import Callable, Iterable
from functools import lru_cache
from types import CellType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import Controller, Sensors
from epuck_sim.control.loader import check_imported_copies, fingerprint
from epuck_sim.errors import ControllerError
from epuck_sim.util.jit import compile_cached, digest, kernel_digest

Records = npt.NDArray[np.void]

if TYPE_CHECKING:  # `_bind` provides the controller's own
    start: Callable[..., None]
    step: Callable[..., None]


def _start_all(memory: Records, parameters: Records, random: StreamArray, serving: IntArray) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        start(memory[robot], parameters[robot], random[robot])  # noqa: F821 see `_bind`


def _step_all(
    step_ms: IntArray,
    infrared: FloatArray,
    distance_mm: IntArray,
    camera: IntArray,
    new_picture: BoolArray,
    actuators: Records,
    memory: Records,
    parameters: Records,
    random: StreamArray,
    serving: IntArray,
) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        passed_ms, is_new = int(step_ms[robot]), bool(new_picture[robot])
        sensors = Sensors(passed_ms, infrared[robot], distance_mm[robot], camera[robot], is_new)
        step(sensors, memory[robot], actuators[robot], parameters[robot], random[robot])  # noqa: F821


class SensorArrays(NamedTuple):
    """What a group of robots senses: the fields of `control.interface.Sensors`, with one row for each robot."""

    step_ms: IntArray
    """(robots,)"""
    infrared: FloatArray
    """(robots, 8)"""
    distance_mm: IntArray
    """(robots, 8)"""
    camera: IntArray
    """(robots, pixels)"""
    new_picture: BoolArray
    """(robots,)"""

    def of(self, rows: slice, pixels: int) -> "SensorArrays":
        """Return views of these rows, those of robots whose cameras have `pixels` pixels."""
        camera = self.camera[rows, :pixels]
        return SensorArrays(
            self.step_ms[rows], self.infrared[rows], self.distance_mm[rows], camera, self.new_picture[rows]
        )


class ControllerRunner:
    """The controllers of one group of robots, with what they remember."""

    memory: Records
    """(robots,) what each robot remembers."""

    def __init__(
        self,
        controller: Controller,
        parameters: Records,
        random: StreamArray,
        senses: SensorArrays,
        actuators: Records,
        interpret: bool = False,
    ) -> None:
        """Start `controller` on each robot.

        Args:
            controller: What runs on the robots.
            parameters: (robots,) its parameters, one record for each robot.
            random: (robots, 4) the robots' streams.
            senses: The arrays that it reads in each step.
            actuators: (robots,) the records that it sets (see `control.interface.ACTUATORS`).
            interpret: Whether it runs as plain Python instead of compiled.

        Raises:
            ControllerError: It cannot be compiled, or the program has set a value in its own import of the file.
            RobotError: Its `start` raises an error.
        """
        check_imported_copies(controller)
        kind: Any = np.recarray if interpret else np.ndarray
        self.memory = np.zeros(len(random), controller.memory).view(kind)
        self._controller = controller
        self._serving = np.zeros(1, np.int64)
        start_all, self._step_all = (_interpreted if interpret else _compiled)(controller)
        own = (self.memory, parameters.view(kind), random, self._serving)
        self._arguments = (*senses, actuators.view(kind), *own)
        if not interpret:  # now: it belongs to no trial's time, and what cannot be compiled is refused before a step
            for loop, arguments in ((start_all, own), (self._step_all, self._arguments)):
                _compile(controller, loop, arguments)
        try:
            start_all(*own)
        except BdbQuit:  # the user has left the debugger
            raise
        except (Exception, SystemExit) as error:  # whatever a user's controller may raise
            raise RobotError(controller, int(self._serving[0]), error) from error

    def step(self) -> None:
        """Run one control step of each robot.

        Raises:
            RobotError: A robot's controller raises an error.
        """
        try:
            self._step_all(*self._arguments)
        except BdbQuit:
            raise
        except (Exception, SystemExit) as error:  # whatever a user's controller may raise
            raise RobotError(self._controller, int(self._serving[0]), error) from error


class RobotError(ControllerError):
    """The controller of a robot has raised an error.

    Attributes:
        robot: The robot's number in its group.
    """

    def __init__(self, controller: Controller, robot: int, error: BaseException) -> None:
        super().__init__(f"{controller.path}: {type(error).__name__}: {error}")
        self.robot = robot


def _bind(start: Any, step: Any) -> tuple[Any, Any]:
    """Return copies of `_start_all` and `_step_all` that call these functions."""
    namespace = {**globals(), "start": start, "step": step}
    return FunctionType(_start_all.__code__, namespace), FunctionType(_step_all.__code__, namespace)


def _interpreted(controller: Controller) -> tuple[Any, Any]:
    """Return the two loops as plain Python; where numpy would only warn of a division by 0 they raise, as compiled."""
    strict = np.errstate(divide="raise", invalid="raise")
    start_all, step_all = _bind(controller.start, controller.step)
    return strict(start_all), strict(step_all)


def _compiled(controller: Controller) -> tuple[Any, Any]:
    """Return the two loops compiled, cached under the sources and the global values that they are made from."""
    values = _frozen_values(controller.modules.values())
    return _compile_loops(controller, digest([_static_digest(controller).encode(), *values]))


@lru_cache
def _static_digest(controller: Controller) -> str:
    """Return the digest of the sources, and of the values in modules that the controller imports from elsewhere."""
    own = controller.modules.values()
    imported = {value: None for module in own for value in vars(module).values() if isinstance(value, ModuleType)}
    return digest([kernel_digest().encode(), *controller.sources.values(), *_frozen_values(imported)])


def _frozen_values(modules: Iterable[ModuleType]) -> list[bytes]:
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
    """Return the defaults of a function, and the values that it has taken from a function around it."""
    cells = [cell.cell_contents for cell in function.__closure__ or () if cell != CellType()]
    return [*(function.__defaults__ or ()), *(function.__kwdefaults__ or {}).values(), *cells]


def _can_be_frozen(value: object) -> bool:
    """Return whether numba copies a global value into compiled code."""
    if isinstance(value, tuple):
        return all(map(_can_be_frozen, value))
    return isinstance(value, bool | int | float | complex | str | bytes | np.ndarray | np.generic)


@lru_cache
def _compile_loops(controller: Controller, contents_digest: str) -> tuple[Any, Any]:
    loops = _bind(*_jitted(controller))
    # nogil: other threads run meanwhile, one of which ends the process if a controller never returns
    return tuple(compile_cached(loop, contents_digest, careful=True, nogil=True) for loop in loops)


def _jitted(controller: Controller) -> tuple[Any, Any]:
    """Return `start` and `step` as numba's dispatchers.

    Each module of the controller gets a twin, in which dispatchers stand in for functions and twins for modules, so
    that the two find compiled helpers under the names that their sources use. The modules themselves do not change.
    """
    twins = {id(vars(module)): ModuleType(module.__name__) for module in controller.modules.values()}
    dispatchers: dict[FunctionType, Any] = {}

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
            dispatchers[value] = numba.njit(boundscheck=True)(copy)
        return dispatchers[value]

    for module in controller.modules.values():
        vars(twins[id(vars(module))]).update({name: twin(value) for name, value in vars(module).items()})
    return twin(controller.start), twin(controller.step)


def _compile(controller: Controller, loop: Any, arguments: tuple[object, ...]) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", numba.core.errors.NumbaWarning)
            loop.compile(tuple(map(numba.typeof, arguments)))
    except Exception as error:  # numba's own errors, and what escapes it
        raise ControllerError(
            f"{controller.path}: cannot be compiled; --interpret runs it as plain Python.\n{_reason(error)}"
        ) from error


INTERNALS = ("During: Pass", "During: lowering", "During: resolving", "raised from")
"""Beginnings of lines in numba's messages that say how it works rather than what is wrong."""


def _reason(error: Exception) -> str:
    """Return the essence of numba's long message: the innermost reason, and its place in the source."""
    _, _, innermost = f"{type(error).__name__}: {error}".rpartition("raised a specific error:")
    lines = [line.strip() for line in innermost.splitlines()]
    kept = [line for line in lines if line and "pipeline" not in line and not line.startswith(INTERNALS)]
    return "\n".join(f"  {line}" for line in kept[:6])
