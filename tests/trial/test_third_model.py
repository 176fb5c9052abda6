"""Claims about a third model of thirty lines: it is read, run, swept, stored and summarised as the others."""

import multiprocessing
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import pytest
from pydantic import Field

from epuck_sim import Scenario, load_scenario, points, read_points, run_sweep, run_trial, summarize
from epuck_sim.order_parameter import Firing
from epuck_sim.scenario.base import Number
from epuck_sim.scenario.loader import SCENARIO_TYPES
from epuck_sim.scenario.stop import StopSection
from epuck_sim.sweep.executors import local_pool
from epuck_sim.trial.model import MODELS, Model, register_model, simulate
from epuck_sim.trial.result import TrialResult


class DiceScenario(Scenario):
    """A swarm that is synchronised once a die says so."""

    model: Literal["dice"]
    chance: Annotated[Number, Field(gt=0, le=1)] = 0.2
    stop: StopSection = StopSection(order_parameter=0.95, max_cycles=50)

    @property
    def population(self) -> int:
        return 1


class Dice:
    """Throws once a cycle; it is its own TrialState."""

    def __init__(self, scenario: DiceScenario, seed: int) -> None:
        self.scenario, self.seed = scenario, seed
        self.random = np.random.default_rng(seed)
        self.time_s, self.cycles, self.order_parameter, self.is_synchronised = 0.0, 0, None, False

    @property
    def outcome(self) -> Firing:
        return Firing(self.cycles, self.order_parameter)


def run(dice: Dice, observers: Any, _: Any, at_cycles: Any, conditions: Any) -> TrialResult:
    while not (dice.is_synchronised or dice.cycles >= dice.scenario.stop.max_cycles or conditions.is_over()):
        dice.cycles, dice.time_s = dice.cycles + 1, dice.time_s + 1.0
        dice.is_synchronised = bool(dice.random.random() < dice.scenario.chance)
        for observer in (*observers, *at_cycles):
            observer(dice.cycles, dice)
    t_sync = dice.cycles if dice.is_synchronised else None
    numbers = dice.cycles, None, dice.cycles, dice.time_s, 1e-3
    return TrialResult(dice.scenario.name, dice.seed, t_sync, t_sync is None, *numbers)


MODEL = Model(DiceScenario, lambda scenario, seed, _: Dice(scenario, seed), run, lambda _: None)

if multiprocessing.parent_process() is not None:  # a worker, which has to know the model to which a task belongs
    register_model("dice", MODEL)


@pytest.fixture(autouse=True)
def _registered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Register the model for a test, and no longer: other tests list the models there are."""
    for table in (SCENARIO_TYPES, MODELS):
        monkeypatch.setitem(table, "dice", None)
    register_model("dice", MODEL)


SWEEP = {"name": "dice", "model": "dice", "trials": 20, "seed": 3, "sweep": {"grid": {"chance": [0.1, 0.5]}}}


def test_it_is_swept_by_worker_processes_stored_and_summarised(tmp_path: Path) -> None:
    progress = run_sweep(SWEEP, tmp_path / "run", lambda: local_pool(1))
    assert (progress.stored, progress.failed) == (40, 0)
    stored = read_points(tmp_path / "run")
    for point, results in zip(points(load_scenario(SWEEP)), stored, strict=True):
        expected = [run_trial(simulate(point.scenario, point.seed(trial))) for trial in range(20)]
        assert results.times.tolist() == [result.cycles for result in expected]
        assert results.observed.tolist() == [not result.censored for result in expected]
    slow, fast = summarize(stored)
    assert slow.estimates["mean"].value > 2 * fast.estimates["mean"].value
