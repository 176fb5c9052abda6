"""The functions of `epuck_sim.elementary` as kernels, equal to the bit: what compiled code calls, and Python may."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

from epuck_sim.arrays import FloatArray
from epuck_sim.util.jit import bind, jit_inline, jit_no_alloc

_plain = vars(import_module("epuck_sim.elementary"))
_kernels: dict[str, Any] = {}


def _kernel(name: str, compiler: Callable[[Any], Any] = jit_inline) -> Any:
    """Compile a function that calls only functions that have been compiled before."""
    _kernels[name] = compiler(bind(_plain[name], **_kernels))
    return _kernels[name]


for _part in ("_upper_half", "_log_of", "_split_power"):
    _kernel(_part)
_kernel("_reduce_exactly", jit_no_alloc)  # which hardly any angle needs: not inlined
_kernel("_reduce")

sin_cos: Callable[[float], tuple[float, float]] = _kernel("sin_cos")
sin: Callable[[float], float] = _kernel("sin")
cos: Callable[[float], float] = _kernel("cos")
tan: Callable[[float], float] = _kernel("tan")
atan: Callable[[float], float] = _kernel("atan")
atan2: Callable[[float, float], float] = _kernel("atan2")
hypot: Callable[[float, float], float] = _kernel("hypot")
exp: Callable[[float], float] = _kernel("exp")
expm1: Callable[[float], float] = _kernel("expm1")
log: Callable[[float], float] = _kernel("log")
log1p: Callable[[float], float] = _kernel("log1p")


@jit_no_alloc
def add_directions(sums: FloatArray, angles: FloatArray) -> None:
    """Add to sums, (2, rows), the sines and the cosines of angles, (rows, n) rad, one after the other."""
    for row in range(angles.shape[0]):
        for column in range(angles.shape[1]):
            sine, cosine = sin_cos(angles[row, column])
            sums[0, row] += sine
            sums[1, row] += cosine
