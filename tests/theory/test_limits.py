"""Chains of phases against simulations, and pairs against their closed form."""

import math

import numpy as np
import pytest

from epuck_sim import ParticleSimulation, load_scenario, run_trial
from epuck_sim.estimate import Estimate
from epuck_sim.particles.phase_response import Response
from epuck_sim.theory.limits import Limit, find_limit
from epuck_sim.theory.pair import measure_pair
from epuck_sim.theory.regime import Course, find_rise, judge, time_at
from epuck_sim.theory.snapshots import take_snapshots

MULTIPLICATIVE = Response(0, 0.1, 0.0)
THRESHOLD = 1 - 1e-9


def simulated(settings: list[str], trials: int) -> tuple[float, float]:
    """Return the mean T_sync of trials, and its standard error."""
    simulation = ParticleSimulation(load_scenario("particles", settings), 0)
    times = []
    for seed in range(trials):
        simulation.reset(seed)
        times.append(run_trial(simulation).t_sync_cycles)
    return float(np.mean(times)), float(np.std(times) / math.sqrt(trials))


@pytest.mark.parametrize("curve", ["multiplicative", "sawtooth"])
def test_links_that_are_new_at_each_instant_are_receivers_drawn_for_each_pulse(curve: str) -> None:
    settings = ["agents.count=8", "neighbourhood={kind: random, k: 2}", f"response.curve={curve}"]
    mean, error = simulated(settings, 150)
    response = MULTIPLICATIVE if curve == "multiplicative" else Response(1, 0.1, 0.0)
    snapshots = take_snapshots(load_scenario("particles", settings), 400)
    found = find_limit(response, THRESHOLD, snapshots, 0.0, chains=200)
    assert found.ended.value == 1
    reach = 3 * math.hypot(error, (found.cycles.high - found.cycles.value) / 2)
    assert found.cycles.value == pytest.approx(mean, abs=reach)


def test_links_that_stay_are_those_of_agents_that_stand() -> None:
    settings = ["agents.count=6", "agents.speed_cm_s=0", "neighbourhood={kind: range, radius_cm: 142}"]
    mean, error = simulated(settings, 150)
    snapshots = take_snapshots(load_scenario("particles", settings), 10)
    found = find_limit(MULTIPLICATIVE, THRESHOLD, snapshots, math.inf, chains=200)
    assert found.cycles.value == pytest.approx(mean, abs=3 * math.hypot(error, found.cycles.value / 30))


def test_what_no_link_joins_never_ends_and_no_snapshot_is_no_limit() -> None:
    apart = np.zeros((1, 3, 3), np.bool_)
    apart[0, 0, 1] = True
    found = find_limit(MULTIPLICATIVE, THRESHOLD, apart, math.inf, chains=2)
    assert found.ended.value == 0
    assert math.isnan(found.cycles.value)
    assert math.isnan(find_limit(MULTIPLICATIVE, THRESHOLD, apart[:0], math.inf).cycles.value)


def test_pairs_grow_and_meet_as_their_curve_says() -> None:
    pair = measure_pair(MULTIPLICATIVE, THRESHOLD)
    assert (pair.lead, pair.lag) == (pytest.approx(math.log(1.1)), -math.inf)
    assert pair.growth == pytest.approx(math.log(1.1**2 / 2))
    sawtooth = measure_pair(Response(1, 0.1, 0.0), 0.99)
    assert (sawtooth.lead, sawtooth.lag) == (pytest.approx(math.log(0.9)), pytest.approx(math.log(0.9)))
    assert sawtooth.growth == pytest.approx(2 * math.log(0.9))
    settings = ["agents.count=2", "agents.speed_cm_s=0", "neighbourhood={kind: all}"]
    mean, error = simulated(settings, 300)
    assert pair.cycles == pytest.approx(mean, abs=3 * error + 0.5)
    assert measure_pair(Response(0, 0.0, 0.0), THRESHOLD).cycles == math.inf


def limit(cycles: float, error: float = 1.05) -> Limit:
    return Limit(Estimate(cycles, cycles / error, cycles * error), Estimate(1.0), cycles)


def test_a_rise_is_from_a_slower_swarm_to_a_faster_one_and_decides() -> None:
    holds = (8.0, 4.0, 2.0, 1.0, 0.0)
    peaked = Course(holds, tuple(map(limit, (200.0, 20.0, 400.0, 30.0, 20.0))))
    rise = find_rise(peaked)
    assert (rise.minimum, rise.peak) == (4.0, 2.0)
    assert rise.log_ratio == pytest.approx(math.log(20), abs=0.1)
    falling = Course(holds, tuple(map(limit, (200.0, 80.0, 40.0, 30.0, 60.0))))
    assert find_rise(falling).log_ratio == 0  # that of the fast limit is none
    assert judge(rise).verdict == "yes"
    assert judge(find_rise(falling)).verdict == "no"


def test_t_sync_at_a_speed_lies_between_those_of_two_holds() -> None:
    course = Course((8.0, 4.0, 0.0), tuple(map(limit, (100.0, 25.0, 10.0))))
    assert time_at(course, math.sqrt(32)).value == pytest.approx(50)
    assert time_at(course, 16.0).value == pytest.approx(200)
    assert time_at(course, 1.0).value == 10
