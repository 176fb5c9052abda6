"""The C functions behind pymunk, by their addresses, and arrays that they read and write for all bodies at once."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import pymunk
import pymunk.batch
from pymunk._chipmunk_cffi import ffi, lib
from pymunk.batch import BodyFields

from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.chipmunk import CALLS
from epuck_sim.errors import EpuckSimError

POSE = BodyFields.POSITION | BodyFields.ANGLE
VELOCITY = BodyFields.VELOCITY | BodyFields.ANGULAR_VELOCITY
"""What an array of bodies holds: x, y and angle, or their changes."""


class Batch:
    """An array from which pymunk's functions of one body read, or to which they write."""

    def __init__(self, fields: BodyFields, array: FloatArray) -> None:
        """Refer to (robots, 3) `array`, which holds these fields of each body."""
        self._buffer = pymunk.batch.Buffer()
        self._buffer.set_float_buf(array)
        self._buffer._float_arr.max = np.iinfo(np.int32).max  # pymunk frees an array that it finds full, and grows it
        self._data = ffi.new("pmBatchedData *")
        self._data.fields = fields.value
        self._data.floatArray, self._data.intArray = self._buffer._float_arr, self._buffer._int_arr

    @property
    def pointer(self) -> int:
        """Address of the batch."""
        return pointer_value(self._data)

    @property
    def index_pointer(self) -> int:
        """Address of the index of the next float to read or to write."""
        return pointer_value(ffi.addressof(self._data.floatArray, "num"))


_FUNCTIONS = {
    "step": ("cpSpaceStep", "void(*)(cpSpace *, cpFloat)"),
    "add_body": ("cpSpaceAddBody", "cpBody *(*)(cpSpace *, cpBody *)"),
    "add_shape": ("cpSpaceAddShape", "cpShape *(*)(cpSpace *, cpShape *)"),
    "remove_body": ("cpSpaceRemoveBody", "void(*)(cpSpace *, cpBody *)"),
    "remove_shape": ("cpSpaceRemoveShape", "void(*)(cpSpace *, cpShape *)"),
    "set_body": ("pmSpaceBodySetIteratorFuncBatched", "cpSpaceBodyIteratorFunc"),
    "get_body": ("pmSpaceBodyGetIteratorFuncBatched", "cpSpaceBodyIteratorFunc"),
}
"""Name and kind of each of Chipmunk's functions that `CALLS` names."""


def calls_with(batches: Mapping[str, Batch]) -> npt.NDArray[np.void]:
    """Return (1,) the record of addresses that `move_bodies` takes, without the space's."""
    calls = np.zeros(1, CALLS)
    for name, (function, kind) in _FUNCTIONS.items():
        calls[name] = function_address(function, kind)
    for name, batch in batches.items():
        calls[name], calls[f"{name}_index"] = batch.pointer, batch.index_pointer
    return calls


def pointer_value(pointer: Any) -> int:
    """Return the address that a pointer of cffi holds."""
    return int(ffi.cast("uintptr_t", pointer))


def function_address(name: str, kind: str) -> int:
    """Return the address of one of Chipmunk's functions.

    Raises:
        EpuckSimError: this pymunk's function is of another kind than compiled code takes it for.
    """
    function = ffi.addressof(lib, name)
    if ffi.typeof(function) is not ffi.typeof(kind):
        raise EpuckSimError(
            f"pymunk {pymunk.version}: its function {name} is {ffi.typeof(function).cname}, not {kind}; "
            f"install pymunk 7.3"
        )
    return pointer_value(function)
