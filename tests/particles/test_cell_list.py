"""The cell list finds all agents within a radius, and trials with and without it are equal to the bit."""

import itertools

import numpy as np
import pytest

from epuck_sim.particles.neighbours import find_candidates
from epuck_sim.particles.simulation import ParticleSimulation
from tests.particles.simulations import search_all

NEIGHBOURHOODS = [
    {"kind": "nearest", "k": 1},
    {"kind": "nearest", "k": 7},
    {"kind": "range", "radius_cm": 12},
    {"kind": "cone_of_vision", "radius_cm": 15, "angle_deg": 70},
    {"kind": "cone_of_emission", "radius_cm": 15, "angle_deg": 250},
]


def swarm_of(speed: float, dimensions: int = 2, boundary: str = "bounded", **keys) -> ParticleSimulation:
    return ParticleSimulation(
        {
            "model": "particles",
            "space": {"dimensions": dimensions, "boundary": boundary, "side_cm": 100},
            "agents": {"count": 450, "speed_cm_s": speed, "speed_distribution": "exponential"},
            **keys,
        },
        3,
    )


CASES = [
    *itertools.product(NEIGHBOURHOODS, ["bounded", "cyclic"], [0.3, 200], [2]),
    *itertools.product([{"kind": "range", "radius_cm": 9}], ["bounded"], [3], [1, 3]),
]
"""Neighbourhoods, boundaries, speeds and dimensions."""


@pytest.mark.parametrize(("rule", "boundary", "speed", "dimensions"), CASES, ids=str)
def test_trials_with_and_without_cells_are_the_same_to_the_bit(rule, boundary, speed, dimensions) -> None:
    in_cells, all_pairs = (swarm_of(speed, dimensions, boundary, neighbourhood=rule) for _ in range(2))
    assert all_pairs._arrays.scene.cells > 0
    search_all(all_pairs)
    for cycle in (1, 3, 6):
        for swarm in (in_cells, all_pairs):
            swarm.run(cycle)
        assert in_cells.firings == all_pairs.firings > 0
        assert in_cells.phases().tolist() == all_pairs.phases().tolist()
        assert in_cells.positions().tolist() == all_pairs.positions().tolist()


@pytest.mark.parametrize(("dimensions", "cells"), [(1, 33), (2, 20), (2, 1), (3, 5)])
@pytest.mark.parametrize("boundary", ["bounded", "cyclic"])
def test_all_agents_within_the_radius_are_found_and_none_twice(boundary, dimensions, cells) -> None:
    swarm = swarm_of(20, dimensions, boundary, neighbourhood={"kind": "range", "radius_cm": 6})
    trajectories, scene = swarm._arrays, swarm._arrays.scene
    assert scene.cells >= cells
    scene.cells, scene.cell_cm = cells, 100 / cells
    for time in (0.0, 0.01, 0.05, 0.4, 0.9):
        for agent, reach in itertools.product(range(0, 450, 18), (0.5, 7.0, 45.0)):
            count = find_candidates(trajectories.block, swarm._addresses, agent, time, reach)
            candidates = trajectories.candidates[:count]
            assert len(set(candidates)) == len(candidates)
            where = positions_at(trajectories, time)  # after the search, which may have begun trajectories anew
            apart = np.abs(where - where[agent])
            apart = np.minimum(apart, 100 - apart) if boundary == "cyclic" else apart
            near = np.flatnonzero(np.sqrt((apart**2).sum(axis=1)) <= reach)
            assert set(near) <= set(candidates)


def positions_at(trajectories, time: float) -> np.ndarray:
    """Return the positions of agents, or those of their wall hits if their trajectories have ended."""
    until = np.minimum(time, trajectories.end_cycle + trajectories.end_time)
    lasts = until - trajectories.start_cycle - trajectories.start_time
    return (trajectories.origin + trajectories.heading * trajectories.speed * lasts).T
