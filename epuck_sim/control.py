"""Runs a controller for a group of robots: compiled by numba, or interpreted for breakpoints and any library.

Both run the same source, the controller's file and `_serve` below, with equal results bit for bit.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt
from numba.extending import register_jitable

from epuck_sim.compiled import compile_cached, digest, package_digest
from epuck_sim.controller import Controller, Sensors
from epuck_sim.errors import ControllerError

Records = npt.NDArray[np.void]

if TYPE_CHECKING:  # bound to a controller's own by `_bound`
    start: Callable[..., None]
    step: Callable[..., None]


def _begin(
    memory: Records, parameters: Records, random: npt.NDArray[np.uint64], serving: npt.NDArray[np.int64]
) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        start(memory[robot], parameters[robot], random[robot])  # noqa: F821 see `_bound`


def _serve(
    step_ms: int,
    infrared: npt.NDArray[np.float64],
    distance_mm: npt.NDArray[np.int64],
    camera: npt.NDArray[np.uint8],
    actuators: Records,
    memory: Records,
    parameters: Records,
    random: npt.NDArray[np.uint64],
    serving: npt.NDArray[np.int64],
) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        sensors = Sensors(step_ms, infrared[robot], distance_mm[robot], camera[robot])
        step(sensors, memory[robot], actuators[robot], parameters[robot], random[robot])  # noqa: F821


class Senses(NamedTuple):
    """What a group of robots senses: `controller.Sensors`, with a row a robot."""

    step_ms: int
    infrared: npt.NDArray[np.float64]
    """(robots, 8)"""
    distance_mm: npt.NDArray[np.int64]
    """(robots, 8)"""
    camera: npt.NDArray[np.uint8]
    """(robots, pixels)"""


class Control:
    """The controllers of one group of robots: what they remember, and what they command."""

    memory: Records
    """(robots,) what each remembers."""

    def __init__(
        self,
        controller: Controller,
        parameters: Records,
        random: npt.NDArray[np.uint64],
        senses: Senses,
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
        try:
            if not interpret:  # now, so that it is no trial's time, and a controller that cannot be is refused
                self._serve.compile(tuple(map(numba.typeof, self._arguments)))
            begin(*own)
        except Exception as error:  # whatever a user's controller may raise
            raise self._explained(error) from error

    def step(self) -> None:
        """Serve each robot once; raises RobotError where a robot's controller raises."""
        try:
            self._serve(*self._arguments)
        except Exception as error:  # whatever a user's controller may raise
            raise self._explained(error) from error

    def _explained(self, error: Exception) -> ControllerError:
        if isinstance(error, numba.core.errors.NumbaError):
            return ControllerError(
                f"{self._controller.path}: cannot be compiled; --interpret runs it as plain Python.\n{error}"
            )
        return RobotError(self._controller, int(self._serving[0]), error)


class RobotError(ControllerError):
    """A controller raised while it served the robot number `robot` of its group."""

    def __init__(self, controller: Controller, robot: int, error: Exception) -> None:
        super().__init__(f"{controller.path}: {type(error).__name__}: {error}")
        self.robot = robot


def _bound(controller: Controller) -> tuple[Any, Any]:
    """Return `_begin` and `_serve` that call the controller's `start` and `step`."""
    own = {**globals(), "start": controller.start, "step": controller.step}
    return FunctionType(_begin.__code__, own), FunctionType(_serve.__code__, own)


def _interpreted(controller: Controller) -> tuple[Any, Any]:
    """Return `_bound`'s functions; where numpy would only warn of a division by 0 they raise, as compiled code does."""
    strict = np.errstate(divide="raise", invalid="raise")
    begin, serve = _bound(controller)
    return strict(begin), strict(serve)


@lru_cache
def _compiled(controller: Controller) -> tuple[Any, Any]:
    """Return `_bound`'s functions compiled, cached under the contents of all files that they come from."""
    for function in _callees(controller.start, controller.sources) | _callees(controller.step, controller.sources):
        # numba's cache imports the module that a function names; a controller's own is not importable
        function.__module__ = __name__
        register_jitable(function)
    sources = f"{package_digest()}-{digest(controller.sources)}"
    begin, serve = _bound(controller)
    return compile_cached(begin, sources), compile_cached(serve, sources)


def _callees(function: Any, sources: tuple[Path, ...]) -> set[FunctionType]:
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
    names = function.__code__.co_names
    values = [function.__globals__[name] for name in names if name in function.__globals__]
    yield from values
    for module in values:
        if isinstance(module, ModuleType):
            yield from (vars(module)[name] for name in names if name in vars(module))
