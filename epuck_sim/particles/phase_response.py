"""Phase response curves: how far a pulse shifts the phase of its receiver (thesis 5.1.1, eqs. 5.3 to 5.5)."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.util.jit import jit_inline

CURVES = ("multiplicative", "sawtooth", "sine")
"""Names of the response curves; the index of a name is the number of its curve."""

MULTIPLICATIVE = 0
"""Number of the multiplicative response curve."""

SAWTOOTH = 1
"""Number of the sawtooth response curve."""

SINE = 2
"""Number of the sine response curve."""


class Response(NamedTuple):
    """A response curve and its parameters."""

    curve: int
    """Index in `CURVES`."""
    coupling: float
    """epsilon of the multiplicative curve, kappa of the others."""
    refractory: float
    """D: end of the refractory period; up to this phase, pulses have no effect."""


@jit_inline
def phase_after_pulse(response: Response, phase: float) -> float:
    """Return the phase, 0 to 1, after a pulse; an oscillator at 1 fires.

    The phase is capped at 1, as in thesis 5.1.1, and at 0, below which the sine curve with kappa > 1 / (2 pi) would
    lead.
    """
    if phase <= response.refractory:
        return phase
    if response.curve == MULTIPLICATIVE:
        shift = response.coupling * phase
    elif response.curve == SINE:
        shift = -response.coupling * math.sin(2 * math.pi * phase)
    elif phase <= 0.5:
        shift = -response.coupling * phase
    else:
        shift = response.coupling * (1 - phase)
    return min(max(phase + shift, 0.0), 1.0)


@jit_inline
def _shift_phases(response: Response, phases: FloatArray, shifts: FloatArray) -> None:
    for index in range(len(phases)):
        shifts[index] = phase_after_pulse(response, phases[index]) - phases[index]


def phase_shift(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return the phase shift Psi (eqs. 5.3 to 5.5, capped) at phases from 0 to 1, of any shape."""
    given = np.asarray(phases, np.float64)
    shifts = np.empty(given.size)
    _shift_phases(response, np.ascontiguousarray(given.ravel()), shifts)
    return shifts.reshape(given.shape)


def order_change(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return Delta r (eq. 5.8): the change of the order parameter of two oscillators when one fires.

    Args:
        response: Response curve of the oscillator that receives the pulse.
        phases: Phases of that oscillator, 0 to 1, of any shape.

    Returns:
        The change for each phase, in the shape of `phases`.

    >>> order_change(Response(0, 0.1, 0.0), [0.25, 0.75]).round(4)
    array([-0.0577,  0.1455])
    """
    before = np.asarray(phases, np.float64)
    after = before + phase_shift(response, before)
    # two oscillators a distance d apart have the order parameter |1 + exp(2 pi i d)| / 2 = |cos(pi d)|
    change: FloatArray = np.abs(np.cos(math.pi * after)) - np.abs(np.cos(math.pi * before))
    return change
