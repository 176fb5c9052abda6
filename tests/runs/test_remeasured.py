"""Measures that are added to a run folder: stored trials are simulated again for them, and must be the same."""

import pytest

from epuck_sim.runs.reader import read_points, read_status
from epuck_sim.runs.store import difference
from epuck_sim.sweep.run import run_sweep
from epuck_sim.trial.result import TrialResult
from tests.cli.commands import call, called
from tests.measures.files import COUNTER, write
from tests.runs.made_folders import edit
from tests.runs.test_store import stored
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import Stopped, agents_sweep, stopper

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


@pytest.fixture
def mine(tmp_path):
    return str(write(tmp_path / "mine.py", COUNTER))


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "run"


def sweep(*measures, trials=3):
    return agents_sweep(measures, trials)


def run(folder, scenario):
    return run_sweep(scenario, folder, pool_here)


def everything(folder):
    return [{**row, "wall_s": None, "checksum": None} for row in stored(folder)]


def test_a_run_that_was_stopped_goes_on(folder, mine):
    run(folder, sweep("near_walls"))
    with pytest.raises(Stopped):
        run_sweep(sweep("near_walls", mine), folder, pool_here, stopper(1))
    status = read_status(folder)
    assert (status.stored, status.unmeasured, status.failed) == (6, 5, [])
    assert "5 of these results lack measures that were added" in called("status", folder)
    assert sorted(point.measured.count(None) for point in read_points(folder, "Counter")) == [2, 3]
    progress = run(folder, sweep("near_walls", mine))
    assert (progress.ended, progress.stored, read_status(folder).unmeasured) == (5, 6, 0)


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("cycles", 5, "cycles is 5 in the folder, 6 now"),
        ("order_parameter", 0.5, "order_parameter is 0.5 in the folder, 0."),
        ("measured", '{"near_walls": 0.123}', "near_walls is 0.123 in the folder, "),
    ],
)
def test_a_trial_that_is_no_longer_the_same_is_reported_and_stays_as_it_is(folder, mine, column, value, said):
    run(folder, sweep("near_walls"))
    edit(folder, f"UPDATE trials SET {column} = ? WHERE trial = 1", value)
    before = everything(folder)
    progress = run(folder, sweep("near_walls", mine))
    assert (progress.stored, progress.failed) == (4, 2)
    status = read_status(folder)
    assert (status.stored, status.unmeasured) == (6, 2)
    assert [(failure.point, failure.trial) for failure in status.failed] == [(0, 1), (1, 1)]
    assert all(said in failure.error for failure in status.failed)
    kept = [row for row in everything(folder) if row["trial"] == 1]
    assert [{**row, "measuring_error": None} for row in kept] == [row for row in before if row["trial"] == 1]
    assert [point.measured for point in read_points(folder, "Counter")] == [(6.0, None, 6.0)] * 2
    result = call("run", folder)
    assert result.exit_code == 1
    assert "2 trials failed; run again to retry them" in result.stderr


def test_a_trial_is_the_same_only_to_the_bit():
    result = TrialResult("demo", 1, 4, False, 4, 0.5, 80, 4.0, 0.1, {"a": 1, "b": 2.0})
    stored = {**result._asdict(), "measured": '{"a": 1}', "events": None}
    for changes, differs in [
        ({}, False),
        ({"measured": None}, False),
        ({"measured": '{"a": 1.0}'}, True),
        ({"measured": '{"a": true}'}, True),
        ({"measured": '{"b": 2.0}'}, False),
        ({"order_parameter": 0.5000000000000001}, True),
        ({"t_sync_cycles": None}, True),
        ({"simulated_s": 4.000000000000001}, True),
        ({"steps": 81}, True),
        ({"events": "[]"}, True),
        ({"cycles": 5}, True),
    ]:
        assert (difference({**stored, **changes}, result) is not None) == differs


@pytest.mark.parametrize("mended", [True, False], ids=["mended", "left out"])
def test_a_measure_that_gave_no_value_may_be_mended_or_left_out(folder, tmp_path, mended):
    run(folder, sweep("near_walls"))
    before = everything(folder)
    broken = str(write(tmp_path / "broken.py", "def half(simulation):\n    return 1 / 0\n"))
    assert run(folder, sweep("near_walls", broken)).failed == 6
    assert len(read_status(folder).failed) == 6
    write(tmp_path / "broken.py", "def half(simulation):\n    return 0.5\n")
    progress = run(folder, sweep("near_walls", *[broken] * mended))
    assert (progress.stored, progress.failed, read_status(folder).failed) == (6, 0, [])
    if mended:
        assert [point.measured for point in read_points(folder, "half")] == [(0.5,) * 3] * 2
    else:
        assert everything(folder) == before
