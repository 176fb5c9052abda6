"""Runs a controller for a group of robots: compiled by numba, or interpreted for breakpoints and any library.

Both run the same source, the controller's file and `_step_all` below, with equal results bit for bit.
"""

import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt
from numba.extending import register_jitable

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import Controller, Sensors
from epuck_sim.errors import ControllerError
from epuck_sim.util.jit import compile_cached, digest, kernel_digest

Records = npt.NDArray[np.void]

CONSTANTS = (bool, int, float, complex, str, bytes, tuple, np.ndarray, np.generic)
"""Types of global values that numba freezes into compiled code."""

if TYPE_CHECKING:  # bound to a controller's own by `_bound`
    start: Callable[..., None]
    step: Callable[..., None]


def _start_all(memory: Records, parameters: Records, random: StreamArray, serving: IntArray) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        start(memory[robot], parameters[robot], random[robot])  # noqa: F821 see `_bound`


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
    """What a group of robots senses: `controller.Sensors`, with a row a robot."""

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
        """Return what some of the robots sense, those whose cameras have so many pixels."""
        camera = self.camera[rows, :pixels]
        return SensorArrays(
            self.step_ms[rows], self.infrared[rows], self.distance_mm[rows], camera, self.new_picture[rows]
        )


class ControllerRunner:
    """The controllers of one group of robots: what they remember, and what they command."""

    memory: Records
    """(robots,) what each remembers."""

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

        parameters: (robots,) records; random: (robots, 4) the robots' streams; senses: the arrays that it reads;
        actuators: (robots,) records that it sets, see `controller.ACTUATORS`.
        Raises ControllerError where it cannot be compiled, RobotError where it raises in `start`.
        """
        kind: Any = np.recarray if interpret else np.ndarray
        self.memory = np.zeros(len(random), controller.memory).view(kind)
        self._controller = controller
        self._serving = np.zeros(1, np.int64)
        begin, self._serve = (_interpreted if interpret else _compiled)(controller)
        own = (self.memory, parameters.view(kind), random, self._serving)
        self._arguments = (*senses, actuators.view(kind), *own)
        if not interpret:  # now, so that it is no trial's time, and a controller that cannot be compiled is refused
            for loop, arguments in ((begin, own), (self._serve, self._arguments)):
                _compile(controller, loop, arguments)
        try:
            begin(*own)
        except (Exception, SystemExit) as error:  # whatever a user's controller may raise
            raise RobotError(controller, int(self._serving[0]), error) from error

    def step(self) -> None:
        """Serve each robot once; raises RobotError where a robot's controller raises."""
        try:
            self._serve(*self._arguments)
        except (Exception, SystemExit) as error:  # whatever a user's controller may raise
            raise RobotError(self._controller, int(self._serving[0]), error) from error


class RobotError(ControllerError):
    """A controller raised while it served the robot number `robot` of its group."""

    def __init__(self, controller: Controller, robot: int, error: BaseException) -> None:
        super().__init__(f"{controller.path}: {type(error).__name__}: {error}")
        self.robot = robot


def _bound(controller: Controller) -> tuple[Any, Any]:
    """Return `_start_all` and `_step_all` that call the controller's `start` and `step`."""
    own = {**globals(), "start": controller.start, "step": controller.step}
    return FunctionType(_start_all.__code__, own), FunctionType(_step_all.__code__, own)


def _interpreted(controller: Controller) -> tuple[Any, Any]:
    """Return `_bound`'s functions; where numpy would only warn of a division by 0 they raise, as compiled code does."""
    strict = np.errstate(divide="raise", invalid="raise")
    begin, serve = _bound(controller)
    return strict(begin), strict(serve)


@lru_cache
def _compiled(controller: Controller) -> tuple[Any, Any]:
    """Return `_bound`'s functions compiled, cached under all that they are made of: sources, and values they name."""
    functions = _callees(controller.start, controller.sources) | _callees(controller.step, controller.sources)
    contents = [kernel_digest().encode(), *controller.sources.values()]
    for function in sorted(functions, key=lambda function: (function.__code__.co_filename, function.__qualname__)):
        # numba's cache imports the module that a function names; a controller's own is not importable
        function.__module__ = __name__
        register_jitable(boundscheck=True)(function)
        contents += [pickle.dumps(value) for value in _named(function) if isinstance(value, CONSTANTS)]
    begin, serve = _bound(controller)
    return tuple(compile_cached(loop, digest(contents), careful=True) for loop in (begin, serve))


def _compile(controller: Controller, loop: Any, arguments: tuple[object, ...]) -> None:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", numba.core.errors.NumbaWarning)
            loop.compile(tuple(map(numba.typeof, arguments)))
    except Exception as error:  # numba's own errors, and what escapes it
        raise ControllerError(
            f"{controller.path}: cannot be compiled; --interpret runs it as plain Python.\n{_reason(error)}"
        ) from error


DETAILS = ("During: Pass", "During: lowering", "During: resolving", "raised from")
"""Lines of numba's that tell how it works rather than what is wrong."""


def _reason(error: Exception) -> str:
    """Return what numba's long story comes to: the innermost reason, and where in the source it lies."""
    _, _, innermost = f"{type(error).__name__}: {error}".rpartition("raised a specific error:")
    lines = [line.strip() for line in innermost.splitlines()]
    told = [line for line in lines if line and "pipeline" not in line and not line.startswith(DETAILS)]
    return "\n".join(f"  {line}" for line in told[:6])


def _callees(function: Any, sources: Mapping[Path, bytes]) -> set[FunctionType]:
    """Return `function` and every plain function from `sources` that it names, directly or not."""
    found: set[FunctionType] = set()
    waiting = [function]
    while waiting:
        candidate = waiting.pop()
        if not isinstance(candidate, FunctionType) or candidate in found:
            continue
        if Path(candidate.__code__.co_filename) not in sources:
            continue
        found.add(candidate)
        waiting.extend(_named(candidate))
    return found


def _named(function: FunctionType) -> Iterator[object]:
    """Yield what the names in a function's code stand for: globals, and attributes of global modules."""
    names = list(_names(function.__code__))
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    yield from values
    for module in values:
        if isinstance(module, ModuleType):
            yield from (vars(module)[name] for name in names if name in vars(module))


def _names(code: CodeType) -> Iterator[str]:
    """Yield the names in a function's code, and in the functions, lambdas and comprehensions inside it."""
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _names(constant)
