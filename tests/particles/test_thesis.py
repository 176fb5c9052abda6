"""What thesis chapters 3 and 5 claim of point-like agents, each with enough trials to be sure, all of them quick.

docs/particle_results.md has the figures and numbers of the sweeps.
"""

from itertools import pairwise

import numpy as np
import pytest

from epuck_sim.particles.simulation import ParticleSimulation
from tests.particles.simulations import make_resting

CENSORED_AT = 10_000


def times(speed: float, trials: int = 10, count: int = 20, limit: int = CENSORED_AT, **sections) -> np.ndarray:
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


def test_t_sync_falls_with_speed_and_with_the_multiplicative_curve_alone_rises_between() -> None:
    """A refractory period of 0.4 removes the bump, and one of 0.1 does not."""
    speeds = [0.1, 0.4, 1.5, 5, 20]
    for curve in ("sawtooth", "sine"):
        found = medians(speeds, response={"curve": curve, "coupling": 0.1})
        assert falls(found)
        assert found[0] > 30 * found[-1]
    slow, least, peak, fast = medians([0.01, 0.1, 2, 20])
    assert slow > least
    assert peak == CENSORED_AT  # which more than half of the trials reach
    assert fast < 150
    assert falls(medians(speeds, response={"refractory": 0.4}))
    before, peak = (times(speed, 20, response={"refractory": 0.1}).mean() for speed in (0.2, 1.5))
    assert peak > 1.5 * before


@pytest.mark.parametrize("count", [10, 20, pytest.param(40, marks=pytest.mark.slow)])
def test_the_fast_regime_begins_near_l_over_the_root_of_n(count: int) -> None:
    begins = 100 / count**0.5
    slower, at_it, faster, fastest = medians([begins / 5, begins, 2 * begins, 5 * begins], count=count)
    assert at_it < 2 * fastest
    assert faster < 1.5 * fastest
    assert slower > 3 * fastest


def test_static_agents_coupled_only_in_pairs_never_synchronise_and_in_the_fast_regime_all_do():
    swarm = make_resting([0.9, 0.7, 0.3, 0.1], [[0.0], [10.0], [60.0], [70.0]], neighbourhood={"kind": "nearest"})
    swarm.run(2000)
    assert swarm.phases()[0] == swarm.phases()[1] != swarm.phases()[2] == swarm.phases()[3]
    for curve in ("multiplicative", "sawtooth", "sine"):
        assert times(100.0, 10, limit=500, response={"curve": curve}).max() < 500
