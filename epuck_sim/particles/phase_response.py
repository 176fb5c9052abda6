"""Phase response curves: how far a pulse shifts the phase of its receiver (thesis 2.4; 5.1.1, eqs. 5.3 to 5.5).

Shipped curves are branches of a kernel. A user's is compiled by itself and called by its address, with its parameters.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import types

from epuck_sim.arrays import ByteArray, FloatArray, IntArray
from epuck_sim.control.compilation import compile_for
from epuck_sim.errors import CurveError
from epuck_sim.particles.swarm import CALLS, CURVE, FLOAT, RESPONSE, WORD_BYTES
from epuck_sim.scenario.particles import SHIPPED, ResponseSection, find_curve
from epuck_sim.util.elementary import expm1, sin
from epuck_sim.util.jit import jit, jit_inline
from epuck_sim.util.native import BLOCK, array_at, evaluate, function_address, unlikely

CURVES = tuple(SHIPPED)
"""Names of the shipped response curves; the index of a name is the number of its curve.

They are those of eqs. 5.3 to 5.5; one that adds a constant (Wang et al. 2015, thesis 2.4); one that adds a constant to
a state, which is concave down (Mirollo and Strogatz 1990); and `multiplicative` with another slope at early phases.
"""

MULTIPLICATIVE, SAWTOOTH, SINE, ADDITIVE, MIROLLO_STROGATZ, PIECEWISE_LINEAR, FROM_FILE = range(7)
"""Numbers of the curves; the last is that of any curve which a user's file defines."""


class Response(NamedTuple):
    """A response curve and its parameters."""

    curve: int  # index in `CURVES`, or `FROM_FILE`
    coupling: float  # strength of the response: epsilon, or kappa of the sawtooth and sine curves
    refractory: float  # D: end of the refractory period; up to this phase, pulses have no effect
    dissipation: float = 3.0  # b of Mirollo and Strogatz: how concave the state is as a function of the phase
    knee: float = 0.5  # phase up to which the piecewise linear curve has its early slope
    early_slope: float = 1.0  # that slope as a multiple of the later one
    address: int = 0
    """Address, in this process, of the function (bytes, phase) that returns the shift of a user's curve."""
    bytes: ByteArray = np.zeros(0, np.uint8)
    """(n,) the coupling of a user's curve, and behind it the record of its parameters."""

    @property
    def record(self) -> tuple[float, ...]:
        """Its record in the scene of a swarm: `swarm.RESPONSE`."""
        return (*self[:-2], 0.0)


@jit_inline
def phase_after_pulse(response: Any, curve: ByteArray, addresses: IntArray, phase: float) -> float:
    """Return the phase, 0 to 1, after a pulse at a phase above the refractory period; an oscillator at 1 fires.

    It is capped at 1, as in thesis 5.1.1, and at 0, as the sine curve with kappa > 1 / (2 pi) would lead below.
    """
    shift: float = response.coupling * phase
    if unlikely(response.curve != MULTIPLICATIVE):
        shift = other_shift(response, curve, addresses, phase)
    return min(max(phase + shift, 0.0), 1.0)


@jit
def other_shift(response: Any, curve: ByteArray, addresses: IntArray, phase: float) -> float:
    """Return the shift of a phase by a curve that is not multiplicative; not inlined, so that kernels stay small."""
    coupling: float = response.coupling
    if response.curve == SINE:
        return -coupling * sin(2 * math.pi * phase)
    if response.curve == SAWTOOTH:
        return -coupling * phase if phase <= 0.5 else coupling * (1 - phase)
    if response.curve == ADDITIVE:
        return coupling
    if response.curve == MIROLLO_STROGATZ:
        # the state f = ln(1 + (e^b - 1) phase) / b grows by the coupling; solved for the phase, that is a line
        dissipation: float = response.dissipation
        return expm1(dissipation * coupling) * (phase + 1 / expm1(dissipation))
    if response.curve == PIECEWISE_LINEAR:
        slope: float = response.early_slope if phase <= response.knee else 1.0
        return coupling * phase * slope
    response.last_phase = phase
    shift: float = evaluate(addresses[CURVE], curve, phase)
    return shift


@jit
def _shift_phases(
    response: npt.NDArray[np.void], curve: ByteArray, addresses: IntArray, phases: FloatArray, shifts: FloatArray
) -> None:
    for index in range(len(phases)):
        phase = phases[index]
        after = phase
        if phase > response[0].refractory:
            after = phase_after_pulse(response[0], curve, addresses, phase)
        shifts[index] = after - phase


def phase_shift(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return the phase shift Psi, capped, at phases from 0 to 1, of any shape."""
    given = np.asarray(phases, np.float64)
    shifts, addresses = np.empty(given.size), np.zeros(CALLS, np.int64)
    addresses[CURVE] = response.address
    record = np.array([response.record], RESPONSE)
    _shift_phases(record, response.bytes, addresses, np.ascontiguousarray(given.ravel()), shifts)
    return shifts.reshape(given.shape)


def order_change(response: Response, phases: npt.ArrayLike) -> FloatArray:
    """Return Delta r (eq. 5.8): the change of the order parameter of two oscillators when one fires.

    The other one receives the pulse, by this response, at phases from 0 to 1, of any shape.

    >>> order_change(Response(0, 0.1, 0.0), [0.25, 0.75]).round(4)
    array([-0.0577,  0.1455])
    """
    before = np.asarray(phases, np.float64)
    after = before + phase_shift(response, before)
    # two oscillators a distance d apart have the order parameter |1 + exp(2 pi i d)| / 2 = |cos(pi d)|
    return np.abs(np.cos(math.pi * after)) - np.abs(np.cos(math.pi * before))


if TYPE_CHECKING:  # `bind` provides them
    _shift: Callable[..., float]
    _PARAMETERS: np.dtype[Any]


def make_response(section: ResponseSection) -> Response:
    """Return the response of a scenario; raise CurveError if a user's curve cannot be found or compiled.

    >>> make_response(ResponseSection(curve="sine", coupling=0.5))[:3]
    (2, 0.5, 0.0)
    """
    strength = section.coupling, section.refractory
    if section.curve in CURVES:
        return Response(CURVES.index(section.curve), *strength, **section.parameters)
    curve = find_curve(section.curve)
    record = curve.parameter_record(curve.resolve(section.parameters))
    coupling = np.array([section.coupling])
    contents = np.concatenate([coupling.view(np.uint8), record.view(np.uint8)])
    names = {"_shift": curve.phase_shift, "_PARAMETERS": record.dtype}
    compiled = compile_for(curve, shift_at, names, takes=(BLOCK, types.float64), error=CurveError)
    return Response(FROM_FILE, *strength, address=function_address(compiled), bytes=contents)


def shift_at(curve: ByteArray, phase: float) -> float:
    """Return the shift of a phase by a user's curve."""
    coupling = array_at(curve, 0, WORD_BYTES, FLOAT)
    parameters = array_at(curve, WORD_BYTES, len(curve), _PARAMETERS)  # noqa: F821 see `bind`
    shift = float(_shift(phase, coupling[0], parameters[0]))  # noqa: F821
    if not math.isfinite(shift):
        raise ValueError("phase_shift returns a number that is not finite")
    return shift


def curve_error(section: ResponseSection, phase: float, error: Exception) -> CurveError:
    """Return the CurveError for an error in a user's curve; a second call, in plain Python, finds the line."""
    curve = find_curve(section.curve)
    try:
        curve.check_shift(phase, section.coupling, curve.resolve(section.parameters))
    except CurveError as again:
        return again
    return CurveError(f"{curve.path}: {type(error).__name__}: {error}")
