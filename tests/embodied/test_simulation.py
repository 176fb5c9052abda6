"""Claims about simulations: one seed makes one trial, resets and copies are equal to the bit, and commands act."""

import copy
import gc
import math
import pickle
import random
import sys
from itertools import islice

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from epuck_sim import ControllerError, EmbodiedScenario, ScenarioError, Simulation, load_scenario, points
from epuck_sim.embodied.start import INFRARED_NOISE, WHEEL_NOISE
from epuck_sim.scenario.loader import write_scenario
from epuck_sim.util.builtin import ARENAS, builtin_files
from epuck_sim.util.yaml_io import parse_yaml
from tests.control.bench import EMPTY, with_sense, with_step, write_controller
from tests.control.test_firmware import write_firmware
from tests.embodied.steps import CHANGING, FAULTY, SIGNALS, bits, coming_and_going, constant, kept, steps_of, swarm_of
from tests.tools import needs_compiler

SHIPPED = [name for name in builtin_files(ARENAS) if isinstance(load_scenario(name), EmbodiedScenario)]
LAMP = constant([[30, 30, 0]], ring_on=True)
POSES = [[60, 60, 0.1], [71, 60, 2.0], [64, 71, 4.0], [90, 70, 3.0], [120, 60, 3.3], [30, 90, 5.5], [45, 40, 1.0]]
SEEN = ("poses", "infrared", "distance_mm", "camera", "wheels_cm_s", "ring_on", "phase_ms")


def following(simulation, steps):
    return [bits(step) for step in islice(simulation, steps)]


def test_the_seed_is_the_scenarios_own_unless_it_is_given_reset_keeps_it_and_a_refused_one_changes_nothing():
    own = bits(Simulation(load_scenario("thesis", ["seed=11"])).advance(20))
    assert own == bits(Simulation("thesis", 11).advance(20)) != bits(Simulation("thesis", 8).advance(20))
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


@pytest.mark.parametrize(
    ("work", "given", "most"), [("reset", {}, 34), ("command", {"left_cm_s": 1, "right_cm_s": 2, "ring_on": 1}, 24)]
)
def test_resets_and_commands_read_no_field_of_a_record_in_python_which_takes_microseconds(work, given, most) -> None:
    simulation, called = Simulation({"robots": [{"controller": "external"}]}, 4), list[str]()
    getattr(simulation, work)(**given)  # which may compile
    gc.collect()  # so that nothing that is freed meanwhile calls anything
    sys.setprofile(lambda frame, event, _: called.append(frame.f_code.co_name) if event == "call" else None)
    getattr(simulation, work)(**given)
    sys.setprofile(None)
    assert work in called
    assert not {"__getattribute__", "_getfield_is_safe"} & {*called}
    assert len(called) <= most


REACT = with_step(
    """red = sensors.camera.sum()
    memory.pixels = len(sensors.camera)
    memory.clock += 1 + red % 3
    actuators.ring_on = memory.clock % 7 < 3
    actuators.left_cm_s = -4.0 + 0.02 * red
    actuators.right_cm_s = 4.0 + 0.0005 * sensors.infrared.sum()""",
    MEMORY="{'clock': int, 'pixels': int}",
)


def written(folder, text):
    return str(write_controller(folder / "mine.py", text).path)


def test_the_order_of_robots_and_of_groups_does_not_matter_to_what_happens(tmp_path):
    react, order = written(tmp_path, REACT), np.random.default_rng(1).permutation(len(POSES))

    def run(*groups):
        robots = [{"poses": [POSES[robot] for robot in group], "controller": react} for group in groups]
        scenario = {"arena": {"width_cm": 150, "height_cm": 120}, "robots": robots, "noise": "off"}
        return kept(Simulation(scenario, 1, interpret=True), 150)

    straight = run(range(7))
    for groups in ([order], [order[:2], order[2:5], order[5:]], [[robot] for robot in order]):
        for one, other in zip(straight, run(*groups), strict=True):
            for name in SEEN:
                np.testing.assert_array_equal(getattr(other, name), getattr(one, name)[order], name)

    positions = np.array([step.poses[:, :2] for step in straight])
    one, other = np.triu_indices(7, 1)
    apart = np.linalg.norm(positions[:, one] - positions[:, other], axis=2)
    assert apart.min() > 7.4  # no two robots have touched
    assert np.any([step.camera.any(axis=1) for step in straight], axis=0).all()  # but all have seen somebody
    assert np.any([step.infrared[:3].any(axis=1) for step in straight], axis=0).all()


