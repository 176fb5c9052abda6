"""Claims about the simulation: the same seed makes the same trial, and all robots sense the same instant."""

import math
from itertools import islice

import numpy as np
import pytest
from numba.core.dispatcher import Dispatcher

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.start import Part, spawned
from epuck_sim.errors import ControllerError, ScenarioError
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.util.builtin import ARENAS, builtin_files
from tests.control.bench import MODES, with_step
from tests.embodied.changing import CHANGING, swarm_of
from tests.embodied.steps import bits, kept

SHIPPED = [name for name in builtin_files(ARENAS) if isinstance(load_scenario(name), EmbodiedScenario)]
LONG = ("crowded", "obstacles", "physical", "thesis")


@pytest.mark.parametrize("arena", SHIPPED)
def test_interpreted_controllers_make_the_same_trial_bit_for_bit(arena):
    compiled, interpreted = (Simulation(arena, 7, interpret=interpret) for interpret in (False, True))
    for _ in range(100 if arena in LONG else 40):
        assert bits(next(interpreted)) == bits(next(compiled))


LAMP = {"poses": [[30, 30, 0]], "controller": "constant", "parameters": {"ring_on": True}}
WATCHER = {"poses": [[20, 30, 0]], "parameters": {"speed_cm_s": 0}}


def test_the_seed_is_the_scenarios_own_unless_it_is_given():
    own = bits(Simulation(load_scenario("thesis", ["seed=11"])).advance(20))
    assert own == bits(Simulation("thesis", 11).advance(20)) != bits(Simulation("thesis", 8).advance(20))
    with pytest.raises(ScenarioError, match=r"pair: seed is -1; allowed: whole numbers from 0"):
        Simulation("pair", -1)


@pytest.mark.parametrize("steps", [0, 2.5, 0.7 / 0.1, math.nan, "3"])
def test_steps_are_whole_numbers_from_1(steps):
    for take in (Simulation("pair").advance, Simulation("pair").stretch):
        with pytest.raises(ValueError, match=f"steps is {steps!r}; allowed: whole numbers from 1"):
            take(steps)
    assert Simulation("pair").advance(np.int32(3)).number == 2


REACT = with_step(
    """red = sensors.camera.sum()
    memory.pixels = len(sensors.camera)
    memory.clock += 1 + red % 3
    actuators.ring_on = memory.clock % 7 < 3
    actuators.left_cm_s = -4.0 + 0.02 * red
    actuators.right_cm_s = 4.0 + 0.0005 * sensors.infrared.sum()""",
    MEMORY="{'clock': int, 'pixels': int}",
)
FAIL = with_step(
    """memory.taken += 1
    is_due = memory.taken == 4 and sensors.infrared[7] > 1000
    if is_due and parameters.way == 0: raise ValueError("too near")
    if is_due and parameters.way == 1: actuators.right_cm_s = float("nan")
    if parameters.way == 3: actuators.left_cm_s = 1 / (50 - memory.taken)""",
    PARAMETERS="{'way': 0}",
    MEMORY="{'taken': int}",
).replace("    pass", "    if parameters.way == 2: raise ValueError('not today')", 1)


@pytest.fixture
def controller(tmp_path):
    """Return a function that writes a controller's file."""

    def write(source):
        path = tmp_path / "controller.py"
        path.write_text(source)
        return str(path)

    return write


POSES = [[60, 60, 0.1], [71, 60, 2.0], [64, 71, 4.0], [90, 70, 3.0], [120, 60, 3.3], [30, 90, 5.5], [45, 40, 1.0]]
SEEN = ("poses", "infrared", "distance_mm", "camera", "wheels_cm_s", "ring_on", "phase_ms")


def test_the_order_of_robots_and_of_groups_does_not_matter_to_what_happens(controller):
    react, order = controller(REACT), np.random.default_rng(1).permutation(len(POSES))

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


