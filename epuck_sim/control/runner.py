"""Runs a controller for a group of robots: compiled by numba, or interpreted for breakpoints and any library.

Both run the same source, the controller's file and `_step_all` below, with equal results bit for bit.
"""

import warnings
from bdb import BdbQuit
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.compilation import _static_digest, explain_refusal, frozen_values, jit_functions
from epuck_sim.control.error_lines import take_error_place
from epuck_sim.control.firmware import Firmware
from epuck_sim.control.firmware_loop import firmware_loops
from epuck_sim.control.interface import ACTUATORS, EPUCK_WHEELS, Controller, Sensors, Wheels
from epuck_sim.control.loader import check_imported_copies
from epuck_sim.errors import ControllerError
from epuck_sim.util.addresses import compile_at, function_address
from epuck_sim.util.held_values import hold, layout
from epuck_sim.util.jit import bind, digest
from epuck_sim.util.messages import describe_error
from epuck_sim.util.python_files import line_of_error

Records = npt.NDArray[np.void]


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
    pulses: IntArray
    """(robots,)"""
    messages: IntArray
    """(robots, MAX_MESSAGES)"""
    present: BoolArray
    """(robots,) no field of `Sensors`: whether a robot is in the arena; the controllers of others do not run."""

    def of(self, rows: slice, pixels: int) -> "SensorArrays":
        """Return views of these rows, those of robots whose cameras have `pixels` pixels.

        Shorter rows of pixels are an array of their own: compiled code is made for arrays without gaps.
        """
        camera = self.camera[rows]
        if camera.shape[1] != pixels:
            camera = np.zeros((len(camera), pixels), camera.dtype)
        return SensorArrays(
            self.step_ms[rows],
            self.infrared[rows],
            self.distance_mm[rows],
            camera,
            self.new_picture[rows],
            self.pulses[rows],
            self.messages[rows],
            self.present[rows],
        )


class ControllerArrays(NamedTuple):
    """What the controllers of a group of robots work on."""

    senses: SensorArrays
    """What they read."""
    actuators: Records
    """(robots,) records that they set, see `control.interface.ACTUATORS`."""
    memory: Records
    """(robots,) what each robot remembers."""
    parameters: Records
    """(robots,) the controller's parameters."""
    random: StreamArray
    """(robots, 4) the robots' streams."""
    serving: IntArray
    """(1,) the robot whose controller is running, counted in the group; -1 if none is."""
    wheels: Wheels
    """What each robot knows of its wheels."""


if TYPE_CHECKING:  # `bind` provides them
    start: Callable[..., None]
    step: Callable[..., None]
    value_at: Callable[[int], ControllerArrays]


def _start_all(address: int) -> None:
    """Start the controllers of a group."""
    arrays = value_at(address)  # noqa: F821 see `bind`
    for robot in range(len(arrays.memory)):
        arrays.serving[0] = robot
        start(arrays.memory[robot], arrays.parameters[robot], arrays.random[robot])  # noqa: F821
    arrays.serving[0] = -1


def _step_all(address: int) -> None:
    """Run one control step of each robot of a group."""
    arrays = value_at(address)  # noqa: F821 see `bind`
    senses, memory, actuators = arrays.senses, arrays.memory, arrays.actuators
    for robot in range(len(memory)):
        if not senses.present[robot]:
            continue
        arrays.serving[0] = robot
        sensors = Sensors(
            int(senses.step_ms[robot]),
            senses.infrared[robot],
            senses.distance_mm[robot],
            senses.camera[robot],
            bool(senses.new_picture[robot]),
            int(senses.pulses[robot]),
            senses.messages[robot],
            arrays.wheels,
        )
        step(sensors, memory[robot], actuators[robot], arrays.parameters[robot], arrays.random[robot])  # noqa: F821
    arrays.serving[0] = -1