@needs_compiler
@pytest.mark.parametrize("scenario", [FAULTY, *map(coming_and_going, SIGNALS)])
def test_groups_without_robots_change_nothing(scenario, here):
    write_firmware(here / "mine.c")
    (here / "place.py").write_text(with_sense("readings.place = robot.x", "{'place': float}"))
    faults = [*scenario["faults"], {"kind": "sensor_dead", "sensor": "place", "at_s": 3}]
    alone = scenario | {"sensors": ["place.py"], "faults": faults}
    first, *others = scenario["robots"]
    own = {key: value for key, value in first.items() if key != "count"} | {"count": 0}
    nowhere, walking = {"placement": "poses", "poses": []}, {"controller": "random_walk"}
    groups = [own | walking, first, own | nowhere, *others, own | {"controller": "mine.c"}]
    found, expected = (steps_of(each, 60) for each in (alone | {"robots": groups}, alone))
    assert all(found[name].tobytes() == values.tobytes() for name, values in expected.items())
    interpreted = Simulation(alone | {"robots": groups[:-1]}, 3, interpret=True).advance(20)
    assert interpreted.poses.tobytes() == expected["poses"][19].tobytes()


def test_groups_with_different_cameras_and_controllers_work_side_by_side(tmp_path):
    wide = {"poses": [[50, 30, math.pi]], "controller": "constant", "camera": {"pixels": 100, "field_of_view_deg": 112}}
    still = {"speed_cm_s": 0, "period_s": 2}
    few = {"poses": [[30, 50, -math.pi / 2]], "parameters": still, "camera": {"pixels": 20}}
    blind = {"poses": [[10, 30, 0]], "controller": written(tmp_path, REACT), "camera": {"pixels": 30, "range_cm": 5}}
    simulation = Simulation({"robots": [LAMP, wide, few, blind], "noise": "off"}, 1, interpret=True)
    _, step = kept(simulation, 2)
    assert step.camera.shape == (4, 100)
    # a disc of radius 3.7 cm, seen 16.3 cm away from where the camera sits, covers 2 asin(3.7 / 16.3)
    seen = 2 * math.degrees(math.asin(3.7 / 16.3))
    assert step.camera.sum(axis=1) == pytest.approx([0, seen / 112 * 100, seen / 56 * 20, 0], abs=1)
    assert not step.camera[2, 20:].any()
    assert step.memories[3]["pixels"] == 30  # a controller is shown the pixels of its own camera alone
    assert [np.isnan(phase) for phase in step.phase_ms] == [True, True, False, True]
    np.testing.assert_array_equal(simulation.period_ms, [np.nan, np.nan, 2000, np.nan])
    np.testing.assert_array_equal(step.flash_seen, [False, True, True, False])


def test_steps_are_numbered_from_0_their_times_are_exact_and_whole_numbers_of_them_are_taken(monkeypatch):
    simulation = Simulation(load_scenario("arc", ["timing.control_hz=40", "timing.physics_hz=200"]))
    assert simulation.step_s == 1 / 40
    assert [(step.number, step.time_s) for step in islice(simulation, 50)] == [(n, n / 40) for n in range(50)]
    for steps in (0, 2.5, 0.7 / 0.1, math.nan, "3"):
        for take in (simulation.advance, simulation.stretch):
            with pytest.raises(ValueError, match=f"steps is {steps!r}; allowed: whole numbers from 1"):
                take(steps)
    taken, take = list[int](), simulation._loop.take_steps
    monkeypatch.setattr(simulation._loop, "take_steps", lambda *given: taken.append(given[2]) or take(*given))
    assert simulation.advance(np.int32(120)).number == 169
    assert taken == [50, 50, 20]  # between which Ctrl-C is heard


@pytest.mark.parametrize("scenario", [*SHIPPED, *CHANGING])
def test_interpreted_steps_one_by_one_and_at_once_are_the_compiled_ones_bit_for_bit(scenario):
    scenario = CHANGING.get(scenario, scenario)
    expected = following(Simulation(scenario, 3), 100)
    simulation = Simulation(scenario, 3, interpret=True)
    for count in (*[1] * 17, 2, 15, 16, 17, 33):
        step = simulation.advance(count)
        assert bits(step) == expected[simulation.steps - 1]
    assert step.number == 99


