"""Claims about trials: what comes out, when they end, and that looking on changes nothing."""

import contextlib

import numpy as np
import pytest

from epuck_sim import ControllerError, Simulation, Step, load_scenario, run_trial
from epuck_sim.trial.embodied import SynchronyWatch
from tests.trial import without_wall


class Recorder:
    """An observer that keeps what it is shown."""

    def __init__(self):
        self.numbers, self.rings, self.phases, self.watched = [], [], [], []

    def __call__(self, step, watch):
        assert isinstance(step, Step)
        assert isinstance(watch, SynchronyWatch)
        self.numbers.append(step.number)
        self.rings.append(step.ring_on.copy())
        self.phases.append(step.phase_ms)
        self.watched.append((watch.cycles, watch.order_parameter))


def firings(rings, robot):
    """Return the steps in which a robot's ring lights up."""
    ring = np.array(rings)[:, robot].astype(int)
    return np.flatnonzero(np.diff(ring, prepend=0) == 1)


@pytest.mark.parametrize(("seed", "reference"), [(0, 0), (1, 7), (2, 0)])
def test_t_sync_is_the_number_of_the_references_firings_until_order_reaches_the_threshold(seed, reference):
    recorder = Recorder()
    scenario = load_scenario("thesis", [f"stop.reference_robot={reference}"])
    result = run_trial(Simulation(scenario, seed), [recorder])
    fired = firings(recorder.rings, reference)
    orders = np.abs(np.exp(2j * np.pi * np.array(recorder.phases)[fired] / 5000).mean(axis=1))
    assert not result.censored
    assert result.t_sync_cycles == result.cycles == len(fired) > 1
    assert fired[-1] == recorder.numbers[-1] == result.steps - 1
    assert (orders[:-1] < 0.95).all()
    assert result.order_parameter == pytest.approx(orders[-1])
    assert orders[-1] >= 0.95


@pytest.mark.parametrize("further", [1, 3])
def test_after_synchrony_a_trial_goes_on_for_the_further_cycles_and_the_outcome_stays(further):
    recorder = Recorder()
    usual = run_trial(Simulation("thesis", 2))
    longer = run_trial(Simulation(load_scenario("thesis", [f"stop.further_cycles={further}"]), 2), [recorder])
    assert longer.steps > usual.steps
    assert longer.simulated_s == pytest.approx(longer.steps * 0.1)
    same_length = {"steps": usual.steps, "simulated_s": usual.simulated_s}
    assert without_wall(longer._replace(**same_length)) == without_wall(usual)
    fired = firings(recorder.rings, 0)
    assert len(fired) == usual.cycles + further
    assert fired[-1] == longer.steps - 1
    assert recorder.watched[-1][0] == len(fired)  # the watch goes on counting


@pytest.mark.parametrize(("limit", "more"), [("max_cycles", 1), ("max_cycles", 0), ("max_time_s", 2.0)])
def test_further_cycles_end_at_the_limits_of_the_trial_which_is_not_censored(limit, more):
    usual = run_trial(Simulation("thesis", 2))
    most = (usual.cycles if limit == "max_cycles" else usual.simulated_s) + more
    settings = ["stop.further_cycles=5", f"stop.{limit}={most}"]
    result = run_trial(Simulation(load_scenario("thesis", settings), 2))
    assert (result.censored, result.t_sync_cycles, result.cycles) == (False, usual.cycles, usual.cycles)
    if limit == "max_time_s":
        assert result.simulated_s == pytest.approx(most)
    else:
        assert usual.steps + 30 * more <= result.steps <= usual.steps + 51 * more


def test_a_trial_without_oscillators_counts_a_cycle_every_5_s_and_has_no_t_sync():
    result = run_trial(Simulation(load_scenario("spotlight", ["stop.max_time_s=22", "stop.max_cycles=100"])))
    assert (result.cycles, result.steps, result.order_parameter) == (4, 220, None)
    assert (result.censored, result.t_sync_cycles) == (None, None)
    limited = run_trial(Simulation(load_scenario("spotlight", ["stop.max_time_s=22", "stop.max_cycles=3"])))
    assert (limited.cycles, limited.steps) == (3, 150)


def test_observers_are_shown_every_step_after_the_watch_has_looked():
    one, other = Recorder(), Recorder()
    result = run_trial(Simulation("thesis", 2), iter([one, other]))
    assert without_wall(result) == without_wall(run_trial(Simulation("thesis", 2)))
    assert one.numbers == other.numbers == list(range(result.steps))
    cycles = np.cumsum(np.isin(one.numbers, firings(one.rings, 0)))
    assert [count for count, _ in one.watched] == cycles.tolist()
    assert one.watched[-1] == (result.cycles, result.order_parameter)


def test_observers_that_write_into_a_steps_arrays_do_not_change_the_outcome():
    def meddle(step, _):
        fields = (step.poses, step.infrared, step.distance_mm, step.camera, step.wheels_cm_s, step.ring_on)
        for array in (*fields, step.memories[0]["phase_ms"]) if step.number % 5 == 0 else ():
            with contextlib.suppress(ValueError):  # refusing is right, too
                array[...] = 1

    scenario = load_scenario("thesis", ["robots.0.parameters.speed_cm_s=3", "stop.max_time_s=100"])
    plain, meddled = (without_wall(run_trial(Simulation(scenario, 2), observers)) for observers in ([], [meddle]))
    assert meddled == plain


NEVER_FIRES = """
PARAMETERS = {"period_s": 5.0}
MEMORY = {"phase_ms": float}
def start(memory, parameters, random):
    memory.phase_ms = PHASE
def step(sensors, memory, actuators, parameters, random):
    actuators.ring_on = LIT
"""


def of_its_own(tmp_path, phase, lit, **stop):
    """Return the trial of two robots with a phase that never changes."""
    path = tmp_path / "own.py"
    path.write_text(f"PHASE, LIT = {phase}, {lit}\n{NEVER_FIRES}")
    return run_trial(Simulation({"robots": [{"count": 2, "controller": str(path)}], "stop": stop}, interpret=True))


@pytest.mark.parametrize("max_cycles", [1, 3])
def test_a_reference_that_never_fires_does_not_keep_a_trial_for_ever(max_cycles, tmp_path):
    result = of_its_own(tmp_path, "1.0", False, max_cycles=max_cycles)
    assert (result.censored, result.cycles, result.steps) == (True, 0, 2 * max_cycles * 51)


def test_a_phase_that_is_no_number_is_an_error(tmp_path):
    with pytest.raises(ControllerError, match="step 0: an oscillator's phase is not a number"):
        of_its_own(tmp_path, "float('inf')", True)


def test_a_firing_counts_though_the_ring_is_lit_already():
    parameters = {"flash_fraction": 0.15, "coupling": 10, "speed_cm_s": 2}
    simulation = Simulation({"robots": [{"count": 10, "parameters": parameters}], "stop": {"order_parameter": 1}}, 1)
    watched, resets, before, edges, was_on = SynchronyWatch(simulation), 0, np.inf, 0, False
    for step, _ in zip(simulation, range(2000), strict=False):
        watched.look(step)
        resets += bool(step.phase_ms[0] < before)
        edges += bool(step.ring_on[0] and not was_on)
        before, was_on = step.phase_ms[0], step.ring_on[0]
    first = 1  # the phase at the start falls from nowhere
    assert watched.cycles == resets - first > edges
