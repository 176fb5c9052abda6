"""A buffer holds what the steps held, whatever its capacity, and counts flashes as the watch counts firings."""

from copy import copy
from functools import cache
from itertools import islice
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.order_parameter import METRICS
from epuck_sim.recording import Level
from epuck_sim.recording.rows import RobotBuffer, RowBatch
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.embodied import SynchronyWatch

STEPS = 300
COPIED = ("ring_on", "phase_ms", "poses", "camera", "distance_mm", "wheels_cm_s")

ALWAYS_LIT = ["period_s=0.5", "flash_fraction=0.9", "refractory_fraction=0.9"]
MIXED = {
    "robots": [
        {"count": 2, "controller": "constant", "parameters": {"ring_on": True, "left_cm_s": 3}},
        {"count": 3, "parameters": {"period_s": 2.0}, "camera": {"pixels": 20}},
        {"count": 1, "controller": "constant"},
        {"count": 4, "camera": {"pixels": 80}},
    ],
}
SCENARIOS = {
    "thesis": load_scenario("thesis"),
    "another reference and metric": load_scenario("thesis", ["stop.reference_robot=3", "stop.metric=reference"]),
    "always lit": load_scenario("thesis", [f"robots.0.parameters.{setting}" for setting in ALWAYS_LIT]),
    "faster steps": load_scenario("crowded", ["timing.control_hz=25"]),
    "mixed": load_scenario({**MIXED, "stop": {"reference_robot": 4}}),
    "mixed, the reference no oscillator": load_scenario(MIXED),
    "spotlight": load_scenario("spotlight"),
    "push": load_scenario("push"),
}
WITH_REFERENCE = ["thesis", "another reference and metric", "always lit", "faster steps", "mixed"]

scenarios = pytest.mark.parametrize("name", SCENARIOS)
sizes = pytest.mark.parametrize("size", [1, 7, 2 * STEPS])


class Shown(NamedTuple):
    """What a buffer was shown, copied by hand."""

    steps: dict[str, npt.NDArray[Any]]
    time_s: list[float]
    order_parameter: list[float]
    """As measured at each step."""
    firings: list[tuple[int, int, float]]
    """Steps in which the watch counted one, its cycles then, and the order parameter."""


@cache
def recorded(name: str, size: int, level: Level = Level.FULL) -> tuple[list[RowBatch], Shown]:
    """Return the batches of a simulation, and what the buffer was shown."""
    simulation = Simulation(SCENARIOS[name], seed=5)
    watch, buffer = SynchronyWatch(simulation), RobotBuffer(simulation.scenario, level, size)
    copies: dict[str, list[Any]] = {key: [] for key in COPIED}
    times, measured, firings, batches = [], [], [], []
    for step in islice(simulation, STEPS):
        cycles = watch.cycles
        watch.look(step)
        buffer.append(step, watch)
        for key in COPIED:
            copies[key].append(getattr(step, key).copy())
        times.append(step.time_s)
        measured.append(float(watch.measure(step.phase_ms)))
        if watch.cycles > cycles and watch.order_parameter is not None:
            firings.append((step.number, watch.cycles, watch.order_parameter))
        if buffer.is_full:
            batches.append(buffer.flush())
    if buffer.row_count:
        batches.append(buffer.flush())
    return batches, Shown({key: np.array(values) for key, values in copies.items()}, times, measured, firings)


def joined(batches: list[RowBatch]) -> RowBatch:
    """Return the batches as one, in which rows count from the first step of all."""
    starts = np.cumsum([0, *(len(batch.time_ns) for batch in batches)])[:-1]
    shifted = [
        batch._replace(flashes=batch.flashes + np.array([start, 0, 0]), firings=batch.firings + start)
        for batch, start in zip(batches, starts, strict=True)
    ]
    return RowBatch(*map(np.concatenate, zip(*shifted, strict=True)))


def slow_flashes(rings: BoolArray, phases: FloatArray) -> list[list[int]]:
    """Return step, robot, number of each time when a robot's ring lights up, or is lit already and its phase falls."""
    flashes = []
    for robot in range(rings.shape[1]):
        number, was_lit, phase_before = 0, False, np.nan
        for step in range(len(rings)):
            if rings[step, robot] and (not was_lit or phases[step, robot] < phase_before):
                number += 1
                flashes.append([step, robot, number])
            was_lit, phase_before = rings[step, robot], phases[step, robot]
    return sorted(flashes)


