"""The oscillator does what thesis section 4.1.2 says: branch by branch, then beside a literal Algorithm 1 and 2."""

from math import floor
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.control.loader import find_controller
from epuck_sim.testing import TestRobot
from epuck_sim.util.seeds import robot_streams
from tests.control.bench import Bench, exactly, function, sensors, settings

ONE_STREAM = robot_streams(np.random.SeedSequence(1), 1)[0]


def stepped(phase_ms, flash=False, ring_on=False, step_ms=100, seen=0, red=1, pixels=60, new=True, **parameters):
    """Return phase and ring after one step from `phase_ms`."""
    robot = TestRobot("oscillator", parameters, pixels=pixels, step_ms=step_ms)
    robot.memory.phase_ms, robot.memory.flash_seen = phase_ms, seen
    robot.ring_on, robot.new_picture = ring_on, new
    robot.camera[: red if flash else 0] = 1
    robot.step()
    return robot.memory.phase_ms, robot.ring_on


# --- Algorithm 1, line by line --------------------------------------------------------------------


@pytest.mark.parametrize("step_ms", [1, 25, 100])
def test_the_phase_advances_by_the_control_step(step_ms):
    assert stepped(1000, step_ms=step_ms) == (1000 + step_ms, False)


@pytest.mark.parametrize(
    ("before", "after"), [(4899, (4999, False)), (4900, (0, True)), (4901, (0, True)), (4999, (0, True))]
)
def test_at_tau_the_phase_becomes_0_and_the_ring_goes_on(before, after):
    assert stepped(before) == after


@pytest.mark.parametrize(("before", "lit"), [(0, True), (274, True), (275, True), (276, False), (3000, False)])
def test_the_ring_goes_off_past_phi_led_and_not_at_it(before, lit):
    assert stepped(before, ring_on=True) == (before + 100, lit)


def test_a_phase_within_the_flash_alone_does_not_light_the_ring():
    assert stepped(100, ring_on=False) == (200, False)


@pytest.mark.parametrize(("before", "after"), [(400, 500), (649, 749), (650, 750), (651, 826), (652, 827)])
def test_no_update_up_to_and_at_phi_ref_and_update_past_it(before, after):
    assert stepped(before, flash=True)[0] == after


def test_without_a_flash_there_is_no_update():
    assert stepped(3000, flash=False)[0] == 3100


@pytest.mark.parametrize("coupling", [0.1, 0.05, 0.3, 0.7, 0.123456, 1.0, 9.99])
def test_an_update_is_truncated_to_whole_milliseconds_with_epsilon_as_written(coupling):
    updated, parameters = function("updated", "oscillator"), settings("oscillator", coupling=coupling)
    phases = [phase for phase in range(751, 5000) if (1 + exactly(coupling)) * phase <= 5000]
    assert [updated(phase, parameters) for phase in phases] == [
        (floor((1 + exactly(coupling)) * phase), False) for phase in phases
    ]


