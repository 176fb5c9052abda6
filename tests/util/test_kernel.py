"""Kernels do the same for Python and inside of each other, where they are compiled but once."""

import numpy as np
import pytest

from epuck_sim.util.jit import jit, jit_inline, jit_no_alloc


@jit_inline
def add_half(number: float) -> float:
    """Return a number plus a half."""
    return number + 0.5


@jit_no_alloc
def take_root(number: float) -> float:
    """Return a square root."""
    if number < 0:
        raise ValueError("a number below 0")
    return float(np.sqrt(add_half(number)))


@jit
def sum_roots(numbers: np.ndarray) -> float:
    """Return a sum of roots, of a copy of numbers."""
    total = 0.0
    for number in numbers.copy():
        total += take_root(number)
    return total


NUMBERS = np.array([0.0, 3.5, 8.5])


def test_a_kernel_is_compiled_for_python_only_when_python_calls_it() -> None:
    compiled = vars(take_root)["_for_python"]
    assert sum_roots(NUMBERS) == np.sqrt(NUMBERS + 0.5).sum()
    assert compiled.signatures == []
    assert take_root(3.5) == 2.0
    assert len(compiled.signatures) == 1
    assert add_half(1.0) == 1.5


def test_what_a_part_raises_comes_through() -> None:
    with pytest.raises(ValueError, match="a number below 0"):
        sum_roots(np.array([1.0, -1.0]))
    with pytest.raises(ValueError, match="a number below 0"):
        take_root(-1.0)
