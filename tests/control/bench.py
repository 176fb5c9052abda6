"""Robots on a bench: tests set what they sense, and read what they remember and command."""

import os
from itertools import count
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from epuck_sim.control.interface import EPUCK_WHEELS, Controller
from epuck_sim.control.loader import find_controller
from epuck_sim.embodied.swarm import SENSED, make_block, open_block
from epuck_sim.embodied.user_code import GroupControllers, assign_bytes, bytes_needed
from epuck_sim.epuck import OUT_OF_RANGE_MM
from epuck_sim.user_files import Value
from epuck_sim.util.seeds import robot_streams

MODES = pytest.mark.parametrize("interpret", [True, False], ids=["interpreted", "compiled"])
"""Runs a test of controllers twice."""

EMPTY = """
PARAMETERS = {}
MEMORY = {"x": float}

def start(memory, parameters, random):
    pass

def step(sensors, memory, actuators, parameters, random):
    pass
"""  # a controller that does nothing: tests replace parts of it


def controlled_swarm(controllers, counts, pixels, *, interpret=True, **rooms):
    """Return the block of groups of e-pucks near which nothing is, the swarm, and controllers that have not started.

    Rooms are lengths of further arrays of the block.
    """
    robots, needed = sum(counts), sum(map(bytes_needed, controllers, counts))
    lengths = {"robots": robots, "groups": len(counts), "pixels": robots * pixels, "bytes": needed}
    block = make_block({**lengths, **rooms})
    swarm = open_block(block)
    members, groups, swarm.scene[0].serving = swarm.robots, swarm.groups, -1
    groups.first, groups.count, groups.pixels = np.cumsum([0, *counts])[:-1], counts, pixels
    groups.row = groups.first * pixels
    members.present, members.random = True, robot_streams(np.random.SeedSequence(1), robots)
    members.wheel_limit_cm_s, members.wheel_base_cm = EPUCK_WHEELS
    members.sensors.distance_mm, members.sensors.new_picture = OUT_OF_RANGE_MM, True
    runs, byte = [], 0
    for number, controller in enumerate(controllers):
        byte = assign_bytes(swarm, groups[number], controller, byte)
        run = GroupControllers(block, swarm, number, controller, interpret=interpret)
        run.parameters[:] = controller.parameter_record(controller.parameters)
        runs.append(run)
    return block, swarm, runs


class Bench:
    """A group of robots under `GroupControllers`, with sensors to be set by hand."""

    def __init__(self, controller: Controller | str, given=None, *, robots: int = 1, interpret: bool = True) -> None:
        if isinstance(controller, str):
            controller = find_controller(controller)
        _, self.swarm, (self.control,) = controlled_swarm([controller], [robots], 60, interpret=interpret)
        members = self.swarm.robots
        self.actuators, self.streams = members.actuators, members.random
        senses = {name: members.sensors[name] for name in SENSED.names or ()}
        self.senses = SimpleNamespace(**senses, camera=self.swarm.pixels.reshape(robots, 60))
        self.senses.step_ms[:] = 100
        self.control.parameters[:] = controller.parameter_record(controller.resolve(given or {}))
        self.memory = self.control.memory
        self.control.start()

    def sense(self, chance: np.random.Generator) -> None:
        """Have each robot sense something else: anything that the sensors can give."""
        robots = len(self.actuators)
        self.senses.infrared[:] = chance.normal(200, 400, (robots, 8))
        self.senses.distance_mm[:] = random_distances(chance, (robots, 8))
        self.senses.camera[:] = chance.random(self.senses.camera.shape) < chance.choice([0, 0.02, 0.5], (robots, 1))
        self.senses.step_ms[:] = 100 + chance.integers(-1, 2, robots)
        self.senses.new_picture[:] = chance.random(robots) < 0.7

    def sense_like(self, other: "Bench") -> None:
        for name, readings in vars(other.senses).items():
            vars(self.senses)[name][:] = readings

    def state(self) -> bytes:
        """What all robots remember, command and will draw, bit for bit."""
        return self.memory.tobytes() + self.actuators.tobytes() + self.streams.tobytes()


def write_controller(path: Path, text: str) -> Controller:
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


def with_sense(lines: str, readings: str, parameters: str = "{}") -> str:
    given = f"PARAMETERS = {parameters}\nREADINGS = {readings}\n\n"
    return f"{given}def sense(world, robot, readings, parameters, random):\n    {lines}\n"


def function(name: str, controller: str) -> Any:
    return find_controller(controller).step.__globals__[name]


def settings(controller: str, **given: Value) -> SimpleNamespace:
    return SimpleNamespace(**find_controller(controller).resolve(given))


def random_distances(chance: np.random.Generator, shape: tuple[int, ...]) -> np.ndarray:
    """Return distances in mm: many close ones, some around each threshold, many out of range."""
    distances = chance.integers(0, 45, shape)
    far = chance.random(shape)
    distances[far < 0.6] = OUT_OF_RANGE_MM
    distances[far < 0.1] = chance.integers(95, 121, shape)[far < 0.1]
    return distances
