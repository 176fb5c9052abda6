"""Claims about what run folders keep of what changed during trials."""

import json
from functools import partial

import pyarrow.csv
import pytest

from epuck_sim.runs.export import export
from epuck_sim.runs.reader import read_points
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.sweep.executors import local_pool
from epuck_sim.sweep.run import run_sweep
from epuck_sim.trial.model import run_trial, simulate
from tests.runs.test_store import DEMO, fill, stored
from tests.sweep.pool_here import pool_here

SCENARIO = {
    "trials": 4,
    "stop": {"max_cycles": 4, "order_parameter": None},
    "robots": [{"count": 3}],
    "faults": [{"kind": "ring_dead", "count": 1, "per_hour": 360, "mean_s": 3}],
    "schedule": [{"at_cycle": 2, "set": {"robots.0.parameters.speed_cm_s": 0}}],
}

SEED = 4111783006597517648
"""With which the first point of `DEMO` was resampled before there were signals, faults and schedules."""


def run(folder, pool=pool_here, **changes):
    given = {key: value for key, value in {**SCENARIO, **changes}.items() if value is not None}
    run_sweep(load_scenario(given), folder, pool)


def test_events_are_stored_read_and_exported_to_the_bit(tmp_path):
    run(tmp_path)
    (point,) = read_points(tmp_path)
    (only,) = points(load_scenario(SCENARIO))
    alone = tuple(run_trial(simulate(only.scenario, only.seed(trial))).events for trial in range(4))
    assert point.events == alone
    assert {event.source for events in alone for event in events} == {"faults.0", "schedule.0"}
    export(tmp_path, tmp_path / "out.csv")
    table = pyarrow.csv.read_csv(tmp_path / "out.csv").to_pydict()
    assert [json.loads(text) for text in table["events"]] == [
        [{**event._asdict(), "robots": list(event.robots)} for event in events] for events in alone
    ]


SWARM = {
    "model": "particles",
    "robots": None,
    "faults": None,
    "schedule": [
        {"at_cycle": 2, "displace": {"by_cycles": "random"}},
        {"at_s": 1.3, "set": {"agents.speed_cm_s": 9, "neighbourhood.k": 2}},
    ],
}


@pytest.mark.parametrize(
    ("changes", "pool"), [({}, partial(local_pool, 2)), (SWARM, pool_here)], ids=["robots", "agents"]
)
def test_events_are_equal_after_a_resume_with_any_workers(changes, pool, tmp_path):
    run(tmp_path / "whole", **changes)
    run(tmp_path / "parted", **changes, trials=1)
    run(tmp_path / "parted", pool, **changes)
    whole, parted = ([row["events"] for row in stored(tmp_path / name)] for name in ("whole", "parted"))
    assert all(whole)
    assert parted == whole


def test_what_changes_is_resampled_apart_and_its_defaults_leave_seeds_as_they_were(tmp_path):
    def seed(name, **changes):
        fill(tmp_path / name, load_scenario({**DEMO.model_dump(), **changes}))
        return read_points(tmp_path / name)[0].seed

    plain = seed("plain")
    assert plain == SEED
    assert seed("same", faults=[], schedule=[]) == plain
    assert seed("faulty", faults=[{"kind": "ring_dead"}]) != plain
    assert seed("scheduled", schedule=[{"at_s": 1, "displace": {"by_cycles": "random"}}]) != plain
    assert seed("silent", contact={"robots": False}) != plain
