"""Fields of what controllers remember and read, by name, for measures, traces and recordings."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import FloatArray
from epuck_sim.control.loader import find_controller
from epuck_sim.control.sensors import find_sensor
from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.util.messages import comma_list, did_you_mean

if TYPE_CHECKING:  # a step knows this module
    from epuck_sim.embodied.step import Step


def memory_field(memory: npt.NDArray[Any], field: str, default: float) -> FloatArray:
    """Return (robots,) a copy of a field of a group's memory, filled with `default` if there is no such field."""
    if field in (memory.dtype.names or ()):
        return np.array(memory[field], float)
    return np.full(len(memory), default)


def memory_values(memories: Sequence[npt.NDArray[Any]], field: str) -> FloatArray:
    """Return (robots,) a copy of a field of all groups' memories; NaN for robots that have no such field."""
    return np.concatenate([memory_field(memory, field, np.nan) for memory in memories])


READING = "sensors."
"""Begins names of readings of sensors in files of their own: `sensors.ground`, or `sensors.ground.2` of an array."""


def reading_fields(scenario: EmbodiedScenario) -> list[str]:
    """Return the names of all single numbers that robots read of sensors in files of their own."""
    fields: dict[str, None] = {}
    for section in (each for group in scenario.robots for each in group.sensors.values()):
        readings = find_sensor(section["file"]).readings
        for name in readings.names or ():
            size = int(np.prod(readings[name].shape, dtype=int))
            of_array = [f"{READING}{name}.{place}" for place in range(size)]
            fields |= dict.fromkeys(of_array if readings[name].shape else [f"{READING}{name}"])
    return list(fields)


def field_values(step: "Step", field: str) -> FloatArray:
    """Return (robots,) the values of a field of all robots' memories, or of a reading; NaN for those that lack it."""
    if not field.startswith(READING):
        return memory_values(step.memories, field)
    name, _, place = field.removeprefix(READING).partition(".")
    return step.readings[name].reshape(len(step.poses), -1)[:, int(place or 0)]


def check_field(scenario: EmbodiedScenario, field: str, robot: int | None = None) -> None:
    """Raise ValueError unless controllers remember a field that is one number.

    Args:
        scenario: Its groups of robots. If it is a sweep over controllers, nothing is known yet, and nothing raised.
        field: Name of the field.
        robot: A robot whose controller must have it; any robot if None.
    """
    if scenario.sweep is not None and any(key.endswith(".controller") for key in scenario.sweep.keys):
        return
    fields: dict[str, tuple[int, ...]] = {}
    first = 0
    for group in scenario.robots:
        if robot is None or first <= robot < first + group.count:
            memory = find_controller(group.controller).memory
            fields |= {name: memory[name].shape for name in memory.names or ()}
        first += group.count
    if field not in fields:
        raise ValueError(f"{did_you_mean(field, fields)}; what is remembered: {comma_list(fields)}")
    if fields[field]:
        raise ValueError(f"{field} is an array of shape {fields[field]}; allowed: fields that are one number")


def check_fields(scenario: EmbodiedScenario, fields: Sequence[str]) -> None:
    """Raise ScenarioError unless controllers of a scenario remember these fields; see `check_field`."""
    for field in fields:
        try:
            check_field(scenario, field)
        except ValueError as error:
            raise ScenarioError(f"{scenario.name}: memory: {error}") from error
