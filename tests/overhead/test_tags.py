"""Tags on top of robots are drawn and read, and tell whose flashes are whose."""

import numpy as np
import pytest

from epuck_sim.arena import make_arena
from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.flashes import Flash
from epuck_sim.overhead.render import ExposureSample
from epuck_sim.overhead.robots import find_robots, flash_columns, summary, trace_columns
from epuck_sim.overhead.tags import Readings, TagReader
from epuck_sim.overhead.track import Track
from tests.overhead.cameras import make_renderer
from tests.overhead.films import TRACK

ARENA = make_arena(36, 36, [], [])
POSES = np.array([(8.0, 9.0, 0.4), (27.0, 10.0, 2.0), (10.0, 27.0, -3.0), (26.0, 26.0, -1.1)])
TIMES = np.arange(60) / 10


def shown(poses=POSES, lit=(), in_the_light=True, **settings: object):
    """Return a camera, and its picture of robots with tags of which some are lit."""
    camera, renderer = make_renderer(ARENA, width_px=240, height_px=240, tags="4X4_50", **settings)
    on = np.isin(np.arange(len(poses)), lit)
    return camera, renderer.render([ExposureSample(poses, on)], room_is_lit=in_the_light)


@pytest.mark.parametrize(
    ("in_the_light", "lit", "settings"),
    [
        (True, (), {}),
        (True, (0, 2), {}),
        (False, (), {"ambient": 0.2}),
        (False, (1,), {"ambient": 0.2, "tilt_deg": 15.0}),
    ],
)
def test_tags_are_read_where_robots_are(in_the_light: bool, lit: tuple[int, ...], settings: dict) -> None:
    camera, picture = shown(lit=lit, in_the_light=in_the_light, **settings)
    reader = TagReader(camera, "4X4_50")
    reader.read(Frame(0.0, picture))
    found = reader.readings(0.0)
    assert found.number.tolist() == [0, 1, 2, 3]
    assert np.hypot(*(found.poses - POSES)[:, :2].T).max() < 0.15
    assert np.abs(np.exp(1j * found.poses[:, 2]) - np.exp(1j * POSES[:, 2])).max() < 0.06


def test_tags_of_a_film_are_gathered() -> None:
    camera, picture = shown()
    reader = TagReader(camera, "4X4_50")
    for time_s, shown_then in ((0.0, picture), (1.0, picture), (2.0, np.zeros_like(picture)), (3.0, picture)):
        reader.read(Frame(time_s, shown_then))
    readings = reader.readings(1.0)
    assert readings.time_s.tolist() == [1] * 4 + [3] * 4
    assert readings.number.tolist() == [0, 1, 2, 3] * 2
    assert readings.poses.shape == (8, 3)


def read(numbers=(4, 7), without=()) -> Readings:
    """Return readings of robots that drive along x, but for those of (time, number)."""
    rows = [
        (time, number, 5.0 + time + 10 * row, 10.0, 3.1 + 0.1 * time)
        for time in TIMES
        for row, number in enumerate(numbers)
        if (round(time, 1), number) not in without
    ]
    columns = np.array(rows)
    return Readings(columns[:, 0], columns[:, 1].astype(int), columns[:, 2:])


def track(*flashes: tuple[float, float], robots: int | None = None) -> Track:
    """Return a track with flashes at times, of robots that were at x 0 s after the start."""
    made = tuple(Flash(time, time + 0.3, x + time + 0.15, 10.3, 80.0) for time, x in flashes)
    return TRACK._replace(flashes=made, times_s=TIMES, start_s=0.0, options=TRACK.options._replace(robots=robots))


def tagged(track: Track, tags: Readings, *numbers: int) -> Track:
    """Return a track with tags that were read, of robots that have some numbers."""
    return track._replace(tags=tags, options=track.options._replace(tag_numbers=frozenset(numbers)))


def test_flashes_are_those_of_the_tags_above_them() -> None:
    dark = {(round(0.1 * k, 1), 7) for k in range(20, 26)}  # unread while lit
    tracked = track((1.0, 5.0), (2.1, 15.0), (2.2, 5.0), (3.0, 5.0), (5.9, 40.0), robots=2)
    robots = find_robots(tracked._replace(tags=read(without=dark)))
    assert robots.warnings == ()  # the last flash may be one frame of a flash
    assert robots.numbers.tolist() == [4, 7]
    table = flash_columns(tracked, robots)
    assert table["robot"].tolist() == [4, 7, 4, 4, -1]
    assert table["cycle"].tolist() == [1, 1, 2, 3, 1]
    assert table["certainty"] == pytest.approx([np.nan, np.nan, 1, 1, np.nan], nan_ok=True)
    trace = trace_columns(tracked, robots)
    own = {name: column[trace["robot"] == 7] for name, column in trace.items()}
    assert own["x_cm"] == pytest.approx(15 + TIMES)  # also where it was not read
    assert own["heading_rad"] == pytest.approx(3.1 + 0.1 * TIMES)
    assert own["ring_on"].sum() == 3
    assert summary(tracked, robots)["by"] == "tags"


def test_where_a_tag_is_unread_for_long_it_is_not_known_where_the_robot_is() -> None:
    gap = {(round(0.1 * k, 1), 4) for k in range(20, 40)}
    robots = find_robots(track((3.0, 5.0))._replace(tags=read(without=gap)))
    assert robots.poses is not None
    assert np.isnan(robots.poses[20:40, 0]).all()
    assert not np.isnan(robots.poses[:20, 0]).any()
    assert robots.identities.robot.tolist() == [-1]
    (warning,) = robots.warnings
    assert warning.startswith("flashes that are under no tag: 1 of 1; there are robots without a tag")


def test_a_tag_that_is_seen_twice_is_said_and_left_out() -> None:
    once, other = read(), read(numbers=(4,))
    double = Readings(
        *(np.concatenate([a, b[:20]]) for a, b in zip(once, other._replace(poses=other.poses + 20), strict=True))
    )
    robots = find_robots(track((1.0, 5.0))._replace(tags=double))
    assert "tag 4 is seen twice in 20 frames, and left out there" in robots.warnings[0]
    assert robots.poses is not None
    assert np.isnan(robots.poses[:19, 0]).all()
    assert robots.poses[30, 0, 0] == pytest.approx(8)


def test_unknown_seldom_and_missing_tags_are_said() -> None:
    seldom = Readings(np.array([1.0]), np.array([33]), np.zeros((1, 3)))
    both = Readings(*(np.concatenate(columns) for columns in zip(read(), seldom, strict=True)))
    (warning,) = find_robots(track()._replace(tags=both)).warnings
    assert warning == "tags that are read in less than 2 % of the frames, and are left out: 33"
    found = find_robots(tagged(track(robots=5), both, 4, 5)).warnings
    assert found == (
        "tags that are not among those given, and are left out: 7",
        "tags that are never read: 5",
        "robots whose tags are read: 1, but there are 5",
    )
    with pytest.raises(FilmError, match=r"^film.mp4: no tag is read, or all are seen twice; check the dictionary"):
        find_robots(tagged(track(), both, 8))