def test_eps_of_a_tenth_means_eleven_tenths_without_rounding_up_or_down():
    updated, parameters = function("updated", "oscillator"), settings("oscillator")
    assert all(updated(phase, parameters)[0] == phase * 11 // 10 for phase in range(751, 4546))


@pytest.mark.parametrize(("before", "after"), [(4445, (4999, False)), (4446, (0, True)), (4800, (0, True))])
def test_an_update_that_reaches_beyond_tau_fires(before, after):
    assert stepped(before, flash=True) == after


def test_an_update_that_reaches_tau_exactly_fires():
    assert stepped(3900, flash=True, coupling=0.25) == (0, True)


@pytest.mark.parametrize("before", [4900, 4950, 4999])
def test_a_cycle_that_is_complete_fires_though_a_flash_is_in_view(before):
    assert stepped(before, flash=True) == (0, True)


# --- what counts as a flash -----------------------------------------------------------------------


@pytest.mark.parametrize(("red", "needed", "acts"), [(1, 1, True), (1, 2, False), (2, 2, True), (60, 61, False)])
def test_so_many_red_pixels_are_a_flash(red, needed, acts):
    assert stepped(1000, flash=True, red=red, flash_pixels=needed)[0] == (1210 if acts else 1100)


@pytest.mark.parametrize("red", [255, 256, 512, 1000])
def test_a_camera_full_of_red_is_a_flash_however_wide_it_is(red):
    assert stepped(1000, flash=True, red=red, pixels=1000)[0] == 1210


def phases_over(flashes, new_pictures=None, **parameters):
    """Return the phase after each step from 1000 ms, with flashes in view as listed."""
    robot = TestRobot("oscillator", parameters)
    robot.memory.phase_ms = 1000
    phases = []
    for flash, new in zip(flashes, new_pictures or [1] * len(flashes), strict=True):
        robot.camera, robot.new_picture = flash, new
        robot.step()
        phases.append(robot.memory.phase_ms)
    return phases


def test_every_step_in_view_updates():
    assert phases_over([1, 1, 1, 0]) == [1210, 1441, 1695, 1795]


def test_once_per_sighting_only_the_first_step_in_view_updates_and_a_new_sighting_does_again():
    assert phases_over([1, 1, 0, 1, 1], once_per_sighting=True) == [1210, 1310, 1410, 1661, 1761]


def test_once_per_sighting_a_sighting_that_begins_in_the_refractory_period_is_used_up():
    assert phases_over([1, 1, 1], once_per_sighting=True, refractory_fraction=0.23) == [1100, 1200, 1300]


# --- pictures that are not new --------------------------------------------------------------------


@given(phase=st.integers(0, 4999), ring=st.booleans())
def test_a_picture_that_is_not_new_acts_like_a_dark_one(phase, ring):
    assert stepped(phase, flash=True, ring_on=ring, new=False) == stepped(phase, flash=False, ring_on=ring)


def test_a_picture_acts_once_however_many_steps_it_is_there():
    assert phases_over([1, 1, 1, 1, 0], [1, 0, 0, 1, 1]) == [1210, 1310, 1410, 1661, 1761]


def test_once_per_sighting_only_the_first_picture_in_view_updates_and_a_new_sighting_does_again():
    flashes, new = [1, 1, 1, 0, 0, 1, 1], [1, 0, 1, 1, 0, 1, 0]
    assert phases_over(flashes, new, once_per_sighting=True) == [1210, 1310, 1410, 1510, 1610, 1881, 1981]


def test_what_was_taken_for_a_flash_is_what_the_last_picture_shows():
    robot = TestRobot("oscillator", step_ms=25)
    robot.memory.phase_ms = 100
    seen = []
    for red, robot.new_picture in ((1, True), (1, False), (0, True), (0, False)):
        robot.camera = red
        robot.step()
        seen.append(robot.memory.flash_seen)
    assert seen == [1, 1, 0, 0]


# --- Algorithm 2 ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("before", "after"), [(1000, (1038 * 11 // 10 + 62, False)), (2345, (2683, False))])
def test_with_a_delay_the_update_acts_on_the_phase_at_the_flash(before, after):
    assert stepped(before, flash=True, delay_ms=62) == after


@pytest.mark.parametrize(("before", "after"), [(651, 751), (712, 812), (713, 813 + 75)])
def test_with_a_delay_the_phase_at_the_flash_must_be_past_phi_ref_too(before, after):
    assert stepped(before, flash=True, delay_ms=62)[0] == after


def test_with_a_delay_a_cycle_that_began_at_the_flash_is_delta_old_and_the_ring_is_on():
    assert stepped(4600, flash=True, delay_ms=62) == (62, True)


def test_with_a_delay_a_phase_of_tau_at_the_flash_fires_only_once_delta_is_added():
    assert function("updated", "oscillator")(4062, settings("oscillator", coupling=0.25, delay_ms=62)) == (5062, False)
    assert stepped(3962, flash=True, coupling=0.25, delay_ms=62) == (0, True)


@pytest.mark.parametrize("before", [4950, 4961, 4962, 4999])
def test_with_a_delay_a_cycle_that_completed_before_or_after_the_flash_fires(before):
    assert stepped(before, flash=True, delay_ms=62) == (62, True)


@given(phase=st.integers(0, 4999), coupling=st.integers(1, 10_000))
def test_no_delay_makes_algorithm_2_algorithm_1(phase, coupling):
    world = World(coupling=coupling / 1000)
    assert algorithm_1(phase, False, True, world, phase_update_2) == algorithm_1(phase, False, True, world)
    assert stepped(phase, flash=True, coupling=coupling / 1000) == algorithm_1(phase, False, True, world)


# --- beside the thesis's own text -----------------------------------------------------------------


class World:
    """The thesis's symbols, as exact numbers."""

    def __init__(self, step_ms=100, period_s=5.0, coupling=0.1, flash=0.075, refractory=0.15, delay_ms=0):
        self.dt, self.delta, self.epsilon = step_ms, delay_ms, exactly(coupling)
        self.tau = exactly(period_s) * 1000
        self.phi_led, self.phi_ref = exactly(flash) * self.tau, exactly(refractory) * self.tau

    def parameters(self, **others):
        given_ = {"period_s": float(self.tau / 1000), "coupling": float(self.epsilon), "delay_ms": self.delta}
        given_ |= {"flash_fraction": float(self.phi_led / self.tau)}
        return given_ | {"refractory_fraction": float(self.phi_ref / self.tau)} | others


def phase_update_1(phi, ring, world):
    """Algorithm 1, line 5."""
    return floor((1 + world.epsilon) * phi), ring


def phase_update_2(phi, ring, world):
    """Algorithm 2; in line 7 a new cycle begins at phase 0.

    Line 2's modulo must not swallow a cycle that is complete: with no delay that would not be Algorithm 1.
    """
    phi = phi - world.delta
    if phi < world.tau:
        phi = phi % world.tau
    if phi > world.phi_ref:
        phi = floor((1 + world.epsilon) * phi)
    if phi > world.tau:
        phi = 0
        ring = True
    phi = phi + world.delta
    return phi, ring


def algorithm_1(phi, ring, was_flash_detected, world, phase_update=phase_update_1):
    """Algorithm 1."""
    phi = phi + world.dt
    if phi > world.phi_ref and was_flash_detected:
        phi, ring = phase_update(phi, ring, world)
    if phi >= world.tau:
        phi = 0
        ring = True
    if phi > world.phi_led:
        ring = False
    return phi, ring


def literal(world):
    """Return the thesis's step: Algorithm 2's update where there is a delay, else Algorithm 1's."""
    return lambda *state: algorithm_1(*state, world, phase_update_2 if world.delta else phase_update_1)


@st.composite
def worlds(draw):
    period_ms = draw(st.integers(100, 20_000))
    refractory = draw(st.integers(0, 999))
    flash = draw(st.integers(0, refractory))
    delay = draw(st.just(0) | st.integers(0, flash * period_ms // 1000))
    return World(
        step_ms=draw(st.sampled_from([1, 10, 25, 100])),
        period_s=period_ms / 1000,
        coupling=draw(st.integers(1, 999_999)) / 10 ** draw(st.integers(5, 6)),
        flash=flash / 1000,
        refractory=refractory / 1000,
        delay_ms=delay,
    )


@given(world=worlds(), chance=st.randoms(use_true_random=False))
def test_each_step_is_the_thesis_s_own(world, chance):
    """A hundred worlds, a hundred states in each, and the states around each of its limits."""
    step, parameters = find_controller("oscillator").step, settings("oscillator", **world.parameters())
    limits = [0, world.phi_led, world.phi_ref, world.phi_ref + world.delta, world.tau / (1 + world.epsilon), world.tau]
    near = [floor(limit) - world.dt + offset for limit in limits for offset in (-1, 0, 1)]
    phases = [chance.randrange(int(world.tau)) for _ in range(100)]
    phases += [phase for phase in near if 0 <= phase < world.tau]
    for phase in phases:
        flash, ring = chance.random() < 0.7, chance.random() < 0.5
        memory = SimpleNamespace(phase_ms=phase, flash_seen=0)
        actuators = SimpleNamespace(ring_on=ring)
        step(sensors(world.dt, red=int(flash)), memory, actuators, parameters, ONE_STREAM)
        assert (memory.phase_ms, actuators.ring_on) == literal(world)(phase, ring, flash), f"from {phase}, {flash}"


WORLDS = {
    "thesis": World(),
    "robots": World(step_ms=25, delay_ms=62),
    "delay below a step": World(delay_ms=62),
    "strong": World(coupling=0.75, refractory=0.075),
    "weak": World(step_ms=25, period_s=1.2, coupling=0.013, flash=0.0, refractory=0.0),
}


@pytest.mark.parametrize("interpret", [True, False], ids=["interpreted", "compiled"])
@pytest.mark.parametrize("name", WORLDS)
def test_long_sequences_are_the_thesis_s_own(name, interpret):
    """A swarm under flashes of random length, step by step beside the literal algorithms."""
    world, robots, steps = WORLDS[name], 20, 250 if interpret else 2500
    bench = Bench("oscillator", world.parameters(), robots=robots, step_ms=world.dt, interpret=interpret)
    expected = [(int(phase), False) for phase in bench.memory["phase_ms"]]
    thesis_step = literal(world)
    chance = np.random.default_rng(5)
    flash = np.zeros(robots, bool)
    for number in range(steps):
        flash ^= chance.random(robots) < np.where(flash, 0.25, 0.03)
        bench.senses.camera[:, 7] = flash
        bench.control.step()
        expected = [thesis_step(*state, seen) for state, seen in zip(expected, flash, strict=True)]
        found = list(zip(bench.memory["phase_ms"].tolist(), bench.actuators["ring_on"].tolist(), strict=True))
        assert found == expected, f"step {number}"


def test_seconds_as_written_become_whole_milliseconds():
    """Of 1.001 s, say, binary fractions alone would make 1000 ms."""
    assert [function("whole_ms", "oscillator")(ms / 1000) for ms in range(20_000)] == list(range(20_000))
    assert function("whole_ms", "oscillator")(0.7505) == 750


# --- start and check ------------------------------------------------------------------------------


def test_phases_begin_uniform_over_all_whole_milliseconds_below_tau():
    phases = Bench("oscillator", {"period_s": 0.02}, robots=20_000, interpret=False).memory["phase_ms"]
    counts = np.bincount(phases, minlength=20)
    assert len(counts) == 20
    assert ((counts - 1000) ** 2 / 1000).sum() < 43.8  # chi-square, 19 degrees of freedom, 0.1 %


LONGEST_DELAY = {"period_s": 1.0, "flash_fraction": 0.125}


@pytest.mark.parametrize(
    ("name", "inside", "outside", "others"),
    [
        ("period_s", 0.001, np.nextafter(0.001, 0), {}),
        ("period_s", 86_400.0, np.nextafter(86_400, 1e6), {}),
        ("coupling", 1e-6, 0.0, {}),
        ("coupling", 10.0, np.nextafter(10, 11), {}),
        ("refractory_fraction", np.nextafter(1, 0), 1.0, {}),
        ("refractory_fraction", 0.0, -1e-300, {"flash_fraction": 0.0}),
        ("flash_fraction", 0.0, -1e-300, {}),
        ("flash_fraction", 0.15, np.nextafter(0.15, 1), {}),
        ("delay_ms", 0, -1, {}),
        ("delay_ms", 125, 126, LONGEST_DELAY),
        ("flash_pixels", 1, 0, {}),
    ],
)
def test_check_allows_up_to_each_limit_and_names_what_lies_beyond(name, inside, outside, others):
    settings("oscillator", **others, **{name: inside})
    with pytest.raises(ValueError, match=rf"^{name} is {outside}; allowed: .*\d"):
        settings("oscillator", **others, **{name: outside})


@given(millionths=st.integers(1, 10_000_000), phase=st.integers(1, 7_854_545))
def test_every_coupling_of_whole_millionths_is_taken_as_written(millionths, phase):
    day = settings(
        "oscillator", coupling=millionths / 1e6, period_s=86_400.0, flash_fraction=0.0, refractory_fraction=0.0
    )
    assert function("updated", "oscillator")(phase, day) == (phase + phase * millionths // 1_000_000, False)
