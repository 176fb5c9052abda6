"""A trial beside its undisturbed twin: how far phases deviate, and what both have in common."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.particles.twin import make_twin, simulate_with_twin
from epuck_sim.scenario.loader import load_scenario
from tests.particles.simulations import KINDS, any_sections, make_simulation, scenario

MIDDLES = np.arange(0.5, 30)
SYNCHRONISED = {"phases": "synchronised"}


def displaced(by):
    return {"phases": "synchronised", "displacement": by}


def compare(seed=0, times=MIDDLES, **sections):
    return simulate_with_twin(load_scenario(scenario(**sections)), seed, times)


@given(st.data(), st.integers(0, 2**32 - 1), st.sampled_from(KINDS))
@settings(max_examples=15)
def test_undisturbed_nothing_deviates_at_any_time(data, seed, kind):
    sections = data.draw(any_sections(kind))
    sections["clocks"]["jitter"] = 0.0
    times = np.linspace(0, 12 * sections["clocks"]["period_s"], 30)
    assert not compare(seed, times, **sections).deviation.any()


@pytest.mark.parametrize(
    ("displacement", "deviation"),
    [(2**-10, 2**-10), (0.25, 0.25), (0.5, 0.5), (0.875, 0.125)],
)
def test_an_uncoupled_displaced_agent_deviates_by_the_displacement_for_ever(displacement, deviation):
    times = np.concatenate([MIDDLES, np.arange(1000.03125, 20_000, 7_777)])
    found = compare(times=times, start=displaced(displacement), response={"coupling": 0})
    assert found.deviation[:, 0].tolist() == [deviation] * len(times)
    assert not found.deviation[:, 1:].any()


def test_the_deviation_spreads_to_agents_that_were_not_displaced():
    everybody = compare(times=np.arange(0.5, 20), start=displaced(2**-10), neighbourhood={"kind": "all"})
    assert everybody.deviation[0].tolist() == [2**-10] + [0] * 19
    np.testing.assert_allclose(everybody.deviation[1:], 2**-10, rtol=1e-11)  # all are early from the first firing on
    np.testing.assert_allclose(everybody.order_parameter[1:], 1, atol=1e-12)
    found = compare(times=np.arange(0.5, 200), start=displaced(0.01), agents={"count": 20, "speed_cm_s": 30}, seed=3)
    deviate = np.count_nonzero(found.deviation > 1e-9, axis=1)
    assert deviate[0] == 1
    assert deviate.max() > 10


def test_with_jitter_deviations_grow_with_the_error_of_the_periods_and_wrap_at_half_a_cycle():
    given = {"clocks": {"jitter": 1e-3, "period_s": 2.0}, "response": {"coupling": 0}, "start": SYNCHRONISED}
    times = np.linspace(0, 8000, 400)
    found = compare(7, times, **given)
    apart = np.abs(times[:, None] / make_simulation(7, **given).periods_s - times[:, None] / 2.0) % 1
    np.testing.assert_allclose(found.deviation, np.minimum(apart, 1 - apart), atol=1e-8)
    early = times < 200
    slopes = found.deviation[early][1:] / times[early][1:, None]
    np.testing.assert_allclose(slopes, np.broadcast_to(slopes[0], slopes.shape), rtol=1e-6)
    assert found.deviation.max() > 0.49


def test_the_order_parameter_is_that_of_all_phases_at_each_time():
    given = {"clocks": {"jitter": 0.01}, "stop": {"metric": "reference"}, "agents": {"count": 7, "speed_cm_s": 20}}
    found = compare(5, MIDDLES + 0.123, **given)
    swarm = make_simulation(5, **given)
    for time, order in zip(MIDDLES + 0.123, found.order_parameter, strict=True):
        swarm.run_to(time)
        assert order == pytest.approx(abs(np.exp(2j * math.pi * swarm.phases()).mean()), abs=1e-12)


@pytest.mark.parametrize(("ahead", "phase"), [(0.25, 0.95), (0.4, 1.0)])
def test_a_twin_of_ones_own_displacement_is_ahead_by_it_or_by_what_is_left_until_it_fires(ahead, phase):
    given = load_scenario(scenario(agents={"count": 3}, start={"phases": [0.7, 0.4, 0.1]}))
    assert make_twin(given, 1, ahead).phases() == pytest.approx([phase, 0.4, 0.1])


@pytest.mark.parametrize(("reorient_on", "moves_alike"), [([], True), (["receiving"], False)])
def test_the_twin_has_nominal_periods_no_displaced_agent_and_moves_alike_unless_pulses_turn(reorient_on, moves_alike):
    given = scenario(
        start=displaced(0.1),
        clocks={"jitter": 0.1, "period_s": 3.0},
        agents={
            "count": 6,
            "speed_cm_s": 30,
            "speed_distribution": "uniform",
            "speed_spread": 0.5,
            "reorient_on": reorient_on,
        },
    )
    disturbed, twin = ParticleSimulation(given, 9), make_twin(load_scenario(given), 9)
    assert (twin.seed, set(twin.periods_s.tolist()), len(set(disturbed.periods_s.tolist()))) == (9, {3.0}, 6)
    assert disturbed.phases().tolist() == [pytest.approx(0.1)] + [0.0] * 5
    assert not twin.phases().any()
    for swarm in (disturbed, twin):
        swarm.run_to(60)
    for moving in ("positions", "headings"):
        apart = np.abs(getattr(disturbed, moving)() - getattr(twin, moving)()).max()
        assert (apart < 1e-9) == moves_alike
