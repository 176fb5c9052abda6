"""`firefly` is `obstacle_avoidance` and `oscillator` at once, neither knowing of the other; `constant` is constant."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.bench import Bench, settings

WHEELS = ["left_cm_s", "right_cm_s"]


@pytest.mark.parametrize("interpret", [True, False], ids=["interpreted", "compiled"])
def test_a_firefly_moves_as_one_part_and_flashes_as_the_other(interpret):
    chance = np.random.default_rng(4)
    firefly, avoidance, oscillator = (
        Bench(name, robots=20, interpret=interpret) for name in ("firefly", "obstacle_avoidance", "oscillator")
    )
    assert (firefly.memory["phase_ms"] == oscillator.memory["phase_ms"]).all()
    avoidance.streams[:] = firefly.streams  # after the phases were drawn
    for _ in range(100 if interpret else 1000):
        firefly.sense(chance)
        for part in (avoidance, oscillator):
            part.sense_like(firefly)
            part.control.step()
        firefly.control.step()
        assert (firefly.actuators[WHEELS] == avoidance.actuators[WHEELS]).all()
        assert (firefly.actuators["ring_on"] == oscillator.actuators["ring_on"]).all()
        assert (firefly.memory["phase_ms"] == oscillator.memory["phase_ms"]).all()
    assert (firefly.streams == avoidance.streams).all()


def run(name, steps=60, *, blind=False, free=False, seed=2):
    """Return wheels and rings over random steps; blind: the camera sees nothing, free: nothing is ever near."""
    chance = np.random.default_rng(seed)
    bench = Bench(name, robots=5)
    wheels, rings = [], []
    for _ in range(steps):
        bench.sense(chance)
        if blind:
            bench.senses.camera[:] = 0
        if free:
            bench.senses.distance_mm[:] = 65535
        bench.control.step()
        wheels.append(bench.actuators[WHEELS].tolist())
        rings.append(bench.actuators["ring_on"].tolist())
    return wheels, rings


def test_what_the_camera_sees_does_not_move_a_firefly_but_makes_it_flash():
    (wheels, rings), (blind_wheels, blind_rings) = run("firefly"), run("firefly", blind=True)
    assert wheels == blind_wheels
    assert rings != blind_rings


def test_what_is_near_does_not_make_a_firefly_flash_but_moves_it():
    (wheels, rings), (free_wheels, free_rings) = run("firefly"), run("firefly", free=True)
    assert rings == free_rings
    assert wheels != free_wheels


@pytest.mark.parametrize(("name", "value"), [("speed_cm_s", 13.0), ("coupling", 0.0), ("delay_ms", 376)])
def test_a_firefly_checks_both_parts(name, value):
    with pytest.raises(ValueError, match=rf"^{name} is {value}; allowed: "):
        settings("firefly", **{name: value})


def test_a_firefly_has_the_parameters_of_both_parts_with_their_defaults():
    both = vars(settings("obstacle_avoidance")) | vars(settings("oscillator"))
    assert vars(settings("firefly")) == both


SPEEDS = st.floats(-12.8, 12.8)


@given(left=SPEEDS, right=SPEEDS, ring=st.booleans(), seed=st.integers(0, 2**32))
def test_constant_commands_the_same_whatever_it_senses(left, right, ring, seed):
    bench = Bench("constant", {"left_cm_s": left, "right_cm_s": right, "ring_on": ring}, robots=3)
    bench.actuators["ring_on"] = not ring
    for _ in range(3):
        bench.sense(np.random.default_rng(seed))
        bench.control.step()
        assert bench.actuators.tolist() == [(left, right, ring, 0, 0)] * 3


@pytest.mark.parametrize("name", WHEELS)
@pytest.mark.parametrize("sign", [-1, 1])
def test_constant_checks_the_wheels_limit(name, sign):
    settings("constant", **{name: sign * 12.8})
    with pytest.raises(ValueError, match=rf"^{name} is {sign * 12.800000000000002}; allowed: -12.8 to 12.8"):
        settings("constant", **{name: sign * np.nextafter(12.8, 13)})
