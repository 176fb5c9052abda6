"""The start of a trial: all that is random in it comes from its seed, each part from numbers of its own."""

from enum import IntEnum

import numpy as np

from epuck_sim.arrays import ByteArray, WordArray
from epuck_sim.control.interface import SENSORS
from epuck_sim.embodied.swarm import swarm_at
from epuck_sim.util.generators import (
    DRAW_BEGIN,
    SEQUENCE_WORDS,
    begin_sequence,
    draw_row,
    seed_pcg64,
    seed_sfc64,
    seed_words,
    spawn,
)
from epuck_sim.util.jit import jit_no_alloc
from epuck_sim.util.rng import uniform


class Part(IntEnum):
    """What has random numbers of its own, independent of those of all others: spawn keys of the trial's seed."""

    PLACEMENT = 0
    INFRARED_NOISE = 1
    WHEEL_NOISE = 2
    CONTROLLERS = 3
    VARIATION = 4
    SIGNALS = 5
    FAULTS = 6
    SCHEDULE = 7
    SENSORS = 8


_PLACEMENT, _INFRARED_NOISE, _WHEEL_NOISE, _CONTROLLERS, _VARIATION, _SIGNALS, *_ = map(int, Part)


def spawned(seed: int, part: Part) -> np.random.SeedSequence:
    """Return the seed sequence of one part of the trial with this seed."""
    return np.random.SeedSequence(seed, spawn_key=(part,))


def draw_start(block: ByteArray, seed: int) -> None:
    """Set the generators and streams of a swarm, as new, to where they are at the start of the trial with a seed."""
    draw_all(block, seed_words(seed), np.empty(2 * SEQUENCE_WORDS, np.uint64))


@jit_no_alloc
def draw_all(block: ByteArray, words: WordArray, scratch: WordArray) -> None:
    """Do what `draw_start` does; words: the `seed_words` of the seed; scratch: (2 * `SEQUENCE_WORDS`,) is written."""
    swarm = swarm_at(block)
    scene, robots = swarm.scene[0], swarm.robots
    size = len(scratch) // 2
    trial, part = scratch[:size], scratch[size:]
    begin_sequence(trial, words)
    for key in range(_SIGNALS + 1):
        spawn(part, trial, key)
        if key == _PLACEMENT:
            seed_pcg64(scene.placement_random, part)
        elif key == _INFRARED_NOISE:
            seed_sfc64(scene.noise_random, part)
        elif key == _WHEEL_NOISE:
            seed_sfc64(scene.slip_random, part)
        elif (
            key == _CONTROLLERS or (key == _VARIATION and scene.robots_vary) or (key == _SIGNALS and scene.signals_draw)
        ):
            factor = DRAW_BEGIN
            for number in range(len(robots)):
                robot = robots[number]
                stream = robot.variation_random if key == _VARIATION else robot.signal_random
                factor = draw_row(robot.random if key == _CONTROLLERS else stream, part, factor)


@jit_no_alloc
def vary(block: ByteArray) -> None:
    """Draw all factors in which robots differ, even if a spread is 0, each robot's from a stream of its own (4.4)."""
    swarm = swarm_at(block)
    spread, step_ms = swarm.scene[0].spread, swarm.scene[0].step_ms
    for number in range(len(swarm.robots)):
        robot = swarm.robots[number]
        random = robot.variation_random
        both = 1 + spread[0] * (2 * uniform(random) - 1)
        for wheel in range(2):
            robot.wheel_gain[wheel] = both * (1 + spread[1] * (2 * uniform(random) - 1))
            robot.free_gain[wheel] = robot.wheel_gain[wheel]
        robot.clock_rate = 1 + spread[2] * (2 * uniform(random) - 1)
        robot.own_step_ms = step_ms * robot.clock_rate
        for sensor in range(SENSORS):
            robot.infrared_gain[sensor] = 1 + spread[3] * (2 * uniform(random) - 1)
