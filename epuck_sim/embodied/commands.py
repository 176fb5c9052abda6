"""Commands from outside: what robots do whose wheels or rings are not their controller's (`Controller.external`)."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.control_loop import ControlLoop, run_calls
from epuck_sim.embodied.differential_drive import apply_commands
from epuck_sim.embodied.group import RobotGroupState
from epuck_sim.embodied.loop_runners import InterpretedLoop
from epuck_sim.embodied.swarm_arrays import NOISE_STEPS
from epuck_sim.util.addresses import compiled_for
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import bind


class CommandArrays(NamedTuple):
    """What is commanded from outside, and the loop in which robots do so."""

    loop: ControlLoop
    wheel_robots: IntArray
    """(n,) numbers of the robots whose wheels are commanded."""
    wheels_cm_s: FloatArray
    """(n, 2) cm/s: left and right wheel of each."""
    ring_robots: IntArray
    """(m,) numbers of the robots whose rings are commanded."""
    rings: BoolArray
    """(m,) whether the ring of each is to be lit."""


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], CommandArrays]


def _carry_out(address: int) -> None:
    """Have robots do what is commanded, from the last control step on: as if their controllers had done so in it."""
    commands = value_at(address)  # noqa: F821 see `bind`
    drive = commands.loop.drive
    for index in range(len(commands.wheel_robots)):
        actuators = drive.actuators[commands.wheel_robots[index]]
        actuators.left_cm_s = commands.wheels_cm_s[index, 0]
        actuators.right_cm_s = commands.wheels_cm_s[index, 1]
    for index in range(len(commands.ring_robots)):
        drive.actuators[commands.ring_robots[index]].ring_on = commands.rings[index]
    step = commands.loop.step[0]
    if step >= 0:  # before, nobody can act
        apply_commands(
            drive.actuators,
            drive.wheels_cm_s,
            drive.ring_commands,
            drive.turns_rad,
            commands.loop.bodies.poses,
            drive.wheel_gain,
            drive.slip,
            drive.step_s,
            commands.loop.bodies.velocities,
            drive.wheel_noise,
            step % NOISE_STEPS,
            drive.wheels,
        )
        run_calls(commands.loop.late_calls)


class Commands:
    """The commands from outside to the robots of one simulation."""

    arrays: CommandArrays

    def __init__(
        self, loop: ControlLoop, groups: Sequence[RobotGroupState], interpreted: InterpretedLoop | None
    ) -> None:
        """Find the robots that are commanded from outside; interpreted: the loop, if it runs as plain Python."""
        wheel_robots, ring_robots = (_external_robots(groups, part) for part in ("wheels", "ring"))
        kind: Any = np.recarray if interpreted else np.ndarray
        drive = loop.drive._replace(actuators=loop.drive.actuators.view(kind))
        self.arrays = CommandArrays(
            loop=loop._replace(drive=drive),
            wheel_robots=wheel_robots,
            wheels_cm_s=np.zeros((len(wheel_robots), 2)),
            ring_robots=ring_robots,
            rings=np.zeros(len(ring_robots), np.bool_),
        )
        if interpreted:
            names: dict[str, Any] = {"value_at": lambda _: self.arrays, "run_calls": interpreted.run_calls}
            self.carry_out = partial(bind(_carry_out, **names), 0)
        elif len(wheel_robots) or len(ring_robots):
            self._owner, address = hold(self.arrays)
            self.carry_out = partial(compiled_for(_carry_out, self.arrays), address)

    def set(
        self, left_cm_s: npt.ArrayLike | None, right_cm_s: npt.ArrayLike | None, ring_on: npt.ArrayLike | None
    ) -> None:
        """Check commands, and write those that are given; see `Simulation.command`."""
        arrays = self.arrays
        left = None if left_cm_s is None else _speeds("left_cm_s", left_cm_s, arrays.wheel_robots)
        right = None if right_cm_s is None else _speeds("right_cm_s", right_cm_s, arrays.wheel_robots)
        rings = None if ring_on is None else _rings(ring_on, arrays.ring_robots)
        if left is not None:
            arrays.wheels_cm_s[:, 0] = left
        if right is not None:
            arrays.wheels_cm_s[:, 1] = right
        if rings is not None:
            arrays.rings[:] = rings

    def restart(self) -> None:
        """Set all commands to standstill in the dark, as before the first step."""
        self.arrays.wheels_cm_s[:] = 0.0
        self.arrays.rings[:] = False


def _external_robots(groups: Sequence[RobotGroupState], part: str) -> IntArray:
    """Return the numbers of the robots whose wheels, or whose rings, are commanded from outside."""
    robots = [np.arange(group.robots.start, group.robots.stop) for group in groups if part in group.controller.external]
    return np.concatenate([np.empty(0, np.int64), *robots])


def _speeds(name: str, given: npt.ArrayLike, robots: IntArray) -> FloatArray:
    """Return the speeds that are given, one for each robot, or one for all."""
    speeds = _fitting(name, given, robots, "wheels")
    if speeds.dtype.kind not in "iuf":
        raise ValueError(f"{name} is of type {speeds.dtype}; allowed: numbers, in cm/s")
    if np.isnan(speeds).any():
        robot = robots[np.isnan(np.broadcast_to(speeds, robots.shape)).argmax()]
        raise ValueError(f"{name}: the speed of robot {robot} is not a number")
    return speeds


def _rings(given: npt.ArrayLike, robots: IntArray) -> npt.NDArray[Any]:
    """Return whether rings are to be lit, one for each robot, or one for all."""
    rings = _fitting("ring_on", given, robots, "ring")
    if rings.dtype != np.bool_ and not np.isin(rings, (0, 1)).all():
        raise ValueError(f"ring_on holds {rings[~np.isin(rings, (0, 1))].flat[0]}; allowed: true and false, or 1 and 0")
    return rings


def _fitting(name: str, given: npt.ArrayLike, robots: IntArray, part: str) -> npt.NDArray[Any]:
    """Return an array that has one value for each of these robots, or one for all."""
    values = np.asarray(given)
    if not len(robots):
        raise ValueError(
            f"{name} is given, but no robot has its {part} commanded from outside; give a group `controller: external`"
            f"{', external_wheels' if part == 'wheels' else ', external_ring'} or a file with EXTERNAL = ({part!r},)"
        )
    if values.shape not in ((), robots.shape):
        raise ValueError(
            f"{name} has the shape {values.shape}; allowed: {robots.shape}, one value for each robot whose {part} is "
            "commanded from outside, or a single one for all"
        )
    return values
