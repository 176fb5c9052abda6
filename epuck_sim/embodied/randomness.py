"""The random numbers of a simulation of robots, all from the trial's seed."""

from enum import IntEnum

import numpy as np

from epuck_sim.embodied.swarm_arrays import SwarmArrays
from epuck_sim.embodied.variation import RobotVariation, draw_variation
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.imperfections import SpreadSection
from epuck_sim.util.seeds import robot_streams


class Part(IntEnum):
    """What has random numbers of its own, independent of those of all others."""

    PLACEMENT = 0
    INFRARED_NOISE = 1
    WHEEL_NOISE = 2
    CONTROLLERS = 3
    VARIATION = 4
    SIGNALS = 5
    FAULTS = 6
    SCHEDULE = 7


def spawned(seed: int, part: Part) -> np.random.SeedSequence:
    """Return the seed sequence of one part of the trial with this seed."""
    return np.random.SeedSequence(seed, spawn_key=(part,))


class Randomness:
    """Generators and streams, which keep their places in memory from trial to trial."""

    def __init__(self, scenario: EmbodiedScenario) -> None:
        """Allocate streams; `restart` sets them."""
        robots = scenario.robot_count
        self._noise = scenario.noise
        self._spread = scenario.spread
        self._signals_draw = any(group.signal_is_random for group in scenario.robots)
        self._robots_vary = scenario.spread != SpreadSection() or scenario.stuck.per_hour > 0
        self.controller_streams = np.zeros((robots, 4), np.uint64)
        """(robots, 4) from which controllers draw."""
        self.signal_streams = np.zeros((robots, 4), np.uint64)
        """(robots, 4) from which cameras and radios draw."""
        self.variation_streams = np.zeros((robots, 4), np.uint64)
        """(robots, 4) from which differences between robots, and their stoppages, are drawn."""
        self.variation: RobotVariation = draw_variation(SpreadSection(), self.variation_streams)
        """How robots differ."""

    def restart(self, seed: int) -> None:
        """Set everything to where it is at the start of the trial with this seed; what nobody draws from stays."""
        robots = len(self.controller_streams)
        self._infrared_random = np.random.Generator(np.random.SFC64(spawned(seed, Part.INFRARED_NOISE)))
        self._wheel_random = np.random.Generator(np.random.SFC64(spawned(seed, Part.WHEEL_NOISE)))
        self.controller_streams[:] = robot_streams(spawned(seed, Part.CONTROLLERS), robots)
        if self._signals_draw:
            self.signal_streams[:] = robot_streams(spawned(seed, Part.SIGNALS), robots)
        if self._robots_vary:
            self.variation_streams[:] = robot_streams(spawned(seed, Part.VARIATION), robots)
            for array, drawn in zip(self.variation, draw_variation(self._spread, self.variation_streams), strict=True):
                array[:] = drawn

    def draw_noise(self, swarm: SwarmArrays) -> None:
        """Draw the noise of the next `NOISE_STEPS` steps."""
        if self._noise.infrared_counts > 0:
            self._infrared_random.standard_normal(out=swarm.infrared_noise)
        if self._noise.wheel_speed > 0:
            self._wheel_random.random(out=swarm.wheel_noise)
