"""A picture of the overhead camera and when it was taken: what films are made of, and what the tracker looks at."""

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]
"""(height_px, width_px, 3) red, green, blue; row 0 is the upper edge."""


class Frame(NamedTuple):
    """One picture of a film."""

    time_s: float
    """When its exposure began, on the film's own clock."""
    picture: Picture


Timed = TypeVar("Timed", bound=tuple[Any, ...])
"""Something that begins with a time, as a frame does, or a row of a recording."""


class Passing(Protocol):
    """Passes things on in the order of their times, and shows how far they are."""

    def __call__(self, timed: Iterable[Timed], duration_s: float | None) -> Iterable[Timed]:
        """Pass on things of which the last has about this time, if that is known."""
