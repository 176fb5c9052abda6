"""What controllers read of sensors in files of their own: further fields of `Sensors`, by the names of the readings."""

from collections import namedtuple
from collections.abc import Sequence
from functools import lru_cache
from typing import Any

from epuck_sim.arrays import ByteArray
from epuck_sim.control.interface import Sensor, Sensors
from epuck_sim.embodied.swarm import SENSED_BYTES
from epuck_sim.util.jit import WITHOUT_ALLOCATION, Kernel, jit_inline
from epuck_sim.util.native import array_at


def names_of_readings(sensors: Sequence[Sensor]) -> tuple[str, ...]:
    """Return the names of all readings of sensors, in order."""
    return tuple(name for sensor in sensors for name in sensor.readings.names or ())


@lru_cache
def completion(sensors: tuple[Sensor, ...]) -> Any:
    """Return a kernel (sensors, block, swarm, first, member) that adds a group's further readings to `Sensors`.

    The first of its sensors in files of their own has index `first` in `Swarm.senses`.
    """
    if not sensors:
        return _as_they_are
    known: dict[str, Any] = {
        "array_at": array_at,
        "Complete": namedtuple("Sensors", (*Sensors._fields, *names_of_readings(sensors))),
    }
    lines, fields = [], [f"sensors.{name}" for name in Sensors._fields]
    for number, sensor in enumerate(sensors):
        known[f"TYPE_{number}"] = sensor.readings
        place = f"swarm.senses[first + {number}]"
        lines.append(
            f"    own_{number} = array_at(block, at + {place}.readings, at + {place}.random, TYPE_{number})[member]"
        )
        for name in sensor.readings.names or ():
            field = sensor.readings[name]
            number_type = "float" if field.kind == "f" else "int"
            fields.append(f"own_{number}.{name}[:]" if field.shape else f"{number_type}(own_{number}.{name})")
    source = [
        "def complete(sensors, block, swarm, first, member):",
        f"    at = swarm.scene[0].at[{SENSED_BYTES}]",
        *lines,
        f"    return Complete({', '.join(fields)})",
    ]
    exec("\n".join(source), known)
    complete = known["complete"]
    kernel = Kernel(complete, **WITHOUT_ALLOCATION, forceinline=True)
    kernel.for_python = complete
    return kernel


@jit_inline
def _as_they_are(sensors: Any, block: ByteArray, swarm: Any, first: int, member: int) -> Any:  # noqa: ARG001
    return sensors
