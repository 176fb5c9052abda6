"""Rewards: functions of a `Situation`, of one swarm or of a batch of them at once."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.control.names import check_draws
from epuck_sim.errors import ScenarioError
from epuck_sim.order_parameter import order_parameter
from epuck_sim.user_files import Kind, load_python_file

NEAR_CM = 15.0
"""Distance of two centres, in cm, within which `aggregation` counts robots as together: about two diameters."""

COVERED_CM = 10.0  # distance from a robot's centre, in cm, within which `coverage` counts the floor as covered
GRID_CM = 5.0  # distance between the points at which `coverage` samples the floor, in cm

NO_PHASES = "synchrony needs oscillators, and no robot is one; drive only wheels: controller: external_wheels"
"""Message for rewards of synchrony in a swarm without oscillators."""


class Situation(NamedTuple):
    """Places and states of robots; arrays of a batch have an axis of swarms before the axis of robots."""

    time_s: FloatArray
    """(...) seconds since the beginning of the episode."""
    poses: FloatArray
    """(..., robots, 3) cm, cm, rad: x, y, heading of all robots, including robots with controllers."""
    wheels_cm_s: FloatArray
    """(..., robots, 2) cm/s: left and right wheel, as commanded."""
    ring_on: BoolArray
    """(..., robots) whether each ring is lit."""
    phase: FloatArray
    """(..., robots) phase of each robot's oscillator, from 0 to 1; NaN for robots that have none."""
    width_cm: float
    """Width of the arena."""
    height_cm: float
    """Height of the arena."""
    movables: FloatArray = np.empty((0, 2))
    """(..., movables, 2) cm: where the arena's movables are."""


SituationFunction = Callable[[Situation], npt.NDArray[Any]]
"""Returns (...) one value for each swarm, or (..., robots) one for each robot, driven from outside or not."""


def synchrony(situation: Situation) -> FloatArray:
    """Return (...) the order parameter of the oscillators (eq. 4.2): 0 is incoherent, 1 synchronised.

    Raises:
        ScenarioError: There are no oscillators.
    """
    if np.isnan(situation.phase).all():
        raise ScenarioError(NO_PHASES)
    return order_of(situation.phase)


def order_of(phase: FloatArray) -> FloatArray:
    """Return (...) the order parameter of (..., robots) phases from 0 to 1, NaN for robots without, but not for all."""
    has_phase = ~np.isnan(phase.reshape(-1, phase.shape[-1])[0])
    return order_parameter(phase[..., has_phase], 1.0)


def aggregation(situation: Situation) -> FloatArray:
    """Return (..., robots) the share of the other robots within `NEAR_CM` of each robot, from 0 to 1."""
    near = (_distances_cm(situation.poses, situation.poses) <= NEAR_CM).sum(axis=-1) - 1
    share: FloatArray = near / max(situation.poses.shape[-2] - 1, 1)
    return share


def coverage(situation: Situation) -> FloatArray:
    """Return (...) the share of the floor that lies within `COVERED_CM` of a robot's centre, from 0 to 1."""
    xs, ys = (
        np.arange(min(GRID_CM, length) / 2, length, GRID_CM) for length in (situation.width_cm, situation.height_cm)
    )
    points = np.stack(np.meshgrid(xs, ys), axis=-1).reshape(-1, 2)
    share: FloatArray = (_distances_cm(points, situation.poses) <= COVERED_CM).any(axis=-1).mean(axis=-1)
    return share


def _distances_cm(points: FloatArray, poses: FloatArray) -> FloatArray:
    """Return (..., points, robots) the distance of each point from each robot's centre."""
    return np.hypot(points[..., :, None, 0] - poses[..., None, :, 0], points[..., :, None, 1] - poses[..., None, :, 1])


REWARDS: dict[str, SituationFunction] = {"synchrony": synchrony, "aggregation": aggregation, "coverage": coverage}
"""The shipped rewards by name."""

REWARD = Kind(
    noun="reward",
    error=ScenarioError,
    suffixes=(".py",),
    group="epuck_sim.rewards",
    shipped=lambda: dict.fromkeys(REWARDS),
    form="a function, or a file that ends in .py",
)
"""How rewards are found."""


def find_reward(reward: SituationFunction | str | Path) -> SituationFunction:
    """Return a reward: a function as it is, one by its name, or the function `reward` of a file.

    ScenarioError is raised if there is no such reward, or the file has none.
    """
    if callable(reward):
        return reward
    if not isinstance(reward, str | Path):
        raise ScenarioError(f"reward is {reward!r}; allowed: a name, a function, or a file that ends in .py")
    place = REWARD.locate(str(reward))
    if place.path is None:
        return REWARDS[place.name]
    file = load_python_file(place, ScenarioError)
    if not callable(file.parts.get("reward")):
        raise file.refusal("reward", "a reward needs a function reward(situation)")
    check_draws(file, "a reward is a function of the situation")
    function: SituationFunction = file.parts["reward"]
    return function
