"""Phase response curves: how far a pulse shifts the phase of its receiver (thesis 2.4; 5.1.1, eqs. 5.3 to 5.5)."""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.util.addresses import evaluate_at
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.native import unlikely

CURVES = ("multiplicative", "sawtooth", "sine", "additive", "mirollo_strogatz", "piecewise_linear")
"""Names of the shipped response curves; the index of a name is the number of its curve."""

MULTIPLICATIVE = 0
"""Number of the multiplicative response curve (eq. 5.3)."""

SAWTOOTH = 1
"""Number of the sawtooth response curve (eq. 5.4)."""

SINE = 2
"""Number of the sine response curve (eq. 5.5)."""

ADDITIVE = 3
"""Number of the response curve that adds a constant (Wang et al. 2015, thesis 2.4)."""

MIROLLO_STROGATZ = 4
"""Number of the response curve that adds a constant to a state, which is concave down (Mirollo and Strogatz 1990)."""

PIECEWISE_LINEAR = 5
"""Number of the response curve that is multiplicative, with another slope at early phases."""

FROM_FILE = 6
"""Number of a response curve that a user's file defines."""


class CurveFromFile(NamedTuple):
    """A user's response curve, compiled; see `curve_compilation`."""

    function: int
    """Address of the function from an address and a phase to the shift."""
    arrays: int
    """Address of what else it works on."""


NO_FILE = CurveFromFile(0, 0)
"""Stands for the curve of a file where a shipped one is used."""


class Response(NamedTuple):
    """A response curve and its parameters."""

    curve: int
    """Index in `CURVES`, or `FROM_FILE`."""
    coupling: float
    """Strength of the response: epsilon, or kappa of the sawtooth and sine curves."""
    refractory: float
    """D: end of the refractory period; up to this phase, pulses have no effect."""
    dissipation: float = 3.0
    """b of Mirollo and Strogatz: how concave the state is as a function of the phase."""
    knee: float = 0.5
    """Phase up to which the piecewise linear curve has its early slope."""
    early_slope: float = 1.0
    """That slope as a multiple of the later one."""
    from_file: CurveFromFile = NO_FILE
    """The curve of a user's file."""


@jit_inline
def phase_after_pulse(response: Response, phase: float) -> float:
    """Return the phase, 0 to 1, after a pulse; an oscillator at 1 fires.

    The phase is capped at 1, as in thesis 5.1.1, and at 0, below which the sine curve with kappa > 1 / (2 pi) would
    lead.
    """
    if phase <= response.refractory:
        return phase
    shift = other_shift(response, phase) if unlikely(response.curve != MULTIPLICATIVE) else response.coupling * phase
    return min(max(phase + shift, 0.0), 1.0)


@jit_no_alloc
def other_shift(response: Response, phase: float) -> float:
    """Return the shift of a phase by a curve that is not multiplicative; not inlined, so that kernels stay small."""
    coupling = response.coupling
    if response.curve == SINE:
        return -coupling * math.sin(2 * math.pi * phase)
    if response.curve == SAWTOOTH:
        return -coupling * phase if phase <= 0.5 else coupling * (1 - phase)
    if response.curve == ADDITIVE:
        return coupling
    if response.curve == MIROLLO_STROGATZ:
        # the state f = ln(1 + (e^b - 1) phase) / b grows by the coupling; solved for the phase, that is a line
        return math.expm1(response.dissipation * coupling) * (phase + 1 / math.expm1(response.dissipation))
    if response.curve == PIECEWISE_LINEAR:
        return coupling * phase * (response.early_slope if phase <= response.knee else 1.0)
    shift: float = evaluate_at(response.from_file.function, response.from_file.arrays, phase)
    return shift


@jit_no_alloc
def _shift_phases(response: Response, phases: FloatArray, shifts: FloatArray) -> None:
    for index in range(len(phases)):
        shifts[index] = phase_after_pulse(response, phases[index]) - phases[index]


def phase_shift(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return the phase shift Psi, capped, at phases from 0 to 1, of any shape."""
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
