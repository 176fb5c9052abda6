"""Phase response curves: how far a pulse shifts the phase of one who hears it (thesis 5.1.1, eqs. 5.3 to 5.5)."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.util.jit import jit_inline

CURVES = ("multiplicative", "sawtooth", "sine")
"""In the order of their numbers."""

MULTIPLICATIVE, SAWTOOTH, SINE = range(len(CURVES))


class Response(NamedTuple):
    """A response curve."""

    curve: int
    """Its place in `CURVES`."""
    coupling: float
    """epsilon or kappa."""
    refractory: float
    """D: up to this phase nothing is heard."""


@jit_inline
def shifted(response: Response, phase: float) -> float:
    """Return the phase, 0 to 1, after a pulse; one of 1 fires.

    It is held at 1, by thesis 5.1.1, and at 0, because no phase is below, where the sine curve with kappa > 1 / (2 pi)
    would lead.
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
def _shift_all(response: Response, phases: FloatArray, shifts: FloatArray) -> None:
    for place in range(len(phases)):
        shifts[place] = shifted(response, phases[place]) - phases[place]


def phase_shift(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return Psi (eqs. 5.3 to 5.5, capped) at phases of any shape, 0 to 1."""
    given = np.asarray(phases, np.float64)
    shifts = np.empty(given.size)
    _shift_all(response, np.ascontiguousarray(given.ravel()), shifts)
    return shifts.reshape(given.shape)


def order_change(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return Delta r (eq. 5.8): what a pulse of one of two oscillators, at phase 1, changes in their order parameter.

    phases: of the other one, 0 to 1, of any shape.

    >>> order_change(Response(0, 0.1, 0.0), [0.25, 0.75]).round(4)
    array([-0.0577,  0.1455])
    """
    before = np.asarray(phases, np.float64)
    after = before + phase_shift(response, before)
    # of two at a distance d the order parameter is |1 + exp(2 pi i d)| / 2 = |cos(pi d)|
    change: FloatArray = np.abs(np.cos(math.pi * after)) - np.abs(np.cos(math.pi * before))
    return change
