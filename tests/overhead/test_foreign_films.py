"""The tracker on films by another renderer: what it finds, where, and when it says that it cannot tell."""

from pathlib import Path

import numpy as np
import pytest

from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.film import film_file
from epuck_sim.overhead.track import Track, track_film
from tests.overhead.films import passed, read_rings
from tests.overhead.score import score_rows
from tests.overhead.webcam import GOOD, KINDS, Extra, Swarm, Webcam, shoot, swarm

NOWHERE = np.empty((0, 2))


class Tracked:
    """A film that was tracked, and what is true of it."""

    def __init__(self, folder: Path, camera: Webcam, filmed: Swarm, *, scale: float = 0.6, **more) -> None:
        known = {name: more.pop(name) for name in list(more) if name in TrackOptions._fields}
        camera = camera.scaled(scale)
        film, table = folder / "film.mp4", folder / "rings.csv"
        truth = []
        with film_file(film, *camera.size_px, {}) as writer:
            for frame, lit_cm in shoot(camera, filmed, **more):
                writer.write(frame)
                truth.append((frame.time_s, lit_cm, NOWHERE))
        floor = tuple((float(x), float(y)) for x, y in camera.floor_px(filmed.arena_cm))
        options = TrackOptions(filmed.arena_cm, camera.above_cm, floor)._replace(**known)
        self.track: Track = track_film(str(film), options, table, passed)
        self.score = score_rows(read_rings(table), truth)


@pytest.mark.parametrize(
    "kind",
    [
        *("points", "burnt out, white", "fisheye", "typical webcam"),
        *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("orange", "flicker in bands")),
    ],
)
def test_rings_are_found_where_they_are(kind: str, tmp_path: Path) -> None:
    robots = swarm(6, 4, 2, seed=1, period_s=2.0)
    tracked = Tracked(tmp_path, KINDS[kind], robots, scale=0.5, period_s=2.0, robots=6, frames_per_s=12.0)
    assert tracked.score.found + tracked.score.missed > 20
    assert tracked.score.recall >= 0.95
    assert tracked.score.precision >= 0.99
    assert tracked.score.rms_cm <= 0.4
    assert tracked.track.reasons == ()
    assert tracked.track.histogram_periods == pytest.approx(2.55, abs=0.25)


def test_what_is_outside_of_the_floor_and_what_never_goes_off_are_left_out(tmp_path: Path) -> None:
    camera = GOOD._replace(focal_px=640.0, size_px=(640, 480))
    robots = swarm(5, 5, 2, seed=2, period_s=2.0)
    neighbour = Extra((68.0, 30.0), tuple(0.3 + 2.3 * np.arange(5)), 0.3)
    free = max(
        ((x, y) for x in (10.0, 30.0, 50.0) for y in (10.0, 30.0, 50.0)),
        key=lambda place: np.hypot(*(robots.homes_cm - place).T).min(),
    )
    extras = (neighbour, Extra(free))
    known = {"period_s": 2.0, "robots": 5}
    tracked = Tracked(tmp_path, camera, robots, scale=0.4, frames_per_s=12.0, extras=extras, **known).track
    assert tracked.rings_outside > 10
    assert tracked.always_lit == 1
    assert tracked.histogram_periods == pytest.approx(2.55, abs=0.25)
    assert tracked.confidence == "low"
    assert any("outside of the floor" in warning for warning in tracked.warnings)
    assert any("stayed lit" in warning for warning in tracked.warnings)
