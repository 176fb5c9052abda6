"""A trial that runs and its recording give the same film, whose pictures are as the camera model has them."""

import json
import math
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

from epuck_sim import epuck
from epuck_sim.arena import make_arena, make_floor
from epuck_sim.arrays import FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import ScenarioError
from epuck_sim.overhead import filming, render
from epuck_sim.overhead.calibration import DESCRIPTION, TrackOptions
from epuck_sim.overhead.camera import WALL_HEIGHT_CM, CameraModel, Frame, LensFile, save_lens, simple_lens
from epuck_sim.overhead.filming import SAMPLES, Captions, VirtualCamera, film_recording, film_trial
from epuck_sim.overhead.render import ArenaView, ExposureSample, dimming
from epuck_sim.overhead.track import track_film
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.recording.reader import Recorded, read_recording
from epuck_sim.recording.recorder import record
from epuck_sim.scenario.arena import OverheadSection
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial
from tests.overhead.cameras import ARENA, CLEAN, EMPTY, make_renderer, painted, pixel_at, shot, standing
from tests.overhead.films import frames_and_description, passed, read_rings, score_rows

SEED = 4  # with which flashes last two control steps each, and hardly overlap


def load(**changes: Any) -> EmbodiedScenario:
    given = {
        "name": "small",
        "robots": [{"count": 5, "parameters": {"period_s": 1.0, "flash_fraction": 0.1, "coupling": 1e-6}}],
        "stop": {"max_time_s": 5, "order_parameter": 1},
        "overhead": {"width_px": 240, "height_px": 240, "frames_per_s": 30},
    }
    return load_scenario(given | changes)


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
    with film_trial(folder / "t.mp4", scenario, SEED) as film, record(folder / "t.rrd", scenario, SEED, "poses") as log:
        run_trial(Simulation(scenario, SEED), [film, log])


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
    scale, glow_s = (filming.AGENTS_PX - 2 * filming.AGENTS_MARGIN_PX) / 100, 0.075 * scenario.clocks.period_s
    for frame in frames:
        for agent, (x_cm, y_cm) in enumerate(places):
            column, row = (round(filming.AGENTS_MARGIN_PX + scale * cm) for cm in (x_cm, 100 - y_cm))
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
        ([{"count": 3}, {"count": 4, "present": False}], 3, 5.0),
    ]:
        description = filming.describe_film(load(robots=groups), SEED)
        assert (description["robots"], description["period_s"]) == (robots, period_s)
        assert description["arena_cm"] == [60, 60]
    grows = load(schedule=[{"at_s": 1, "set": {"arena.width_cm": 80}}])
    assert filming.describe_film(grows, SEED)["arena_cm"] == [80, 60]


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
        captions.write(Frame(time_s, np.full((720, 960, 3), 90, np.uint8)))
    first, second = "   cycle 1   order parameter 0.25", "   cycle 2   order parameter 0.75"
    assert written == ["0.0 s", "0.4 s", f"0.5 s{first}", f"0.9 s{first}", f"1.2 s{second}", f"7.0 s{second}"]


def test_letters_are_white_edged_in_black_in_the_upper_left_corner() -> None:
    plain = Frame(1.0, np.full((720, 960, 3), 90, np.uint8))
    picture = Captions(0.0).write(plain).picture
    changed = (picture != 90).any(axis=-1)
    assert changed[:50].any()
    assert not changed[50:].any()
    assert picture.max() == 255
    assert picture.min() < 10
    assert (plain.picture == 90).all()


@pytest.mark.parametrize(("light", "faults"), [("lit", []), ("lit", ["ring_dead"]), ("dark", [])])
def test_a_trial_and_its_recording_have_the_same_captions_in_the_light_alone(tmp_path, written, light, faults) -> None:
    overhead = {"width_px": 160, "height_px": 160, "frames_per_s": 5, "light": light}
    of_reference = [{"kind": kind, "robots": [0]} for kind in faults]
    groups = [{"count": 3, "parameters": {"period_s": 1.0}}]
    scenario = load(robots=groups, overhead=overhead, faults=of_reference)
    film_and_record(tmp_path, scenario)
    live = list(written)
    written.clear()
    film_recording(tmp_path / "t.rrd", [], tmp_path / "r.mp4", passed)
    assert live == written
    assert len(live) == (len(frames_and_description(tmp_path / "t.mp4")[0]) if light == "lit" else 0)
    assert any("order parameter" in text for text in live) == (light == "lit")