@pytest.mark.parametrize(("reference", "interpret"), [(0, False), (4, False), (4, True)])
def test_steps_taken_at_once_end_where_the_reference_fires(reference, interpret):
    scenario = load_scenario("thesis", [f"stop.reference_robot={reference}"])
    steps = kept(Simulation(scenario, 3), 150)
    lit = np.array([step.ring_commands[reference] for step in steps])
    phase = np.array([step.phase_ms[reference] for step in steps])
    expected = np.flatnonzero(lit & (~np.roll(lit, 1) | (phase < np.roll(phase, 1))))
    simulation, seen = Simulation(scenario, 3, interpret=interpret), []
    while simulation.steps < 150:
        step = simulation.advance(min(40, 150 - simulation.steps), until_firing=True)
        if simulation.is_firing:
            seen.append(step.number)
    assert seen == expected.tolist()
    assert len(seen) > 2


def test_a_robot_judges_a_flash_by_any_red_pixel_unless_its_controller_does():
    simulation = Simulation("spotlight")
    first, second = kept(simulation, 2)
    assert np.isnan(simulation.period_ms).all()
    assert np.isnan(first.phase_ms).all()
    np.testing.assert_array_equal(second.flash_seen, second.camera.any(axis=1))
    assert second.flash_seen[0]
    assert not second.flash_seen.all()
    np.testing.assert_array_equal(Simulation("spotlight").stretch(2).flash_seen, [first.flash_seen, second.flash_seen])
    watcher = {"poses": [[20, 30, 0]], "parameters": {"speed_cm_s": 0, "flash_pixels": 61}}
    step = Simulation({"robots": [watcher, LAMP], "noise": "off"}, 1).advance(2)
    assert step.camera[0].any()
    assert not step.flash_seen[0]


def test_noise_is_what_numpy_draws_with_the_seed_anew_for_each_sensor_wheel_robot_and_step():
    simulation = Simulation("thesis", 3)
    swarm = swarm_of(simulation)
    sequences = (np.random.SeedSequence(3, spawn_key=(part,)) for part in (INFRARED_NOISE, WHEEL_NOISE))
    sensors, wheels = (np.random.Generator(np.random.SFC64(sequence)) for sequence in sequences)
    for _ in islice(simulation, 50):
        np.testing.assert_allclose(swarm.robots.infrared_noise, sensors.standard_normal((10, 8)), rtol=1e-15)
        np.testing.assert_array_equal(swarm.robots.wheel_noise, wheels.random((10, 2)))
    assert (swarm.groups[0].infrared.noise_counts, swarm.scene[0].slip) == (10, 0.05)


def test_no_step_makes_numba_look_for_types_anew(monkeypatch):
    """Its slow way, which arrays of unaligned records take, costs ten times a step."""
    simulations = [Simulation(arena, 1) for arena in ("thesis", "arc", "spotlight", "physical")]
    for simulation in simulations:
        next(simulation)
    monkeypatch.setattr(Dispatcher, "_compile_for_args", lambda *_: pytest.fail("types are not known at once"))
    for simulation in simulations:
        next(simulation)


THREE_GROUPS = [
    {"count": 8, "camera": {"pixels": 20}, "memory": {"phase_ms": [*range(0, 4000, 500)]}},
    {"count": 12, "controller": "external"},
    {"count": 5, "placement": "grid", "parameters": {"speed_cm_s": 2}, "camera": {"frames_per_s": 7}},
]
CROWD = {"robots": THREE_GROUPS, "contact": {"friction": 0.3}, "arena": {"width_cm": 70, "height_cm": 70}}
UNLIKE = load_scenario(CROWD)


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
    taken, robots = [], len(simulation.external_wheels)
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


