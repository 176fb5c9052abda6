"""Grey pictures in files."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from epuck_sim.arrays import ByteArray

LONGEST_SIDE = 4000
"""Most rows, and most columns, of a picture."""


def read_grey(path: Path) -> ByteArray:
    """Return (rows, columns) levels of a picture, from 0 for black to 255 for white.

    The file is read again only when it has changed.

    Raises:
        OSError: The file cannot be read.
        ValueError: It holds no picture that OpenCV reads, or a larger one than allowed.
    """
    status = path.stat()
    return _read(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=8)
def _read(path: Path, *_stamp: int) -> ByteArray:
    import cv2  # noqa: PLC0415 is needed, and installed, where there are pictures

    try:
        picture = cv2.imdecode(np.frombuffer(path.read_bytes(), np.uint8), cv2.IMREAD_GRAYSCALE)
    except cv2.error:
        picture = None
    if picture is None:
        raise ValueError("is no picture that can be read; give a PNG, say")
    rows, columns = picture.shape
    if max(rows, columns) > LONGEST_SIDE:
        raise ValueError(f"is a picture of {columns} x {rows} pixels; allowed: up to {LONGEST_SIDE} x {LONGEST_SIDE}")
    return np.asarray(picture, np.uint8)
