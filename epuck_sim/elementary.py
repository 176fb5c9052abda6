"""Elementary functions whose results are the same on every machine: sine, exponential, logarithm and their kin.

Functions of system libraries differ in the last digit, and from there on a trial takes another course. These use only
sums, products and quotients, which all processors round alike (IEEE 754). Algorithms and coefficients are those of
FreeBSD's msun, which has them from Sun Microsystems' fdlibm (1993); errors of results are below one unit in the last
place, or below two for `atan2` and `hypot`.

They are plain Python; `util.elementary` has them as kernels, equal to the bit. Nothing raises, unlike in Python's
`math`: results that are not defined are NaN, and those that are too large are infinite.
"""

import math

import numpy as np

from epuck_sim.arrays import IntArray

_QUARTERS_PER_RAD = 6.36619772367581382433e-01
_QUARTER_1, _QUARTER_2, _QUARTER_3 = 1.57079632673412561417, 6.07710050630396597660e-11, 2.02226624879595063154e-21
"""A quarter turn, pi / 2, in three parts: 118 bits. The first two have 33 each, so that their multiples are exact."""

_QUARTER, _QUARTER_REST = 1.57079632679489655800, 6.12323399573676603587e-17
_EIGHTH, _EIGHTH_REST = 7.85398163397448278999e-01, 3.06161699786838301793e-17

_LARGE_RAD = 1e6
"""Angle up to which 118 bits of pi / 2 are enough, unless it is nearer to a multiple than any random angle."""

_NEAR_RAD = 2.0**-58  # distance from a quarter turn within which they are too few; of n quarter turns, n times as far
_TO_WHOLE = 6755399441055744.0  # 1.5 * 2**52: a number to which this has been added has no bits left for a fraction

_BITS = 26
_LIMBS = 50
_MASK = (1 << _BITS) - 1


def _limbs_of_two_over_pi() -> IntArray:
    """Return the first `_LIMBS` digits of 2 / pi behind the point, to the base 2**26, by Machin's formula (1706)."""
    unit = 1 << _BITS * (_LIMBS + 2)

    def inverse_tangent_of_inverse(number: int) -> int:
        power, total, odd = unit // number, 0, 1
        while power:
            total += (2 - odd % 4) * (power // odd)
            power, odd = power // number**2, odd + 2
        return total

    pi = 4 * (4 * inverse_tangent_of_inverse(5) - inverse_tangent_of_inverse(239))
    digits = (2 * unit << _BITS * _LIMBS) // pi
    return np.array([digits >> _BITS * (_LIMBS - 1 - limb) & _MASK for limb in range(_LIMBS)], np.int64)


_TWO_OVER_PI = _limbs_of_two_over_pi()


def _upper_half(number: float) -> float:
    """Return the number of 26 bits that is nearest: products of two such are exact (Veltkamp 1968)."""
    product = 134217729.0 * number
    return product - (product - number)


def _reduce_exactly(angle: float) -> tuple[int, float, float]:
    """Reduce any angle as `_reduce` does, by as many digits of 2 / pi as it takes (Payne and Hanek 1983)."""
    if not abs(angle) < math.inf:
        return 0, math.nan, math.nan
    fraction, exponent = math.frexp(abs(angle))
    point = (exponent - 53) // _BITS  # the angle is an integer of three limbs, times 2**(26 point)
    shift = exponent - 53 - _BITS * point
    bits = int(math.ldexp(fraction, 53))
    low = (bits & _MASK) << shift
    high = ((bits >> _BITS) << shift) + (low >> _BITS)
    limbs = (low & _MASK, high & _MASK, high >> _BITS)
    carry, digit, upper, middle, lower = 0, 0, 0, 0, 0
    for place in range(-6, 1):  # of the quarter turns, six digits behind the point, and the one before it
        for limb in range(3):
            other = point - 1 - place + limb
            if other >= 0:
                carry += limbs[limb] * int(_TWO_OVER_PI[other])
        digit = carry & _MASK
        carry >>= _BITS
        if place < 0:  # pairs of digits
            lower = lower >> _BITS | (middle & _MASK) << _BITS
            middle = middle >> _BITS | (upper & _MASK) << _BITS
            upper = upper >> _BITS | digit << _BITS
    is_more = upper >> 2 * _BITS - 1  # than half a quarter turn: seen from the next one
    first, second = (upper - (is_more << 2 * _BITS)) * 2.0**-52, middle * 2.0**-104
    quarters = first + second
    rest = ((first - quarters) + second) + lower * 2.0**-156
    near = quarters * _QUARTER
    of_quarters, of_quarter = _upper_half(quarters), _upper_half(_QUARTER)
    missed = (of_quarters * of_quarter - near) + of_quarters * (_QUARTER - of_quarter)
    missed += (quarters - of_quarters) * of_quarter
    missed += (quarters - of_quarters) * (_QUARTER - of_quarter)
    missed += quarters * _QUARTER_REST + rest * _QUARTER
    remainder = near + missed
    tail = (near - remainder) + missed
    return (digit + is_more, remainder, tail) if angle > 0.0 else (-digit - is_more, -remainder, -tail)


def _reduce(angle: float) -> tuple[int, float, float]:
    """Return the number of quarter turns nearest to an angle, up to a multiple of 4, and the rest, in two parts."""
    quarters = (angle * _QUARTERS_PER_RAD + _TO_WHOLE) - _TO_WHOLE
    begin = angle - quarters * _QUARTER_1
    missed = quarters * _QUARTER_2
    middle = begin - missed
    missed = quarters * _QUARTER_3 - ((begin - middle) - missed)
    remainder = middle - missed
    if abs(angle) <= _LARGE_RAD and abs(remainder) >= abs(quarters) * _NEAR_RAD:
        return int(quarters), remainder, (middle - remainder) - missed
    return _reduce_exactly(angle)


def sin_cos(angle: float) -> tuple[float, float]:
    """Return the sine and the cosine of an angle in radians; NaN if it is infinite."""
    quarters, x, tail = _reduce(angle)
    z = x * x
    w = z * z
    cube = z * x
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
    r += z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    sine = x - ((z * (0.5 * tail - cube * r) - tail) - cube * -1.66666666666666324348e-01)
    r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05))
    r += w * w * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
    half = 0.5 * z
    most = 1.0 - half
    cosine = most + (((1.0 - most) - half) + (z * r - x * tail))
    if quarters & 1:
        sine, cosine = cosine, -sine
    if quarters & 2:
        sine, cosine = -sine, -cosine
    return sine, cosine


