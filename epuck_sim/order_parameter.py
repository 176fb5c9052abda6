"""Order parameters: how synchronised a swarm is, from the phases of its oscillators (eqs. 3.4, 4.2, 5.7).

All take (..., n) phases in the unit of the periods, of which there are n, or one for all.
"""

import math
from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.util.elementary import add_directions


def order_parameter(phases: FloatArray, periods: FloatArray | float) -> FloatArray:
    """Return (...) r, the modulus of the complex order parameter (eq. 4.2), from 0, incoherent, to 1, synchronised.

    >>> f"{order_parameter(np.array([100.0, 100.0, 100.0]), 5000.0):.6f}"
    '1.000000'
    """
    sine, cosine = _mean_direction(phases, periods)
    r: FloatArray = np.sqrt(sine * sine + cosine * cosine)  # ** of one number is the system's `pow`
    return r


def reference_order_parameter(phases: FloatArray, periods: FloatArray | float) -> FloatArray:
    """Return (...) eta (eq. 3.4), at most 1: the mean cosine of the phases as the reference fires, with phase 0."""
    eta: FloatArray = _mean_direction(phases, periods)[1]
    return eta


def from_reference(phases: FloatArray, periods: FloatArray, reference: int) -> FloatArray:
    """Return (..., n) phases relative to that of the reference: at its firing that is 0, or Delta of Algorithm 2."""
    own: FloatArray = phases[..., reference, None] / periods[reference]
    return phases - own * periods


def _mean_direction(phases: FloatArray, periods: FloatArray | float) -> FloatArray:
    """Return (2, ...) the mean sine and the mean cosine of the oscillators' angles."""
    angles = np.asarray(2 * math.pi * phases / periods, np.float64)
    sums = np.zeros((2, *angles.shape[:-1]))
    rows = np.ascontiguousarray(angles).reshape(math.prod(angles.shape[:-1]), angles.shape[-1])
    add_directions(sums.reshape(2, len(rows)), rows)
    mean: FloatArray = sums / angles.shape[-1]
    return mean


METRICS = {"complex": order_parameter, "reference": reference_order_parameter}


class Firing(NamedTuple):
    """A firing of the reference, and what was measured at it."""

    cycles: int  # number of firings of the reference, this one included
    order_parameter: float | None
