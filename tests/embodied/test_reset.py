"""Claims about simulations that start anew, go back, are copied, and change on the way: equal to the bit."""

import copy
import gc
import pickle
import random
from itertools import islice

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.loader import load_scenario
from tests.control.bench import with_step
from tests.embodied.steps import bits


def following(simulation, steps):
    return [bits(step) for step in islice(simulation, steps)]


UNLIKE = load_scenario(
    {
        "robots": [
            {"count": 8, "camera": {"pixels": 20}, "memory": {"phase_ms": [*range(0, 4000, 500)]}},
            {"count": 12, "controller": "external"},
            {"count": 5, "placement": "grid", "parameters": {"speed_cm_s": 2}, "camera": {"frames_per_s": 7}},
        ],
        "contact": {"friction": 0.3},
        "arena": {"width_cm": 70, "height_cm": 70},
    }
)


def test_reset_keeps_the_seed_unless_another_is_given_and_a_refused_one_changes_nothing():
    simulation = Simulation("thesis", 4)
    first = following(simulation, 20)
    simulation.reset()
    assert following(simulation, 20) == first
    with pytest.raises(ScenarioError, match="seed is -1; allowed"):
        simulation.reset(-1)
    assert (simulation.steps, simulation.seed) == (20, 4)
    simulation.reset(5)
    simulation.reset()
    assert simulation.seed == 5


def test_many_resets_in_crowds_leave_no_body_behind():
    """Bodies and shapes are freed by turns with spaces in which they were; pymunk aborts if they are still in one."""
    crowds = [Simulation("crowded", seed) for seed in range(2)]
    chance = random.Random(1)
    for _ in range(20):
        crowd = chance.choice(crowds)
        crowd.advance(chance.randint(1, 12))
        crowd.reset(chance.randint(0, 99))
        if chance.random() < 0.2:
            crowds[crowds.index(crowd)] = Simulation("crowded", 1)
            del crowd
            gc.collect()
    used = crowds[0]
    used.reset(7)
    assert following(used, 30) == following(Simulation("crowded", 7), 30)


def drive(simulation, steps, chance):
    """Command and change at random for some steps."""
    taken = []
    robots = len(simulation.external_wheels)
    for _ in range(steps):
        taken.append(bits(next(simulation)))
        if chance.random() < 0.5:
            simulation.command(chance.uniform(-20, 20, robots), 12.8, chance.random(robots) < 0.5)
        if chance.random() < 0.1:
            simulation.set_parameters(2, speed_cm_s=chance.uniform(0, 12))
    return taken


COPIES = {
    "restored": lambda simulation: simulation.restore(simulation.snapshot()) or simulation,
    "copied": copy.copy,
    "deep copied": copy.deepcopy,
    "pickled": lambda simulation: pickle.loads(pickle.dumps(simulation)),
    "of a pickled snapshot": lambda simulation: restored_elsewhere(pickle.dumps(simulation.snapshot())),
}


def restored_elsewhere(dumped):
    simulation = Simulation(UNLIKE, 99)
    simulation.advance(30)
    simulation.restore(pickle.loads(dumped))
    return simulation


@pytest.mark.parametrize("way", COPIES)
@pytest.mark.parametrize("steps", [0, 67])
def test_copies_go_on_equal_to_the_bit_among_contacts_commands_and_changes(way, steps):
    original, alone = (Simulation(UNLIKE, 3) for _ in range(2))
    for simulation in (original, alone):
        drive(simulation, steps, np.random.default_rng(1))
    made = COPIES[way](original)
    assert made.steps == alone.steps
    expected = drive(alone, 40, np.random.default_rng(2))
    assert drive(made, 40, np.random.default_rng(2)) == expected
    if made is not original:  # which neither notices its copy nor shares anything with it
        assert drive(original, 40, np.random.default_rng(2)) == expected


def test_a_snapshot_is_a_moment_which_later_steps_do_not_change_and_one_of_another_scenario_is_refused():
    simulation = Simulation(UNLIKE, 3)
    drive(simulation, 20, np.random.default_rng(1))
    snapshot = simulation.snapshot()
    assert "steps=20" in repr(snapshot)
    first = drive(simulation, 30, np.random.default_rng(2))
    with pytest.raises(ValueError, match="cannot be restored from Snapshot"):
        simulation.restore(Simulation("crowded", 3).snapshot())
    assert simulation.steps == 50
    simulation.restore(snapshot)
    assert drive(simulation, 30, np.random.default_rng(2)) == first


def test_changed_parameters_act_from_the_next_step_on_and_reset_takes_them_back():
    apart = [{"poses": [[15, 15, 0]]}, {"poses": [[15, 30, 0], [15, 45, 0]]}]
    simulation = Simulation({"robots": apart, "noise": "off"}, 1)
    simulation.advance(3)
    simulation.set_parameters(1, speed_cm_s=1.5, period_s=3.0)
    assert simulation.period_ms.tolist() == [5000, 3000, 3000]
    simulation.set_parameters(1, coupling=0.2)
    assert next(simulation).wheels_cm_s.max(axis=1).tolist() == [12.8, 1.5, 1.5]
    simulation.reset()
    assert simulation.period_ms.tolist() == [5000, 5000, 5000]
    assert next(simulation).wheels_cm_s.max() == 12.8


@pytest.mark.parametrize(
    ("group", "values", "kind", "message"),
    [
        (0, {"speed_cm_s": 99.0}, ScenarioError, r"robots.0.parameters: speed_cm_s is 99.0; allowed: 0 to 12.8"),
        (0, {"sped_cm_s": 1.0}, ScenarioError, "speed_cm_s"),
        (0, {"period_s": 0.1}, ScenarioError, "longer than a control step"),
        (1, {"speed_cm_s": 1.0}, ValueError, "group is 1; allowed: 0 to 0"),
    ],
)
def test_parameters_that_a_controller_does_not_take_are_refused(group, values, kind, message):
    simulation = Simulation("thesis", 1)
    with pytest.raises(kind, match=message):
        simulation.set_parameters(group, **values)
    assert simulation.period_ms.tolist() == [5000] * 10
    assert not simulation.snapshot().changes


def test_a_controller_that_raises_at_a_restart_is_named(tmp_path):
    path = tmp_path / "late.py"
    path.write_text(with_step("pass").replace("    pass\n", "    x = 1 / (int(random[0] % 2))\n", 1))
    scenario = load_scenario({"robots": [{"controller": str(path), "count": 1}]})
    is_good = {}
    for seed in range(20):
        try:
            simulation, is_good[seed] = Simulation(scenario, seed, interpret=True), True
        except ControllerError:
            is_good[seed] = False
    good, bad = (next(seed for seed in is_good if is_good[seed] == wanted) for wanted in (True, False))
    with pytest.raises(ControllerError, match=rf"robot 0, step 0, seed {bad}: .*late.py"):
        simulation.reset(bad)
    simulation.reset(good)
    assert next(simulation).number == 0
