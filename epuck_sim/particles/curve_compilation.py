"""The response of a scenario: a shipped curve, or a user's, compiled and called by its address."""

import math
import warnings
from collections.abc import Callable, Hashable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.control.compilation import digest_sources, explain_refusal, frozen_values, jit_functions
from epuck_sim.control.error_lines import take_error_place
from epuck_sim.control.interface import Value, record_type
from epuck_sim.errors import CurveError
from epuck_sim.particles.phase_response import CURVES, FROM_FILE, CurveFromFile, Response
from epuck_sim.scenario.curves import Curve, find_curve
from epuck_sim.scenario.response import ResponseSection
from epuck_sim.util.addresses import compile_at, function_address
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import bind, digest


class CurveArrays(NamedTuple):
    """What a user's curve works on, beside the phase; nothing changes it, so that simulations in threads share it."""

    coupling: FloatArray
    """(1,) strength of the response."""
    parameters: npt.NDArray[np.void]
    """(1,) record of its parameters."""


if TYPE_CHECKING:  # `bind` provides them
    phase_shift: Callable[..., float]
    value_at: Callable[[int], CurveArrays]

_compiled: dict[Hashable, tuple[Any, CurveFromFile]] = {}


def make_response(section: ResponseSection) -> Response:
    """Return the response of a scenario.

    Raises:
        CurveError: The curve is a user's, and cannot be found or compiled.

    >>> make_response(ResponseSection(curve="sine", coupling=0.5))[:3]
    (2, 0.5, 0.0)
    """
    strength = section.coupling, section.refractory
    if section.curve in CURVES:
        return Response(CURVES.index(section.curve), *strength, **section.parameters)
    curve = find_curve(section.curve)
    from_file = _compile_curve(curve, section.coupling, curve.resolve(section.parameters))
    return Response(FROM_FILE, *strength, from_file=from_file)


def _compile_curve(curve: Curve, coupling: float, parameters: Mapping[str, Value]) -> CurveFromFile:
    """Return a user's curve, compiled; it stays at its address until the process ends."""
    contents_digest = digest(
        [digest_sources(curve.sources, curve.modules).encode(), *frozen_values(curve.modules.values())]
    )
    key = contents_digest, curve.name, coupling, *parameters.items()
    if key not in _compiled:
        record = np.zeros(1, record_type({name: type(value) for name, value in parameters.items()}))
        for name, value in parameters.items():
            record[name] = value
        arrays = CurveArrays(np.full(1, coupling), record)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", numba.core.errors.NumbaWarning)
                (function,) = jit_functions([curve.phase_shift], curve.modules, contents_digest)
                compiled = compile_at(bind(_shift_at, phase_shift=function), arrays, contents_digest, careful=True)
        except Exception as error:  # numba's own errors, and what escapes it
            raise CurveError(explain_refusal(error, Path(curve.name), curve.sources)) from error
        owner, address = hold(arrays)
        _compiled[key] = owner, CurveFromFile(function_address(compiled), address)
    return _compiled[key][1]


def _shift_at(address: int, phase: float) -> float:
    """Return the shift of a phase by a user's curve."""
    arrays = value_at(address)  # noqa: F821 see `bind`
    shift = float(phase_shift(phase, arrays.coupling[0], arrays.parameters[0]))  # noqa: F821
    if not math.isfinite(shift):
        raise ValueError("phase_shift returns a number that is not finite")
    return shift


def trial_error(name: str, error: Exception) -> CurveError:
    """Return what to raise for what a user's curve, of this name, has raised in compiled code."""
    place = take_error_place()
    where = f"{list(find_curve(name).sources)[place.file]}:{place.line}" if place else name
    return CurveError(f"{where}: {type(error).__name__}: {error}")
