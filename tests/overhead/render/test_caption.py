"""Films in the light say what time it is, and what the swarm has come to; films in the dark are left alone."""

import numpy as np
import pytest

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.overhead import filming
from epuck_sim.overhead.film import open_film
from epuck_sim.overhead.filming import Captions, film_recording, film_trial
from epuck_sim.overhead.frame import Frame
from epuck_sim.recording.level import Level
from epuck_sim.recording.recorder import record
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from tests.overhead.track.films import passed


def frame(time_s: float) -> Frame:
    return Frame(time_s, np.full((720, 960, 3), 90, np.uint8))


def test_a_frame_says_what_the_trial_had_come_to(monkeypatch) -> None:
    written: list[str] = []
    monkeypatch.setattr(filming, "_write", lambda picture, text: written.append(text) or picture)
    captions = Captions(start_s=2.0)
    for state in ((0.0, 0, None), (0.5, 1, 0.25), (1.0, 2, 0.75), (1.5, 2, 0.75)):
        captions.add(*state)
    for time_s in (1.0, 2.4, 2.5, 2.9, 3.25, 9.0):
        captions.write(frame(time_s))
    measured = "cycle 2   order parameter 0.75"
    assert written[:2] == ["0.0 s", "0.4 s"]
    assert written[2] == "0.5 s   cycle 1   order parameter 0.25"
    assert [text.partition("   ")[2] for text in written[3:]] == ["cycle 1   order parameter 0.25", measured, measured]


def test_letters_are_white_edged_in_black_in_the_upper_left_corner() -> None:
    captions = Captions(0.0)
    picture = captions.write(frame(1.0)).picture
    changed = (picture != 90).any(axis=-1)
    assert changed[:50].any()
    assert not changed[50:].any()
    assert picture.max() == 255
    assert picture.min() < 10
    assert (frame(1.0).picture == 90).all()


@pytest.mark.parametrize("light", ["lit", "dark"])
def test_a_trial_and_its_recording_have_the_same_captions_in_the_light_alone(tmp_path, monkeypatch, light: str) -> None:
    given = {
        "robots": [{"count": 3, "parameters": {"period_s": 1.0}}],
        "stop": {"max_time_s": 3, "order_parameter": 1},
        "overhead": {"width_px": 160, "height_px": 160, "frames_per_s": 5, "light": light},
    }
    written: list[str] = []
    monkeypatch.setattr(filming, "_write", lambda picture, text: written.append(text) or picture)
    scenario = load_scenario(given)
    with (
        record(tmp_path / "t.rrd", scenario, 1, Level.POSES) as recorder,
        film_trial(tmp_path / "t.mp4", scenario, 1) as camera,
    ):
        run_trial(Simulation(scenario, 1), [recorder, camera])
    live = list(written)
    written.clear()
    film_recording(tmp_path / "t.rrd", [], tmp_path / "r.mp4", passed)
    assert live == written
    with open_film(str(tmp_path / "t.mp4")) as film:
        assert len(live) == (len([*film.frames()]) if light == "lit" else 0)
    assert any("order parameter" in text for text in live) == (light == "lit")
