"""Recordings, films and pictures show movables where they are."""

import numpy as np
import pytest

from epuck_sim import ArenaView, Simulation, load_scenario, read_recording
from epuck_sim.figures.trial_page import draw_page
from tests.recording.filmed import films_of, record_and_film

SETTINGS = ["stop.max_time_s=14", "robots.0.parameters.speed_cm_s=12.8", "robots.0.memory={phase_ms: 4900}"]
CAMERA = ["overhead.light=lit", "overhead.width_px=320", "overhead.height_px=240", "overhead.frames_per_s=5"]


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """A recording, the film of the same trial, and its steps' movables, contacts and sightings."""
    folder, scenario = tmp_path_factory.mktemp("pushed"), load_scenario("pushing", [*SETTINGS, *CAMERA])
    seen = []

    def look(step, _):
        seen.append((step.movables.copy(), step.contacts.tolist()))

    record_and_film(folder, scenario, look)
    return folder, scenario, seen


def test_a_recording_holds_where_movables_were_and_who_touched_them(trial):
    folder, _, seen = trial
    recorded = read_recording(folder / "t.rrd")
    places = np.array([movables for movables, _ in seen])
    assert np.ptp(places[:, 0, 0]) > 2
    np.testing.assert_array_equal(recorded.movables, places.astype(np.float32))
    np.testing.assert_allclose(recorded.arena_at(-1).circles[:, :2], places[-1], atol=1e-4)
    contacts = [[row, *contact] for row, (_, found) in enumerate(seen) for contact in found]
    assert sorted(recorded.contacts.tolist()) == sorted(contacts)
    assert draw_page(recorded) is not None
    assert recorded._repr_html_()


def test_films_of_a_trial_and_of_its_recording_are_the_same(trial):
    folder, _, _ = trial
    films = films_of(folder)
    assert len(films[0]) == len(films[1]) > 10
    differences = [np.abs(one.astype(int) - other).max() for one, other in zip(*films, strict=True)]
    assert max(differences) < 60  # poses are in single precision, and films are compressed
    assert np.abs(films[0][0].astype(int) - films[0][-1]).max() > 60


def test_pictures_show_the_disc_where_it_was_pushed_to(trial):
    _, scenario, seen = trial
    view = ArenaView(scenario, 320, 240)
    nobody = np.empty((0, 3)), np.empty(0, bool)
    first, last = view.draw(*nobody, seen[0][0]), view.draw(*nobody, seen[0][0] + [60, 0])
    np.testing.assert_array_equal(view.draw(*nobody), first)
    assert (first != last).any()
    simulation = Simulation(scenario, 1)
    ((x, _),) = simulation.advance(60).movables
    assert f'cx="{x:.5g}"' in simulation._repr_html_()
