"""A trial that runs and its recording give the same film, and what cannot be filmed is refused."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.overhead.calibration import DESCRIPTION, TrackOptions
from epuck_sim.overhead.camera import Frame
from epuck_sim.overhead.filming import (
    AGENTS_MARGIN_PX,
    AGENTS_PX,
    SAMPLES,
    Captions,
    VirtualCamera,
    describe_film,
    film_recording,
    film_trial,
)
from epuck_sim.overhead.render import ExposureSample
from epuck_sim.overhead.track import track_film
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.recording import Level
from epuck_sim.recording.reader import read_recording
from epuck_sim.recording.recorded import Recorded
from epuck_sim.recording.recorder import record
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.overhead import OverheadSection
from epuck_sim.trial.model import run_trial
from tests.cli.films import frames_and_description
from tests.overhead.cameras import ARENA, CLEAN
from tests.overhead.films import passed, read_rings, score_rows

SEED = 4
"""With which flashes last two control steps each, and hardly overlap."""

GIVEN = {
    "name": "small",
    "robots": [{"count": 5, "parameters": {"period_s": 1.0, "flash_fraction": 0.1, "coupling": 1e-6}}],
    "stop": {"max_time_s": 5, "order_parameter": 1},
    "overhead": {"width_px": 240, "height_px": 240, "frames_per_s": 30},
}


def load(**changes: Any) -> EmbodiedScenario:
    scenario = load_scenario({**GIVEN, **changes})
    assert isinstance(scenario, EmbodiedScenario)
    return scenario


def lit_rings(trial: Recorded, frame_s: float, exposure_s: float) -> tuple[FloatArray, ...]:
    """Return (n, 2) cm, in mid-exposure, of the rings lit for a frame's whole exposure, and (m, 2) for a part of it."""
    moments_s = frame_s + 1e-6, frame_s + exposure_s - 1e-6
    first, last = np.searchsorted(trial.time_s, moments_s, side="right") - 1
    on = np.array(trial.ring_on[first : last + 1])
    middle_s = min(frame_s + exposure_s / 2, trial.time_s[-1])
    columns = np.moveaxis(np.array(trial.positions), 0, 2)
    here = np.array([[np.interp(middle_s, trial.time_s, axis) for axis in robot] for robot in columns])
    return here[on.all(axis=0)], here[on.any(axis=0) & ~on.all(axis=0)]


def film_and_record(folder: Path, scenario: EmbodiedScenario) -> None:
    with (
        film_trial(folder / "t.mp4", scenario, SEED) as filming,
        record(folder / "t.rrd", scenario, SEED, Level.POSES) as recording,
    ):
        run_trial(Simulation(scenario, SEED), [filming, recording])


def test_tracker_finds_what_the_simulation_had(tmp_path: Path) -> None:
    scenario = load()
    film_and_record(tmp_path, scenario)
    track = track_film(str(tmp_path / "t.mp4"), TrackOptions(), tmp_path / "rings.csv", passed)
    rows = read_rings(tmp_path / "rings.csv")
    trial, exposure_s = read_recording(tmp_path / "t.rrd"), scenario.overhead.exposure_ms / 1000
    truth = [(time_s, *lit_rings(trial, time_s, exposure_s)) for time_s in track.times_s.tolist()]
    total = score_rows(rows, truth)
    certain = np.array([len(lit_cm) for _, lit_cm, _ in truth])
    possible = certain + [len(part_cm) for *_, part_cm in truth]
    assert (total.missed, total.false) == (0, 0)
    assert total.found >= sum(certain) > 60
    assert total.worst_cm <= 0.2
    assert ((certain <= track.counts) & (track.counts <= possible)).all()
    assert (track.calibration, track.period_s, track.warnings) == (DESCRIPTION, 1.0, ())
    assert track.times_s == pytest.approx(np.arange(round(trial.time_s[-1] * 30) + 1) / 30, abs=1e-4)