# --- columns ----------------------------------------------------------------------------------------


@scenarios
@sizes
def test_columns_are_those_of_the_steps_whatever_the_capacity(name: str, size: int) -> None:
    batches, shown = recorded(name, size)
    full, left = divmod(STEPS, size)
    assert [len(batch.time_ns) for batch in batches] == [size] * full + [left] * (left > 0)
    columns = joined(batches)
    for key in COPIED:
        np.testing.assert_array_equal(getattr(columns, key), shown.steps[key], err_msg=key)
    assert columns.time_ns.tolist() == [round(1e9 * time_s) for time_s in shown.time_s]
    np.testing.assert_array_equal(columns.order_parameter, shown.order_parameter)


@scenarios
@sizes
def test_ring_before_is_the_ring_of_the_step_before_and_dark_at_first(name: str, size: int) -> None:
    batches, shown = recorded(name, size)
    rings = shown.steps["ring_on"]
    np.testing.assert_array_equal(joined(batches).ring_before, [np.zeros(rings.shape[1], bool), *rings[:-1]])


@pytest.mark.parametrize("name", [name for name in SCENARIOS if name not in {"spotlight", "push"}])
def test_the_order_parameter_is_that_of_each_steps_oscillators(name: str) -> None:
    batches, shown = recorded(name, 7)
    periods = Simulation(SCENARIOS[name], seed=5).period_ms
    oscillators = np.isfinite(periods)
    metric = METRICS[SCENARIOS[name].stop.metric]
    expected = [metric(phases[oscillators], periods[oscillators]) for phases in shown.steps["phase_ms"]]
    assert joined(batches).order_parameter.tolist() == expected


@pytest.mark.parametrize("name", ["thesis", "mixed"])
def test_levels_leave_out_what_they_say_and_nothing_else(name: str) -> None:
    full = joined(recorded(name, 7)[0])
    left_out = {
        Level.SUMMARY: {"poses", "camera", "distance_mm", "wheels_cm_s"},
        Level.POSES: {"camera", "distance_mm", "wheels_cm_s"},
        Level.FULL: set(),
    }
    for level, absent in left_out.items():
        columns = joined(recorded(name, 7, level)[0])
        for key in set(RowBatch._fields) - {"arenas"}:  # which are as many objects as simulations
            expected = getattr(full, key)[:0] if key in absent else getattr(full, key)
            np.testing.assert_array_equal(getattr(columns, key), expected, err_msg=f"{level}: {key}")


def test_what_was_returned_is_not_written_to_again() -> None:
    simulation = Simulation("thesis", seed=2)
    watch, buffer = SynchronyWatch(simulation), RobotBuffer(simulation.scenario, Level.FULL, 60)
    returned = []
    for step in islice(simulation, 240):
        watch.look(step)
        buffer.append(step, watch)
        if buffer.is_full:
            columns = buffer.flush()
            returned.append((columns, [copy(column) for column in columns]))
    assert len(returned) == 4
    for columns, copies in returned:
        for key, column, kept in zip(RowBatch._fields, columns, copies, strict=True):
            np.testing.assert_array_equal(column, kept, err_msg=key)


def test_a_buffer_is_full_at_its_capacity_and_empty_after_a_flush() -> None:
    simulation = Simulation("pair")
    watch, buffer = SynchronyWatch(simulation), RobotBuffer(simulation.scenario, Level.FULL, 3)
    for _ in range(2):
        for taken in range(3):
            assert (buffer.row_count, buffer.is_full) == (taken, False)
            buffer.append(next(simulation), watch)
        assert (buffer.row_count, buffer.is_full) == (3, True)
        buffer.flush()


# --- flashes ----------------------------------------------------------------------------------------


@scenarios
@sizes
def test_flashes_are_those_of_a_slow_loop_over_robots(name: str, size: int) -> None:
    batches, shown = recorded(name, size)
    expected = slow_flashes(shown.steps["ring_on"], shown.steps["phase_ms"])
    assert joined(batches).flashes.tolist() == expected


