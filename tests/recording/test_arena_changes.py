"""Recordings, films and pictures show the walls and obstacles of the moment."""

import numpy as np
import pytest

from epuck_sim import ArenaView, load_scenario, read_recording
from epuck_sim.figures.trial_page import draw_page
from epuck_sim.recording.layers.arena import OBSTACLES, WALLS
from epuck_sim.recording.reader import Entities
from tests.embodied.changes.test_arena_change import GATE, PILLARS
from tests.recording.filmed import films_of, record_and_film

SCENARIO = {
    "arena": {"obstacles": GATE},
    "robots": [{"poses": [[10, 10, 0], [10, 40, 1]], "memory": {"phase_ms": 4900}, "parameters": {"speed_cm_s": 1}}],
    "schedule": [
        {"at_s": 2, "set": {"arena.obstacles": [], "arena.height_cm": 60}},
        {"at_cycle": 2, "set": {"arena.height_cm": 80, "arena.obstacles": PILLARS}},
    ],
    "stop": {"max_time_s": 8, "order_parameter": None},
    "overhead": {"light": "lit", "width_px": 320, "height_px": 240, "frames_per_s": 5},
}


@pytest.fixture(scope="module")
def trial(tmp_path_factory):
    """A recording, the film of the same trial, and what its steps show."""
    folder, scenario = tmp_path_factory.mktemp("changing"), load_scenario(SCENARIO)
    seen = []

    def look(step, _):
        seen.append((step.arena, step.contacts.tolist()))

    record_and_film(folder, scenario, look)
    return folder, scenario, seen


def test_a_recording_holds_the_walls_of_the_moment(trial):
    folder, _, seen = trial
    recorded = read_recording(folder / "t.rrd")
    assert [arena.height_cm for _, arena in recorded.arenas] == [60, 60, 80]
    for row, (arena, _) in enumerate(seen):
        found = recorded.arena_at(row)
        assert found.height_cm == arena.height_cm
        assert found.edges.tolist() == arena.edges.tolist()
        assert found.circles.tolist() == arena.circles.tolist()
    contacts = [[row, *contact] for row, (_, found) in enumerate(seen) for contact in found]
    assert sorted(recorded.contacts.tolist()) == sorted(contacts)
    entities = Entities(folder / "t.rrd", WALLS, OBSTACLES)
    assert entities.times(WALLS).tolist() == [time_s for time_s, _ in recorded.arenas]
    assert entities.lengths(OBSTACLES, "LineStrips2D:strips").tolist() == [1, 0, 2]
    assert draw_page(recorded) is not None
    assert recorded._repr_html_()


def test_films_of_a_trial_and_of_its_recording_show_walls_come_and_go(trial):
    folder, _, _ = trial
    films = films_of(folder)
    assert len(films[0]) == len(films[1]) > 10
    differences = [np.abs(one.astype(int) - other).max() for one, other in zip(*films, strict=True)]
    assert max(differences) < 60  # poses are in single precision, and films are compressed


def test_pictures_show_the_obstacles_that_are_given(trial):
    _, scenario, seen = trial
    view, nobody = ArenaView(scenario, 320, 240), (np.empty((0, 3)), np.empty(0, bool))
    first, last = (view.draw(*nobody, arena=arena) for arena in (seen[0][0], seen[-1][0]))
    np.testing.assert_array_equal(view.draw(*nobody), first)
    assert (np.abs(first.astype(int) - last) > 20).any(axis=2).sum() > 300
