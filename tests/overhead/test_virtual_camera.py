"""Frames come at their times, and show where robots are and which rings are on in their exposures."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuck_sim import epuck
from epuck_sim.arrays import FloatArray
from epuck_sim.overhead.camera import Frame, overhead_camera
from epuck_sim.overhead.filming import SAMPLES, VirtualCamera
from epuck_sim.overhead.render import BODY_TOP, FLOOR, HEADING_MARK, ExposureSample, Renderer
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.cameras import ARENA, CLEAN, pixel_at, ring_centroid

STILL = np.array([[30.0, 30.0, 0.0]])
SMALL = {"width_px": 64, "height_px": 64}


def shoot(section: OverheadSection, steps: list[tuple[float, FloatArray, list[bool]]]) -> list[Frame]:
    camera = VirtualCamera(section, ARENA, 0)
    frames = [frame for time_s, poses, on in steps for frame in camera.observe(time_s, poses, np.array(on))]
    return frames + list(camera.finish())


def flashing(is_on: Any, seconds: float = 3.0, step_s: float = 0.1) -> list[tuple[float, FloatArray, list[bool]]]:
    """Return steps of one robot that stands still, its ring on where `is_on` says so of a step's number."""
    return [(number * step_s, STILL, [is_on(number)]) for number in range(round(seconds / step_s) + 1)]


def is_red(frame: Frame) -> bool:
    return bool(frame.picture[..., 0].max() > 200)


Spied = list[tuple[list[ExposureSample], bool]]
"""Samples that were to be rendered, and whether the room was lit."""


class Spy(Renderer):
    """A renderer that notes what it is asked to render, and renders nothing."""

    asked: Spied = []

    def __init__(self, *_: Any) -> None:
        self.asked.clear()

    def render(self, samples: Any, *, room_is_lit: bool) -> Any:
        self.asked.append((list(samples), room_is_lit))
        return np.zeros((2, 2, 3), np.uint8)


@pytest.fixture
def spied(monkeypatch: pytest.MonkeyPatch) -> Spied:
    monkeypatch.setattr("epuck_sim.overhead.filming.Renderer", Spy)
    return Spy.asked


@pytest.mark.parametrize("rate", [1.0, 15.0, 16.0, 29.97, 60.0])
@pytest.mark.parametrize("start_s", [0.0, 2.0])
@pytest.mark.usefixtures("spied")
def test_frames_begin_at_multiples_of_their_interval(rate: float, start_s: float) -> None:
    frames = shoot(OverheadSection(frames_per_s=rate, exposure_ms=10, lit_start_s=start_s), flashing(lambda _: False))
    assert [frame.time_s for frame in frames] == [number / rate for number in range(len(frames))]
    assert len(frames) == math.floor((start_s + 3.0) * rate + 1e-6) + 1


@pytest.mark.usefixtures("spied")
def test_frame_comes_as_soon_as_its_exposure_has_ended() -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=10, exposure_ms=50), ARENA, 0)
    given_at = [
        [f.time_s for f in camera.observe(t, STILL, np.array([False]))] for t in (0.0, 0.04, 0.05, 0.1, 0.2, 0.25)
    ]
    assert given_at == [[], [], [0.0], [], [0.1], [0.2]]
    assert not list(camera.finish())


@pytest.mark.usefixtures("spied")
def test_first_step_need_not_be_at_0() -> None:
    steps = [(100 + t, poses, on) for t, poses, on in flashing(lambda _: False, 1.0)]
    assert [frame.time_s for frame in shoot(OverheadSection(frames_per_s=10), steps)] == [k / 10 for k in range(11)]


def test_nothing_was_seen_before_anything_was_there() -> None:
    assert list(VirtualCamera(OverheadSection(**SMALL), ARENA, 0).finish()) == []


@pytest.mark.parametrize("step", [3, 6, 7, 12, 29])
def test_ring_switched_at_the_beginning_of_a_frame_is_on_in_it(step: int) -> None:
    section = OverheadSection(frames_per_s=10, **CLEAN, **SMALL)
    frames = shoot(section, flashing(lambda number: number >= step))
    assert [is_red(frame) for frame in frames] == [number >= step for number in range(len(frames))]
    frames = shoot(section, flashing(lambda number: number < step))
    assert [is_red(frame) for frame in frames] == [number < step for number in range(len(frames))]


