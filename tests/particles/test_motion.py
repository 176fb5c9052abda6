"""Walls are reached on time, directions have the thesis's distributions, and positions those of theory.

Exact distributions after a long time:

- In a cyclic space positions stay uniform and headings never change: p(t) = p(0) + v t, modulo the side.
- In a segment with walls that only turn agents back, they stay uniform too: each agent is on a triangle wave.
- In a square whose walls reflect by the cosine law they would be uniform; with this law, uniform in the angle to the
  normal, they are not. Let J(s) be the number of agents that reach the wall at s per unit of time. An agent that leaves
  s at an angle a to the normal has the phase-space density J(s) / (pi V cos a), and keeps it along its trajectory.
  Seen from a point x, the piece ds of the wall covers the angle cos a ds / |x - s|. So the density is
  rho(x) = (1 / pi V) * closed integral of J(s) / |x - s| ds, and, as agents reach the wall at t at an angle b to its
  normal, J(t) = (1 / pi) * closed integral of J(s) cos b / |t - s| ds. The density is that of a charge J on the wall:
  it diverges logarithmically towards the wall, where agents that left at grazing angles move along it.
"""

import itertools
import math

import numpy as np
import pytest

from tests.particles.distributions import fits, is_anywhere
from tests.particles.simulations import make_simulation, set_trajectories

dimensions = pytest.mark.parametrize("dimensions", [1, 2, 3])
boundaries = pytest.mark.parametrize("boundary", ["bounded", "cyclic", "mirrored"])


def uncoupled(count, speed_cm_s=100.0, seed=0, **sections):
    """Return uncoupled agents that fire together once a cycle, so that simulating their motion is fast."""
    agents = {"count": count, "speed_cm_s": speed_cm_s}
    return make_simulation(seed, agents=agents, start={"phases": "synchronised"}, response={"coupling": 0}, **sections)


# --- walls ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("dimensions", "boundary"), [(1, "bounded"), *itertools.product((1, 2, 3), ("cyclic", "mirrored"))]
)
@pytest.mark.parametrize("speed_cm_s", [0.01, 3.0, 250.0])
def test_paths_are_straight_lines_modulo_the_side_and_between_mirrors_triangle_waves(dimensions, boundary, speed_cm_s):
    space = {"dimensions": dimensions, "boundary": boundary}
    swarm = make_simulation(3, agents={"count": 6, "speed_cm_s": speed_cm_s}, space=space)
    start, heading = swarm.positions(), swarm.headings()
    for time_s in [0.7, 33.0, 2000.25]:
        swarm.run_to(time_s)
        unfolded = (start + speed_cm_s * time_s * heading) % 200
        if boundary == "cyclic":
            off = (swarm.positions() - unfolded) / 100
            assert np.abs(off - np.rint(off)).max() < 1e-9
            assert (swarm.headings() == heading).all()
        else:
            assert swarm.positions() == pytest.approx(100 - np.abs(100 - unfolded), abs=1e-7)
            assert (np.abs(swarm.headings()) == np.abs(heading)).all()


@dimensions
@boundaries
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


# --- where agents are after a long time -------------------------------------------------------------


def gauss(low, high, points=24):
    """Return the points and weights of Gauss and Legendre between two ends."""
    at, weight = np.polynomial.legendre.leggauss(points)
    return low + (at + 1) * (high - low) / 2, weight * (high - low) / 2


def wall_hits(bins=300):
    """Return (bins + 1,) the edges along a wall of length 1, and (bins,) J there: a fixed point of its equation.

    All walls are alike. The shares of trajectories from s that end in each interval of a wall are exact: the angle
    which the interval covers, seen from s, divided by pi.
    """
    edges = (1 - np.cos(np.linspace(0, math.pi, bins + 1))) / 2  # closer together at the corners
    lands = np.zeros((bins, bins))
    with np.errstate(divide="ignore"):
        for start in range(bins):
            for s, weight in zip(*gauss(edges[start], edges[start + 1], 4), strict=True):
                opposite = np.diff(np.arctan(edges - s))
                left = -np.diff(np.arctan(s / edges))
                right = -np.diff(np.arctan((1 - s) / edges))
                lands[start] += weight * (opposite + left + right) / math.pi
    lands = (lands + lands[:, ::-1]) / 2 / np.diff(edges)[:, None]  # walls are alike from either end, too
    assert lands.sum(axis=1) == pytest.approx(1)
    hits = np.diff(edges)  # that is, J ds
    for _ in range(200):
        hits = hits @ lands
    return edges, hits / np.diff(edges)


