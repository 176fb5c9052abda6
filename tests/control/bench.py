"""Robots on a bench: tests set what they sense, and read what they remember and command."""

import os
from collections.abc import Mapping, Sequence
from fractions import Fraction
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np

from epuck_sim.control.interface import ACTUATORS, MAX_MESSAGES, Controller, Sensors, Value
from epuck_sim.control.loader import find_controller
from epuck_sim.control.runner import ControllerRunner, SensorArrays
from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.util.seeds import robot_streams

EMPTY = """
PARAMETERS = {}
MEMORY = {"x": float}

def start(memory, parameters, random):
    pass

def step(sensors, memory, actuators, parameters, random):
    pass
"""
"""A controller that does nothing: tests replace parts of it."""


class Bench:
    """A group of robots under `ControllerRunner`, with sensors to be set by hand."""

    def __init__(
        self,
        controller: Controller | str,
        given: Mapping[str, Value] | None = None,
        *,
        each: Mapping[str, Sequence[Value]] | None = None,
        robots: int = 1,
        seed: int = 1,
        pixels: int = 60,
        step_ms: int = 100,
        interpret: bool = True,
    ) -> None:
        """given: parameters of all robots; each: parameters with a value a robot."""
        if isinstance(controller, str):
            controller = find_controller(controller)
        parameters = np.repeat(controller.parameter_record(controller.resolve(given or {})), robots)
        for name, values in (each or {}).items():
            parameters[name] = values
        self._step_ms = step_ms
        self.senses = SensorArrays(
            np.full(robots, step_ms),
            np.zeros((robots, 8)),
            np.full((robots, 8), OUT_OF_RANGE_MM),
            np.zeros((robots, pixels), np.int64),
            np.ones(robots, np.bool_),
            np.zeros(robots, np.int64),
            np.zeros((robots, MAX_MESSAGES), np.int64),
            np.ones(robots, np.bool_),
        )
        self.actuators = np.zeros(robots, ACTUATORS)
        self.streams = robot_streams(np.random.SeedSequence(seed), robots)
        self.control = ControllerRunner(controller, parameters, self.streams, self.senses, self.actuators, interpret)
        self.control.start()
        self.memory = self.control.memory

    def sense(self, chance: np.random.Generator) -> None:
        """Have each robot sense something else: anything that the sensors can give."""
        robots = len(self.actuators)
        self.senses.infrared[:] = chance.normal(200, 400, (robots, 8))
        self.senses.distance_mm[:] = random_distances(chance, (robots, 8))
        self.senses.camera[:] = chance.random(self.senses.camera.shape) < chance.choice([0, 0.02, 0.5], (robots, 1))
        self.senses.step_ms[:] = self._step_ms + chance.integers(-1, 2, robots)
        self.senses.new_picture[:] = chance.random(robots) < 0.7

    def state(self) -> bytes:
        """What all robots remember, command and will draw, bit for bit."""
        return self.memory.tobytes() + self.actuators.tobytes() + self.streams.tobytes()


def write_controller(path: Path, text: str) -> Controller:
    """Write a controller's file and return what it describes."""
    write_soon_after(path, text)
    return find_controller(str(path))


def write_soon_after(path: Path, text: str) -> None:
    """Write a file as if all tests' writing had taken less than a second, as a quick editor's does."""
    path.write_text(text)
    stamp = 1_700_000_000 * 10**9 + next(_microseconds) * 1000
    os.utime(path, ns=(stamp, stamp))


_microseconds = count()


def with_step(line: str, **assignments: str) -> str:
    """Return `EMPTY` with `line` as its step, and with e.g. PARAMETERS="{'gain': 2.0}"."""
    head, _, _ = EMPTY.rpartition("    pass")
    return head + f"    {line}\n" + "".join(f"{name} = {value}\n" for name, value in assignments.items())


def function(name: str, controller: str) -> Any:
    """Return a function of a shipped controller's file."""
    return find_controller(controller).step.__globals__[name]


def settings(controller: str, **given: Value) -> SimpleNamespace:
    """Return a controller's parameters as its functions read them."""
    return SimpleNamespace(**find_controller(controller).resolve(given))


def sensors(
    step_ms: int = 100,
    distance_mm: Mapping[int, int] | None = None,
    red: int = 0,
    pixels: int = 60,
    new_picture: bool = True,
) -> Sensors:
    """Return what a robot senses: distances by the sensor's number, and so many red pixels."""
    distances = np.full(8, OUT_OF_RANGE_MM)
    for sensor, distance in (distance_mm or {}).items():
        distances[sensor] = distance
    return Sensors(step_ms, np.zeros(8), distances, (np.arange(pixels) < red).astype(np.uint8), new_picture)


def random_distances(chance: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Return distances in mm: many close ones, some around each threshold, many out of range."""
    distances = chance.integers(0, 45, shape)
    far = chance.random(shape)
    distances[far < 0.6] = OUT_OF_RANGE_MM
    distances[far < 0.1] = chance.integers(95, 121, shape)[far < 0.1]
    return distances


def exactly(value: float) -> Fraction:
    """Return the decimal number that was written, not its nearest binary one."""
    return Fraction(repr(value))
