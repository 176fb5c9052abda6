"""Frames come at their times, and show where robots are and which rings are on in their exposures."""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.filming import SAMPLES, VirtualCamera
from epuck_sim.overhead.render import ExposureSample
from epuck_sim.scenario.overhead import OverheadSection
from tests.overhead.cameras import ARENA, CLEAN

STILL = np.array([[30.0, 30.0, 0.0]])
OFF = np.array([False])
SMALL = {"width_px": 64, "height_px": 64}
Spied = list[tuple[list[ExposureSample], bool]]
"""Samples that were to be rendered, and whether the room was lit."""


def shoot(section: OverheadSection, steps: list[tuple[float, FloatArray, list[bool]]]) -> list[Frame]:
    camera = VirtualCamera(section, ARENA, 0)
    frames = [frame for time_s, poses, on in steps for frame in camera.observe(time_s, poses, np.array(on))]
    return frames + list(camera.finish())


def flashing(is_on: Any, seconds: float = 3.0, first_s: float = 0.0) -> list[tuple[float, FloatArray, list[bool]]]:
    """Return steps of a tenth of a second of one robot, its ring on where `is_on` says so of a step's number."""
    return [(first_s + number / 10, STILL, [is_on(number)]) for number in range(round(10 * seconds) + 1)]


@pytest.fixture
def spied(monkeypatch: pytest.MonkeyPatch) -> Spied:
    """Have a renderer note what it is asked to render, and render nothing."""
    asked: Spied = []

    class Spy:
        def __init__(self, *_: Any) -> None:
            asked.clear()

        def render(self, samples: Any, *, room_is_lit: bool) -> Any:
            asked.append((list(samples), room_is_lit))
            return np.zeros((2, 2, 3), np.uint8)

    monkeypatch.setattr("epuck_sim.overhead.filming.Renderer", Spy)
    return asked


@pytest.mark.parametrize("rate", [1.0, 15.0, 29.97, 60.0])
@pytest.mark.parametrize(("lit_s", "first_s"), [(0.0, 0.0), (2.0, 0.0), (0.0, 100.0)])
@pytest.mark.usefixtures("spied")
def test_frames_begin_at_multiples_of_their_interval(rate: float, lit_s: float, first_s: float) -> None:
    section = OverheadSection(frames_per_s=rate, exposure_ms=10, lit_start_s=lit_s)
    frames = shoot(section, flashing(lambda _: False, first_s=first_s))
    assert [frame.time_s for frame in frames] == [number / rate for number in range(len(frames))]
    assert len(frames) == math.floor((lit_s + 3.0) * rate + 1e-6) + 1
    assert list(VirtualCamera(section, ARENA, 0).finish()) == []


@pytest.mark.usefixtures("spied")
def test_frame_comes_as_soon_as_its_exposure_has_ended() -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=10, exposure_ms=50), ARENA, 0)
    given_at = [[frame.time_s for frame in camera.observe(t, STILL, OFF)] for t in (0.0, 0.04, 0.05, 0.1, 0.2)]
    assert given_at == [[], [], [0.0], [], [0.1]]
    camera.observe(0.25, STILL, OFF)
    assert [frame.time_s for frame in camera.observe(0.35, STILL, OFF)] == [0.2, 0.3]  # those not asked for, too
    assert not list(camera.finish())


@pytest.mark.parametrize("step", [3, 6, 7, 29])
@pytest.mark.parametrize("is_on", [True, False])
def test_ring_switched_at_the_beginning_of_a_frame_is_switched_in_it(step: int, is_on: bool) -> None:
    frames = shoot(OverheadSection(frames_per_s=10, **CLEAN, **SMALL), flashing(lambda n: (n >= step) == is_on))
    red = [frame.picture[..., 0].max() > 200 for frame in frames]
    assert red == [(number >= step) == is_on for number in range(len(frames))]


def test_ring_switched_on_in_mid_exposure_gives_half_of_its_light(spied: Spied) -> None:
    shoot(OverheadSection(frames_per_s=5, exposure_ms=200), flashing(lambda number: number == 3, 1.0))
    assert [sum(bool(each.ring_on[0]) for each in samples) / SAMPLES for samples, _ in spied] == [0, 0.5, 0, 0, 0, 0]


def test_film_begins_lit_with_rings_off(spied: Spied) -> None:
    shoot(OverheadSection(lit_start_s=2, frames_per_s=10), flashing(lambda _: True, 1.0))
    assert [is_lit for _, is_lit in spied] == [True] * 20 + [False] * 11
    assert [any(each.ring_on[0] for each in samples) for samples, _ in spied] == [False] * 20 + [True] * 11
    assert all((sample.poses == STILL).all() for samples, _ in spied for sample in samples)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0.05, 0.5), st.floats(1, 30), st.floats(-12.8, 12.8), st.floats(-4, 4))
def test_robots_move_evenly_from_step_to_step(
    spied: Spied, step_s: float, rate: float, speed: float, turning: float
) -> None:
    times = np.arange(8) * step_s
    wrapped = (turning * times + math.pi) % math.tau - math.pi
    steps = [(t, np.array([[30 + speed * t, 30.0, a]]), [False]) for t, a in zip(times, wrapped, strict=True)]
    shoot(OverheadSection(frames_per_s=rate, exposure_ms=20), steps)
    for number, (samples, _) in enumerate(spied):
        for part, sample in enumerate(samples):
            moment_s = min(number / rate + (part + 0.5) / SAMPLES * 0.02, times[-1])
            x, _, heading = sample.poses[0]
            assert x == pytest.approx(30 + speed * moment_s, abs=1e-4)
            assert math.cos(heading - turning * moment_s) == pytest.approx(1)


def test_what_is_given_is_copied_and_forgotten(spied: Spied) -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=15), ARENA, 0)
    poses, on = STILL.copy(), OFF.copy()
    list(camera.observe(0.0, poses, on))
    poses[:], on[:] = 0, True
    for number in range(1, 500):
        list(camera.observe(number * 0.02, STILL, OFF))
    assert len(camera._steps) <= 5
    assert all((sample.poses == STILL).all() and not sample.ring_on[0] for sample in spied[0][0])