def test_ring_switched_on_in_mid_exposure_gives_half_of_its_light(
    spied: Spied,
) -> None:
    shoot(OverheadSection(frames_per_s=5, exposure_ms=200), flashing(lambda number: number == 3, 1.0))
    assert [sum(bool(i.ring_on[0]) for i in samples) / SAMPLES for samples, _ in spied] == [0, 0.5, 0, 0, 0, 0]


def test_film_begins_lit_with_rings_off(spied: Spied) -> None:
    shoot(OverheadSection(lit_start_s=2, frames_per_s=10), flashing(lambda _: True, 1.0))
    assert [is_lit for _, is_lit in spied] == [True] * 20 + [False] * 11
    assert [any(i.ring_on[0] for i in samples) for samples, _ in spied] == [False] * 20 + [True] * 11
    assert all((sample.poses == STILL).all() for samples, _ in spied for sample in samples)


def test_lit_start_shows_the_room_and_then_the_dark() -> None:
    section = OverheadSection(lit_start_s=1, frames_per_s=2, **CLEAN, **SMALL)
    frames = shoot(section, flashing(lambda _: False, 1.0))
    camera = overhead_camera(section, 60, 60)
    assert [frame.picture[pixel_at(camera, 40, 30)].tolist() for frame in frames] == [[FLOOR] * 3] * 2 + [[0] * 3] * 3
    assert frames[0].picture[pixel_at(camera, 28, 30, epuck.HEIGHT_CM)][0] == BODY_TOP
    assert frames[0].picture[pixel_at(camera, 31.4, 30, epuck.HEIGHT_CM)][0] == HEADING_MARK


@given(st.floats(0.05, 0.5), st.floats(1, 30), st.floats(-12.8, 12.8), st.floats(-4, 4))
def test_robots_move_evenly_from_step_to_step(step_s: float, rate: float, speed: float, turning: float) -> None:
    section = OverheadSection(frames_per_s=rate, exposure_ms=20)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("epuck_sim.overhead.filming.Renderer", Spy)
        times = np.arange(8) * step_s
        wrapped = (turning * times + math.pi) % math.tau - math.pi
        shoot(
            section, [(t, np.array([[30 + speed * t, 30.0, a]]), [False]) for t, a in zip(times, wrapped, strict=True)]
        )
    for number, (samples, _) in enumerate(Spy.asked):
        for part, sample in enumerate(samples):
            tracked = min(number / rate + (part + 0.5) / SAMPLES * 0.02, times[-1])
            x, _, heading = sample.poses[0]
            assert x == pytest.approx(30 + speed * tracked, abs=1e-4)
            assert math.cos(heading - turning * tracked) == pytest.approx(1)


def test_moving_ring_is_seen_where_it_is_in_mid_exposure() -> None:
    section = OverheadSection(frames_per_s=10, exposure_ms=40, **CLEAN)
    frames = shoot(section, [(0.1 * n, np.array([[10 + 1.28 * n, 30.0, 0.0]]), [True]) for n in range(5)])
    camera = overhead_camera(section, 60, 60)
    for number, frame in enumerate(frames[:-1]):
        assert ring_centroid(frame.picture, camera)[0] == pytest.approx(10 + 1.28 * (number + 0.2), abs=0.05)


def test_what_is_given_is_copied(spied: Spied) -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=10), ARENA, 0)
    poses, on = STILL.copy(), np.array([False])
    list(camera.observe(0.0, poses, on))
    poses[:], on[:] = 0, True
    list(camera.observe(1e-3, STILL, np.array([False])))
    list(camera.finish())
    assert all((sample.poses == STILL).all() and not sample.ring_on[0] for sample in spied[0][0])


@pytest.mark.usefixtures("spied")
def test_frames_not_asked_for_come_with_the_next() -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=10, lit_start_s=1), ARENA, 0)
    camera.observe(0.0, STILL, np.array([False]))
    assert len(list(camera.observe(0.5, STILL, np.array([False])))) == 15


@pytest.mark.usefixtures("spied")
def test_memory_stays_flat() -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=15), ARENA, 0)
    for number in range(1000):
        list(camera.observe(number * 0.02, STILL, np.array([False])))
    assert len(camera._steps) <= 5
