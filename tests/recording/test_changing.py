"""Recordings, films and pictures show what changes: walls and obstacles, movables, and who is in the arena."""

from types import SimpleNamespace

import numpy as np
import pytest

from epuck_sim import ArenaView, Simulation, Trace, film_trial, load_scenario, read_recording, record, run_trial
from epuck_sim.arena import Arena
from epuck_sim.figures.trial_page import draw_page
from epuck_sim.overhead.film import open_film
from epuck_sim.overhead.filming import film_recording
from epuck_sim.recording.layers import OBSTACLES, WALLS
from epuck_sim.recording.reader import Entities
from tests.embodied.steps import GATE, PILLARS

POST = {"shape": "circle", "x_cm": 10, "y_cm": 25, "radius_cm": 4}  # hides one robot from the other
WALLS_CHANGE = {
    "arena": {"obstacles": [*GATE, POST]},
    "robots": [{"poses": [[10, 10, 0], [10, 40, -1.6]], "memory": {"phase_ms": 4900}, "parameters": {"speed_cm_s": 1}}],
    "schedule": [
        {"at_s": 2, "set": {"arena.obstacles": [{**POST, "x_cm": 50, "radius_cm": 1}], "arena.height_cm": 60}},
        {"at_cycle": 2, "set": {"arena.height_cm": 80, "arena.obstacles": PILLARS}},
    ],
    "stop": {"max_time_s": 8, "order_parameter": None},
}
THREE = {"poses": [[10, 10, 0], [20, 10, 1], [40, 40, 2]], "memory": {"phase_ms": [4900, 4900, 2400]}}
ROBOTS_COME_AND_GO = {
    "robots": [THREE, {"count": 1, "present": False}],
    "schedule": [{"at_s": 1, "remove": [2]}, {"at_s": 2, "add": [3]}, {"at_s": 4, "remove": [1]}],
    "stop": {"max_time_s": 6, "order_parameter": None},
}
PUSHED = ["stop.max_time_s=8", "robots.0.parameters.speed_cm_s=12.8", "robots.0.memory={phase_ms: 4900}"]
CAMERA = "overhead={light: lit, width_px: 160, height_px: 120, frames_per_s: 3}"
SCENES = {"walls": (WALLS_CHANGE, []), "robots": (ROBOTS_COME_AND_GO, []), "movables": ("pushing", PUSHED)}


@pytest.fixture(scope="module", params=SCENES)
def trial(request, tmp_path_factory) -> SimpleNamespace:
    source, settings = SCENES[request.param]
    arenas: dict[Arena, Arena] = {}
    folder, scenario, steps = tmp_path_factory.mktemp("changing"), load_scenario(source, [*settings, CAMERA]), []

    def look(step, _):
        kept = {"circles": step.arena.circles.copy(), "movables": step.movables.copy(), "present": step.present.copy()}
        arena = arenas.setdefault(step.arena, step.arena.with_movables_at(step.movables))  # whose circles change
        steps.append((arena, kept, step.phase_ms, step.contacts.tolist(), step.sightings.tolist()))

    with record(folder / "t.rrd", scenario, 1) as recorder, film_trial(folder / "t.mp4", scenario, 1) as camera:
        run_trial(Simulation(scenario, 1), [recorder, camera, look])
    recorded = read_recording(folder / "t.rrd")
    return SimpleNamespace(name=request.param, folder=folder, scenario=scenario, steps=steps, recorded=recorded)


