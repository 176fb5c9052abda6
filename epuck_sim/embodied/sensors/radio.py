"""Radio pulses: who receives which, and when (thesis 6.2).

A robot sends in each control step in which its ring goes on, or its controller sets `actuators.send`. The pulse is on
the air in the next control step, in which robots also see the ring, and arrives `latency` control steps later.
"""

import math
from typing import Any

from epuck_sim.arrays import ByteArray, IntArray
from epuck_sim.control.interface import MAX_MESSAGES
from epuck_sim.embodied.sensors.camera import NEVER
from epuck_sim.embodied.sensors.flash_cone import in_cone
from epuck_sim.embodied.swarm import Swarm, group_of, swarm_at
from epuck_sim.scenario.robots import RadioSignal, SignalSection
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.rng import uniform


def slots_of(section: SignalSection, step_ms: int) -> int:
    """Return the number of control steps for which each robot of a group has PULSES in `Swarm.air`; 0 without radio."""
    return math.ceil(section.latency_ms / step_ms) + 1 if isinstance(section, RadioSignal) else 0


def set_radio(record: Any, section: RadioSignal, step_ms: int) -> None:
    """Set RADIO of a group, without the index of its pulses; `set_cone` says where they reach."""
    record.loss, record.collisions, record.half_duplex = section.loss, section.collisions, section.half_duplex
    record.slots = slots_of(section, step_ms)


@jit_no_alloc
def receive_pulses(block: ByteArray, addresses: IntArray, number: int) -> None:  # noqa: ARG001
    """Send the pulses of the last control step on their way, and deliver to a group those that arrive in this one."""
    swarm = swarm_at(block)
    group, step = swarm.groups[number], swarm.scene[0].step
    radio = group.radio
    senders = 0
    for index in range(len(swarm.robots)):
        robot = swarm.robots[index]
        goes_on = robot.ring_on and not robot.ring_before
        robot.sends = goes_on or robot.actuators.send != 0
        if robot.sends:
            swarm.numbers[senders] = index
            senders += 1
    departing, arriving = (step + radio.slots - 1) % radio.slots, step % radio.slots
    for place in range(group.count):
        leaving = swarm.air[radio.first + departing * group.count + place]
        leaving.count = _take_from_air(swarm, group, senders, group.first + place, leaving)
        pulses = swarm.air[radio.first + arriving * group.count + place]
        sensors = swarm.robots[group.first + place].sensors
        sensors.pulses = pulses.count
        for message in range(MAX_MESSAGES):
            sensors.messages[message] = pulses.messages[message] if message < pulses.count else 0
        swarm.pixels[group.row + place] = 1 if pulses.count > 0 else 0


@jit_inline
def _take_from_air(swarm: Swarm, group: Any, senders: int, number: int, pulses: Any) -> int:
    """Write the messages that reach a robot in this control step; return how many do."""
    radio, receiver = group.radio, swarm.robots[number]
    if radio.half_duplex and receiver.sends:
        return 0
    count = 0
    for place in range(senders):
        sender = swarm.numbers[place]
        if sender == number or not in_cone(receiver, swarm.robots[sender], group.cone):
            continue
        if radio.loss > 0.0 and uniform(receiver.signal_random) < radio.loss:
            continue
        if count < MAX_MESSAGES:
            pulses.messages[count] = swarm.robots[sender].actuators.send
        count += 1
    return 0 if radio.collisions and count > 1 else count


def forget_signals(swarm: Swarm, robot: int) -> None:
    """Discard the picture and the pulses on their way to a robot; its camera keeps its instants."""
    swarm.robots[robot].picture_arrives = NEVER
    group = swarm.groups[group_of(swarm, robot)]
    first = group.radio.first + robot - group.first
    swarm.air.count[first : first + group.radio.slots * group.count : group.count] = 0
