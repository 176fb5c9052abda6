"""What thesis chapters 3 and 5 claim of point-like agents, each with enough trials to be sure, all of them quick.

docs/particle_results.md has the figures and numbers of the sweeps.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from epuck_sim.particles.simulation import ParticleSimulation
from tests.particles.simulations import make_resting, make_simulation

CENSORED_AT = 20_000


def times(speed: float, trials: int = 20, count: int = 20, limit: int = CENSORED_AT, **sections) -> np.ndarray:
    """Return T_sync of some trials, in cycles; the limit where one is censored."""
    agents = {"count": count, "speed_cm_s": speed, **sections.pop("agents", {})}
    found = []
    for seed in range(trials):
        swarm = ParticleSimulation({"model": "particles", "agents": agents, **sections}, seed)
        swarm.run(limit)
        found.append(swarm.cycles)
    return np.array(found)


def medians(speeds, **sections) -> list[float]:
    return [float(np.median(times(speed, **sections))) for speed in speeds]


def falls(values: list[float], slack: float = 1.0) -> bool:
    return all(after <= slack * before for before, after in pairwise(values))


def test_with_delay_advance_curves_t_sync_falls_with_speed() -> None:
    for curve in ("sawtooth", "sine"):
        found = medians([0.1, 0.4, 1.5, 5, 20], response={"curve": curve, "coupling": 0.1})
        assert falls(found)
        assert found[0] > 30 * found[-1]


def test_with_the_multiplicative_curve_it_falls_rises_and_falls_again() -> None:
    slow, least, peak, fast = medians([0.01, 0.1, 2, 20])
    assert slow > least
    assert peak == CENSORED_AT  # which more than half of the trials reach
    assert fast < 150


def test_a_refractory_period_of_0_4_removes_the_bump_and_one_of_0_1_does_not() -> None:
    speeds = [0.1, 0.4, 1.5, 5, 20]
    assert falls(medians(speeds, response={"refractory": 0.4}))
    before, peak = (times(speed, 60, response={"refractory": 0.1}).mean() for speed in (0.2, 1.5))
    assert peak > 1.5 * before


def test_more_neighbours_weaken_the_bump_until_beyond_five_none_is_left() -> None:
    rises = {}
    for k in (1, 2, 3, 6, 10):
        least, peak = medians([0.1, 1.5], neighbourhood={"kind": "nearest", "k": k})
        rises[k] = peak / least
    assert min(rises[1], rises[2]) > 3  # and with one neighbour more than half of the trials are censored at the peak
    assert max(rises[3], rises[6], rises[10]) < 1.5
    for k in (6, 10, 19):  # 19 are all, so that speed makes no difference
        assert falls(medians([0.03, 1, 30], neighbourhood={"kind": "nearest", "k": k}), slack=1.35)


@pytest.mark.parametrize("kind", ["cone_of_vision", "cone_of_emission"])
def test_wide_cones_are_monotone_and_narrow_ones_are_not(kind: str) -> None:
    speeds = [0.1, 1, 10, 100]
    wide = medians(speeds, neighbourhood={"kind": kind, "radius_cm": 25, "angle_deg": 360})
    assert falls(wide)
    assert wide[0] > 5 * wide[-1]
    slow, peak, _, fast = medians(speeds, neighbourhood={"kind": kind, "radius_cm": 40, "angle_deg": 60})
    assert peak > 3 * slow
    assert fast < slow / 10


@pytest.mark.parametrize("count", [10, 20, pytest.param(40, marks=pytest.mark.slow)])
def test_the_fast_regime_begins_near_l_over_the_root_of_n(count: int) -> None:
    begins = 100 / count**0.5
    slower, at_it, faster, fastest = medians([begins / 5, begins, 2 * begins, 5 * begins], count=count)
    assert at_it < 2 * fastest
    assert faster < 1.5 * fastest
    assert slower > 3 * fastest


def test_after_a_perturbation_the_transient_grows_exponentially_with_n_at_intermediate_speed_alone() -> None:
    start = {"phases": "synchronised", "displacement": 0.001}

    def transient(speed: float, count: int) -> float:
        side = 100 * (count / 20) ** 0.5
        return float(times(speed, 20, count, 10**6, start=start, space={"side_cm": side}).mean())

    intermediate = [transient(1, count) for count in (6, 9, 12)]
    factors = [after / before for before, after in pairwise(intermediate)]
    assert min(factors) > 4  # every three agents more
    assert transient(50, 48) < 3 * transient(50, 12)
    assert transient(0.03, 24) < 4 * transient(0.03, 12)


def test_jitter_is_catastrophic_at_intermediate_speed_and_harmless_at_high_speed() -> None:
    def left(speed: float) -> float:
        """Return the mean order parameter after 200 to 400 cycles."""
        keys = {"clocks": {"jitter": 5e-5}, "start": {"phases": "synchronised"}, "agents": {"speed_cm_s": speed}}
        found = []
        for seed in range(10):
            swarm = make_simulation(seed, **keys)
            for time in range(200, 400, 20):
                swarm.run_to(time + 0.5)
                found.append(abs(np.exp(2j * np.pi * swarm.phases()).mean()))
        return float(np.mean(found))

    slow, intermediate, fast = map(left, (0.03, 1, 50))
    assert fast > 0.999
    assert 0.95 > slow > intermediate + 0.2
    assert intermediate < 0.6


@pytest.mark.parametrize(
    ("sections", "speeds"),
    [
        *(({"agents": {"reorient_on": pulses}}, (0.3, 3, 20)) for pulses in (["emitting"], ["emitting", "receiving"])),
        ({"space": {"boundary": "cyclic"}}, (0.1, 2, 50)),
        ({"space": {"dimensions": 3}}, (0.1, 3, 50)),
    ],
    ids=str,
)
@pytest.mark.slow
def test_motion_that_is_coupled_to_pulses_and_other_spaces_show_the_three_regimes_too(sections, speeds) -> None:
    slow, peak, fast = medians(speeds, trials=10, limit=100_000, **sections)
    assert peak > 2.5 * slow
    assert fast < slow / 5


def test_static_agents_coupled_only_in_pairs_never_synchronise_and_in_the_fast_regime_all_do():
    swarm = make_resting([0.9, 0.7, 0.3, 0.1], [[0.0], [10.0], [60.0], [70.0]], neighbourhood={"kind": "nearest"})
    swarm.run(2000)
    assert swarm.phases()[0] == swarm.phases()[1] != swarm.phases()[2] == swarm.phases()[3]
    for curve in ("multiplicative", "sawtooth", "sine"):
        assert times(100.0, 10, limit=500, response={"curve": curve}).max() < 500


# --- what the thesis says in passing, or leaves to be tested ----------------------------------------


def test_fast_agents_are_a_mean_field_and_slower_ones_are_not() -> None:
    for k in (1, 5):
        drawn = times(100, 100, neighbourhood={"kind": "random", "k": k})
        fast, slower = (times(speed, 100, neighbourhood={"kind": "nearest", "k": k}) for speed in (100, 8))
        assert abs(fast.mean() / drawn.mean() - 1) < 0.25
        assert slower.mean() > 1.25 * drawn.mean()


def test_the_bump_is_there_if_early_pulses_lower_the_order_of_two_and_not_otherwise() -> None:
    for early_slope, has_bump in [(0.6, True), (0.0, False), (-0.5, False)]:
        parameters = {"knee": 1 / 2.1, "early_slope": early_slope}
        response = {"curve": "piecewise_linear", "coupling": 0.1, "parameters": parameters}
        slow, middle = medians([0.1, 0.7], trials=10, response=response)
        assert (middle == CENSORED_AT) == has_bump
        assert has_bump or middle < slow


# --- random walks and broad speeds (docs/open_questions.md) -----------------------------------------

WALKS = {
    "straight": {"kind": "straight"},
    "short runs": {"kind": "brownian", "run_s": 1},
    "long runs": {"kind": "brownian", "run_s": 10},
    "correlated": {"kind": "correlated", "run_s": 1, "persistence": 0.9},
    "levy": {"kind": "levy", "run_s": 1, "exponent": 2},
}


@cache
def mean(speed: float, walk: str, **agents) -> float:
    """Return the mean T_sync of ten agents, in cycles."""
    return float(times(speed, 30, 10, 100_000, agents={"walk": WALKS[walk], **agents}).mean())


@pytest.mark.parametrize("walk", WALKS)
def test_every_walk_has_the_three_regimes_with_the_peak_at_the_speed_of_straight_motion(walk):
    least, peak, fast = mean({"short runs": 0.7}.get(walk, 0.4), walk), mean(3, walk), mean(20, walk)
    assert peak > 2 * least
    assert fast < least / 5


BROAD = {
    "lognormal": {"speed_distribution": "lognormal", "speed_spread": 2},
    "two speeds": {"speed_distribution": "two_speeds", "fast_share": 0.1, "fast_ratio": 10},
}


@pytest.mark.parametrize("speeds", BROAD)
def test_broad_speeds_lower_the_peak_leave_it_in_place_and_begin_the_fast_regime_later(speeds):
    least, peak, later, fast = (mean(speed, "straight", **BROAD[speeds]) for speed in (0.4, 3, 10, 20))
    assert mean(3, "straight") > 1.5 * peak
    assert peak > 1.8 * least
    assert fast < least / 5
    assert later > 1.5 * mean(10, "straight")