def test_a_film_through_a_lens_of_a_file_describes_that_lens(tmp_path) -> None:
    film_and_record(tmp_path, load(overhead={"width_px": 160, "height_px": 160}))
    lens = simple_lens(160, 160, 150.0, 0.01)
    save_lens(tmp_path / "lens.json", LensFile(width_px=160, height_px=160, **lens._asdict()))
    film_recording(tmp_path / "t.rrd", [], tmp_path / "l.mp4", passed, tmp_path / "lens.json")
    _, described = frames_and_description(tmp_path / "l.mp4")
    assert (described["overhead"], described["lens"]) == (None, json.loads(json.dumps(lens._asdict())))


STILL = np.array([[30.0, 30.0, 0.0]])
OFF = np.array([False])
Spied = list[tuple[list[ExposureSample], bool]]  # samples that were to be rendered, and whether the room was lit


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

    def note(samples: Any, *, room_is_lit: bool) -> Any:
        asked.append((list(samples), room_is_lit))
        return 3 * [np.zeros((2, 2), np.uint8)]

    monkeypatch.setattr(filming, "Renderer", lambda *_: asked.clear() or SimpleNamespace(render=note))
    return asked


@pytest.mark.parametrize(("rate", "lit_s", "first_s"), [(1.0, 0.0, 0.0), (29.97, 2.0, 0.0), (60.0, 0.0, 100.0)])
@pytest.mark.usefixtures("spied")
def test_frames_begin_at_multiples_of_their_interval(rate: float, lit_s: float, first_s: float) -> None:
    section = OverheadSection(frames_per_s=rate, exposure_ms=10, lit_start_s=lit_s)
    frames = shoot(section, flashing(lambda _: False, first_s=first_s))
    assert [frame.time_s for frame in frames] == [number / rate for number in range(len(frames))]
    assert len(frames) == math.floor((lit_s + 3.0) * rate + 1e-6) + 1
    assert list(VirtualCamera(section, ARENA, 0).finish()) == []


def test_frame_comes_as_soon_as_its_exposure_has_ended_and_what_is_given_is_copied_and_forgotten(spied) -> None:
    camera = VirtualCamera(OverheadSection(frames_per_s=10, exposure_ms=50), ARENA, 0)
    given_at = [[frame.time_s for frame in camera.observe(t, STILL, OFF)] for t in (0.0, 0.04, 0.05, 0.1, 0.2)]
    assert given_at == [[], [], [0.0], [], [0.1]]
    camera.observe(0.25, STILL, OFF)
    assert [frame.time_s for frame in camera.observe(0.35, STILL, OFF)] == [0.2, 0.3]  # those not asked for, too
    assert not list(camera.finish())
    camera = VirtualCamera(OverheadSection(frames_per_s=15), ARENA, 0)
    poses, on = STILL.copy(), OFF.copy()
    list(camera.observe(0.0, poses, on))
    poses[:], on[:] = 0, True
    for number in range(1, 50):
        list(camera.observe(number * 0.02, STILL, OFF))
    assert len(camera._steps) <= 5
    assert all((sample.poses == STILL).all() and not sample.ring_on[0] for sample in spied[0][0])


@pytest.mark.parametrize(("step", "is_on"), [(3, True), (6, False), (29, True)])
def test_ring_switched_at_the_beginning_of_a_frame_is_switched_in_it(step: int, is_on: bool) -> None:
    section = OverheadSection(frames_per_s=10, **CLEAN, width_px=64, height_px=64)
    frames = shoot(section, flashing(lambda n: (n >= step) == is_on))
    red = [frame.picture[..., 0].max() > 200 for frame in frames]
    assert red == [(number >= step) == is_on for number in range(len(frames))]


def test_film_begins_lit_with_rings_off_and_a_ring_switched_on_in_mid_exposure_gives_half_its_light(spied) -> None:
    shoot(OverheadSection(lit_start_s=2, frames_per_s=10), flashing(lambda _: True, 1.0))
    assert [is_lit for _, is_lit in spied] == [True] * 20 + [False] * 11
    assert [any(each.ring_on[0] for each in samples) for samples, _ in spied] == [False] * 20 + [True] * 11
    assert all((sample.poses == STILL).all() for samples, _ in spied for sample in samples)
    shoot(OverheadSection(frames_per_s=5, exposure_ms=200), flashing(lambda number: number == 3, 1.0))
    assert [sum(bool(each.ring_on[0]) for each in samples) / SAMPLES for samples, _ in spied] == [0, 0.5, 0, 0, 0, 0]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.floats(0.05, 0.5), st.floats(1, 30), st.floats(-12.8, 12.8), st.floats(-4, 4))
