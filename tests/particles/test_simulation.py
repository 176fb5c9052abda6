"""A simulation depends on its seed alone, in any process, and motion does not depend on the oscillators."""

import copy
import math
import pickle

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import ScenarioError
from epuck_sim.particles.simulation import ParticleSimulation
from tests.particles.simulations import KINDS, MOTION, any_sections, make_simulation, scenario, state_of

SEEDS = st.integers(0, 2**63 - 1)


@given(st.data(), SEEDS, SEEDS, st.sampled_from(KINDS))
@settings(max_examples=15)
def test_a_reset_simulation_is_a_new_one_and_a_copy_goes_on_alike(data, seed, before, kind):
    sections = data.draw(any_sections(kind))
    sections["schedule"] = data.draw(st.sampled_from([[], [{"at_s": 0.7, "set": {"response.refractory": 0.3}}]]))
    new, used = make_simulation(seed, **sections), make_simulation(before, **sections)
    used.run(data.draw(st.integers(0, 5)), 20)
    used.reset(seed)
    for _ in range(20):
        assert state_of(used) == state_of(new)
        mine, yours = next(used), next(new)
        assert (mine.time_s, mine.turned, *mine.fired) == (yours.time_s, yours.turned, *yours.fired)
    copies = [copy.copy(used), copy.deepcopy(used), pickle.loads(pickle.dumps(used))]
    for swarm in (new, *copies, used):  # a copy's time does not touch that of the original
        swarm.run(10, 20)
        assert state_of(swarm) == state_of(new)
        assert (swarm.events, swarm.outcome) == (new.events, new.outcome)


def test_a_reset_without_a_seed_takes_that_of_the_scenario():
    swarm, new = ParticleSimulation(scenario(seed=3), 5), ParticleSimulation(scenario(seed=3))
    assert state_of(new) == state_of(ParticleSimulation(scenario(), 3)) != state_of(swarm)
    swarm.reset()
    assert (swarm.seed, state_of(swarm)) == (3, state_of(new))
    with pytest.raises(ScenarioError, match="seed is -1"):
        swarm.reset(-1)
    assert (swarm.seed, state_of(swarm)) == (3, state_of(new))


OTHERS = [
    {"response": {"curve": "sine", "coupling": 0.3, "refractory": 0.4}},
    {"neighbourhood": {"kind": "cone_of_vision", "angle_deg": 90}},
    {"start": {"phases": "synchronised", "displacement": 0.001}, "neighbourhood": {"kind": "all"}},
    {"clocks": {"jitter": 0.1}, "stop": {"reference": 3, "metric": "reference"}},
]


@pytest.mark.parametrize("other", OTHERS, ids=str)
@pytest.mark.parametrize(("dimensions", "boundary"), [(1, "bounded"), (2, "cyclic"), (3, "bounded")])
def test_swarms_of_one_seed_move_alike_whatever_their_oscillators_do(other, dimensions, boundary):
    speeds = {"speed_cm_s": 60.0, "speed_distribution": "uniform", "speed_spread": 0.5}
    scene = {
        "space": {"dimensions": dimensions, "boundary": boundary},
        "agents": {"count": 8, **speeds, "walk": {"kind": "levy", "run_s": 0.3, "exponent": 2.2}},
    }
    one, two = make_simulation(9, **scene), make_simulation(9, **scene, **other)
    assert (one.positions() == two.positions()).all()
    for time_s in (0.9, 3.3, 12.6):
        one.run_to(time_s)
        two.run_to(time_s)
        # positions differ in the last digit, because `now` may be counted from one cycle or the next
        assert one.positions() == pytest.approx(two.positions(), abs=1e-11)
        for name in MOTION:
            assert (getattr(one._arrays, name) == getattr(two._arrays, name)).all()


@pytest.mark.parametrize("time_s", [3.9, -1.0, math.nan, math.inf])
def test_a_simulation_cannot_go_back_nor_to_a_time_that_is_not_finite(time_s):
    swarm = make_simulation(1)
    swarm.run_to(4.0)
    said = r"the simulation is at 4\.0 s and cannot go back" if math.isfinite(time_s) else "allowed: a finite number"
    with pytest.raises(ValueError, match=said):
        swarm.run_to(time_s)
    swarm.run_to(4.0)
    assert swarm.time_s == 4.0


@pytest.mark.parametrize("cycles", [-1, 1.5, "3"])
def test_cycles_are_whole_numbers(cycles):
    with pytest.raises(ValueError, match=f"cycles is {cycles!r}; allowed: whole numbers from 0"):
        make_simulation(1).run(cycles)
