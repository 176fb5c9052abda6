"""Types of arrays, by what they hold; shapes and units stand where an array is described."""

from typing import Any

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]
Float32Array = npt.NDArray[np.float32]
IntArray = npt.NDArray[np.int64]
IndexArray = npt.NDArray[np.uint32]
"""Indices in compiled loops; unsigned, as compiled code tests a signed index for counting from the end."""
BoolArray = npt.NDArray[np.bool_]
ByteArray = npt.NDArray[np.uint8]
StreamArray = npt.NDArray[np.uint64]  # (n, 4) states of random number generators, one a row; see `util.rng`
RecordArray = Any  # (n,) np.recarray, whose fields mypy does not know
WordArray = npt.NDArray[np.uint64]  # (n,) words of the state of a seed sequence or a generator; see `util.generators`