def sin(angle: float) -> float:
    """Return the sine of an angle in radians; NaN if it is infinite."""
    return sin_cos(angle)[0]


def cos(angle: float) -> float:
    """Return the cosine of an angle in radians; NaN if it is infinite."""
    return sin_cos(angle)[1]


def tan(angle: float) -> float:
    """Return the tangent of an angle in radians; NaN if it is infinite."""
    quarters, x, tail = _reduce(angle)
    is_far, sign = abs(x) >= 0.67434, -1.0 if x < 0.0 else 1.0
    if is_far:  # seen from an eighth of a turn
        x, tail = (_EIGHTH - sign * x) + (_EIGHTH_REST - sign * tail), 0.0
    z = x * x
    w = z * z
    r = 3.59207910759131235356e-03 + w * (
        5.88041240820264096874e-04 + w * (7.81794442939557092300e-05 + w * -1.85586374855275456654e-05)
    )
    r = 1.33333333333201242699e-01 + w * (2.18694882948595424599e-02 + w * r)
    v = 1.45620945432529025516e-03 + w * (
        2.46463134818469906812e-04 + w * (7.14072491382608190305e-05 + w * 2.59073051863633712884e-05)
    )
    v = z * (5.39682539762260521377e-02 + w * (8.86323982359930005737e-03 + w * v))
    cube = z * x
    r = tail + z * (cube * (r + v) + tail) + 3.33333333333334091986e-01 * cube
    tangent = x + r
    if is_far:
        one = -1.0 if quarters & 1 else 1.0
        return sign * (one - 2.0 * (x - (tangent * tangent / (tangent + one) - r)))
    if not quarters & 1:
        return tangent
    upper, inverse = _upper_half(tangent), -1.0 / tangent
    upper_inverse = _upper_half(inverse)
    return upper_inverse + inverse * ((1.0 + upper_inverse * upper) + upper_inverse * (r - (upper - x)))


def atan(tangent: float) -> float:
    """Return the angle in radians, from -pi / 2 to pi / 2, that has a tangent."""
    x, at, at_rest = abs(tangent), 0.0, 0.0
    if x >= 2.4375:
        x, at, at_rest = -1.0 / x, _QUARTER, _QUARTER_REST
    elif x >= 1.1875:
        x, at, at_rest = (x - 1.5) / (1.0 + 1.5 * x), 9.82793723247329054082e-01, 1.39033110312309984516e-17
    elif x >= 0.6875:
        x, at, at_rest = (x - 1.0) / (x + 1.0), _EIGHTH, _EIGHTH_REST
    elif x >= 0.4375:
        x, at, at_rest = (2.0 * x - 1.0) / (2.0 + x), 4.63647609000806093515e-01, 2.26987774529616870924e-17
    z = x * x
    w = z * z
    odd = 9.09088713343650656196e-02 + w * (
        6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02)
    )
    odd = z * (3.33333333333329318027e-01 + w * (1.42857142725034663711e-01 + w * odd))
    even = -7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02)
    even = w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * even))
    return math.copysign(at - ((x * (odd + even) - at_rest) - x), tangent)