def stationary_density(cells):
    """Return (cells, cells) shares of the square: the integral of J(s) / |x - s| over the wall, and over each cell."""
    edges, rate = wall_hits()
    at, weight = map(np.concatenate, zip(*(gauss(k / cells, (k + 1) / cells) for k in range(cells)), strict=True))
    along, away = np.meshgrid(at, at, indexing="ij")
    # over an interval of the wall in which J is constant the integral is a difference of inverse hyperbolic sines
    one_wall = sum(
        rate[k] * (np.arcsinh((edges[k + 1] - along) / away) - np.arcsinh((edges[k] - along) / away))
        for k in range(len(rate))
    )
    density = one_wall + one_wall[:, ::-1] + one_wall.T + one_wall.T[::-1]
    shares = (density * np.outer(weight, weight)).reshape(cells, len(at) // cells, cells, -1).sum(axis=(1, 3))
    return shares / shares.sum()


def stationary_headings(bins):
    """Return (bins,) shares of headings in the first quadrant: trajectories are weighted by their durations.

    A trajectory from the lower wall at s, at an angle a to its normal, has the length min(1 / cos a, (1 - s) / sin a);
    one from the left wall is the same with the angle to the other axis. No trajectory from the other two walls has such
    a heading.
    """
    edges, rate = wall_hits()
    middles, widths = (edges[1:] + edges[:-1]) / 2, np.diff(edges)
    shares = []
    for k in range(bins):
        angles, weights = gauss(k * math.pi / 2 / bins, (k + 1) * math.pi / 2 / bins)
        total = 0.0
        for angle, weight in zip(angles, weights, strict=True):
            for a in (angle, math.pi / 2 - angle):
                length = np.minimum(1 / math.cos(a), (1 - middles) / math.sin(a))
                total += weight * (rate * widths * length).sum()
        shares.append(total)
    return np.array(shares) / np.sum(shares)


def snapshots(swarm, count, every=23.7):
    """Return positions, as shares of the side, and headings at times far apart."""
    places, headings = [], []
    for number in range(count):
        swarm.run_to((number + 1) * every)
        places.append(swarm.positions() / swarm.scenario.space.side_cm)
        headings.append(swarm.headings())
    return np.concatenate(places), np.concatenate(headings)


def in_cells(places, cells):
    return np.histogramdd(places, cells, [(0, 1)] * places.shape[1])[0]


def test_in_the_bounded_square_positions_and_headings_are_those_of_the_integral_equation():
    places, headings = snapshots(uncoupled(2000, seed=11), 30)
    expected = stationary_density(8)
    assert fits(in_cells(places, 8), expected)
    angles = np.arctan2(headings[:, 1], headings[:, 0]) % (math.pi / 2)
    assert fits(np.histogram(angles, 12, (0, math.pi / 2))[0], stationary_headings(12))
    # which is far from uniform, so that it could have gone wrong
    assert expected.max() / expected.min() > 1.5
    assert not fits(in_cells(places, 8), np.ones((8, 8)))


def test_in_the_bounded_square_walls_are_reached_where_the_integral_equation_says():
    swarm = uncoupled(500, seed=3)
    swarm.run_to(20.0)
    along = []
    while len(along) < 20_000:
        event = next(swarm)
        if event.turned is not None:
            axis = int(np.isin(swarm._arrays.origin[:, event.turned], (0.0, 100.0)).argmax())
            along.append(swarm._arrays.origin[1 - axis, event.turned] / 100)
    edges, rate = wall_hits()
    reached = np.interp(np.linspace(0, 1, 17), edges, np.concatenate([[0], np.cumsum(rate * np.diff(edges))]))
    assert fits(np.histogram(along, 16, (0, 1))[0], np.diff(reached))


@pytest.mark.parametrize(
    ("dimensions", "boundary"), [(1, "bounded"), *itertools.product((1, 2, 3), ("cyclic", "mirrored"))]
)
def test_positions_and_headings_stay_uniform_elsewhere(dimensions, boundary):
    swarm = uncoupled(20_000, 61.0, space={"dimensions": dimensions, "boundary": boundary})
    places, headings = snapshots(swarm, 1, 1234.5)
    assert fits(in_cells(places, 6), np.ones((6,) * dimensions))
    assert is_anywhere(headings)
