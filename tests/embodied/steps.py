"""Steps that no simulation has taken."""

from collections.abc import Sequence

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.step import Step


def bare_step(number: int, time_s: float, ring_on: BoolArray, phase_ms: Sequence[float] | FloatArray) -> Step:
    """Return a step in which rings are lit and oscillators have phases, and nothing else is known."""
    memory = np.array([(phase,) for phase in phase_ms], [("phase_ms", float)])
    seen = (np.empty((0, 2)), np.ones(len(ring_on), bool), None, (memory,), (), None, {})
    return Step(number, time_s, *[np.empty(0)] * 5, ring_on, ring_on, *seen)