def test_robots_move_evenly_from_step_to_step(spied: Spied, step_s, rate, speed, turning) -> None:
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


def slow_picture(camera: CameraModel, samples: list[ExposureSample], section: OverheadSection) -> np.ndarray:
    """Return (rows, columns, 3) levels by the formula of a ring, at each pixel for each ring and its mirror images."""
    shown = camera.plane_map(epuck.RING_HEIGHT_CM).astype(float)
    light = np.zeros(shown.shape[:2])
    for sample in samples:
        for x, y, heading in sample.poses[sample.ring_on]:
            mirrored = [(-x, y, math.pi - heading), (120 - x, y, math.pi - heading)]
            mirrored += [(x, -y, -heading), (x, 120 - y, -heading)]
            for share, (ring_x, ring_y, ahead) in [(1.0, (x, y, heading)), *((section.gloss, at) for at in mirrored)]:
                across = shown - (ring_x, ring_y)
                off = np.abs(np.hypot(across[..., 0], across[..., 1]) - epuck.RING_RADIUS_CM)
                angle = np.arctan2(across[..., 1], across[..., 0]) - ahead
                leds = 1 - render.DEPTH * (1 - np.cos(8 * angle)) / 2
                haze = section.bloom * np.exp(-off / render.FADE_CM)
                light += share * (leds * np.exp(-0.5 * (off / render.WIDTH_CM) ** 2) + haze) / len(samples)
    light *= section.gain * section.exposure_ms / render.NOMINAL_EXPOSURE_MS
    light *= dimming(section.width_px, section.height_px, section.vignetting)
    return np.minimum(light[..., None] * render.COLOUR_LEVELS, 255)


def test_brightness_is_that_of_the_formula_at_each_pixel() -> None:
    """Rings that move, go on and off in an exposure, and overlap; beyond half a level, haze is cut off."""
    poses = np.array([(21.0, 37.0, 0.8), (27.0, 36.0, -2.0), (5.0, 20.0, 0.3)])  # the last one behind a wall
    later = ExposureSample(poses + np.array([0.3, 0, 0.3]), np.array([True, True, True]))
    samples = [ExposureSample(poses, np.array([True, False, True])), later]
    for given_settings in [
        {"exposure_ms": 4.0, "bloom": 0.1, "width_px": 320, "height_px": 180},
        {"exposure_ms": 2.0, "bloom": 0.5, "vignetting": 0.5},
        {"exposure_ms": 1000.0, "frames_per_s": 1},
        {"gain": 0.2, "bloom": 0.1, "gloss": 0.5, "field_of_view_deg": 45.0},
        {"gain": 6.0},
        {"exposure_ms": 4.0, "lens": "fisheye", "height_cm": 40.0},
        {"exposure_ms": 4.0, "tilt_deg": 20.0, "turn_deg": 30.0},
    ]:
        section = OverheadSection(**CLEAN | {"width_px": 240, "height_px": 240} | given_settings)
        camera, renderer = make_renderer(EMPTY, **section.model_dump())
        expected = slow_picture(camera, samples, section)
        assert expected.max() > 100, given_settings
        off = np.abs(painted(renderer, samples, False) - expected).max()
        assert off < 0.6 + 0.5 * 2 * bool(section.bloom), given_settings


def test_vignetting_darkens_the_corners_blur_keeps_the_light_and_the_dark_is_noise_of_the_seed() -> None:
    kept = dimming(640, 480, 0.3)
    assert kept[[0, 0, -1, -1], [0, -1, 0, -1]] == pytest.approx(0.7, abs=1e-6)
    assert kept[239:241, 319:321] == pytest.approx(1, abs=1e-5)
    assert kept[240, 0] == pytest.approx(1 - 0.3 * 640**2 / 800**2, abs=1e-5)
    sharp, soft = (shot((30, 30, 0), exposure_ms=4.0, blur_px=blur)[1] for blur in (0, 3))
    assert soft.max() < 0.8 * sharp.max()
    assert soft[..., 0].sum(dtype=float) == pytest.approx(sharp[..., 0].sum(dtype=float), rel=0.03)
    _, picture = shot((20, 20, 0), lit=False, noise_levels=4)
    above = picture[picture > 0]
    assert len(above) / picture.size == pytest.approx(0.5 - 0.05, abs=0.01)  # what rounds to 0 is 1 in 10
    assert math.sqrt((above.astype(float) ** 2).mean()) == pytest.approx(4.2, abs=0.1)
    assert not shot((20, 20, 0), lit=False)[1].any()
    _, noisy = make_renderer(**CLEAN | {"noise_levels": 10.0})
    shots = [painted(noisy, standing(), True).astype(float) for _ in range(2)]
    floor = (slice(150, 330), slice(150, 330))
    rest = (shots[0] - shot(room=True)[1])[floor]
    assert rest.std() == pytest.approx(10, rel=0.03)
    assert abs(rest.mean()) < 0.5
    assert (shots[1] - shots[0])[floor].std() == pytest.approx(10 * math.sqrt(2), rel=0.03)

    def drawn(seed: int) -> list[bytes]:
        _, renderer = make_renderer(seed=seed, width_px=120, height_px=120)
        return [painted(renderer, standing((20, 20, 1)), room).tobytes() for room in (True, False, False)]

    assert drawn(3) == drawn(3)
    assert drawn(3) != drawn(4)


