"""Users' code that runs on robots, controllers and sensors: as plain Python, and what is said of its errors.

Compiled code does not know the line at which it has raised. What has failed runs again as plain Python, which does.
"""

import sys
from abc import ABC, abstractmethod
from bdb import BdbQuit
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.compilation import compile_for
from epuck_sim.control.interface import Described, Sensor
from epuck_sim.control.loader import check_imported_copies
from epuck_sim.embodied.swarm import Swarm, open_block
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import line_of_error
from epuck_sim.util.jit import bind
from epuck_sim.util.messages import describe_error
from epuck_sim.util.native import function_address

AGAIN_S = 1.0
"""Time for which what has failed runs again, to find the line; compiled, it may have run through a long loop."""


class RobotError(ControllerError):
    """The controller of a robot, or a sensor in a file of its own, has raised an error.

    Attributes:
        robot: The robot's number.
    """

    def __init__(self, user: Described, robot: int, error: BaseException, place: str) -> None:
        kind = "sensor" if isinstance(user, Sensor) else "controller"
        inside = "" if place.startswith(str(user.path)) else f" (in the {kind} {user.path})"
        super().__init__(f"{place}: {describe_error(error)}{inside}")
        self.robot = robot


class UserCode(ABC):
    """A user's code on robots of a block, which must stay where it is: the controllers of a group, or a sensor."""

    robots: slice
    """Numbers of the robots."""
    run: Callable[[ByteArray, IntArray, int], None]
    """Runs it on each of them; takes the block, the addresses and its number. Compiled, unless it is interpreted."""
    address: int
    """Address of `run` in this process; 0 if it is interpreted."""
    _is_compiled = False

    def __init__(self, user: Described, block: ByteArray, swarm: Swarm, number: int, record: Any) -> None:
        """Find the robots of a user's code by its GROUP or SENSE, of this number, in a block."""
        check_imported_copies(user)
        self._user, self._block, self._swarm, self._number = user, block, swarm, number
        self._scene = swarm.scene[0]
        self.robots = slice(int(record.first), int(record.first + record.count))

    def _make_run(self, function: Any, names: Mapping[str, Any], contents: str = "", *, interpret: bool) -> None:
        """Make `run` of a function, see `compile_for`; now, as it belongs to no trial's time."""
        self._function, self._names, self._is_compiled = function, names, not interpret
        if interpret:
            self.run, self.address = self._interpreted(self._swarm), 0
        else:
            self.run = compile_for(self._user, function, names, contents)
            self.address = function_address(self.run)

    def _interpreted(self, swarm: Swarm) -> Any:
        """Return the function as plain Python, which raises where compiled code does: at 1 / 0."""
        known = {"swarm_at": lambda _: swarm, "array_at": view_at}
        kernels = {
            name: bind(each.function, **known) for name, each in self._names.items() if hasattr(each, "function")
        }
        return np.errstate(divide="raise", invalid="raise")(bind(self._function, **known, **{**self._names, **kernels}))

    @abstractmethod
    def _is_at_work(self) -> bool: ...

    @abstractmethod
    def _undo(self, block: ByteArray, swarm: Swarm, robot: int) -> None:
        """Set back what it has changed of the robot that it works on."""

    def _without_line(self, error: BaseException, robot: int) -> tuple[str, BaseException]:  # noqa: ARG002
        """Return the place of an error that is not met again, and the error."""
        return str(self._user.path), error

    def fault(self, error: BaseException) -> RobotError | None:
        """Return what to say of an error that this code has raised on a robot; None if it did not."""
        if not self._is_at_work() or isinstance(error, BdbQuit | KeyboardInterrupt):  # the debugger was left, or Ctrl-C
            return None
        robot = int(self._scene.serving)
        place = self._line_again(error, robot) if self._is_compiled else line_of_error(error, self._user.sources)
        if place is None:
            place, error = self._without_line(error, robot)
        self._scene.serving, self._scene.sensing = -1, 0
        return RobotError(self._user, robot, error, place)

    def _line_again(self, error: BaseException, robot: int) -> str | None:
        """Return FILE:LINE of an error by running what failed again in plain Python; None if it does not fail so."""
        expected = ArithmeticError if isinstance(error, ArithmeticError) else type(error)  # numpy's of 1 / 0 is its own
        block = self._block.copy()
        swarm = open_block(block)
        self._undo(block, swarm, robot)
        others = np.arange(len(swarm.robots)) != robot
        swarm.robots.present[others] = swarm.robots.starts[others] = False
        again = self._interpreted(swarm)
        try:
            with _time_limit(AGAIN_S):
                again(block, np.zeros(0, np.int64), self._number)
        except KeyboardInterrupt:
            raise
        except BaseException as second:
            if isinstance(second, expected):
                return line_of_error(second, self._user.sources)
        return None


def view_at(block: Any, first: int, end: int, dtype: np.dtype[Any]) -> Any:
    """Do what `native.array_at` does, in plain Python."""
    return block[first:end].view(dtype).view(np.recarray)


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    end_s, before = perf_counter() + seconds, sys.gettrace()

    def trace(*_: object) -> Any:
        if perf_counter() > end_s:
            raise TimeoutError
        return trace

    sys.settrace(trace)
    try:
        yield
    finally:
        sys.settrace(before)