@pytest.mark.parametrize(("name", "cycles"), [("thesis", 6), ("always lit", 60)])
def test_robots_flash_about_once_a_cycle_even_if_their_rings_stay_lit(name: str, cycles: int) -> None:
    batches, shown = recorded(name, 7)
    assert (name == "always lit") == bool(shown.steps["ring_on"][10:].all())
    flashes = np.bincount(joined(batches).flashes[:, 1], minlength=10)
    assert cycles - 2 <= flashes.min() <= flashes.max() <= cycles + 6


@pytest.mark.parametrize("name", WITH_REFERENCE)
@sizes
def test_the_reference_flashes_exactly_where_the_watch_counts_and_measures(name: str, size: int) -> None:
    batches, shown = recorded(name, size)
    columns = joined(batches)
    assert len(shown.firings) > 2
    own = columns.flashes[columns.flashes[:, 1] == SCENARIOS[name].stop.reference_robot]
    steps, cycles, order = zip(*shown.firings, strict=True)
    assert tuple(columns.firings) == tuple(own[:, 0]) == steps
    assert tuple(own[:, 2]) == cycles == tuple(range(1, len(cycles) + 1))
    assert tuple(columns.firing_order) == order == tuple(columns.order_parameter[columns.firings])


@pytest.mark.parametrize("name", ["mixed, the reference no oscillator", "spotlight", "push"])
def test_a_reference_that_is_no_oscillator_never_fires(name: str) -> None:
    columns = joined(recorded(name, 7)[0])
    assert len(columns.firings) == len(columns.firing_order) == 0


@pytest.mark.parametrize(("name", "lit"), [("spotlight", [1, 2, 3]), ("push", [])])
def test_robots_without_oscillator_flash_when_their_rings_light_up_and_are_in_no_order(name: str, lit: list) -> None:
    columns = joined(recorded(name, 7)[0])
    assert columns.flashes.tolist() == [[0, robot, 1] for robot in lit]
    assert np.isnan(columns.phase_ms).all()
    assert np.isnan(columns.order_parameter).all()


# --- made-up steps ----------------------------------------------------------------------------------


@cache
def made_up(robots: int) -> Scenario:
    return load_scenario({"robots": [{"count": robots}], "arena": {"width_cm": 200}, "stop": {"reference_robot": 0}})


@st.composite
def stories(draw: st.DrawFn) -> tuple[BoolArray, FloatArray]:
    """Rings and phases of some robots, step by step; those of robots that are no oscillators are NaN."""
    steps, robots = draw(st.integers(1, 40)), draw(st.integers(1, 4))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    phases = 1000.0 * random.integers(0, 5, (steps, robots))
    phases[:, random.random(robots) < 0.3] = np.nan
    return random.random((steps, robots)) < random.choice([0.2, 0.5, 0.9, 1.0]), phases


@given(stories(), st.integers(1, 50))
def test_flashes_and_firings_of_made_up_steps(story: tuple[BoolArray, FloatArray], size: int) -> None:
    rings, phases = story
    scenario = made_up(rings.shape[1])
    periods = np.where(np.isnan(phases[0]), np.nan, 5000.0)
    watch = SynchronyWatch(SimpleNamespace(scenario=scenario, period_ms=periods, events=[]))
    buffer, batches, firings = RobotBuffer(scenario, Level.SUMMARY, size), [], []
    for number, (ring_on, phase_ms) in enumerate(zip(rings, phases, strict=True)):
        memory = np.array([(phase,) for phase in phase_ms], [("phase_ms", float)])
        step = Step(
            number,
            number / 10,
            *[np.empty(0)] * 5,
            ring_on,
            ring_on,
            np.empty((0, 2)),
            np.ones(len(ring_on), bool),
            None,
            (memory,),
            (),
            None,
        )
        cycles = watch.cycles
        watch.look(step)
        buffer.append(step, watch)
        if watch.cycles > cycles and watch.order_parameter is not None:
            firings.append((number, watch.order_parameter))
        if buffer.is_full or number == len(rings) - 1:
            batches.append(buffer.flush())
    columns = joined(batches)
    expected = slow_flashes(rings, phases)
    assert columns.flashes.tolist() == expected
    assert list(zip(columns.firings, columns.firing_order, strict=True)) == firings
    if not np.isnan(periods[0]):
        assert columns.firings.tolist() == [step for step, robot, _ in expected if robot == 0]
    assert (columns.ring_before[1:] == rings[:-1]).all()
    assert not columns.ring_before[0].any()
