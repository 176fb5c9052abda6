"""Commands from outside: what robots do whose wheels or rings are not their controller's (`Controller.external`)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.interface import EXTERNAL, Controller
from epuck_sim.embodied.loop import act_again
from epuck_sim.embodied.swarm import Swarm

PARTS = {"left_cm_s": "wheels", "right_cm_s": "wheels", "ring_on": "ring"}
"""What is commanded, by name, and the part of a controller's `EXTERNAL` that leaves it to commands."""


class Commands:
    """The commands from outside to the robots of one simulation, which actuators keep until the next."""

    robots: dict[str, IntArray]
    """By part, of `EXTERNAL`, (n,) numbers of the robots that are commanded."""

    def __init__(self, controllers: Sequence[Controller], block: ByteArray, swarm: Swarm, addresses: IntArray) -> None:
        """Find the robots that are commanded from outside, in groups with these controllers."""
        self.memory = block, addresses  # of the swarm, and of what it calls
        external = {part: [part in each.external for each in controllers] for part in EXTERNAL}
        self.robots = {part: np.flatnonzero(np.repeat(each, swarm.groups["count"])) for part, each in external.items()}
        actuators = swarm.robots["actuators"].view(np.ndarray)
        self._targets: dict[str, tuple[npt.NDArray[Any], IntArray]] = {
            name: (actuators[name], self.robots[part]) for name, part in PARTS.items()
        }

    def carry_out(self, **given: npt.ArrayLike | None) -> None:
        """Have robots do what is given, unchecked, from the last control step on; see `Simulation.command`."""
        for name, values in given.items():
            if values is not None:
                actuators, robots = self._targets[name]
                actuators[robots] = values
        act_again(*self.memory)

    def check(self, **given: npt.ArrayLike | None) -> None:
        """Raise ValueError for commands that robots cannot be given, or for none; see `Simulation.command`."""
        if all(values is None for values in given.values()):
            raise ValueError("nothing is commanded; give left_cm_s, right_cm_s or ring_on")
        for name, values in given.items():
            if values is not None:
                _check(name, np.asarray(values), PARTS[name], self.robots[PARTS[name]])


def _check(name: str, values: npt.NDArray[Any], part: str, robots: IntArray) -> None:
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
    allowed, fits = "numbers, in cm/s", np.zeros(values.shape, np.bool_)
    if part == "ring":
        allowed, fits = "true and false, or 1 and 0", np.isin(values, (0, 1))
    elif values.dtype.kind in "iuf":
        fits = ~np.isnan(values)
    if not fits.all():
        robot = robots[np.broadcast_to(fits, robots.shape).argmin()]
        raise ValueError(f"{name} is {values[~fits][0]} for robot {robot}; allowed: {allowed}")
