"""Radio pulses: who receives which, and when (thesis 6.2).

A robot sends in each control step in which its ring goes on, or its controller sets `actuators.send`. The pulse is on
the air in the next control step, in which robots also see the ring, and arrives `latency` control steps later.
"""

import math
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.control.interface import MAX_MESSAGES
from epuck_sim.control.runner import SensorArrays
from epuck_sim.embodied.flash_cone import FlashCone, in_cone, make_cone
from epuck_sim.scenario.signals import RadioSignal
from epuck_sim.util.jit import jit
from epuck_sim.util.rng import uniform


class Radio(NamedTuple):
    """The receivers of a group of robots."""

    cone: FlashCone
    """Where pulses reach."""
    loss: float
    """Probability with which a receiver misses a pulse."""
    collisions: bool
    """Whether several pulses at once destroy each other."""
    half_duplex: bool
    """Whether a robot that sends receives nothing."""
    streams: StreamArray
    """(group, 4) random streams."""
    actuators: npt.NDArray[np.void]
    """(robots,) records that controllers set, see `control.interface.ACTUATORS`."""
    ring_before: BoolArray
    """(robots,) whether each ring was lit one control step earlier."""
    is_sending: BoolArray
    """(robots,) whether each robot's pulse is on the air in this control step."""
    counts_on_way: IntArray
    """(latency + 1, group) number of pulses that arrive, by the control step of their arrival modulo latency + 1."""
    messages_on_way: IntArray
    """(latency + 1, group, MAX_MESSAGES) the messages in them."""
    counts: IntArray
    """(group,) number of pulses that arrive in this control step; written."""
    messages: IntArray
    """(group, MAX_MESSAGES) the messages in them; written."""
    flashes: IntArray
    """(group, 1) 1 for a robot at which a pulse arrives, 0 for others; written."""


def make_radio(
    section: RadioSignal,
    step_ms: int,
    streams: StreamArray,
    actuators: npt.NDArray[np.void],
    ring_before: BoolArray,
    sensors: SensorArrays,
) -> Radio:
    """Return the receivers that a group's section of a scenario describes.

    Args:
        section: The group's signal.
        step_ms: Length of a control step.
        streams: See `Radio`, for the next two, too.
        actuators: See `Radio`.
        ring_before: See `Radio`.
        sensors: What the group's controllers read; written.
    """
    robots, group = len(actuators), len(streams)
    slots = math.ceil(section.latency_ms / step_ms) + 1
    return Radio(
        cone=make_cone(section),
        loss=section.loss,
        collisions=section.collisions,
        half_duplex=section.half_duplex,
        streams=streams,
        actuators=actuators,
        ring_before=ring_before,
        is_sending=np.zeros(robots, np.bool_),
        counts_on_way=np.zeros((slots, group), np.int64),
        messages_on_way=np.zeros((slots, group, MAX_MESSAGES), np.int64),
        counts=sensors.pulses,
        messages=sensors.messages,
        flashes=sensors.camera,
    )


def restart_radio(radio: Radio) -> None:
    """Set receivers to before the first step: nothing is on its way."""
    radio.counts_on_way[:] = 0


def forget_pulses(radio: Radio, row: int) -> None:
    """Have nothing be on its way to a robot of the group."""
    radio.counts_on_way[:, row] = 0


@jit
def receive_pulses(radio: Radio, poses: FloatArray, ring_on: BoolArray, first_robot: int, step: int) -> None:
    """Send the pulses of the last control step on their way, and deliver those that arrive in this one.

    Args:
        radio: The receivers.
        poses: (robots, 3) cm, cm, rad: x, y, heading.
        ring_on: (robots,) whether each ring is lit.
        first_robot: Number of the group's first robot.
        step: Number of the control step.
    """
    for robot in range(len(ring_on)):
        goes_on = ring_on[robot] and not radio.ring_before[robot]
        radio.is_sending[robot] = goes_on or radio.actuators[robot].send != 0
    senders = np.flatnonzero(radio.is_sending)
    slots = len(radio.counts_on_way)
    departing, arriving = (step + slots - 1) % slots, step % slots
    for row in range(len(radio.counts)):
        radio.counts_on_way[departing, row] = _take_from_air(
            radio, poses, senders, first_robot + row, row, radio.messages_on_way[departing, row]
        )
        count = radio.counts_on_way[arriving, row]
        radio.counts[row] = count
        radio.messages[row, :] = 0
        for place in range(min(count, MAX_MESSAGES)):
            radio.messages[row, place] = radio.messages_on_way[arriving, row, place]
        radio.flashes[row, 0] = count > 0


@jit
def _take_from_air(
    radio: Radio, poses: FloatArray, senders: IntArray, receiver: int, row: int, messages: IntArray
) -> int:
    """Write the messages that reach a receiver in this control step; return how many do."""
    if radio.half_duplex and radio.is_sending[receiver]:
        return 0
    count = 0
    for sender in senders:
        if sender == receiver or not in_cone(poses, receiver, sender, radio.cone):
            continue
        if radio.loss > 0.0 and uniform(radio.streams[row]) < radio.loss:
            continue
        if count < MAX_MESSAGES:
            messages[count] = radio.actuators[sender].send
        count += 1
    return 0 if radio.collisions and count > 1 else count