class ControllerRunner:
    """The controllers of one group of robots, with what they remember."""

    controller: Controller
    """What runs on the robots."""
    arrays: ControllerArrays
    """What the controllers work on."""
    step_all: Callable[[int], None]
    """Runs one control step of each robot; takes `address`. Compiled, unless controllers are interpreted."""
    address: int
    """Address of `arrays` in compiled code; 0 if controllers are interpreted."""

    def __init__(
        self,
        controller: Controller,
        parameters: Records,
        random: StreamArray,
        senses: SensorArrays,
        actuators: Records,
        interpret: bool = False,
        wheels: Wheels = EPUCK_WHEELS,
    ) -> None:
        """Prepare `controller` for each robot, without starting it.

        Args:
            controller: What runs on the robots.
            parameters: (robots,) its parameters, one record for each robot.
            random: (robots, 4) the robots' streams.
            senses: The arrays that it reads in each step.
            actuators: (robots,) the records that it sets (see `control.interface.ACTUATORS`).
            interpret: Whether it runs as plain Python instead of compiled.
            wheels: The robots' wheels.

        Raises:
            ControllerError: It cannot be compiled, or the program has set a value in its own import of the file.
        """
        check_imported_copies(controller)
        kind: Any = np.recarray if interpret else np.ndarray
        self.controller = controller
        self.arrays = arrays = ControllerArrays(
            senses=senses,
            actuators=actuators.view(kind),
            memory=np.zeros(len(random), controller.memory).view(kind),
            parameters=parameters.view(kind),
            random=random,
            serving=np.full(1, -1),
            wheels=wheels,
        )
        # compiled now: it belongs to no trial's time, and what cannot be compiled is refused before a step
        if isinstance(controller, Firmware):
            self._start_all, self.step_all, self.address, self._owners = firmware_loops(
                controller, arrays, interpret=interpret
            )
        elif interpret:
            self._start_all, self.step_all = _interpreted_loops(controller, arrays)
            self.address = 0
        else:
            self._start_all, self.step_all = compile_loops(controller, (_start_all, _step_all), arrays)
            owner, self.address = hold(arrays)
            self._owners = (owner,)

    @property
    def memory(self) -> Records:
        """(robots,) what each robot remembers."""
        return self.arrays.memory

    @property
    def step_address(self) -> int:
        """Address of `step_all` in compiled code."""
        return function_address(self.step_all)

    def start(self) -> None:
        """Start the controller of each robot, which remembers and commands nothing yet.

        Raises:
            RobotError: A robot's controller raises an error.
        """
        self.memory.view(np.ndarray)[:] = np.zeros(1, self.memory.dtype)
        self.arrays.actuators.view(np.ndarray)[:] = np.zeros(1, ACTUATORS)
        self._run(self._start_all)

    def step(self) -> None:
        """Run one control step of each robot.

        Raises:
            RobotError: A robot's controller raises an error.
        """
        self._run(self.step_all)

    def _run(self, loop: Callable[[int], None]) -> None:
        try:
            loop(self.address)
        except BaseException as error:  # whatever a user's controller may raise
            if fault := self.fault(error):
                raise fault from error
            raise

    def fault(self, error: BaseException) -> "RobotError | None":
        """Return what to say of an error that a robot of this group has raised; None if none of them did."""
        robot = int(self.arrays.serving[0])
        if robot < 0 or isinstance(error, BdbQuit | KeyboardInterrupt):  # the debugger was left, or Ctrl-C pressed
            return None
        return RobotError(self.controller, robot, error, self._place_of(error))

    def _place_of(self, error: BaseException) -> str:
        """Return FILE:LINE of an error that a robot has raised, or its controller's file."""
        sources = self.controller.sources
        if self.address == 0:
            return line_of_error(error, sources) or str(self.controller.path)
        place = take_error_place()
        return f"{list(sources)[place.file]}:{place.line}" if place else str(self.controller.path)


def compile_loops(controller: Controller, loops: tuple[Any, ...], arrays: object) -> Any:
    """Return functions compiled that call the controller's `start` and `step`.

    They are cached under the sources and the global values that they are made from.

    Args:
        controller: The controller.
        loops: Functions of the address of `arrays`, see `util.addresses.compile_at`.
        arrays: What they work on.

    Raises:
        ControllerError: The controller cannot be compiled.
    """
    contents_digest = digest([_static_digest(controller).encode(), *frozen_values(controller.modules.values())])
    key = controller, contents_digest, loops, layout(arrays)
    if key not in _compiled:
        start, step = jit_functions((controller.start, controller.step), controller.modules, contents_digest)
        bound = [bind(loop, start=start, step=step) for loop in loops]
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", numba.core.errors.NumbaWarning)
                _compiled[key] = tuple(compile_at(loop, arrays, contents_digest, careful=True) for loop in bound)
        except Exception as error:  # numba's own errors, and what escapes it
            message = explain_refusal(
                error, controller.path, controller.sources, "; --interpret runs it as plain Python"
            )
            raise ControllerError(message) from error
    return _compiled[key]


_compiled: dict[Any, Any] = {}


def _interpreted_loops(controller: Controller, arrays: ControllerArrays) -> tuple[Any, Any]:
    """Return `_start_all` and `_step_all` as plain Python.

    They raise where numpy would only warn of a division by 0, as compiled code does.
    """
    strict = np.errstate(divide="raise", invalid="raise")
    names: dict[str, Any] = {"start": controller.start, "step": controller.step, "value_at": lambda _: arrays}
    return strict(bind(_start_all, **names)), strict(bind(_step_all, **names))


class RobotError(ControllerError):
    """The controller of a robot has raised an error.

    Attributes:
        robot: The robot's number in its group.
    """

    def __init__(self, controller: Controller, robot: int, error: BaseException, place: str) -> None:
        inside = "" if place.startswith(str(controller.path)) else f" (in the controller {controller.path})"
        super().__init__(f"{place}: {describe_error(error)}{inside}")
        self.robot = robot
