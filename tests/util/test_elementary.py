"""Our own elementary functions: near the exact values, alike in Python and in compiled code, and as they were."""

import hashlib
import itertools
import math
import re
import struct

import mpmath
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numba import njit

from epuck_sim import elementary
from epuck_sim.util import elementary as kernels

DIGESTS = {  # of what each function gives, on every machine
    "sin": "e1d96b6307f7f3be",
    "cos": "040f3a79bf9523b0",
    "tan": "ac3eed5848beee1d",
    "atan": "60d2eb0ccb74dbf8",
    "exp": "7a0c865da9fa100b",
    "expm1": "e1b6ad23ce3c606b",
    "log": "f06e75d6abbd35c0",
    "log1p": "8611d7aa3241ef3e",
}
# near multiples of a quarter turn, on both sides of where the reduction changes
near = st.integers(-700_000, 700_000).map(lambda quarter: quarter * math.pi / 2)
angles = st.one_of(st.floats(-10, 10), near, st.floats(allow_nan=False, allow_infinity=False))
numbers = st.one_of(st.floats(-2, 2), st.floats(-800, 800), st.floats(allow_nan=False))


def ulps(function, *arguments):
    """Return the distance of a result from the exact one, in units in the last place of the latter."""
    with mpmath.workprec(1300):  # as it takes to tell the largest angles apart from multiples of pi
        exact = getattr(mpmath, function)(*map(mpmath.mpf, arguments))
        unit = math.ulp(float(exact))
        return abs(float((mpmath.mpf(getattr(elementary, function)(*arguments)) - exact) / mpmath.mpf(unit)))


def bits(number):
    return "nan" if math.isnan(number) else struct.pack("d", number)


@pytest.mark.parametrize("function", ["sin", "cos", "tan"])
@settings(max_examples=40)
@given(angle=angles)
@example(angle=6381956970095103.0 * 2.0**797)  # the nearest to a multiple of a quarter turn (Muller 1997)
@example(angle=math.pi / 2)
@example(angle=math.pi)
@example(angle=22.0)
@example(angle=1e6)
def test_angles_of_any_size_are_taken_to_the_last_digit(function, angle):
    assert ulps(function, angle) < 1


@pytest.mark.parametrize("function", ["atan", "exp", "expm1", "log", "log1p"])
@settings(max_examples=40)
@given(number=numbers)
def test_other_results_are_exact_to_the_last_digit(function, number):
    low = {"log": 5e-324, "log1p": math.nextafter(-1, 0)}.get(function, -1e308)
    number = min(max(number, low), 709.0 if function in ("exp", "expm1") else 1e308)
    assert ulps(function, number) < 1


@given(y=st.floats(-100, 100), x=st.floats(-100, 100))
@example(y=0.0, x=-0.0)
@example(y=-0.0, x=-1.0)
def test_directions_and_distances_of_points_are_within_two_units(y, x):
    if y:  # mpmath has no zeros with a sign
        assert ulps("atan2", y, x) < 2
    else:
        assert elementary.atan2(y, x) == math.atan2(y, x)
    if abs(x) + abs(y) > 1e-150:
        assert ulps("hypot", x, y) < 2


def test_special_values_are_right_and_directions_along_axes_and_diagonals_are_python_s():
    inf, nan = math.inf, math.nan
    for function, special in {
        "sin": {inf: nan, -inf: nan, -0.0: -0.0},
        "cos": {inf: nan, -inf: nan, 0.0: 1.0},
        "tan": {inf: nan, -inf: nan},
        "atan": {inf: math.pi / 2, -inf: -math.pi / 2, -0.0: -0.0},
        "exp": {inf: inf, 709.8: inf, 709.78: 1.7928227943945155e308, -745.2: 0.0, -745.0: 5e-324, 0.0: 1.0},
        "expm1": {709.8: inf, -50.0: -1.0, -0.0: -0.0},
        "log": {0.0: -inf, 1.0: 0.0, -1.0: nan, inf: inf},
        "log1p": {-1.0: -inf, -1.5: nan, inf: inf},
    }.items():
        for argument, result in special.items():
            assert bits(getattr(elementary, function)(argument)) == bits(result), (function, argument)
    for y, x in itertools.product([0.0, -0.0, 2.0, -2.0, math.inf, -math.inf], repeat=2):
        assert bits(elementary.atan2(y, x)) == bits(math.atan2(y, x)), (y, x)


@given(st.sampled_from([*DIGESTS]), st.one_of(angles, numbers, st.just(math.nan)), st.floats())
def test_compiled_functions_are_those_of_python_to_the_bit(function, number, other):
    for name, given_ in ((function, (number,)), ("atan2", (number, other)), ("hypot", (number, other))):
        assert bits(getattr(kernels, name)(*given_)) == bits(getattr(elementary, name)(*given_))


def arguments():
    """Return arguments of all sizes, the same on every machine."""
    word, found = 1, []
    for _ in range(4000):
        word = (word * 6364136223846793005 + 1442695040888963407) % 2**64
        found += [(word >> 11) * 2.0**-50 - 4.0, struct.unpack("d", struct.pack("Q", word))[0]]
    return [number for number in found if math.isfinite(number)]


def test_results_are_those_of_every_other_machine():
    for function, digest in DIGESTS.items():
        results = np.array([getattr(elementary, function)(number) for number in arguments()], "<f8")
        assert hashlib.sha256(results[~np.isnan(results)].tobytes()).hexdigest()[:16] == digest, function


def test_compiled_code_rounds_products_before_it_adds():
    @njit
    def both(angle):
        sine, cosine = kernels.sin_cos(angle)
        return sine * cosine + angle

    both(1.0)
    (code,) = both.inspect_asm().values()
    assert "mul" in code  # what it looks for is there
    assert re.search(r"fn?m(add|sub|la|ls)", code) is None
