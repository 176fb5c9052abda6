"""A picture of the overhead camera and when it was taken: what films are made of, and what the tracker looks at."""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Picture = npt.NDArray[np.uint8]
"""(height_px, width_px, 3) red, green, blue; row 0 is the upper edge."""


class Frame(NamedTuple):
    """One picture of a film."""

    time_s: float
    """When its exposure began, on the film's own clock."""
    picture: Picture
