"""Motion: initial conditions, walls, and random walks have their distributions, in closed form where there is one."""

import itertools
import math

import numpy as np
import pytest
from scipy import stats

from tests.particles.simulations import UNLIKELY, make_simulation, set_trajectories

CLOSED = [(1, "bounded"), *itertools.product((1, 2, 3), ("cyclic", "mirrored"))]  # where there is a closed form
FAR = {"space": {"side_cm": 1e6}, "neighbourhood": {"kind": "all"}}  # sections of agents that come near no wall
BROWNIAN = {"kind": "brownian", "run_s": 2.0}
CORRELATED = {"kind": "correlated", "run_s": 0.5, "persistence": 0.8}


def is_uniform(values, low, high):
    return stats.kstest(np.ravel(values), "uniform", args=(low, high - low)).pvalue > UNLIKELY


def is_anywhere(headings):
    """Whether (agents, dimensions) headings are uniform over all directions."""
    if headings.shape[1] == 1:
        values, counts = np.unique(headings, return_counts=True)
        return values.tolist() == [-1, 1] and stats.chisquare(counts).pvalue > UNLIKELY
    is_round = is_uniform(np.arctan2(headings[:, 1], headings[:, 0]), -math.pi, math.pi)
    return is_round and (headings.shape[1] == 2 or is_uniform(headings[:, 2], -1, 1))


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
    lengths = np.array([[3.0], [1e300], [1e-200], [1.0]]) if part == "headings" else 1
    start = {part: (getattr(other, states[part])() * lengths).tolist()}
    given = make_simulation(7, start=start, **scene)
    for key, method in states.items():
        expected = getattr(other if key == part else drawn, method)()
        assert getattr(given, method)() == pytest.approx(expected, abs=1e-15)
    assert (given._arrays.streams == drawn._arrays.streams).all()


def test_speeds_have_the_distribution_and_the_mean_of_the_scenario():
    sigma = math.log(1 + 0.7**2) ** 0.5  # of the logarithm of lognormal speeds whose deviation is 0.7 of their mean
    for distribution, spread, expected in [
        *(("uniform", spread, stats.uniform(1 - spread, 2 * spread)) for spread in (0.1, 1.0)),
        *(("normal", spread, stats.truncnorm(-1 / spread, 1 / spread, 1, spread)) for spread in (0.1, 0.5, 1.0)),
        ("lognormal", 0.7, stats.lognorm(sigma, scale=math.exp(-(sigma**2) / 2))),
        ("exponential", None, stats.expon()),
    ]:
        speeds = {"speed_distribution": distribution, **({} if spread is None else {"speed_spread": spread})}
        swarm = make_simulation(3, agents={"count": 6000, "speed_cm_s": 4.0, **speeds}, space={"side_cm": 1e6})
        start = swarm.positions()
        swarm._arrays.scene.now = 0.1  # before anybody fires or comes far
        drawn = np.linalg.norm(swarm.positions() - start, axis=1) / 0.4
        assert stats.kstest(drawn, expected.cdf).pvalue > UNLIKELY
        low, high = expected.support()
        assert ((drawn >= low - 1e-6) & (drawn <= high + 1e-6)).all()
        assert drawn.mean() == pytest.approx(1, abs=0.03)


@pytest.mark.parametrize("jitter", [5e-5, 0.2])
def test_jittered_periods_are_normal_around_the_nominal_one(jitter):
    swarm = make_simulation(1, agents={"count": 6000}, clocks={"jitter": jitter, "period_s": 3.0})
    start = swarm.phases()
    swarm._arrays.scene.now = 1e-3
    periods = 1e-3 / (swarm.phases() - start)
    assert stats.kstest(swarm._arrays.period, stats.norm(1, jitter).cdf).pvalue > UNLIKELY
    assert periods == pytest.approx(swarm._arrays.period, rel=1e-9)
    assert swarm._arrays.period.min() >= 0.1
    assert stats.kstest(start, "uniform").pvalue > UNLIKELY  # jitter leaves phases uniform


def uncoupled(count, speed_cm_s=100.0, agents=None, **sections):
    """Return uncoupled agents that fire together once a cycle, so that simulating their motion is fast."""
    sections |= {"start": {"phases": "synchronised"}, "response": {"coupling": 0}}
    return make_simulation(agents={"count": count, "speed_cm_s": speed_cm_s, **(agents or {})}, **sections)


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


@pytest.mark.parametrize("exponent", [2.2, 3.0])
def test_runs_of_a_levy_walk_have_a_power_law_above_the_shortest(exponent):
    swarm = uncoupled(20_000, agents={"walk": {"kind": "levy", "run_s": 0.3, "exponent": exponent}}, **FAR)
    durations = swarm._arrays.run_end_cycle + swarm._arrays.run_end_time
    assert durations.min() >= 0.3
    assert stats.kstest(durations, "pareto", args=(exponent - 1, 0, 0.3)).pvalue > UNLIKELY


@pytest.mark.parametrize("dimensions", [1, 2, 3])
@pytest.mark.parametrize(("walk", "reorients"), [(BROWNIAN, False), (CORRELATED, False), (CORRELATED, True)])
def test_the_mean_squared_displacement_is_that_of_theory(dimensions, walk, reorients):
    """2 v^2 tau (t - tau (1 - exp(-t / tau))), with the speed v, in any number of dimensions.

    Agents that keep a direction for a time of mean T, and turn by an angle of mean cosine g, forget it after a mean
    of tau = T / (1 - g): the correlation of two headings a time t apart is exp(-t / tau).
    """
    agents = {"walk": walk, "reorient_on": ["emitting"] * reorients}
    swarm = uncoupled(4000, 3.0, agents, **FAR | {"space": {"dimensions": dimensions, "side_cm": 1e6}})
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
    agents["walk"] = {"kind": "brownian", "run_s": 0.1}
    swarm = uncoupled(10_000, 4.0, agents, clocks={"period_s": 2.0}, **FAR)
    table = swarm._arrays.run_speeds
    assert table.mean() == pytest.approx(2 * 4.0)  # cm in a period
    assert swarm._arrays.scene.max_speed == max(table.max(), swarm._arrays.speed.max())
    first = swarm.speeds_cm_s
    swarm.run_to(3.0)
    later = swarm.speeds_cm_s
    assert (first != later).mean() > 0.15  # of two speeds most are the same again
    assert stats.ks_2samp(first.round(9), later.round(9)).pvalue > UNLIKELY
    assert abs(later.mean() - 4.0) < 4 * later.std() / math.sqrt(len(later))