@pytest.mark.parametrize("exposure_ms", [5, 60])
def test_lit_room_shows_each_thing_in_its_grey(exposure_ms: int) -> None:
    camera, picture = shot((10, 20, 0), room=True, lit=False, exposure_ms=exposure_ms)
    for grey, places in {
        render.FLOOR: [(30, 30, 0), (0.5, 0.5, 0)],
        render.OBSTACLE: [(45, 45, 0), (48, 45, 0), (15, 45, 0)],
        render.WALL_FACE: [(0, 30, 3), (60, 30, 3), (30, 0, 3), (30, 60, 3)],
        render.WALL_TOP: [(-0.5, 30, WALL_HEIGHT_CM), (30, 60.5, WALL_HEIGHT_CM)],
        render.BODY_TOP: [(10, 20 + 3, epuck.HEIGHT_CM)],
    }.items():
        for place in places:
            assert (picture[pixel_at(camera, *place)] == grey).all(), place
    assert (picture[0, 0] == render.TABLE).all()


def test_bodies_stand_upright_with_marks_that_point_ahead_hide_others_and_are_cut_off_at_the_edge() -> None:
    camera, picture = shot((50, 30, 2.5), room=True, lit=False, distortion=0)
    for ahead, grey in ((2.0, render.HEADING_MARK), (-2.0, render.BODY_TOP)):
        spot = (50 + ahead * math.cos(2.5), 30 + ahead * math.sin(2.5), epuck.HEIGHT_CM)
        assert (picture[pixel_at(camera, *spot)] == grey).all()
    assert (picture[pixel_at(camera, 50 - 3.65, 30, 1.0)] == render.BODY_SIDE).all()  # towards the picture's middle
    across, body = picture[pixel_at(camera, 50, 30)[0], :, 0], (render.BODY_SIDE, render.BODY_TOP, render.HEADING_MARK)
    columns = np.flatnonzero(np.isin(across, body))
    ends = camera.project(np.array([(50 - 3.7, 30, 0.0), (50 + 3.7, 30, epuck.HEIGHT_CM)]))[:, 0]
    assert np.abs(columns[[0, -1]] - ends).max() <= 1
    wide = make_arena(120, 40, [], [])
    outer, inner = (47.4, 30.0, math.pi), (54.8, 30.0, math.pi)
    for poses in ((inner, outer), (outer, inner)):
        camera, picture = shot(*poses, arena=wide, room=True, lit=False, width_px=640, height_px=240)
        assert (picture[pixel_at(camera, 54.8 - 3.5, 30, epuck.HEIGHT_CM)] == render.BODY_TOP).all()
    assert (picture[pixel_at(camera, 119, 39)] == render.FLOOR).all()
    assert (picture[pixel_at(camera, 60, 40, 3)] == render.WALL_FACE).all()
    inside, narrow = ((30, 30, 0), (15.5, 30, 0)), {"field_of_view_deg": 15, "width_px": 120, "height_px": 120}
    for room in (False, True):
        seen = [shot(*inside, *beyond, room=room, **narrow)[1] for beyond in ([(3.7, 3.7, 0)], [])]
        assert np.array_equal(*seen)


def test_a_floor_is_as_grey_as_it_is_bright_and_ambient_light_shows_the_room_as_in_the_light_but_darker() -> None:
    picture = np.array([[0, 255]], np.uint8)
    arena = replace(make_arena(60, 60, [], []), floor=make_floor(1, [(0.2, (50, 50, 5)), (0.6, (59, 30, 4))], picture))
    camera, grey = shot(arena=arena, room=True)
    for place, level in {(10, 30): 0, (40, 30): 1, (50, 52): 0.2, (58, 30): 0.6}.items():
        assert (grey[pixel_at(camera, *place)] == round(level * render.FLOOR)).all(), place
    assert (grey[pixel_at(camera, 60, 30, 3)] == render.WALL_FACE).all()
    dim, lit = shot((20, 20, 0), lit=False, ambient=0.25)[1], shot((20, 20, 0), lit=False, room=True)[1]
    assert np.abs(dim - lit * 0.25).max() <= 1


