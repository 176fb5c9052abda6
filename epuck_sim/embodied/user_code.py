"""Users' code that runs on robots, controllers and sensors: as plain Python, and what is said of its errors.

Compiled code does not know the line at which it has raised. What has failed runs again as plain Python, which does.
"""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from time import perf_counter
from typing import Any

import numpy as np

from epuck_sim.control.interface import Described, Sensor
from epuck_sim.embodied.swarm import Swarm
from epuck_sim.errors import ControllerError
from epuck_sim.user_files import line_of_error
from epuck_sim.util.jit import bind
from epuck_sim.util.messages import describe_error

AGAIN_S = 1.0
"""Time for which what has failed runs again, to find the line; compiled, it may have run through a long loop."""


class RobotError(ControllerError):
    """The controller of a robot, or a sensor in a file of its own, has raised an error.

    Attributes:
        robot: The robot's number, in its group for a controller.
    """

    def __init__(self, user: Described, robot: int, error: BaseException, place: str) -> None:
        kind = "sensor" if isinstance(user, Sensor) else "controller"
        inside = "" if place.startswith(str(user.path)) else f" (in the {kind} {user.path})"
        super().__init__(f"{place}: {describe_error(error)}{inside}")
        self.robot = robot


def as_python(function: Any, swarm: Swarm, names: dict[str, Any]) -> Any:
    """Return a function (block, addresses, number) as plain Python that works on a swarm.

    It raises where compiled code does and numpy would warn: at 1 / 0.

    Args:
        function: The function.
        swarm: The swarm.
        names: What further global names of the function stand for.
    """
    bound = bind(function, swarm_at=lambda _: swarm, array_at=view_at, **names)
    return np.errstate(divide="raise", invalid="raise")(bound)


def view_at(block: Any, first: int, end: int, dtype: np.dtype[Any]) -> Any:
    """Do what `native.array_at` does, in plain Python."""
    return block[first:end].view(dtype).view(np.recarray)


def line_again(run: Callable[[], object], error: BaseException, user: Described) -> str | None:
    """Return FILE:LINE of an error in a user's code by running what has failed again; None if it does not fail so.

    Args:
        run: Runs it in plain Python, on a copy of the swarm.
        error: The error.
        user: What has raised it.
    """
    expected = ArithmeticError if isinstance(error, ArithmeticError) else type(error)  # numpy's of 1 / 0 is its own
    try:
        with _time_limit(AGAIN_S):
            run()
    except KeyboardInterrupt:
        raise
    except BaseException as second:
        if isinstance(second, expected):
            return line_of_error(second, user.sources)
    return None


@contextmanager
def _time_limit(seconds: float) -> Iterator[None]:
    """Raise TimeoutError in Python code that takes longer."""
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
