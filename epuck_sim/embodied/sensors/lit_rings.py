"""The lit rings that the sensors of flashes look for: numbers and labels in a swarm's scratch, see `Swarm.numbers`."""

from typing import Any

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.embodied.swarm import HIDE
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.native import call


@jit_inline
def find_lit(robots: Any, numbers: IntArray) -> int:
    """Label the robots whose rings are lit with 1, others with 0, and list the lit; return how many there are.

    Labels and list are written to the swarm's scratch numbers.
    """
    found = 0
    for robot in range(len(robots)):
        numbers[len(robots) + robot] = 0
        if robots[robot].ring_on:
            numbers[len(robots) + robot] = 1
            numbers[found] = robot
            found += 1
    return found


@jit_inline
def find_visible(block: ByteArray, addresses: IntArray, robot: int, robots: int, numbers: IntArray) -> int:
    """Label and list the lit rings that faults do not hide from a robot, of all robots; return how many there are."""
    call(addresses[HIDE], block, addresses, robot)
    return list_labelled(robots, numbers)


@jit_inline
def list_labelled(robots: int, numbers: IntArray) -> int:
    """List the robots whose labels are not 0; return how many there are."""
    found = 0
    for robot in range(robots):
        if numbers[robots + robot] > 0:
            numbers[found] = robot
            found += 1
    return found
