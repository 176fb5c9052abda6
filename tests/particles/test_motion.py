"""Walls are reached on time, and directions have the thesis's distributions, in closed form where there is one.

In a cyclic space positions stay uniform and headings never change: p(t) = p(0) + v t, modulo the side. Between mirrors,
and in a segment with walls that only turn agents back, each agent is on a triangle wave.
"""

import itertools
import math

import numpy as np
import pytest

from tests.particles.distributions import is_uniform
from tests.particles.simulations import make_simulation, set_trajectories

CLOSED = [(1, "bounded"), *itertools.product((1, 2, 3), ("cyclic", "mirrored"))]
"""Dimensions and boundaries of spaces with a closed form."""


def uncoupled(count, speed_cm_s=100.0, seed=0, **sections):
    """Return uncoupled agents that fire together once a cycle, so that simulating their motion is fast."""
    agents = {"count": count, "speed_cm_s": speed_cm_s}
    return make_simulation(seed, agents=agents, start={"phases": "synchronised"}, response={"coupling": 0}, **sections)


@pytest.mark.parametrize(("dimensions", "boundary"), CLOSED)
def test_paths_are_straight_lines_modulo_the_side_and_between_mirrors_triangle_waves(dimensions, boundary):
    space = {"dimensions": dimensions, "boundary": boundary}
    for speed_cm_s, time_s in itertools.product([0.01, 3.0, 250.0], [0.7, 33.0, 2000.25]):
        swarm = make_simulation(3, agents={"count": 6, "speed_cm_s": speed_cm_s}, space=space)
        start, heading = swarm.positions(), swarm.headings()
        swarm.run_to(time_s)
        unfolded = (start + speed_cm_s * time_s * heading) % 200
        if boundary == "cyclic":
            off = (swarm.positions() - unfolded) / 100
            assert np.abs(off - np.rint(off)).max() < 1e-9
            assert (swarm.headings() == heading).all()
        else:
            assert swarm.positions() == pytest.approx(100 - np.abs(100 - unfolded), abs=1e-7)
            assert (np.abs(swarm.headings()) == np.abs(heading)).all()


@pytest.mark.parametrize(("dimensions", "boundary"), [*CLOSED, (2, "bounded"), (3, "bounded")])
@pytest.mark.parametrize("end_s", [3e4, pytest.param(1e6, marks=pytest.mark.slow)])
def test_no_agent_ever_leaves_the_space(end_s, boundary, dimensions):
    swarm = uncoupled(5, 77.0, space={"boundary": boundary, "dimensions": dimensions})
    for time_s in np.linspace(1, end_s, 200):
        swarm.run_to(time_s)
        places = swarm.positions()
        assert ((places >= -1e-9) & (places <= 100 + 1e-9)).all()
        assert np.linalg.norm(swarm.headings(), axis=1) == pytest.approx(1)


def test_an_agent_that_comes_in_from_a_corner_goes_on_inside():
    swarm = make_simulation(agents={"count": 4, "speed_cm_s": 50.0})
    set_trajectories(swarm, [[0, 0], [100, 100], [0, 100], [100, 0]], [[-1, -1], [1, 1], [-1, 1], [1, -1]])
    for _ in range(40):
        next(swarm)
        assert ((swarm.positions() >= 0) & (swarm.positions() <= 100)).all()
    assert swarm.time_s > 0.1


@pytest.mark.parametrize("dimensions", [2, 3])
def test_walls_turn_agents_by_a_uniform_angle_in_a_square_and_over_the_hemisphere_in_a_cube(dimensions):
    """Thesis 3.1 and D.3: whichever wall it is, and wherever an agent came from."""
    swarm, turned, towards = uncoupled(500, space={"dimensions": dimensions}), [], []
    while len(turned) < 4_000:
        before, event = swarm.headings(), next(swarm)
        if event.turned is None:
            continue
        place, after = swarm.positions()[event.turned], swarm.headings()[event.turned]
        axis = int(np.minimum(place, 100 - place).argmin())
        inward = 1.0 if place[axis] < 50 else -1.0
        turned.append([inward * after[axis], *np.delete(after, axis)])
        towards.append(-inward * before[event.turned, axis])
    along, *aside = np.transpose(turned)
    assert (along >= 0).all()
    if dimensions == 2:
        assert is_uniform(np.arctan2(aside[0], along), -math.pi / 2, math.pi / 2)
    else:
        assert is_uniform(along, 0, 1)
        assert is_uniform(np.arctan2(*aside), -math.pi, math.pi)
    assert abs(np.corrcoef(along, towards)[0, 1]) < 0.06