def test_groups_with_different_cameras_and_controllers_work_side_by_side(controller):
    wide = {"poses": [[50, 30, math.pi]], "controller": "constant", "camera": {"pixels": 100, "field_of_view_deg": 112}}
    still = {"speed_cm_s": 0, "period_s": 2}
    few = {"poses": [[30, 50, -math.pi / 2]], "parameters": still, "camera": {"pixels": 20}}
    blind = {"poses": [[10, 30, 0]], "controller": controller(REACT), "camera": {"pixels": 30, "range_cm": 5}}
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


@MODES
@pytest.mark.parametrize(
    ("way", "robot", "step", "message"),
    [
        (0, 3, 3, "ValueError: too near"),
        (1, 3, 3, "wheel speed or a turn that is not a number"),
        (2, 2, 0, "ValueError: not today"),
        (3, 2, 49, "(ZeroDivisionError|FloatingPointError)"),
    ],
)
def test_a_controller_that_fails_is_blamed_with_robot_step_and_seed(controller, way, robot, step, message, interpret):
    """Robot 3, in the second group, stands before a wall."""
    places = [[20, 50, 0], [56, 30, 0], [20, 10, 0]]
    failing = {"poses": places, "controller": controller(FAIL), "parameters": {"way": way}}
    robots = [{"poses": [[10, 30, 0], [20, 30, 0]], "controller": "constant"}, failing]

    def run():
        Simulation({"name": "failing", "robots": robots, "noise": "off"}, 5, interpret=interpret).advance(100)

    with pytest.raises(ControllerError, match=rf"failing: robot {robot}, step {step}, seed 5: .*{message}"):
        run()


def test_steps_are_numbered_from_0_and_their_times_are_exact():
    simulation = Simulation(load_scenario("arc", ["timing.control_hz=40", "timing.physics_hz=200"]))
    assert simulation.step_s == 1 / 40
    assert [(step.number, step.time_s) for step in islice(simulation, 50)] == [(n, n / 40) for n in range(50)]


@pytest.mark.parametrize("scenario", CHANGING)
def test_interpreted_steps_taken_at_once_are_the_compiled_ones_taken_one_by_one(scenario):
    expected = [bits(step) for step in islice(Simulation(CHANGING[scenario], 3), 84)]
    simulation = Simulation(CHANGING[scenario], 3, interpret=True)
    for count in (1, 2, 15, 16, 17, 33):
        step = simulation.advance(count)
        assert bits(step) == expected[simulation.steps - 1]
    assert step.number == 83


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
    watcher = {**WATCHER, "parameters": {"speed_cm_s": 0, "flash_pixels": 61}}
    step = Simulation({"robots": [watcher, LAMP], "noise": "off"}, 1).advance(2)
    assert step.camera[0].any()
    assert not step.flash_seen[0]


def test_noise_is_what_numpy_draws_with_the_seed_anew_for_each_sensor_wheel_robot_and_step():
    simulation = Simulation("thesis", 3)
    swarm = swarm_of(simulation)
    parts = (Part.INFRARED_NOISE, Part.WHEEL_NOISE)
    sensors, wheels = (np.random.Generator(np.random.SFC64(spawned(3, part))) for part in parts)
    for _ in islice(simulation, 50):
        np.testing.assert_allclose(swarm.robots.infrared_noise, sensors.standard_normal((10, 8)), rtol=1e-15)
        np.testing.assert_array_equal(swarm.robots.wheel_noise, wheels.random((10, 2)))
    assert (swarm.groups[0].infrared.noise_counts, swarm.scene[0].slip) == (10, 0.05)


def test_no_step_makes_numba_look_for_types_anew(monkeypatch):
    """Its slow way, which arrays of unaligned records take, costs ten times a step."""
    simulations = [Simulation(arena, 1) for arena in ("thesis", "arc", "spotlight", "physical")]
    for simulation in simulations:
        next(simulation)

    def refuse(*_):
        raise AssertionError("the types of a kernel's arguments are not known at once")

    monkeypatch.setattr(Dispatcher, "_compile_for_args", refuse)
    for simulation in simulations:
        next(simulation)