def atan2(y: float, x: float) -> float:
    """Return the angle in radians, from -pi to pi, of the point (x, y), counter-clockwise from x."""
    if not abs(y) <= abs(x) * 2.0**60:
        return math.copysign(_QUARTER, y) if abs(y) > abs(x) else math.nan  # one is NaN
    angle = 0.0 if y == 0.0 else _EIGHTH if abs(y) == abs(x) else atan(abs(y) / abs(x))
    if math.copysign(1.0, x) < 0.0:
        angle = 2.0 * _QUARTER - (angle - 2.0 * _QUARTER_REST)
    return math.copysign(angle, y)


def hypot(x: float, y: float) -> float:
    """Return the length of the vector (x, y), unless it is below 1e-150 or above 1e150, as none in an arena is."""
    return math.sqrt(x * x + y * y)


_PER_LOG_2, _LOG_2, _LOG_2_REST = 1.44269504088896338700, 6.93147180369123816490e-01, 1.90821492927058770002e-10
_LARGEST, _SMALLEST = 7.09782712893383973096e02, -7.45133219101941108420e02
"""Exponents beyond which an exponential is infinite, and below which it is 0."""


def exp(x: float) -> float:
    """Return e**x."""
    if not _SMALLEST <= x <= _LARGEST:
        return 0.0 if x < 0.0 else x * math.inf  # or NaN
    power = int(_PER_LOG_2 * x + math.copysign(0.5, x))
    high, low = x - power * _LOG_2, power * _LOG_2_REST
    r = high - low
    z = r * r
    c = 6.61375632143793436117e-05 + z * (-1.65339022054652515390e-06 + z * 4.13813679705723846039e-08)
    c = r - z * (1.66666666666666019037e-01 + z * (-2.77777777770155933842e-03 + z * c))
    return math.ldexp(1.0 - ((low - r * c / (2.0 - c)) - high), power)


def expm1(x: float) -> float:
    """Return e**x - 1, as exactly where x is small."""
    if not -40.0 <= x <= _LARGEST:
        return -1.0 if x < 0.0 else x * math.inf  # or NaN
    power = int(_PER_LOG_2 * x + math.copysign(0.5, x))
    high, low = x - power * _LOG_2, power * _LOG_2_REST
    r = high - low
    rest = (high - r) - low
    half = 0.5 * r
    z = r * half
    q = -7.93650757867487942473e-05 + z * (4.00821782732936239552e-06 + z * -2.01099218183624371326e-07)
    q = 1.0 + z * (-3.33333333333331316428e-02 + z * (1.58730158725481460165e-03 + z * q))
    t = 3.0 - q * half
    e = z * ((q - t) / (6.0 - r * t))
    if power == 0:
        return r - (r * e - z)
    e = (r * (e - rest) - rest) - z
    if power == -1:
        return 0.5 * (r - e) - 0.5
    if power == 1:
        return -2.0 * (e - (r + 0.5)) if r < -0.25 else 1.0 + 2.0 * (r - e)
    one = math.ldexp(1.0, -power)
    if 2 <= power <= 56:
        return math.ldexp((1.0 - one) - (e - r) if power < 20 else (r - (e + one)) + 1.0, power)
    return math.ldexp(1.0 - (e - r), power) - 1.0


def _log_of(power: int, f: float, rest: float) -> float:
    """Return the logarithm of 2**power * (1 + f), and a rest, where 1 + f is between the roots of 1 / 2 and of 2."""
    s = f / (2.0 + f)
    z = s * s
    w = z * z
    even = w * (3.999999999940941908e-01 + w * (2.222219843214978396e-01 + w * 1.531383769920937332e-01))
    odd = 1.818357216161805012e-01 + w * 1.479819860511658591e-01
    odd = z * (6.666666666666735130e-01 + w * (2.857142874366239149e-01 + w * odd))
    half = 0.5 * f * f
    return power * _LOG_2 - ((half - (s * (half + (even + odd)) + (power * _LOG_2_REST + rest))) - f)


def _split_power(x: float) -> tuple[int, float]:
    """Return a power of 2, and x divided by it, which is between the roots of 1 / 2 and of 2."""
    share, power = math.frexp(x)
    return (power - 1, 2.0 * share) if share < 0.70710678118654752 else (power, share)


def log(x: float) -> float:
    """Return the natural logarithm; -infinity of 0, NaN of negative numbers."""
    if not 0.0 < x < math.inf:
        return -math.inf if x == 0.0 else x if x > 0.0 else math.nan
    power, share = _split_power(x)
    return _log_of(power, share - 1.0, 0.0)


def log1p(x: float) -> float:
    """Return the natural logarithm of 1 + x, as exactly where x is small; -infinity of -1."""
    if not -1.0 < x < math.inf:
        return -math.inf if x == -1.0 else x if x > 0.0 else math.nan
    if -0.29 < x < 0.41:
        return _log_of(0, x, 0.0)
    total = 1.0 + x
    rest = (1.0 - (total - x) if x > 1.0 else x - (total - 1.0)) / total
    power, share = _split_power(total)
    return _log_of(power, share - 1.0, rest)