def test_changed_parameters_act_from_the_next_step_on_reset_takes_them_back_and_those_that_do_not_fit_are_refused():
    simulation = Simulation({key: CHANGING["scheduled"][key] for key in ("robots", "noise")}, 1)
    simulation.advance(3)
    simulation.set_parameters(1, speed_cm_s=1.5, period_s=3.0)
    assert simulation.period_ms.tolist() == [5000, 3000, 3000]
    simulation.set_parameters(1, coupling=0.2)
    assert next(simulation).wheels_cm_s.max(axis=1).tolist() == [12.8, 1.5, 1.5]
    simulation.reset()
    assert simulation.period_ms.tolist() == [5000, 5000, 5000]
    assert next(simulation).wheels_cm_s.max() == 12.8
    for group, values, kind, message in (
        (0, {"speed_cm_s": 99.0}, ScenarioError, r"robots.0.parameters: speed_cm_s is 99.0; allowed: 0 to 12.8"),
        (0, {"sped_cm_s": 1.0}, ScenarioError, "speed_cm_s"),
        (0, {"period_s": 0.1}, ScenarioError, "longer than a control step"),
        (2, {"speed_cm_s": 1.0}, ValueError, "group is 2; allowed: 0 to 1"),
        ("firefly", {"speed_cm_s": 1.0}, ValueError, "group is 'firefly'; allowed: 0 to 1"),
        (1.0, {"speed_cm_s": 1.0}, ValueError, "group is 1.0; allowed: 0 to 1"),
    ):
        with pytest.raises(kind, match=message):
            simulation.set_parameters(group, **values)
        assert simulation.period_ms.tolist() == [5000, 5000, 5000]
        assert not simulation.snapshot().changes


def test_no_observer_changes_what_others_are_shown_or_asks_for_contacts_that_are_over():
    simulation = Simulation("thesis", 1)
    step = simulation.advance(5)
    shown = [each for each in (*step, *step.memories, step.sightings, step.contacts) if isinstance(each, np.ndarray)]
    assert len(shown) == 12
    assert not any(array.flags.writeable for array in shown)
    kept, _ = next(simulation).copied(), next(simulation)
    with pytest.raises(ValueError, match="step 5 is over: 6 is the last; ask for contacts earlier, and keep them"):
        _ = kept.contacts


def test_a_list_of_numbers_is_a_parameter_of_scenarios_axes_and_running_trials(tmp_path):
    turner = with_step("actuators.left_cm_s = parameters.w[1]", PARAMETERS="{'w': [1, 0.5, 0]}")
    axes = ["w=[1, 2, 3],[3, 4, 5]"]
    scenario = load_scenario({"robots": [{"controller": written(tmp_path, turner), "count": 2}]}, axes=axes)
    assert load_scenario(parse_yaml(write_scenario(scenario), "")) == scenario
    first, second = (point.scenario for point in points(scenario))
    assert second.robots[0].parameters == {"w": (3.0, 4.0, 5.0)}
    simulation = Simulation(first, 1)
    assert next(simulation).wheels_cm_s[:, 0].tolist() == [2, 2]
    simulation.set_parameters(w=np.array([0, 7, 0]))
    assert [next(each).wheels_cm_s[1, 0] for each in (copy.copy(simulation), simulation)] == [7, 7]
    simulation.reset()
    assert next(simulation).wheels_cm_s[1, 0] == 2


def test_a_controller_that_raises_at_a_restart_is_named(tmp_path):
    late = with_step("pass").replace("    pass\n", "    x = 1 / (int(random[0] % 2))\n", 1)
    scenario = load_scenario({"robots": [{"controller": written(tmp_path, late), "count": 1}]})
    is_good = {}
    for seed in range(20):
        try:
            simulation, is_good[seed] = Simulation(scenario, seed, interpret=True), True
        except ControllerError:
            is_good[seed] = False
    good, bad = (next(seed for seed in is_good if is_good[seed] == wanted) for wanted in (True, False))
    with pytest.raises(ControllerError, match=rf"robot 0, step 0, seed {bad}: .*mine.py"):
        simulation.reset(bad)
    simulation.reset(good)
    assert next(simulation).number == 0


POLICY = with_step(
    """actuators.left_cm_s = 12.8 - sensors.infrared[7] / 50.0
    actuators.right_cm_s = -3.0 if sensors.camera.sum() > 0 else 40.0
    actuators.ring_on = sensors.distance_mm.min() < 60 or memory.steps % 17 == 0
    memory.steps += 1""",
    MEMORY="{'steps': int}",
)


