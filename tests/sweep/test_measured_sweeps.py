"""Measures of sweeps: the same to the bit however a sweep is run, and a failure costs no other trial."""

import json
import tempfile
from contextlib import suppress
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.runs.database import reading
from epuck_sim.runs.reader import read_points, read_status
from epuck_sim.scenario.points import points
from epuck_sim.sweep.run import run_sweep
from epuck_sim.trial.model import run_trial, simulate
from tests.measures.files import COUNTER, write
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import Stopped, agents_sweep, stopper, table

SETTLED = "def settled(simulation): return bool(simulation.positions()[0, 0] > 50)\n"


@pytest.fixture(scope="module")
def mine(tmp_path_factory):
    return str(write(tmp_path_factory.mktemp("measures") / "mine.py", COUNTER + SETTLED))


def sweep(measures, trials, **sections):
    ends = {"stop": {"when": "order_parameter > 0.6", "max_cycles": 5}}
    return agents_sweep(measures, trials, **{**ends, **sections})


def content(folder):
    with reading(folder) as connection:
        measures = connection.execute("SELECT key, measures FROM points ORDER BY key").fetchall()
    return table(folder), measures


@settings(max_examples=5, deadline=None)
@given(
    trials=st.lists(st.integers(1, 3), max_size=4),
    counts=st.lists(st.integers(0, 4), min_size=4, max_size=4),
    stops=st.lists(st.integers(1, 6), min_size=4, max_size=4),
)
def test_measures_are_the_same_whatever_was_added_when_and_however_often_a_run_was_stopped(mine, trials, counts, stops):
    measures = ["order_parameter", "near_walls", f"{mine}:Counter", f"{mine}:settled"]
    with tempfile.TemporaryDirectory() as place:
        folder, anew = Path(place) / "folder", Path(place) / "anew"
        for number, count, after in zip(sorted(trials), sorted(counts), stops, strict=False):
            with suppress(Stopped):
                run_sweep(sweep(measures[:count], number), folder, pool_here, stopper(after))
        for each in (folder, anew):
            run_sweep(sweep(measures, 3), each, pool_here)
        assert content(folder) == content(anew)
        of_folder = (read_points(folder, name) for name in ("order_parameter", "settled"))
        for point, *stored in zip(points(sweep(measures, 3)), *of_folder, strict=True):
            again = [run_trial(simulate(point.scenario, point.seed(trial))).measures for trial in range(3)]
            for each in stored:
                assert each.measured == tuple(measures[each.of] for measures in again)


RAISING = """
class Mine:
    def __init__(self, simulation):
        self.fails = simulation.scenario.agents.count == 5

    def cycle(self, event, state):
        pass

    def value(self):
        return {} if self.fails else 1
"""
VALUES = {"1 / 0": ":10: ZeroDivisionError", "'text'": "its value is 'text', a str; "}


@pytest.mark.parametrize(("value", "said"), VALUES.items())
@pytest.mark.parametrize("was_added", [False, True])
def test_a_measure_that_fails_costs_its_trials_alone(value, said, was_added, tmp_path):
    path = write(tmp_path / "mine.py", RAISING.format(value))
    when = "order_parameter > 1" if was_added else "Mine > 1"  # measures end trials, too
    stop, folder = {"stop": {"when": when, "max_cycles": 3}}, tmp_path / "run"
    if was_added:
        run_sweep(sweep(["order_parameter"], 2, **stop), folder, pool_here)
    progress = run_sweep(sweep(["order_parameter", str(path)], 2, **stop), folder, pool_here)
    assert (progress.stored, progress.failed) == (2, 2)
    status = read_status(folder)
    assert (status.stored, status.unmeasured) == ((4, 2) if was_added else (2, 0))
    assert [(failure.point, said in failure.error) for failure in status.failed] == [(0, True)] * 2
    assert [point.measured.count(1) for point in read_points(folder, "Mine")] == [0, 2]
    assert json.loads(json.dumps(status._asdict()))["unmeasured"] == status.unmeasured
