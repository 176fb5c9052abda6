"""The robots' bodies in their arena, as compiled code moves them."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.cell_list import CellList


class Bodies(NamedTuple):
    """The robots' bodies in their arena."""

    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading. Headings count full turns."""
    velocities: FloatArray
    """(robots, 3) cm/s, cm/s, rad/s: what the bodies move with."""
    width_cm: float
    """Width of the arena."""
    height_cm: float
    """Height of the arena."""
    radius_cm: float
    """Radius of a robot."""
    circles: FloatArray
    """(k, 3) cm: round obstacles and movables, see `arena.Arena`; those of movables are written."""
    edges: FloatArray
    """(m, 4) cm: edges of the other obstacles, see `arena.Arena`."""
    cells: CellList
    """Cell list sorted by the poses."""
    touch: bool
    """Whether robots touch each other; else they pass through each other."""
    step_s: float
    """Seconds of a physics step."""
    calls: npt.NDArray[np.void]
    """(1,) a record, see `chipmunk.CALLS`."""
    pointers: IntArray
    """(robots, 2) addresses of each robot's `cpBody` and `cpShape`."""
    present: BoolArray
    """(robots,) whether each robot is in the arena; others are parked outside, at rest, see `attendance`."""
    is_candidate: BoolArray
    """(robots,) whether a robot may touch something in this control step."""
    reached: IntArray
    """(robots,) space for `find_contact_candidates`."""
    is_in_space: BoolArray
    """(robots,) whether a robot's body is in the `cpSpace`."""
    movables: IntArray
    """(movables,) address of the `cpBody` of each movable."""
    drives: IntArray
    """(robots,) address of the `cpBody` whose velocity a robot's wheels give it, see `movables`; none without any."""