@pytest.mark.parametrize("interpret", [False, True])
def test_robots_commanded_from_outside_move_and_flash_as_with_a_controller_to_the_bit(interpret, tmp_path):
    others = [{"count": 3}, {"count": 2, "controller": "oscillator"}]
    imperfect = {"spread": {"wheel_speed": 0.2, "infrared_gain": 0.1}, "stuck": {"per_hour": 900, "mean_s": 2}}
    both = [{"count": 6, "controller": name} for name in (written(tmp_path, POLICY), "external")]
    ruled, free = (load_scenario({"robots": [*others, group], **imperfect}) for group in both)
    commanded = Simulation(free, 3, interpret=interpret)
    for theirs in kept(Simulation(ruled, 3, interpret=True), 100):
        step, robots = next(commanded), commanded.external_wheels
        seen, near = step.camera[robots].sum(axis=1) > 0, step.distance_mm[robots].min(axis=1) < 60
        left = 12.8 - step.infrared[robots, 7] / 50.0
        commanded.command(left, np.where(seen, -3.0, 40.0), near | (step.number % 17 == 0))
        for name in ("poses", "infrared", "distance_mm", "camera", "wheels_cm_s", "ring_on"):
            np.testing.assert_array_equal(getattr(step, name), getattr(theirs, name), err_msg=name)
    assert step.ring_on.any()


def test_a_command_holds_until_the_next_what_is_left_out_stays_and_parts_are_commanded_apart():
    robots = [{"controller": "external_wheels", "count": 3}, {"controller": "external_ring", "count": 2}]
    simulation = Simulation({"robots": robots}, 1, interpret=True)
    assert simulation.external_wheels.tolist() == [0, 1, 2]
    assert simulation.external_rings.tolist() == [3, 4]
    simulation.command(left_cm_s=-5.0, right_cm_s=[5.0, 6.0, -20.0], ring_on=[False, True])
    simulation.command(left_cm_s=-6.0)
    steps = kept(simulation, 100)
    rings = np.array([step.ring_on for step in steps])
    assert rings[:, :3].any(axis=0).all()  # oscillators with commanded wheels flash by themselves
    assert not rings[:, 3].any()
    assert rings[:, 4].all()
    assert all(step.wheels_cm_s[:3].tolist() == [[-6, 5], [-6, 6], [-6, -12.8]] for step in steps)
    assert (steps[-1].wheels_cm_s[3:] > 0).any()


def test_faults_and_absence_come_after_commands_and_a_file_says_what_is_external(tmp_path):
    assert write_controller(tmp_path / "mine.py", EMPTY + "EXTERNAL = ('ring',)\n").external == ("ring",)
    robots = [{"controller": "external", "count": 3, "placement": "grid"}]
    faults, schedule = [{"kind": "ring_dead", "robots": [0]}], [{"at_s": 0, "remove": [1]}]
    simulation = Simulation({"robots": robots, "faults": faults, "schedule": schedule}, 1, interpret=True)
    next(simulation)
    simulation.command(5, 5, ring_on=True)
    assert simulation.last_step.ring_on.tolist() == [False, False, True]
    assert simulation.last_step.wheels_cm_s.tolist() == [[5, 5], [0, 0], [5, 5]]


def test_commands_that_do_not_fit_are_refused_and_nothing_is_commanded():
    for controller, given, message in (
        ("external", {"left_cm_s": np.zeros(3)}, r"left_cm_s has the shape \(3,\); allowed: \(2,\).* with wheels c"),
        ("external", {"left_cm_s": [1.0, np.nan]}, "left_cm_s is nan for robot 9; allowed: numbers"),
        ("external", {"left_cm_s": ["fast", "slow"]}, "left_cm_s is fast for robot 8; allowed: numbers"),
        ("external", {"right_cm_s": 1.0, "ring_on": [True, 2]}, "ring_on is 2 for robot 9; allowed: true and false"),
        ("external", {"right_cm_s": 1.0, "ring_on": [True]}, r"ring_on has the shape \(1,\)"),
        ("external", {}, "nothing is commanded; give left_cm_s, right_cm_s or ring_on"),
        ("constant", {"left_cm_s": 0}, "no robot has its wheels commanded from outside; give a group `controller: e"),
        ("external_wheels", {"ring_on": True}, "no robot has its ring commanded"),
    ):
        simulation = Simulation({"robots": [{"count": 8}, {"count": 2, "controller": controller}]}, 1, interpret=True)
        with pytest.raises(ValueError, match=message):
            simulation.command(**given)
        step = next(simulation)
        assert not step.wheels_cm_s[8:].any()
        assert controller == "external_wheels" or not step.ring_on[8:].any()
