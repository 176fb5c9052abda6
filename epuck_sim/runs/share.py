"""A share of a sweep's trials, so that machines that know nothing of each other can run the whole of it."""

import re
from typing import NamedTuple, Self

from epuck_sim.errors import EpuckSimError

GOLDEN_RATIO = 0x9E3779B97F4A7C15
"""The golden ratio's fraction in 64 bits: multiples of it, cut to 64 bits, lie evenly at every step of an axis."""


class Share(NamedTuple):
    """One of several shares, each of which has about as many trials of every point as any other."""

    number: int
    """From 1 to `of`."""
    of: int

    @classmethod
    def parse(cls, text: str) -> Self:
        """Return the share that a text such as 3/40 names.

        Raises:
            EpuckSimError: It names none.
        """
        match = re.fullmatch(r"([0-9]{1,9})/([0-9]{1,9})", text)
        if match is None or not 1 <= int(match[1]) <= int(match[2]):
            raise EpuckSimError(f"--share is {text}; allowed: K/N with K from 1 to N, as in 3/40")
        return cls(int(match[1]), int(match[2]))

    def trials(self, point: int, trials: int) -> range:
        """Return the trials of this share at a point.

        They follow from the number of the point and that of the trial alone: trials that are added later leave those
        before them where they were. Points that have fewer trials than there are shares begin at different shares.

        Args:
            point: Number of the point in the sweep.
            trials: Number of its trials.

        >>> [list(Share(number, 3).trials(0, 5)) for number in (1, 2, 3)]
        [[0, 3], [1, 4], [2]]
        """
        begin = (point * GOLDEN_RATIO % 2**64) * self.of >> 64
        return range((self.number - 1 - begin) % self.of, trials, self.of)

    def __str__(self) -> str:
        return f"{self.number}/{self.of}"


WHOLE = Share(1, 1)
"""The only share of a sweep that is not divided."""