def test_agents_are_discs_on_the_floor_of_their_space_and_red_when_they_have_fired(tmp_path: Path) -> None:
    places, flashes = [(10.0, 80.0), (70.0, 30.0)], []
    given = {"agents": {"count": 2, "speed_cm_s": 0}, "start": {"positions_cm": places}, "space": {"side_cm": 100}}
    scenario = load_scenario({"model": "particles", **given, "stop": {"max_cycles": 3}})
    with film_trial(tmp_path / "t.mp4", scenario, 1) as observer:
        simulation = ParticleSimulation(scenario, 1)
        run_trial(simulation, [observer, lambda event, _: flashes.extend((event.time_s, k) for k in event.fired)])
    frames, _ = frames_and_description(tmp_path / "t.mp4")
    assert len(frames) == 1 + int(25 * flashes[-1][0])
    scale, glow_s = (AGENTS_PX - 2 * AGENTS_MARGIN_PX) / 100, 0.075 * scenario.clocks.period_s
    for frame in frames:
        for agent, (x_cm, y_cm) in enumerate(places):
            column, row = (round(AGENTS_MARGIN_PX + scale * cm) for cm in (x_cm, 100 - y_cm))
            red, green, _ = np.median(frame.picture[row - 6 : row + 7, column - 6 : column + 7], axis=(0, 1))
            lit = any(0 < frame.time_s - at_s < glow_s for at_s, fired in flashes if fired == agent)
            assert (red > 150, green > 90) == (lit, not lit)


def test_film_says_how_many_flash_and_in_which_period() -> None:
    never = {"count": 4, "controller": "constant"}
    for groups, robots, period_s in [
        ([{"count": 3}, {"count": 4}], 7, 5.0),
        ([{"count": 3}, {"count": 4, "parameters": {"period_s": 2.0}}], 7, None),
        ([{"count": 3}, never], 3, 5.0),
        ([never], None, None),
    ]:
        description = describe_film(load(robots=groups), SEED)
        assert (description["robots"], description["period_s"]) == (robots, period_s)


def frame(time_s: float) -> Frame:
    return Frame(time_s, np.full((720, 960, 3), 90, np.uint8))


@pytest.fixture
def written(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Texts that are written into frames."""
    texts: list[str] = []

    def put(_: Any, text: str, *style: Any) -> None:
        if (0, 0, 0) not in style:  # the letters themselves, not their edges
            texts.append(text)

    monkeypatch.setattr("epuck_sim.overhead.filming.cv2.putText", put)
    return texts


def test_a_frame_says_what_the_trial_had_come_to(written: list[str]) -> None:
    captions = Captions(start_s=2.0)
    for state in ((0.0, 0, None), (0.5, 1, 0.25), (1.0, 2, 0.75), (1.5, 2, 0.75)):
        captions.add(*state)
    for time_s in (1.0, 2.4, 2.5, 2.9, 3.25, 9.0):
        captions.write(frame(time_s))
    first, second = "   cycle 1   order parameter 0.25", "   cycle 2   order parameter 0.75"
    assert written == ["0.0 s", "0.4 s", f"0.5 s{first}", f"0.9 s{first}", f"1.2 s{second}", f"7.0 s{second}"]


def test_letters_are_white_edged_in_black_in_the_upper_left_corner() -> None:
    plain = frame(1.0)
    picture = Captions(0.0).write(plain).picture
    changed = (picture != 90).any(axis=-1)
    assert changed[:50].any()
    assert not changed[50:].any()
    assert picture.max() == 255
    assert picture.min() < 10
    assert (plain.picture == 90).all()


@pytest.mark.parametrize("light", ["lit", "dark"])
def test_a_trial_and_its_recording_have_the_same_captions_in_the_light_alone(tmp_path, written, light: str) -> None:
    overhead = {"width_px": 160, "height_px": 160, "frames_per_s": 5, "light": light}
    scenario = load(robots=[{"count": 3, "parameters": {"period_s": 1.0}}], overhead=overhead)
    film_and_record(tmp_path, scenario)
    live = list(written)
    written.clear()
    film_recording(tmp_path / "t.rrd", [], tmp_path / "r.mp4", passed)
    assert live == written
    assert len(live) == (len(frames_and_description(tmp_path / "t.mp4")[0]) if light == "lit" else 0)
    assert any("order parameter" in text for text in live) == (light == "lit")


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


@pytest.mark.parametrize(("rate", "lit_s", "first_s"), [(1.0, 0.0, 0.0), (29.97, 2.0, 0.0), (60.0, 0.0, 100.0)])
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


@pytest.mark.parametrize(("step", "is_on"), [(3, True), (6, False), (29, True)])
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
    for number in range(1, 50):
        list(camera.observe(number * 0.02, STILL, OFF))
    assert len(camera._steps) <= 5
    assert all((sample.poses == STILL).all() and not sample.ring_on[0] for sample in spied[0][0])