def test_a_recording_holds_what_was_there_and_who_touched_and_saw_it(trial) -> None:
    recorded = trial.recorded
    present, movables = (np.array([kept[name] for _, kept, *_ in trial.steps]) for name in ("present", "movables"))
    np.testing.assert_array_equal(np.isnan(recorded.positions).any(axis=2), ~present)
    np.testing.assert_array_equal(np.isnan(recorded.headings), ~present)
    np.testing.assert_array_equal(recorded.phase_ms, np.array([phases for _, _, phases, *_ in trial.steps]))
    assert not recorded.ring_on[~present].any()
    assert not np.isnan(recorded.order_parameter).any()
    np.testing.assert_array_equal(recorded.movables, movables.astype(np.float32))
    for row, (arena, kept, *_) in enumerate(trial.steps):
        found = recorded.arena_at(row)
        assert (found.height_cm, found.edges.tolist()) == (arena.height_cm, arena.edges.tolist())
        np.testing.assert_allclose(found.circles, kept["circles"], atol=1e-4)
    contacts, lit = ([[row, *pair] for row, step in enumerate(trial.steps) for pair in step[at]] for at in (3, 4))
    assert sorted(recorded.contacts.tolist()) == sorted(contacts)
    assert sorted(recorded.sightings[recorded.sightings[:, 3] == 1, :3].tolist()) == sorted(lit)
    rows, observers, others, _ = recorded.sightings.T
    assert present[rows, observers].all()
    assert present[rows, others].all()
    assert draw_page(recorded) is not None
    assert '"nan' not in recorded._repr_html_()


def test_what_a_scene_is_of_changes_in_it_and_films_of_a_trial_and_of_its_recording_show_the_same(trial) -> None:
    heights = dict.fromkeys(arena.height_cm for arena, *_ in trial.steps)
    present = dict.fromkeys(int(kept["present"].sum()) for _, kept, *_ in trial.steps)
    assert ([*heights] == [60, 80]) == (trial.name == "walls")
    assert ([*present] == [3, 2]) == (trial.name == "robots")
    if trial.name == "movables":
        assert np.ptp([kept["movables"][0, 0] for _, kept, *_ in trial.steps]) > 0.3
    if trial.name == "walls":
        entities = Entities(trial.folder / "t.rrd", WALLS, OBSTACLES)
        assert entities.times(WALLS).tolist() == [time_s for time_s, _ in trial.recorded.arenas]
        assert entities.rows(OBSTACLES, "LineStrips2D:strips", 3).tolist() == [0, 0, 1, 2, 2]
    film_recording(trial.folder / "t.rrd", [], trial.folder / "again.mp4", lambda rows, _: rows)
    films = []
    for name in ("t.mp4", "again.mp4"):
        with open_film(str(trial.folder / name)) as film:
            films.append(np.array([frame.picture for frame in film.frames()], int))
    assert len(films[0]) > 10
    assert np.abs(films[0] - films[1]).max() < 60  # poses are in single precision, and films are compressed
    assert np.abs(films[0][0] - films[0][-1]).max() > 60


def test_pictures_show_the_obstacles_and_movables_that_are_given(trial) -> None:
    view, nobody = ArenaView(trial.scenario, 160, 120), (np.empty((0, 3)), np.empty(0, bool))
    (first, kept, *_), last = trial.steps[0], trial.steps[-1][0]
    shown = view.draw(*nobody, kept["movables"], arena=first)
    np.testing.assert_array_equal(view.draw(*nobody), shown)
    if last is not first:
        changed = view.draw(*nobody, kept["movables"], arena=last)
        assert (np.abs(shown.astype(int) - changed) > 20).any(axis=2).sum() > 75
    if len(kept["movables"]):
        assert (view.draw(*nobody, kept["movables"] + [60, 0]) != shown).any()
        simulation = Simulation(trial.scenario, 1)
        ((x, _),) = simulation.advance(60).movables
        assert f'cx="{x:.5g}"' in simulation._repr_html_()


def test_notebooks_and_traces_take_steps_without_some_robots(tmp_path) -> None:
    simulation = Simulation({**ROBOTS_COME_AND_GO, "stop": {"max_time_s": 3, "order_parameter": None}}, 1)
    with Trace(tmp_path / "t.parquet", simulation.scenario, 1) as trace:
        run_trial(simulation, [trace])
    assert '"nan' not in simulation._repr_html_()