def test_lamps_are_bright_dots_in_the_light_and_points_shine_at_the_leds_and_not_between() -> None:
    """The camera hangs 110 cm above (30, 30), so that a lamp at half of that seems twice as far from there."""
    lamps = np.array([(40, 30, 55, 1), (30, 35, 0.1, 2), (20, 20, 110, 1)], float)
    arena = replace(make_arena(60, 60, [], []), lamps=lamps)
    camera, grey = shot((30, 35, 0), arena=arena, room=True, lit=False)
    shown = np.zeros(grey.shape[:2], bool)
    for x, y, radius in ((50, 30, 1.5), (30, 35, 0.75)):
        shown |= np.hypot(*np.moveaxis(camera.plane_map(0.0) - (x, y), -1, 0)) <= radius
    assert (grey.min(axis=-1) == 255).sum() == pytest.approx(shown.sum(), rel=0.1)
    assert (grey[pixel_at(camera, 50, 30)] == 255).all()
    assert (grey[pixel_at(camera, 30, 35)] == 255).all()
    assert not shot(arena=arena)[1].any()
    camera, picture = shot((30, 30, 0.2), led_points=True)
    angles = 0.2 + np.arange(16) * math.tau / 16
    places = 30 + epuck.RING_RADIUS_CM * np.column_stack([np.cos(angles), np.sin(angles)])
    levels = [int(picture[pixel_at(camera, *place, epuck.RING_HEIGHT_CM)][0]) for place in places]
    assert min(levels[::2]) > 200
    assert max(levels[1::2]) < 60


def test_bodies_are_dark_lit_rings_red_without_the_cameras_faults_and_kilobots_as_wide_as_they_are() -> None:
    poses = np.array([[15.0, 45.0, 0.0], [45.0, 15.0, 1.0]])
    view = ArenaView("thesis", 200, 200)
    empty = view.draw(np.empty((0, 3)), np.empty(0, bool)).astype(int)
    picture = view.draw(poses, np.array([False, True])).astype(int)
    np.testing.assert_array_equal(view.draw(poses, [0, 1]), picture)  # numbers, as policies and tables have them
    places = np.argwhere(np.abs(picture - empty).max(axis=-1) > 20) < 100
    assert set(map(tuple, places.tolist())) == {(True, True), (False, False)}
    redness = picture[..., 0] - picture[..., 1]
    assert redness[:100, :100].max() == 0
    assert redness[100:, 100:].max() > 100
    scenario = load_scenario("obstacles", ["overhead.noise_levels=20", "overhead.blur_px=5"])
    view = ArenaView(scenario, width_px=120, height_px=80)
    lit = np.array([True, False])
    first = view.draw(poses, lit)
    assert first.shape == (80, 120, 3)
    np.testing.assert_array_equal(view.draw(poses, lit), first)
    np.testing.assert_array_equal(ArenaView("obstacles", 120, 80).draw(poses, lit), first)
    for refused, said in ((scenario, "width_px"), ("particles", "model is 'particles'")):
        with pytest.raises(ScenarioError, match=said):
            ArenaView(refused, width_px=101)

    def drawn(robot: str) -> tuple[int, int]:
        """Return the number of pixels that show a robot, and of those that are red if it is lit."""
        scenario = load_scenario({"robot": robot, "robots": [{"signal": {"kind": "radio"}}]})
        view = ArenaView(scenario, 400, 400)
        pose = np.array([[30.0, 30.0, 0.3]])  # below the camera, which sees no side
        empty = view.draw(pose[:0], np.zeros(0, bool)).astype(int)
        dark, lit = (view.draw(pose, np.array([on])).astype(int) for on in (False, True))
        red = lit[..., 0] - lit[..., 1] > 100
        return int((np.abs(dark - empty).max(axis=-1) > 20).sum()), int(red.sum())

    (epuck_px, ring_px), (kilobot_px, led_px) = drawn("epuck"), drawn("kilobot")
    assert kilobot_px / epuck_px == pytest.approx((1.65 / 3.7) ** 2, rel=0.1)
    assert 0 < led_px < 0.3 * ring_px
