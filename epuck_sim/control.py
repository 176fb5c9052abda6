"""Runs a controller for a group of robots: compiled by numba, or interpreted for breakpoints and any library.

Both run the same source, the controller's file and `_serve` below, with equal results bit for bit.
"""

from collections.abc import Callable, Iterator
from functools import lru_cache
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from numba.extending import register_jitable

from epuck_sim.compiled import compile_cached, digest, package_digest
from epuck_sim.controller import ACTUATORS, Controller, Sensors
from epuck_sim.errors import ControllerError

Records = npt.NDArray[np.void]

# bound to a controller's own by `_bound`
start: Callable[..., None]
step: Callable[..., None]


def _begin(memory: Records, parameters: Records, random: npt.NDArray[np.uint64], serving: npt.NDArray[np.int64]) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        start(memory[robot], parameters[robot], random[robot])


def _serve(
    step_ms: int,
    infrared: npt.NDArray[np.float64],
    distance_mm: npt.NDArray[np.int64],
    camera: npt.NDArray[np.uint8],
    memory: Records,
    actuators: Records,
    parameters: Records,
    random: npt.NDArray[np.uint64],
    serving: npt.NDArray[np.int64],
) -> None:
    for robot in range(len(memory)):
        serving[0] = robot
        sensors = Sensors(step_ms, infrared[robot], distance_mm[robot], camera[robot])
        step(sensors, memory[robot], actuators[robot], parameters[robot], random[robot])


class Control:
    """The controllers of one group of robots: what they remember, and what they command."""

    memory: Records
    """(robots,) what each remembers."""
    actuators: Records
    """(robots,) what each commands; see `controller.ACTUATORS`."""

    def __init__(
        self,
        controller: Controller,
        parameters: Records,
        random: npt.NDArray[np.uint64],
        interpret: bool = False,
    ) -> None:
        """Start `controller` on each robot.

        parameters: (robots,) records; random: (robots, 4) the robots' streams.
        Raises ControllerError where it cannot be compiled, or raises in `start`.
        """
        self.controller = controller
        self.interpret = interpret
        robots = len(random)
        kind: Any = np.recarray if interpret else np.ndarray
        self.memory = np.zeros(robots, controller.memory).view(kind)
        self.actuators = np.zeros(robots, ACTUATORS).view(kind)
        self._parameters = parameters.view(kind)
        self._random = random
        self._serving = np.zeros(1, np.int64)
        begin, self._serve = (_bound if interpret else _compiled)(controller)
        self._run(begin, self.memory, self._parameters, random, self._serving)

    def step(
        self,
        step_ms: int,
        infrared: npt.NDArray[np.float64],
        distance_mm: npt.NDArray[np.int64],
        camera: npt.NDArray[np.uint8],
    ) -> None:
        """Serve each robot once; see `controller.Sensors` for the arrays, which have a row a robot here."""
        self._run(
            self._serve,
            step_ms,
            infrared,
            distance_mm,
            camera,
            self.memory,
            self.actuators,
            self._parameters,
            self._random,
            self._serving,
        )

    def _run(self, function: Callable[..., None], *arguments: object) -> None:
        try:
            if self.interpret:  # numpy would only warn where compiled code raises
                with np.errstate(divide="raise", invalid="raise"):
                    function(*arguments)
            else:
                function(*arguments)
        except numba.core.errors.NumbaError as error:
            reason = str(error).strip()
            raise ControllerError(
                f"{self.controller.path}: cannot be compiled; --interpret runs it as plain Python.\n{reason}"
            ) from error
        except Exception as error:  # whatever a user's controller may raise
            raise RobotError(self.controller, int(self._serving[0]), error) from error


class RobotError(ControllerError):
    """A controller raised while it served the robot number `robot` of its group."""

    def __init__(self, controller: Controller, robot: int, error: Exception) -> None:
        super().__init__(f"{controller.path}: {type(error).__name__}: {error}")
        self.robot = robot


def _bound(controller: Controller) -> tuple[Any, Any]:
    """Return `_begin` and `_serve` that call the controller's `start` and `step`."""
    own = {"start": controller.start, "step": controller.step}
    return tuple(
        FunctionType(loop.__code__, {**globals(), **own}, loop.__name__) for loop in (_begin, _serve)
    )


@lru_cache
def _compiled(controller: Controller) -> tuple[Any, Any]:
    """Return `_bound`'s functions compiled, cached under the contents of all files that they come from."""
    for function in _callees(controller.start, controller.sources) | _callees(controller.step, controller.sources):
        register_jitable(function)
    sources = f"{package_digest()}-{digest(controller.sources)}"
    return tuple(compile_cached(loop, sources) for loop in _bound(controller))


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
