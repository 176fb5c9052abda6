"""Claims about stretches: measures find in many steps at once what they find in these one by one."""

import numpy as np
import pytest

from epuck_sim.embodied.history import MOST_STEPS
from epuck_sim.measures.loader import SHIPPED, find_measure
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial, simulate

TOLD = [name for name in SHIPPED if hasattr(find_measure(name).make, "stretch")]

BASE = {
    "robots": [{"count": 6, "parameters": {"speed_cm_s": 8.0, "period_s": 2.0}}],
    "arena": {"width_cm": 35, "height_cm": 35},
    "stop": {"order_parameter": 1.0, "max_cycles": 12},
}

CASES = {
    "plain": {},
    "faults": {
        "faults": [
            {"kind": "ring_dead", "robots": [1], "at_s": 3.05},
            {"kind": "oscillator_frozen", "robots": [2], "at_s": 5, "until_s": 9},
        ]
    },
    "movables": {
        "arena": {
            **BASE["arena"],
            "movables": [{"x_cm": 17, "y_cm": 17, "radius_cm": 2, "mass_kg": 0.1, "friction": 0.5}],
        }
    },
    "schedule": {"schedule": [{"at_s": 4.3, "set": {"arena.width_cm": 60}}]},
    "groups": {"robots": [*BASE["robots"], {"count": 2, "signal": {"kind": "cone"}}]},
    "no oscillators": {"robots": [{"count": 6, "controller": "obstacle_avoidance"}], "stop": {"max_time_s": 30}},
}


def values(case: str, observers=(), *, interpret: bool = False) -> dict:
    """Return the values of all measures that are told of stretches, in a trial of a case."""
    sections = {**BASE, **CASES[case], "measures": TOLD}
    return run_trial(simulate(load_scenario(sections), 3, interpret=interpret), observers)


@pytest.mark.parametrize("case", CASES)
def test_they_find_what_they_find_step_by_step(case: str) -> None:
    at_once, one_by_one = values(case), values(case, [lambda *_: None])
    assert at_once.steps == one_by_one.steps > 2 * MOST_STEPS
    for name, value in at_once.measures.items():
        found, expected = np.array(value, float), np.array(one_by_one.measures[name], float)
        np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12, err_msg=name)
    assert at_once._replace(measures={}, wall_s=0) == one_by_one._replace(measures={}, wall_s=0)


def test_interpreted_controllers_make_the_same_stretches() -> None:
    compiled, interpreted = values("faults"), values("faults", interpret=True)
    assert compiled.measures == interpreted.measures
