"""What shipped controllers allow: parameters up to their limits, and none beyond; `constant` is constant."""

import hypothesis
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.control.bench import Bench, settings

LIMIT_CM_S, BEYOND_CM_S = 12.8, np.nextafter(12.8, 13)
SPEEDS_CM_S, TOO_FAST_CM_S = (-LIMIT_CM_S, LIMIT_CM_S), (-BEYOND_CM_S, BEYOND_CM_S)

LIMITS = [
    ("obstacle_avoidance", "speed_cm_s", (0.0, LIMIT_CM_S), (-5e-324, BEYOND_CM_S), {}),
    ("obstacle_avoidance", "rotation_speed_cm_s", (0.0, LIMIT_CM_S), (-5e-324, BEYOND_CM_S), {}),
    ("obstacle_avoidance", "proximity_threshold", (0, 99), (-1, 100), {}),
    ("obstacle_avoidance", "proximity_count_threshold", (0,), (-1,), {}),
    ("obstacle_avoidance", "rotation_max", (1, 1_000_000), (0, 1_000_001), {}),
    ("oscillator", "period_s", (0.001, 86_400.0), (np.nextafter(0.001, 0), np.nextafter(86_400, 1e6)), {}),
    ("oscillator", "coupling", (0.0, 1e-6, 10.0), (-1e-6, 1e-7, np.nextafter(10, 11)), {}),
    ("oscillator", "refractory_fraction", (np.nextafter(1, 0), 0.0), (1.0, -1e-300), {"flash_fraction": 0.0}),
    ("oscillator", "flash_fraction", (0.0, 0.15), (-1e-300, np.nextafter(0.15, 1)), {}),
    ("oscillator", "delay_ms", (0, 125), (-1, 126), {"period_s": 1.0, "flash_fraction": 0.125}),
    ("oscillator", "flash_pixels", (1,), (0,), {}),
    ("firefly", "speed_cm_s", (LIMIT_CM_S,), (13.0,), {}),
    ("firefly", "coupling", (10.0,), (-0.1,), {}),
    ("firefly", "delay_ms", (375,), (376,), {}),
    ("constant", "left_cm_s", SPEEDS_CM_S, TOO_FAST_CM_S, {}),
    ("constant", "right_cm_s", SPEEDS_CM_S, TOO_FAST_CM_S, {}),
    ("random_walk", "run_s", (0.1,), (0.05,), {}),
    ("random_walk", "persistence", (1.0,), (1.1,), {}),
    ("random_walk", "exponent", (2.0, 3.0), (1.0, 3.5), {}),
    ("random_walk", "rotation_speed_cm_s", (12.8,), (0,), {}),
    ("pushing", "speed_cm_s", (LIMIT_CM_S,), (13.0,), {}),
    ("switching", "slow_cm_s", (LIMIT_CM_S,), (12.9,), {}),
    ("switching", "flashes_to_settle", (1,), (0,), {}),
    ("switching", "coupling", (10.0,), (-0.1,), {}),
    ("varied_firefly", "speed_spread", (0.0, 10.0), (-0.1, 11.0), {}),
    ("varied_firefly", "new_speed_s", (0.0,), (-1.0,), {}),
]
"""Controller, parameter, its values at limits and beyond, and other parameters."""


def test_up_to_its_limits_a_parameter_is_allowed_and_what_lies_beyond_is_named():
    for controller, name, inside, outside, others in LIMITS:
        for value in inside:
            settings(controller, **others, **{name: value})
        for value in outside:
            with pytest.raises(ValueError, match=rf"^{name} is {value}; allowed: ."):
                settings(controller, **others, **{name: value})


SPEEDS = st.floats(-12.8, 12.8)


@hypothesis.settings(max_examples=20)
@given(left=SPEEDS, right=SPEEDS, ring=st.booleans(), seed=st.integers(0, 2**32))
def test_constant_commands_the_same_whatever_it_senses(left, right, ring, seed):
    bench = Bench("constant", {"left_cm_s": left, "right_cm_s": right, "ring_on": ring}, robots=3)
    bench.actuators["ring_on"] = not ring
    for _ in range(3):
        bench.sense(np.random.default_rng(seed))
        bench.control.step()
        assert bench.actuators.tolist() == [(left, right, ring, 0, 0)] * 3
