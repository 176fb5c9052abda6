"""Steps that are kept, and such that no simulation has taken."""

from collections.abc import Sequence
from itertools import islice

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.step import Step


def bare_step(number: int, time_s: float, ring_on: BoolArray, phase_ms: Sequence[float] | FloatArray) -> Step:
    """Return a step in which rings are lit and oscillators have phases, and nothing else is known."""
    memory = np.array([(phase,) for phase in phase_ms], [("phase_ms", float)])
    seen = (np.empty((0, 2)), np.ones(len(ring_on), bool), None, (memory,), (), None, {})
    return Step(number, time_s, *[np.empty(0)] * 5, ring_on, ring_on, *seen)


def kept(simulation, count):
    """Return the next `count` steps with arrays of their own."""
    return [
        step._replace(
            **{name: value.copy() for name, value in step._asdict().items() if isinstance(value, np.ndarray)},
            memories=tuple(memory.copy() for memory in step.memories),
        )
        for step in islice(simulation, count)
    ]


def bits(step):
    """Return every bit of every array of a step, with types and shapes."""
    arrays = [np.array([step.number, step.time_s]), *(each for each in step if isinstance(each, np.ndarray))]
    return [(each.shape, each.dtype.str, each.tobytes()) for each in (*arrays, *step.memories)]
