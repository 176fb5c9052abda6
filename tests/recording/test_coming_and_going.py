"""Recordings, films and pictures leave out robots that are not in the arena."""

import numpy as np
import pytest

from epuck_sim import Simulation, Trace, load_scenario, read_recording, run_trial
from epuck_sim.figures.trial_page import draw_page
from tests.recording.filmed import films_of, record_and_film

SCENARIO = {
    "robots": [
        {"poses": [[10, 10, 0], [20, 10, 1], [40, 40, 2]], "memory": {"phase_ms": [4900, 4900, 2400]}},
        {"count": 1, "present": False},
    ],
    "schedule": [{"at_s": 1, "remove": [2]}, {"at_s": 2, "add": [3]}, {"at_s": 4, "remove": [1]}],
    "stop": {"max_time_s": 6, "order_parameter": None},
    "overhead": {"light": "lit", "width_px": 160, "height_px": 120, "frames_per_s": 5},
}


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """A recording, the film of the same trial, and what its steps show."""
    folder, scenario = tmp_path_factory.mktemp("coming"), load_scenario(SCENARIO)
    seen = []

    def look(step, _):
        seen.append((step.present.copy(), step.phase_ms, step.contacts.tolist(), step.sightings.tolist()))

    record_and_film(folder, scenario, look)
    return folder, seen


def test_a_recording_holds_who_was_there(trial):
    folder, seen = trial
    recorded = read_recording(folder / "t.rrd")
    present = np.array([present for present, *_ in seen])
    assert present.sum(axis=0).tolist() == [60, 40, 10, 40]
    np.testing.assert_array_equal(np.isnan(recorded.positions).any(axis=2), ~present)
    np.testing.assert_array_equal(np.isnan(recorded.headings), ~present)
    np.testing.assert_array_equal(recorded.phase_ms, np.array([phases for _, phases, *_ in seen]))
    assert not recorded.ring_on[~present].any()
    contacts = [[row, *contact] for row, (_, _, found, _) in enumerate(seen) for contact in found]
    assert sorted(recorded.contacts.tolist()) == sorted(contacts)
    lit = [[row, *pair] for row, (*_, found) in enumerate(seen) for pair in found]
    assert sorted(recorded.sightings[recorded.sightings[:, 3] == 1, :3].tolist()) == sorted(lit)
    rows, observers, others, _ = recorded.sightings.T
    assert present[rows, observers].all()
    assert present[rows, others].all()
    assert not np.isnan(recorded.order_parameter).any()
    assert draw_page(recorded) is not None
    assert '"nan' not in recorded._repr_html_()


def test_films_of_a_trial_and_of_its_recording_show_who_is_there(trial):
    folder, _ = trial
    films = films_of(folder)
    assert len(films[0]) == len(films[1]) > 10
    differences = [np.abs(one.astype(int) - other).max() for one, other in zip(*films, strict=True)]
    assert max(differences) < 60  # poses are in single precision, and films are compressed


def test_notebooks_and_traces_take_steps_without_some_robots(tmp_path):
    scenario = {**SCENARIO, "stop": {"max_time_s": 3, "order_parameter": None}}
    simulation = Simulation(scenario, 1)
    with Trace(tmp_path / "t.parquet", simulation.scenario, 1) as trace:
        run_trial(simulation, [trace])
    assert '"nan' not in simulation._repr_html_()
