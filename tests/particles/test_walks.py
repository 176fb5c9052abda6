"""Random walks: runs and turns have their distributions, and agents spread as theory says.

Agents that keep a direction for a time of mean T, and turn by an angle of mean cosine g, forget it after a mean of
tau = T / (1 - g): the correlation of two headings a time t apart is exp(-t / tau), from which, with speed v, follows
the mean squared displacement 2 v^2 tau (t - tau (1 - exp(-t / tau))), in any number of dimensions.
"""

import math

import pytest
from scipy import stats

from tests.particles.distributions import UNLIKELY
from tests.particles.simulations import make_simulation

dimensions = pytest.mark.parametrize("dimensions", [1, 2, 3])

BROWNIAN = {"kind": "brownian", "run_s": 2.0}
CORRELATED = {"kind": "correlated", "run_s": 0.5, "persistence": 0.8}
LEVY = {"kind": "levy", "run_s": 0.3, "exponent": 2.2}


def walkers(walk, count=4000, speed_cm_s=1.0, seed=0, agents=None, **sections):
    """Return uncoupled agents that fire together once a cycle, far from any wall unless `sections` say otherwise."""
    sections = {"space": {"side_cm": 1e6}, "neighbourhood": {"kind": "all"}, "response": {"coupling": 0}, **sections}
    motion = {"count": count, "speed_cm_s": speed_cm_s, "walk": walk, **(agents or {})}
    return make_simulation(seed, agents=motion, start={"phases": "synchronised"}, **sections)


@pytest.mark.parametrize("exponent", [2.2, 3.0])
def test_runs_of_a_levy_walk_have_a_power_law_above_the_shortest(exponent):
    swarm = walkers({**LEVY, "exponent": exponent}, count=20_000)
    durations = swarm._arrays.run_end_cycle + swarm._arrays.run_end_time
    assert durations.min() >= 0.3
    assert stats.kstest(durations, "pareto", args=(exponent - 1, 0, 0.3)).pvalue > UNLIKELY


@dimensions
@pytest.mark.parametrize(("walk", "reorients"), [(BROWNIAN, False), (CORRELATED, False), (CORRELATED, True)])
def test_the_mean_squared_displacement_is_that_of_theory(dimensions, walk, reorients):
    agents = {"reorient_on": ["emitting"]} if reorients else {}
    swarm = walkers(walk, speed_cm_s=3.0, agents=agents, space={"dimensions": dimensions, "side_cm": 1e6})
    start = swarm.positions()
    rate = (1 - walk.get("persistence", 0.0)) / walk["run_s"]
    for time_s in (0.4, 1.0, 7.5) if not reorients else (0.5, 1.0):  # reorientation is at 1 s, and then each second
        swarm.run_to(time_s)
        expected = 2 * 9.0 / rate * (time_s - (1 - math.exp(-rate * time_s)) / rate)
        squares = ((swarm.positions() - start) ** 2).sum(axis=1)
        assert abs(squares.mean() - expected) < 4 * squares.std() / math.sqrt(len(squares))


DISTRIBUTIONS = {
    "uniform": {"speed_spread": 0.5},
    "normal": {"speed_spread": 0.6},
    "exponential": {},
    "lognormal": {"speed_spread": 2.0},
    "two_speeds": {"fast_share": 0.1, "fast_ratio": 10.0},
}


@pytest.mark.parametrize("distribution", DISTRIBUTIONS)
def test_speeds_of_later_runs_have_the_distribution_of_the_first(distribution):
    agents = {"speed_distribution": distribution, "speed_per_run": True, **DISTRIBUTIONS[distribution]}
    swarm = walkers({"kind": "brownian", "run_s": 0.1}, count=10_000, speed_cm_s=4.0, agents=agents)
    table = swarm._arrays.run_speeds
    assert table.mean() == pytest.approx(4.0)
    assert swarm._arrays.scene.max_speed == max(table.max(), swarm._arrays.speed.max())
    first = swarm.speeds_cm_s
    swarm.run_to(3.0)
    later = swarm.speeds_cm_s
    assert (first != later).mean() > 0.15  # of two speeds most are the same again
    assert stats.ks_2samp(first.round(9), later.round(9)).pvalue > UNLIKELY
    assert abs(later.mean() - 4.0) < 4 * later.std() / math.sqrt(len(later))
