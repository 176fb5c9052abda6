"""A picture of the overhead camera and the time it was taken: what films consist of and the tracker reads."""

from collections.abc import Iterable
from typing import Any, NamedTuple, Protocol, TypeVar

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]
"""(height_px, width_px, 3) red, green, blue; row 0 is the upper edge."""
Light = npt.NDArray[np.uint8]
"""(rows, columns) one channel of a picture or of the rectified view."""


class Frame(NamedTuple):
    """One picture of a film."""

    time_s: float
    """Beginning of its exposure, on the film's own clock."""
    picture: Picture


Timed = TypeVar("Timed", bound=tuple[Any, ...])
"""A tuple whose first item is its time in seconds, such as a frame or a row of a recording."""


class ProgressWrapper(Protocol):
    """Wraps an iterable of timed items and shows how far its reader is."""

    def __call__(self, timed: Iterable[Timed], duration_s: float | None) -> Iterable[Timed]:
        """Return the same items in the same order; duration_s: time of the last one, None if it is unknown."""
