"""Effects of faults on pulses, clocks and speeds of point agents; `epuck_sim.faults` has who has them, and when."""

from collections.abc import Iterator

import numpy as np

from epuck_sim.arrays import BoolArray, ByteArray, FloatArray, IntArray, RecordArray
from epuck_sim.faults import (
    CAMERA_BLIND,
    CLOCK_DRIFT,
    OSCILLATOR_FROZEN,
    RESTART,
    RING_DEAD,
    WHEELS_DEAD,
    change_until,
    misses,
    restart_faults,
)
from epuck_sim.particles.motion import advance_one, begin_motion, distance_travelled, start_at_present
from epuck_sim.particles.neighbours import nearest_image, row_of
from epuck_sim.particles.oscillators import forget_earliest
from epuck_sim.particles.swarm import FAULT_SEED, Arrays, Faulty, Instant, Neighbours, Trajectories, entry_of
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.jit import jit, jit_no_alloc
from epuck_sim.util.native import carve

FROZEN_RATE = 2.0**-60  # rate of the clock of a frozen oscillator: its phase stays, as far as it has digits


def begin_faults(swarm: Arrays, scenario: ParticleScenario, seed: int) -> None:
    """Begin a trial with the faults that its seed draws; periods and speeds are those without faults."""
    restart_faults(swarm.faults, swarm.affected, scenario.faults, seed, FAULT_SEED)
    swarm.base_period[:], swarm.base_speed[:] = swarm.period, swarm.speed
    swarm.is_mute[:] = swarm.is_deaf[:] = False


def change_faults(swarm: Arrays, time_ms: float) -> Iterator[tuple[int, int, bool, list[int]]]:
    """Begin and end the faults that are due; yield number, kind, whether it begins, and the agents of each change.

    The swarm is one that has been observed at this time.
    """
    faults: RecordArray = swarm.faults
    affected: RecordArray = swarm.affected.reshape(len(faults), -1)
    before, phases, now = affected.is_active.copy(), np.empty(affected.shape), swarm.scene.now
    _change_each(faults, affected, time_ms, phases)
    swarm.is_mute[:] = _have(swarm, RING_DEAD)
    swarm.is_deaf[:] = _have(swarm, CAMERA_BLIND) | _have(swarm, OSCILLATOR_FROZEN)
    drifts = faults.kind == CLOCK_DRIFT
    rates = np.where(affected.is_active[drifts], faults.strength[drifts, None], 1.0).prod(axis=0)
    periods = swarm.base_period / (rates * np.where(_have(swarm, OSCILLATOR_FROZEN), FROZEN_RATE, 1.0))
    other, left = periods != swarm.period, (swarm.next_firing - now) * (periods / swarm.period)
    swarm.next_firing[other] = now + left[other]  # clocks go on at other rates from the phases where they are
    swarm.period[:] = periods
    restarted, phase = (phases >= 0).any(axis=0), phases.max(axis=0)
    swarm.next_firing[restarted] = now + ((1 - phase) * periods)[restarted]
    forget_earliest(swarm)
    if (faults.kind == WHEELS_DEAD).any():
        start_at_present(swarm, speeds_with_faults(swarm, swarm.base_speed))
        swarm.cached_until[:] = swarm.scene.sorted_at = -np.inf  # these hold for the speeds before
        begin_motion(swarm.block)
    for fault, kind in enumerate(faults.kind.tolist()):
        for begins in (False, True):
            changed = (affected.is_active[fault] != before[fault]) & (before[fault] != begins)
            if kind == RESTART and begins:
                changed = phases[fault] >= 0
            if changed.any():
                yield fault, kind, begins, np.flatnonzero(changed).tolist()


def speeds_with_faults(swarm: Arrays, speeds: FloatArray) -> FloatArray:
    """Set the speeds without faults, (agents,) cm per cycle; return those with them."""
    swarm.base_speed[:] = speeds
    return np.where(_have(swarm, WHEELS_DEAD), 0.0, speeds)


def _have(swarm: Arrays, kind: int) -> BoolArray:
    """Return (agents,) whether each agent has a fault of this kind."""
    is_active = swarm.affected["is_active"].reshape(len(swarm.faults), -1)
    has: BoolArray = is_active[swarm.faults["kind"] == kind].any(axis=0)
    return has


@jit
def _change_each(faults: RecordArray, affected: RecordArray, time_ms: float, phases: FloatArray) -> None:
    for fault in range(len(faults)):
        for agent in range(affected.shape[1]):
            phases[fault, agent] = change_until(faults[fault], affected[fault, agent], time_ms)


@jit_no_alloc
def keep_heard(block: ByteArray, addresses: IntArray, agent: int, time: float) -> None:
    """List in `heard` the receivers of an agent's pulse that faults do not keep from it.

    An agent's pulses are told apart by their instants.
    """
    trajectories, neighbours, faulty = carve(block, Trajectories), carve(block, Neighbours), carve(block, Faulty)
    scene, heard, row = neighbours.scene, carve(block, Instant).heard, row_of(neighbours, agent)
    scene.heard = 0
    for rank in range(0 if faulty.is_mute[agent] else neighbours.counts[agent]):
        other, square = entry_of(neighbours.members, row + rank), 0.0
        if faulty.is_deaf[other]:
            continue
        advance_one(block, addresses, trajectories, agent, time)
        advance_one(block, addresses, trajectories, other, time)
        for axis in range(scene.dimensions):
            to, here = axis * scene.agents + agent, axis * scene.agents + other
            offset = trajectories.origin[to] - trajectories.origin[here]
            offset += trajectories.heading[to] * distance_travelled(trajectories, agent, time)
            offset -= trajectories.heading[here] * distance_travelled(trajectories, other, time)
            offset = nearest_image(scene.is_cyclic, scene.side_cm, offset)
            square += offset * offset
        if not misses(faulty.faults, faulty.affected, other, np.sqrt(square), agent, scene.instants):
            heard[scene.heard] = other
            scene.heard += 1
