"""Positions, headings, speeds, phases and periods are drawn from the distributions that a scenario asks for."""

import math

import numpy as np
import pytest
from scipy import stats

from tests.particles.distributions import UNLIKELY, is_anywhere, is_uniform
from tests.particles.simulations import make_simulation


@pytest.mark.parametrize("dimensions", [1, 2, 3])
def test_agents_begin_anywhere_in_any_direction_at_any_phase(dimensions):
    swarm = make_simulation(5, space={"dimensions": dimensions}, agents={"count": 20_000})
    assert is_uniform(swarm.positions(), 0, 100)
    assert is_anywhere(swarm.headings())
    assert is_uniform(swarm.phases(), 0, 1)
    assert abs(np.corrcoef(swarm.positions()[:, 0], swarm.phases())[0, 1]) < 0.03


@pytest.mark.parametrize("dimensions", [1, 2, 3])
@pytest.mark.parametrize("part", ["phases", "positions_cm", "headings"])
def test_what_is_given_takes_the_place_of_what_is_drawn_and_all_else_stays(dimensions, part):
    scene = {"space": {"dimensions": dimensions, "side_cm": 64.0}, "agents": {"count": 4, "speed_cm_s": 9.0}}
    drawn = make_simulation(7, **scene)
    other = make_simulation(8, **scene)
    states = {"phases": "phases", "positions_cm": "positions", "headings": "headings"}
    start = {part: (getattr(other, states[part])() * (3 if part == "headings" else 1)).tolist()}  # of any length
    given = make_simulation(7, start=start, **scene)
    for key, method in states.items():
        expected = getattr(other if key == part else drawn, method)()
        assert getattr(given, method)() == pytest.approx(expected, abs=1e-15)
    assert (given._arrays.streams == drawn._arrays.streams).all()


MANY = 6_000


def speeds(**agents):
    """Return the speeds of many agents, measured from their motion, as shares of the mean."""
    swarm = make_simulation(3, agents={"count": MANY, "speed_cm_s": 4.0, **agents}, space={"side_cm": 1e6})
    start = swarm.positions()
    swarm._arrays.scene.now = 0.1  # before anybody fires or comes far
    return np.linalg.norm(swarm.positions() - start, axis=1) / 0.4


SIGMA = math.log(1 + 0.7**2) ** 0.5  # of the logarithm of lognormal speeds whose deviation is 0.7 of their mean


def test_speeds_have_the_distribution_and_the_mean_of_the_scenario():
    for distribution, spread, expected in [
        *(("uniform", spread, stats.uniform(1 - spread, 2 * spread)) for spread in (0.1, 1.0)),
        *(("normal", spread, stats.truncnorm(-1 / spread, 1 / spread, 1, spread)) for spread in (0.1, 0.5, 1.0)),
        ("lognormal", 0.7, stats.lognorm(SIGMA, scale=math.exp(-(SIGMA**2) / 2))),
        ("exponential", None, stats.expon()),
    ]:
        drawn = speeds(speed_distribution=distribution, **({} if spread is None else {"speed_spread": spread}))
        assert stats.kstest(drawn, expected.cdf).pvalue > UNLIKELY
        low, high = expected.support()
        assert ((drawn >= low - 1e-6) & (drawn <= high + 1e-6)).all()
        assert drawn.mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("jitter", [5e-5, 0.2])
def test_jittered_periods_are_normal_around_the_nominal_one(jitter):
    swarm = make_simulation(1, agents={"count": MANY}, clocks={"jitter": jitter, "period_s": 3.0})
    start = swarm.phases()
    swarm._arrays.scene.now = 1e-3
    periods = 1e-3 / (swarm.phases() - start)
    assert stats.kstest(swarm._arrays.period, stats.norm(1, jitter).cdf).pvalue > UNLIKELY
    assert periods == pytest.approx(swarm._arrays.period, rel=1e-9)
    assert swarm._arrays.period.min() >= 0.1
    assert stats.kstest(start, "uniform").pvalue > UNLIKELY  # jitter leaves phases uniform
