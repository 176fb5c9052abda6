"""Measures of a trial: what they are told, one by one or many at once, that they change nothing, how they fail."""

import numpy as np
import pytest

from epuck_sim import MeasureError, load_scenario
from epuck_sim.embodied.history import MOST_STEPS
from epuck_sim.measures.loader import SHIPPED, find_measure
from epuck_sim.trial.measuring import as_value
from epuck_sim.trial.model import run_trial, simulate
from tests.measures.files import COUNTER, TELLTALE, write

SHORT = ["stop.max_cycles=6"]
MODELS = ["thesis", "particles"]

CYCLES = """
class Cycles:
    def __init__(self, simulation):
        self.seen = []

    def cycle(self, event, state):
        self.seen += [event.time_s, state.time_s, state.cycles, state.order_parameter]

    def value(self):
        return self.seen
"""


def measured(scenario, measures, seed=3, observers=(), settings=SHORT):
    loaded = load_scenario(scenario, settings, measures=measures)
    return run_trial(simulate(loaded, seed), observers)


def onlooking(*_) -> None:
    """Observe a trial, of which every event is then seen."""


def without_measures(result):
    return result._replace(measures={}, wall_s=0.0)


@pytest.mark.parametrize("scenario", MODELS)
def test_cycles_are_the_same_whether_or_not_every_event_is_seen(scenario, tmp_path):
    cycles, steps = write(tmp_path / "cycles.py", CYCLES), write(tmp_path / "steps.py", TELLTALE)
    count = write(tmp_path / "count.py", COUNTER)
    plain, counted = measured(scenario, []), measured(scenario, [str(count)])
    assert (plain.measures, counted.measures) == ({}, {"Counter": float(plain.cycles)})
    assert without_measures(counted) == without_measures(plain)
    fast = measured(scenario, [str(cycles)])
    slow = measured(scenario, [str(cycles), str(steps)])
    watched = measured(scenario, [str(cycles)], observers=[onlooking])
    assert fast.measures["Cycles"] == slow.measures["Cycles"] == watched.measures["Cycles"]
    assert len(fast.measures["Cycles"]) == 4 * fast.cycles
    assert fast.measures["Cycles"][-1] == fast.order_parameter
    assert without_measures(slow) == without_measures(fast)


@pytest.mark.parametrize("scenario", MODELS)
def test_a_measure_is_told_of_every_event_as_observers_are(scenario, tmp_path):
    seen = []
    key = (lambda step: step.number) if scenario == "thesis" else (lambda event: len(event.fired))
    path = write(tmp_path / "mine.py", TELLTALE)
    result = measured(scenario, [str(path)], observers=[lambda event, _: seen.append(key(event))])
    assert result.measures["Telltale"] == seen
    assert len(seen) > result.cycles


@pytest.mark.parametrize("hz", [10, 25, 40])
def test_cycles_of_robots_without_oscillators_last_five_seconds(hz, tmp_path):
    path = write(tmp_path / "mine.py", CYCLES)
    settings = [*SHORT, "robots.0={controller: obstacle_avoidance}", f"timing.control_hz={hz}", "timing.physics_hz=200"]
    fast = measured("thesis", [str(path)], settings=settings).measures["Cycles"]
    assert fast[::4] == pytest.approx([5 * cycle - 1 / hz for cycle in range(1, 7)])
    assert fast[2::4] == list(range(1, 7))
    assert fast[3::4] == [None] * 6
    slow = measured("thesis", [str(path)], settings=settings, observers=[onlooking])
    assert slow.measures["Cycles"] == fast


@pytest.mark.parametrize("scenario", MODELS)
def test_a_function_is_called_with_the_simulation_at_the_end(scenario, tmp_path):
    path = write(tmp_path / "mine.py", "def product(simulation, *, factor=2): return factor * simulation.seed")
    assert measured(scenario, [str(path)], seed=21).measures == {"product": 42}


RAISING = """
class Mine:
    def __init__(self, simulation, *, at="never"):
        self.at = at
        self.told("__init__")

    def told(self, method):
        if method == self.at:
            raise RuntimeError("not today")

    def step(self, step, state):
        self.told("step")

    def event(self, event, state):
        self.told("event")

    def cycle(self, event, state):
        self.told("cycle")

    def value(self):
        self.told("value")
        return 1
"""


@pytest.mark.parametrize("scenario", MODELS)
@pytest.mark.parametrize("at", ["__init__", "every event", "cycle", "value"])
def test_a_measure_that_raises_fails_the_trial_with_file_and_line(scenario, at, tmp_path):
    path = write(tmp_path / "mine.py", RAISING)
    method = {"thesis": "step", "particles": "event"}[scenario] if at == "every event" else at
    with pytest.raises(MeasureError) as caught:
        measured(scenario, [f"{path}: {{at: {method}}}"])
    assert str(caught.value) == f"{scenario}: measure Mine, seed 3: {path}:9: RuntimeError: not today"


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("much", "is 'much', a str; allowed: a number, true or false, None, or a list of them"),
        ([[1]], r"is \[1\], a list; allowed: "),
        (float("inf"), "is inf; allowed: finite numbers, and None where it is undetermined"),
        (2**63, "allowed: numbers below"),
    ],
)
def test_a_value_of_another_kind_is_refused(given, said):
    with pytest.raises(ValueError, match=said):
        as_value(given)
    assert repr(as_value((np.bool_(True), np.float32(0.5), np.nan))) == "[True, 0.5, None]"
    assert repr(as_value(np.array([1.0, np.nan]))) == "[1.0, None]"


TOLD = [name for name in SHIPPED if hasattr(find_measure(name).make, "stretch")]

BASE = {
    "robots": [{"count": 6, "parameters": {"speed_cm_s": 8.0, "period_s": 2.0}}],
    "arena": {"width_cm": 35, "height_cm": 35},
    "stop": {"order_parameter": 1.0, "max_cycles": 12},
}

DEAD = {"kind": "ring_dead", "robots": [1], "at_s": 3.05}
MOVABLE = {"x_cm": 17, "y_cm": 17, "radius_cm": 2, "mass_kg": 0.1, "friction": 0.5}

CASES = {
    "plain": {},
    "faults": {"faults": [DEAD, {"kind": "oscillator_frozen", "robots": [2], "at_s": 5, "until_s": 9}]},
    "movables": {"arena": {**BASE["arena"], "movables": [MOVABLE]}},
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
