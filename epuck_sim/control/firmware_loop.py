"""Runs firmware in C for a group of robots: one call for all of them, with no Python between steps."""

import ctypes
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuck_sim.control.firmware import Firmware
from epuck_sim.util.addresses import call_c_at, compile_at
from epuck_sim.util.held_values import hold
from epuck_sim.util.jit import kernel_digest

GROUP = np.dtype(
    [
        ("robots", np.int64),
        ("pixels", np.int64),
        ("memory_size", np.int64),
        ("parameters_size", np.int64),
        ("step_ms", np.intp),
        ("distance_mm", np.intp),
        ("camera", np.intp),
        ("infrared", np.intp),
        ("new_picture", np.intp),
        ("pulses", np.intp),
        ("messages", np.intp),
        ("actuators", np.intp),
        ("memory", np.intp),
        ("parameters", np.intp),
        ("random", np.intp),
        ("serving", np.intp),
        ("present", np.intp),
    ]
)
"""Record of a group, `e_group` of the header: sizes, and addresses of its arrays."""

TYPES = dict.fromkeys(("step_ms", "distance_mm", "camera", "pulses", "messages"), np.int64) | {
    "infrared": np.float64,
    "new_picture": np.bool_,
    "present": np.bool_,
}
"""Type of each array of sensors."""


class FirmwareCall(NamedTuple):
    """A function of a firmware, and what it is called with."""

    function: int
    """Address of the function."""
    group: int
    """Address of a `GROUP`."""


class FirmwareLoops(NamedTuple):
    """How a firmware runs on a group of robots."""

    start_all: Callable[[int], None]
    step_all: Callable[[int], None]
    """Runs one control step of each robot; takes `address`."""
    address: int
    """Address of a `FirmwareCall`; 0 if Python calls the firmware."""
    owners: tuple[object, ...]
    """What must exist as long as these are called."""


if TYPE_CHECKING:  # `bind` provides it
    value_at: Callable[[int], FirmwareCall]


def _call_firmware(address: int) -> None:
    """Call a function of a firmware."""
    call = value_at(address)  # noqa: F821 see `bind`
    call_c_at(call.function, call.group)


def firmware_loops(firmware: Firmware, arrays: Any, *, interpret: bool) -> FirmwareLoops:
    """Return the loops of a firmware over a group of robots.

    Args:
        firmware: What runs on the robots.
        arrays: The group's `ControllerArrays`.
        interpret: Whether Python calls the firmware, instead of compiled code.
    """
    group = _group_record(arrays)
    address_of_group = group.ctypes.data

    def start_all(_: int) -> None:
        firmware.library.e_start_all(ctypes.c_void_p(address_of_group))

    def step_all(_: int) -> None:
        firmware.library.e_step_all(ctypes.c_void_p(address_of_group))

    if interpret:
        return FirmwareLoops(start_all, step_all, 0, (group, arrays))
    function = ctypes.cast(firmware.library.e_step_all, ctypes.c_void_p).value or 0
    call = FirmwareCall(function, address_of_group)
    compiled = _compiled_call(call)
    owner, address = hold(call)
    return FirmwareLoops(start_all, compiled, address, (owner, group, arrays))


def _group_record(arrays: Any) -> np.ndarray[Any, Any]:
    """Return the record of a group; the firmware reads and writes the arrays themselves."""
    group = np.zeros(1, GROUP)
    group["robots"], group["pixels"] = arrays.senses.camera.shape
    group["memory_size"], group["parameters_size"] = arrays.memory.itemsize, arrays.parameters.itemsize
    sensors = {name: getattr(arrays.senses, name) for name in TYPES}
    assert all(array.dtype == TYPES[name] for name, array in sensors.items())
    others = {name: getattr(arrays, name) for name in ("actuators", "memory", "parameters", "random", "serving")}
    for name, array in (sensors | others).items():
        assert array.flags.c_contiguous
        group[name] = array.ctypes.data
    return group


_compiled: list[Any] = []


def _compiled_call(call: FirmwareCall) -> Any:
    """Return `_call_firmware` compiled, once for all firmware."""
    if not _compiled:
        _compiled.append(compile_at(_call_firmware, call, kernel_digest(), careful=False))
    return _compiled[0]
