"""One control step of a simulation, as onlookers see it."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray


class Step(NamedTuple):
    """One control step of all robots: what they sensed, and what they commanded at that instant.

    The arrays are read-only views of the simulation's own and hold the next step's values as soon as that is taken:
    copy what you keep.
    """

    number: int
    """Control steps before this one."""
    time_s: float
    """Simulated time of this instant."""
    poses: FloatArray
    """(robots, 3) cm, cm, rad: x, y, heading at this instant; headings count full turns."""
    infrared: FloatArray
    """(robots, 8) counts: readings of the proximity sensors."""
    distance_mm: IntArray
    """(robots, 8) mm: distances that belong to them; `epuck.OUT_OF_RANGE_MM` where nothing is in range."""
    camera: IntArray
    """(robots, pixels): 1 where a lit ring is seen; index 0 is the left edge. Shorter rows are filled up with 0."""
    wheels_cm_s: FloatArray
    """(robots, 2) cm/s: left and right wheel as commanded, within the wheels' limit, without noise."""
    ring_on: BoolArray
    """(robots,): whose ring is lit, as commanded."""
    memories: tuple[npt.NDArray[Any], ...]
    """One record array a group of robots: what each remembers."""

    @property
    def phase_ms(self) -> FloatArray:
        """(robots,) ms: the oscillators' phases; NaN for robots that remember none."""
        groups = [memory_field(memory, "phase_ms", np.nan) for memory in self.memories]
        return groups[0] if len(groups) == 1 else np.concatenate(groups)  # which takes as long as all the rest

    @property
    def flash_seen(self) -> BoolArray:
        """(robots,): who sees a flash, by its controller's own judgement, or else by any red pixel."""
        judged = np.concatenate([memory_field(memory, "flash_seen", np.nan) for memory in self.memories])
        return np.where(np.isnan(judged), self.camera.any(axis=1), judged > 0)


def memory_field(memory: npt.NDArray[Any], field: str, otherwise: float) -> FloatArray:
    """Return (robots,) a copy of a field of what a group remembers, or `otherwise` where it remembers none."""
    if field in (memory.dtype.names or ()):
        return np.array(memory[field], float)
    return np.full(len(memory), otherwise)
