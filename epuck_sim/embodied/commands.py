"""Commands from outside: what robots do whose wheels or rings are not their controller's (`Controller.external`)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray
from epuck_sim.control.interface import Controller
from epuck_sim.embodied.loop import act_again
from epuck_sim.embodied.swarm import swarm_at
from epuck_sim.util.jit import jit_no_alloc


@jit_no_alloc
def _carry_out(
    block: ByteArray,
    addresses: IntArray,
    wheel_robots: IntArray,
    wheels_cm_s: FloatArray,
    ring_robots: IntArray,
    rings: BoolArray,
) -> None:
    """Have robots do what is commanded, from the last control step on: as if their controllers had done so in it."""
    robots = swarm_at(block).robots
    for index in range(len(wheel_robots)):
        actuators = robots[wheel_robots[index]].actuators
        actuators.left_cm_s, actuators.right_cm_s = wheels_cm_s[index, 0], wheels_cm_s[index, 1]
    for index in range(len(ring_robots)):
        robots[ring_robots[index]].actuators.ring_on = rings[index]
    act_again(block, addresses)


class Commands:
    """The commands from outside to the robots of one simulation."""

    wheel_robots: IntArray
    """(n,) numbers of the robots whose wheels are commanded."""
    wheels_cm_s: FloatArray
    """(n, 2) cm/s: left and right wheel of each."""
    ring_robots: IntArray
    """(m,) numbers of the robots whose rings are commanded."""
    rings: BoolArray
    """(m,) whether the ring of each is to be lit."""

    def __init__(
        self, controllers: Sequence[Controller], counts: Sequence[int], block: ByteArray, addresses: IntArray
    ) -> None:
        """Find the robots that are commanded from outside, in groups with these controllers and numbers of robots."""
        self._block, self._addresses = block, addresses
        self.wheel_robots, self.ring_robots = (
            np.flatnonzero(np.repeat([part in each.external for each in controllers], counts))
            for part in ("wheels", "ring")
        )
        self.wheels_cm_s = np.zeros((len(self.wheel_robots), 2))
        self.rings = np.zeros(len(self.ring_robots), np.bool_)

    def carry_out(self) -> None:
        """Have robots do what is commanded now, see `Simulation.command`."""
        _carry_out(self._block, self._addresses, self.wheel_robots, self.wheels_cm_s, self.ring_robots, self.rings)

    def set(
        self, left_cm_s: npt.ArrayLike | None, right_cm_s: npt.ArrayLike | None, ring_on: npt.ArrayLike | None
    ) -> None:
        """Check commands, and write those that are given; see `Simulation.command`."""
        if left_cm_s is None and right_cm_s is None and ring_on is None:
            raise ValueError("nothing is commanded; give left_cm_s, right_cm_s or ring_on")
        given = (
            ("left_cm_s", left_cm_s, self.wheel_robots, self.wheels_cm_s[:, 0]),
            ("right_cm_s", right_cm_s, self.wheel_robots, self.wheels_cm_s[:, 1]),
            ("ring_on", ring_on, self.ring_robots, self.rings),
        )
        checked = [
            (target, _checked(name, values, robots)) for name, values, robots, target in given if values is not None
        ]
        for target, values in checked:
            target[:] = values

    def restart(self) -> None:
        """Set all commands to standstill in the dark, as before the first step."""
        self.wheels_cm_s[:] = 0.0
        self.rings[:] = False


def _checked(name: str, given: npt.ArrayLike, robots: IntArray) -> npt.NDArray[Any]:
    """Return what is commanded, one value for each of these robots, or one for all; raise ValueError for others."""
    values, part = np.asarray(given), "ring" if name == "ring_on" else "wheels"
    if not len(robots):
        raise ValueError(
            f"{name} is given, but no robot has its {part} commanded from outside; give a group `controller: external`"
            f", external_{part} or a file with EXTERNAL = ({part!r},)"
        )
    if values.shape not in ((), robots.shape):
        raise ValueError(
            f"{name} has the shape {values.shape}; allowed: {robots.shape}, one value for each robot whose {part} is "
            "commanded from outside, or a single one for all"
        )
    if part == "ring":
        is_other = ~np.isin(values, (0, 1))
        if values.dtype != np.bool_ and is_other.any():
            raise ValueError(f"ring_on holds {values[is_other].flat[0]}; allowed: true and false, or 1 and 0")
    elif values.dtype.kind not in "iuf":
        raise ValueError(f"{name} is of type {values.dtype}; allowed: numbers, in cm/s")
    elif np.isnan(values).any():
        robot = robots[np.isnan(np.broadcast_to(values, robots.shape)).argmax()]
        raise ValueError(f"{name}: the speed of robot {robot} is not a number")
    return values
