"""Sensors in files of their own: where their readings and random numbers lie in a block, and how they run.

`run_sensor` is compiled, or interpreted, with the `sense` of a user's file (docs/sensors.md).
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any
from zlib import crc32

import numpy as np

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.interface import Sensor, World
from epuck_sim.embodied.start import SENSORS
from epuck_sim.embodied.swarm import FLOAT64, SENSED_BYTES, Swarm, swarm_at
from epuck_sim.embodied.user_code import Records, UserCode
from epuck_sim.user_files import line_of_definition
from epuck_sim.util.native import array_at, record_type
from epuck_sim.util.seeds import robot_streams

if TYPE_CHECKING:  # `bind` provides them
    sense: Callable[..., None]
    READINGS: np.dtype[Any]
    PARAMETERS: np.dtype[Any]

STREAM = record_type([("words", "u8", 4)])  # a stream of random numbers

STREAM_BYTES = STREAM.itemsize


def run_sensor(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Read a sensor on each robot of a group that is in the arena; others read 0."""
    swarm = swarm_at(block)
    scene, own = swarm.scene[0], swarm.senses[number]
    at = scene.at[SENSED_BYTES]
    parameters = array_at(block, at + own.parameters, at + own.readings, PARAMETERS)[0]  # noqa: F821
    readings = array_at(block, at + own.readings, at + own.random, READINGS)  # noqa: F821
    words = array_at(block, at + own.readings, at + own.random, FLOAT64)
    streams = array_at(block, at + own.random, at + own.kept, STREAM)
    world = World(
        float(scene.step * scene.step_s),
        float(scene.width_cm),
        float(scene.height_cm),
        float(swarm.robots[own.first].radius_cm),
        swarm.robots,
        swarm.circles[: scene.circles],
        swarm.edges[: scene.edges],
        swarm,
    )
    first_robot, count, floats = own.first, own.count, own.floats
    size = len(words) // count
    scene.sensing = number + 1
    for member in range(count):
        robot, first = swarm.robots[first_robot + member], member * size
        if not robot.present:
            for place in range(first, first + size):
                words[place] = 0.0
            continue
        stream = streams[member]
        scene.serving = first_robot + member
        scene.kept_random = stream.words
        sense(world, robot, readings[member], parameters, stream.words[:])  # noqa: F821
        for place in range(first, first + floats):
            if math.isnan(words[place]):
                raise ValueError("a reading is not a number")
    scene.serving, scene.sensing = -1, 0


def sensed_bytes(sensor: Sensor, robots: int) -> int:
    """Return how many bytes in `Swarm.sensed` a sensor of this number of robots needs."""
    return sensor.parameter_type.itemsize + robots * (2 * sensor.readings.itemsize + STREAM_BYTES)


def assign_sense(record: Any, sensor: Sensor, first: int, count: int, byte: int) -> int:
    """Set the SENSE of a sensor of `count` robots from `first` on; return the end of its bytes, from `byte` on."""
    record.first, record.count, record.parameters = first, count, byte
    record.readings = byte + sensor.parameter_type.itemsize
    record.random = record.readings + count * sensor.readings.itemsize
    record.kept = record.random + count * STREAM_BYTES
    fields = [sensor.readings[name] for name in sensor.readings.names or ()]
    record.floats = sum(int(np.prod(field.shape, dtype=int)) for field in fields if field.base.kind == "f")
    return byte + sensed_bytes(sensor, count)


def readings_of(swarm: Swarm, record: Any, sensor: Sensor) -> Records:
    """Return (robots,) each robot's readings of a sensor, by its SENSE record, in place."""
    readings: Records = swarm.sensed[record.readings : record.random].view(sensor.readings)
    return readings


class OwnSensor(UserCode):
    """A sensor in a file of its own, of one group of robots."""

    sensor: Sensor
    name: str  # its name in the scenario
    readings: Records  # (robots,) each robot's readings, in place

    def __init__(
        self, block: ByteArray, swarm: Swarm, number: int, name: str, sensor: Sensor, *, interpret: bool = False
    ) -> None:
        """Compile a sensor of a scenario, without calling it; number: its index in `Swarm.senses`."""
        self._own = own = swarm.senses[number]
        super().__init__(sensor, block, swarm, number, own, swarm.sensed[own.parameters : own.readings])
        self.readings = readings_of(swarm, own, sensor)
        self.sensor, self.name, self._sensing = sensor, name, number + 1
        types = {"READINGS": sensor.readings, "PARAMETERS": sensor.parameter_type}
        self._make_run(run_sensor, {"sense": sensor.sense, **types}, interpret=interpret)

    @property
    def keys(self) -> tuple[int, int]:
        """Spawn key of its seed sequence, a child of the trial's."""
        return SENSORS, crc32(self.name.encode())

    @property
    def streams_at(self) -> tuple[int, int]:
        """Offsets in the block, in bytes, at which its robots' streams begin and end."""
        first = int(self._scene.at[SENSED_BYTES])
        return first + int(self._own.random), first + int(self._own.kept)

    def draw_streams(self, seed: int) -> None:
        """Set the robots' streams for the trial with a seed: they depend on the sensor's name and the robot alone."""
        sequence = np.random.SeedSequence(seed, spawn_key=self.keys)
        streams = robot_streams(sequence, self.robots.stop)[self.robots]
        self._swarm.sensed[self._own.random : self._own.kept] = streams.view(np.uint8).ravel()

    def _undo(self, block: ByteArray, swarm: Swarm, robot: int) -> None:  # noqa: ARG002
        stream = swarm.senses[self._number].random + STREAM_BYTES * (robot - self.robots.start)
        swarm.sensed[stream : stream + STREAM_BYTES] = swarm.scene[0].kept_random.view(np.uint8)

    def _without_line(self, error: BaseException, robot: int) -> tuple[str, BaseException]:
        reading = self.readings[robot - self.robots.start]
        if nan := [name for name in reading.dtype.names or () if np.isnan(np.asarray(reading[name], float)).any()]:
            error = ValueError(f"readings.{nan[0]} is not a number; allowed: numbers")
        return f"{self.sensor.path}:{line_of_definition('sense', self.sensor.sources[self.sensor.path])}", error
