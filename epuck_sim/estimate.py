"""An estimate of a number from several trials, with its 95 % interval; and how many trials an interval takes."""

import math
from collections.abc import Callable
from typing import NamedTuple

LEVEL = 0.95  # probability with which an interval is meant to hold the truth

MIN_TRIALS = 5
"""Fewest trials with an interval.

With 5 trials of skewed distributions intervals of the mean hold the truth in 90 to 98 % of all cases, and are 1 to 3
times as wide as the mean; with 3 they are 3 to 8 times as wide, and tell nothing (docs/statistics.md).
"""

DIGITS = 3  # significant digits of numbers that people read; JSON has all of them
PLAIN = (1e-4, 1e7)  # range of absolute values that are written out; other numbers have a power of ten


class Estimate(NamedTuple):
    """An estimate with its 95 % interval."""

    value: float
    """NaN where it is undetermined."""
    low: float = math.nan
    high: float = math.nan
    """NaN, as `low` is, where there is no interval; inf where the upper end is not reached."""
    name: str = ""
    """Name of the statistic: mean, restricted mean, median, share."""
    unit: str = ""
    n: int = 0
    """Number of trials from which it is estimated; 0 if it is not estimated from trials."""
    censored: float = 0.0
    """Share of these that is censored."""

    @property
    def has_interval(self) -> bool:
        """Whether there is an interval, though its upper end may be open."""
        return not math.isnan(self.low)

    @property
    def ends(self) -> tuple[float, float, float]:
        """The value, and the lower and the upper end of its interval."""
        return self.value, self.low, self.high

    def apply(self, function: Callable[[float], float]) -> "Estimate":
        """Return the estimate of a rising function of the estimated number."""
        value, low, high = map(function, self.ends)
        return self._replace(value=value, low=low, high=high)

    def __str__(self) -> str:
        """Return the value and its interval in the digits that the interval leaves to them, three at most.

        >>> print(Estimate(44.21, 28.9, 66.8), Estimate(0.94, 0.55, 1.6), Estimate(47.02, 40.1, math.inf))
        44 [29, 67] 0.94 [0.55, 1.60] 47.0 [40.1, ?]
        >>> print(Estimate(4.421e8, 2.89e8, 6.68e8), Estimate(1e8, 9.9e7, 1.01e8))
        4.4e+08 [2.9e+08, 6.7e+08] 1.00e+08 [9.90e+07, 1.01e+08]
        """
        value, low, high = self.ends
        if not self.has_interval or math.isnan(value):
            return significant(value)
        sides = [side for side in (value - low, high - value) if 0 < side < math.inf]
        decimals = DIGITS - 2 - math.floor(math.log10(min(sides))) if sides else None
        return "{} [{}, {}]".format(*(significant(end, decimals) for end in self.ends))


UNDETERMINED = Estimate(math.nan)  # of a number of which nothing is known


def significant(number: float, decimals: int | None = None) -> str:
    """Return a number in three significant digits: `-` for NaN, `?` for one that is not reached.

    With `decimals`, the largest number of digits after the point, negative for whole tens, zeros at their end stay.

    >>> significant(12345.6), significant(47.0271), significant(0.000012), significant(47.0, 1)
    ('12300', '47', '1.2e-05', '47.0')
    """
    if math.isnan(number) or math.isinf(number):
        return "-" if math.isnan(number) else "?"
    if number == 0:
        return f"{0:.{min(DIGITS - 1, max(0, decimals or 0))}f}"
    places = DIGITS - 1 - math.floor(math.log10(abs(number)))
    places = places if decimals is None else min(places, decimals)
    shown = round(number, places)
    if shown and not PLAIN[0] <= abs(shown) < PLAIN[1]:
        kept = min(DIGITS, places + math.floor(math.log10(abs(shown))) + 1)
        return f"{number:.{DIGITS}g}" if decimals is None else f"{shown:.{kept - 1}e}"
    text = f"{shown + 0.0:.{max(0, places)}f}"
    return text.rstrip("0").rstrip(".") if decimals is None and "." in text else text
