"""A recording of robots holds what the simulation's arrays held, as rerun's own reader and ours find it."""

import json
import subprocess
from collections import Counter
from importlib.metadata import version
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from epuck_sim import RecordingError, Scenario, ScenarioError, Simulation, TrialResult, load_scenario, record, run_trial
from epuck_sim.embodied.observers import find_sightings, make_scene
from epuck_sim.embodied.step import Step, memory_values
from epuck_sim.recording import Level, layers, recorder, series
from epuck_sim.recording.layers import UNBOUNDED_VIEW_CM, row_numbers
from epuck_sim.recording.reader import Recorded, read_recording
from epuck_sim.recording.recorder import arrangement_of, make_layout
from epuck_sim.recording.rerun import PROGRAM, SEAL, run_rerun
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.particles import ParticleScenario
from epuck_sim.util.provenance import versions
from epuck_sim.util.yaml_io import parse_yaml
from tests.cli.commands import call
from tests.embodied.scenes import directions_of
from tests.recording.recordings import Found, Watched, recorded

SUMMARY = {"/now", "/flashes", "/order/steps", "/order/firings", "/order/threshold"}
POSES = SUMMARY | {"/phases", "/phase_lead", "/arena/robots", "/arena/headings"}
NUMBERS = {f"/arena/numbers/{robot}" for robot in range(10)}
SENSED = {"/wheels", "/infrared", "/camera/rows", "/camera/space_time"}
FULL = POSES | SENSED | {"/arena/views", "/arena/sightings", "/arena/contacts"}
MOVING = {Level.SUMMARY: SUMMARY, Level.POSES: POSES | NUMBERS, Level.FULL: FULL | NUMBERS}

SHOWN: dict[str, Any] = parse_yaml(
    """
mixed:
  arena: {width_cm: 90, height_cm: 70, obstacles: [{shape: circle, x_cm: 45, y_cm: 35, radius_cm: 5}]}
  robots:
  - {count: 3, camera: {pixels: 31, field_of_view_deg: 100, central_pixels: 11}}
  - count: 2
    controller: constant
    parameters: {ring_on: true, left_cm_s: 2, right_cm_s: 1}
    camera: {pixels: 12, field_of_view_deg: 300, range_cm: 25}
  - {count: 2, parameters: {period_s: 3}, infrared: {distance: firmware_table}}
  stop: {reference_robot: 6, metric: reference}
dazzled:  # robots that fire again while their rings are lit
  robots: [{parameters: {flash_fraction: 0.15, coupling: 10, speed_cm_s: 2}}]
frozen:  # a ring that stays lit with one phase fires once
  robots: [{count: 3, memory: {phase_ms: [4900, 4900, 2400]}}]
  faults: [{kind: oscillator_frozen, robots: [1], at_s: 0.2}]
unsure: {robots: [{count: 2, controller: constant}, {count: 4}]}  # the reference is no oscillator
kilobots:
  robot: {kind: kilobot, camera: {forward_cm: 0.5}}
  robots: [{count: 20, parameters: {period_s: 1.0}}]
  arena: {width_cm: 25, height_cm: 25}
""",
    "scenarios",
)
CASES = {
    "thesis": (15, {"BUFFER_ROWS": 73}),
    "pair": (400, {"BUFFER_S": 1}),  # which is synchronised before
    "mixed": (10, {"BUFFER_ROWS": 73}),
    "dazzled": (4, {"BUFFER_ROWS": 1}),
    "frozen": (3, {"BUFFER_S": 1}),
    "spotlight": (3, {"BUFFER_ROWS": 73}),
    "push": (5, {"BUFFER_S": 1}),
    "arc": (5, {}),
    "unsure": (7, {}),
    "kilobots": (4, {"BUFFER_S": 1}),
}
"""Longest time, s, and buffers in which scenarios are recorded: chunks are one window, a second, or so many rows."""


@pytest.fixture(scope="module", params=CASES)
def trial(request, tmp_path_factory) -> SimpleNamespace:
    """Return a trial that was recorded, and the same one as it was watched without a recorder."""
    longest_s, window = CASES[request.param]
    scenario = load_scenario(SHOWN.get(request.param, request.param), [f"stop.max_time_s={longest_s}"])
    path, beside, alone = tmp_path_factory.mktemp("recording") / "t.rrd", Watched(), Watched()
    with pytest.MonkeyPatch.context() as patch:
        for name, value in window.items():
            patch.setattr(recorder, name, value)
        result = recorded(path, scenario, 2**64 + 5, Level.FULL, beside)
        of_time, of_rows = recorder.BUFFER_S * scenario.timing.control_hz, recorder.BUFFER_ROWS // scenario.population
    results = result._replace(wall_s=0), run_trial(Simulation(scenario, 2**64 + 5), [alone])._replace(wall_s=0)
    made = {"window": max(1, min(of_time, of_rows)), "found": Found(path), "read": read_recording(path)}
    return SimpleNamespace(scenario=scenario, beside=beside, watched=alone, results=results, **made)


def test_a_recorded_trial_is_the_same_trial_each_step_has_its_time_and_each_chunk_is_a_flushed_buffer(trial) -> None:
    recorded_result, result = trial.results
    assert recorded_result == result
    assert trial.beside.is_like(trial.watched)
    read = trial.read
    assert (read.scenario, read.seed, read.level) == (trial.scenario, 2**64 + 5, Level.FULL)
    assert read.versions == {**versions(), "rerun": version("rerun-sdk")}
    assert (read.cycles, read.synchronised) == (result.cycles, result.t_sync_cycles is not None)
    step_ns = 1_000_000 * trial.scenario.timing.step_ms
    steps = [step * step_ns for step in range(trial.results[1].steps)]
    rare = {"/flashes", "/order/firings", "/phase_lead", "/order/threshold", "/camera/space_time", "/now"}
    for entity in FULL - rare:
        assert trial.found.times(entity) == steps, entity
    full, left = divmod(len(steps), trial.window)
    rows = [batch.num_rows for batch in trial.found.moving["/order/steps"]]
    assert rows == [trial.window] * full + [left] * (left > 0)
    threshold = trial.found.times("/order/threshold")
    assert (threshold[0], threshold[-1]) == (0, steps[-1])
    assert set(trial.found.array("/order/threshold", "Scalars:scalars").ravel()) == {0.95}


def test_poses_phases_rings_wheels_cameras_and_infrared_distances_are_those_of_the_robots(trial) -> None:
    read, watched, poses = trial.read, trial.watched, trial.watched["poses"]
    np.testing.assert_array_equal(read.time_s, [step.time_s for step in watched.steps])
    np.testing.assert_array_equal(read.positions, poses[..., :2].astype(np.float32), strict=True)
    np.testing.assert_array_equal(read.phase_ms, watched["phase_ms"], strict=True)
    np.testing.assert_array_equal(read.ring_on, watched["ring_on"], strict=True)
    np.testing.assert_allclose(np.angle(np.exp(1j * (read.headings - poses[..., 2]))), 0, atol=1e-5)
    assert (np.abs(read.headings) <= np.pi).all()
    vectors = trial.found.array("/arena/headings", "Arrows2D:vectors")
    radii = np.array([kind.radius_cm for kind in trial.scenario.robot_kinds])[:, None]
    np.testing.assert_allclose(vectors, radii * directions_of(poses[..., 2]), rtol=0, atol=1e-6)
    found = trial.found
    steps, count, pixels = watched["camera"].shape
    wheels = found.array("/wheels", "Scalars:scalars")
    np.testing.assert_array_equal(wheels, watched["wheels_cm_s"].reshape(steps, -1), strict=True)
    names = [f"robot {robot} {side}" for robot in range(count) for side in ("left", "right")]
    assert found.static["/wheels"]["SeriesLines:names"] == names
    rows = found.array("/camera/rows", "SegmentationImage:buffer")
    np.testing.assert_array_equal(rows.reshape(steps, count, pixels), watched["camera"])
    distances = np.frombuffer(found.array("/infrared", "DepthImage:buffer").tobytes(), "<u2")
    np.testing.assert_array_equal(distances.reshape(steps, count, 8), watched["distance_mm"])
    for entity, archetype, width in (("/camera/rows", "SegmentationImage", pixels), ("/infrared", "DepthImage", 8)):
        (picture,) = found.static[entity][f"{archetype}:format"]
        assert (picture["height"], picture["width"]) == (count, width)


def test_flashes_are_counted_robot_by_robot_and_the_order_is_that_of_the_watch(trial) -> None:
    read, watched = trial.read, trial.watched
    flashes = list(zip(read.flash_s.tolist(), read.flash_robot.tolist(), read.flash_cycle.tolist(), strict=True))
    expected, cycles, rings, phases = [], Counter[int](), watched["ring_on"], watched["phase_ms"]
    for row, time_s in enumerate(read.time_s.tolist()):
        for robot in np.flatnonzero(rings[row]).tolist():  # that lights up, or is lit already while the phase falls
            if row == 0 or not rings[row - 1][robot] or phases[row][robot] < phases[row - 1][robot]:
                cycles[robot] += 1
                expected.append((time_s, robot, cycles[robot]))
    assert flashes == expected
    np.testing.assert_array_equal(read.order_parameter, watched.order)
    assert list(zip(read.firing_s.tolist(), read.firing_order.tolist(), strict=True)) == watched.firings
    if watched.firings:
        reference = trial.scenario.stop.reference_robot
        assert read.flash_s[read.flash_robot == reference].tolist() == read.firing_s.tolist()
        assert len(watched.firings) == trial.results[1].cycles > 0
        at = trial.found.times("/order/firings")
        assert trial.found.times("/phase_lead") == at
        groups = [group for group in trial.scenario.robots for _ in range(group.count)]
        periods_ms = 1000 * np.array([group.parameters.get("period_s", np.nan) for group in groups])
        turns = watched["phase_ms"][np.isin(trial.found.times("/phases"), at)] / periods_ms
        lead = trial.found.array("/phase_lead", "Scalars:scalars")
        np.testing.assert_allclose(np.exp(2j * np.pi * (lead - turns + turns[:, [reference]])), 1 + 0 * lead, atol=1e-9)
        assert np.nanmax(np.abs(lead)) <= 0.5


def test_links_are_those_of_the_cameras_and_bodies(trial) -> None:
    watched, scenario, sightings = trial.watched, trial.scenario, trial.read.sightings
    assert sorted(trial.read.contacts.tolist()) == watched.pairs("contacts")
    assert trial.read.links.contact_points.shape == (len(trial.read.contacts), 2)
    assert sorted(sightings[sightings[:, 3] == 1, :3].tolist()) == watched.pairs("sightings")
    scene = make_scene(scenario.robots, scenario.group_kinds, scenario.arena.build())
    assert sorted(sightings[:, :3].tolist()) == sorted(find_sightings(scene, watched["poses"]).tolist())
    with pytest.raises(RecordingError, match="embodied has no pulses; only model: particles has them"):
        _ = trial.read.pulses


def test_a_view_shows_the_outermost_rays_of_the_central_window_up_to_the_walls(trial) -> None:
    strips, poses = trial.found.array("/arena/views", "LineStrips2D:strips").astype(float), trial.watched["poses"]
    eyes = strips[:, :, 1]
    forward_cm = np.array([kind.camera_forward_cm for kind in trial.scenario.robot_kinds])[:, None]
    np.testing.assert_allclose(eyes, poses[..., :2] + forward_cm * directions_of(poses[..., 2]), rtol=0, atol=1e-5)
    views = [group.camera for group in trial.scenario.robots for _ in range(group.count)]
    shares = np.array([(view.central_pixels or view.pixels) / view.pixels for view in views])
    half = np.radians([view.field_of_view_deg for view in views]) * shares / 2
    longest = np.array([view.range_cm or UNBOUNDED_VIEW_CM for view in views])
    walls = trial.scenario.arena.width_cm, trial.scenario.arena.height_cm
    for place, side in ((0, 1), (2, -1)):
        ends = strips[:, :, place]
        lengths = np.hypot(*np.moveaxis(ends - eyes, 2, 0))
        rays = lengths[..., None] * directions_of(poses[..., 2] + side * half)
        np.testing.assert_allclose(ends, eyes + rays, rtol=0, atol=2e-5)
        beyond = np.maximum(-ends, ends - walls).max(axis=2)  # how far outside of the nearest wall
        assert ((np.abs(np.maximum(lengths - longest, beyond)) < 1e-4) | (lengths == 0)).all()
    assert lengths.any()


def test_cones_of_any_signal_show_their_edges_and_those_all_around_are_circles(tmp_path) -> None:
    groups = [
        {"count": 2, "signal": {"kind": "cone", "range_cm": 25, "angle_deg": 100}},
        {"count": 2, "signal": {"kind": "radio", "range_cm": 30, "angle_deg": 270, "of": "emission"}},
        {"count": 2, "signal": {"kind": "radio", "angle_deg": 60}},
        {"count": 2, "signal": {"kind": "radio", "range_cm": 40}},
        {"count": 2, "signal": {"kind": "cone"}},
    ]
    sections = {"arena": {"width_cm": 1000, "height_cm": 1000}, "robots": groups, "stop": {"max_time_s": 2}}
    watched = Watched()
    recorded(tmp_path / "t.rrd", load_scenario(sections), 3, Level.FULL, watched)
    poses, found = watched["poses"], Found(tmp_path / "t.rrd")
    strips = found.array("/arena/views", "LineStrips2D:strips").astype(float)
    np.testing.assert_allclose(strips[:, :, 1], poses[..., :2], atol=1e-4)
    for place, side in ((0, 1), (2, -1)):
        edges = strips[:, :, place] - strips[:, :, 1]
        longest = np.linalg.norm(edges, axis=-1).max(axis=0).reshape(-1, 2).max(axis=1)
        np.testing.assert_allclose(longest, [25, 30, UNBOUNDED_VIEW_CM, 0, 0], atol=1e-3)
        turned = np.exp(1j * (np.arctan2(edges[..., 1], edges[..., 0]) - poses[..., 2]))
        halves = np.repeat(np.radians([50, 135, 30]), 2)
        np.testing.assert_allclose(turned[:, :6], np.exp(1j * side * np.tile(halves, (len(poses), 1))), atol=1e-3)
    centers = found.array("/arena/ranges", "Ellipses2D:centers")
    np.testing.assert_allclose(centers, poses[:, 6:8, :2], atol=1e-4)
    assert found.static["/arena/ranges"]["Ellipses2D:half_sizes"] == [[40, 40]] * 2


@pytest.mark.parametrize(("rows", "robots"), [(recorder.BUFFER_ROWS, 3), (100, 2)])
def test_in_a_picture_of_a_minute_time_runs_down_and_robots_with_room_are_beside(tmp_path, monkeypatch, rows, robots):
    monkeypatch.setattr(layers, "PICTURE_STEPS", 120)
    monkeypatch.setattr(layers, "MAX_COLUMNS", robots * 16 + 10)
    monkeypatch.setattr(recorder, "BUFFER_ROWS", rows)
    watched, stop = Watched(), {"max_time_s": 150, "order_parameter": 1}  # two and a half pictures
    group = {"count": 3, "camera": {"pixels": 12}}
    scenario = load_scenario({"robots": [group], "timing": {"control_hz": 2}, "stop": stop})
    recorded(tmp_path / "t.rrd", scenario, 1, Level.FULL, watched)
    found, camera = Found(tmp_path / "t.rrd"), watched["camera"][:, :robots]
    assert found.times("/camera/space_time") == [minute * 60_000_000_000 for minute in range(3)]
    (picture,) = found.static["/camera/space_time"]["SegmentationImage:format"]
    assert (picture["height"], picture["width"]) == (120, robots * 16)
    for minute, shown in enumerate(found.array("/camera/space_time", "SegmentationImage:buffer")):
        rows, columns = camera[minute * 120 : minute * 120 + 120], shown.reshape(120, robots, 16)
        np.testing.assert_array_equal(columns[: len(rows), :, :12], rows)
        assert rows.any()
        assert not columns[len(rows) :, :, :12].any()
        assert (columns[:, :, 12:] == 2).all()


@pytest.mark.parametrize(
    ("second", "error", "said"),
    [
        ("pair", RecordingError, "a recorder is for one trial"),
        ("thesis", ValueError, r"an observer is for Emb.*\(name='pair'.*the trial is of .*name='thesis'"),
        ({"robots": [{"count": 2}]}, ValueError, "or has other values"),
    ],
)
def test_a_recorder_is_for_its_own_trial_alone(tmp_path, second, error, said) -> None:
    named = load_scenario("pair", ["stop.max_cycles=3", "name=another"])
    path, short = tmp_path / "t.rrd", load_scenario("pair", ["stop.max_cycles=3"])
    with record(path, short, 1, Level.SUMMARY) as observer:
        run_trial(Simulation(named, 1), [observer])
        with pytest.raises(error, match=said):
            run_trial(Simulation(short if second == "pair" else second, 1), [observer])
    assert len(read_recording(path).firing_s) == 2
    with pytest.raises(ScenarioError, match=r"^pair: seed is -1; allowed"), record(path, "pair", -1):
        pass


def static_of(folder: Path, scenario: EmbodiedScenario) -> dict[str, dict[str, Any]]:
    with record(folder / "t.rrd", scenario, 0, Level.POSES):
        pass
    return Found(folder / "t.rrd").static


def test_the_arena_is_shown_with_y_up_and_its_floor_and_lamps_where_they_are(tmp_path) -> None:
    static = static_of(tmp_path, load_scenario("obstacles", ["arena.height_cm=110"]))
    assert static["/arena"]["Transform3D:translation"] == [[0, 110, 0]]
    assert static["/arena"]["Transform3D:mat3x3"] == [[1, 0, 0, 0, -1, 0, 0, 0, 1]]
    assert static["/arena/walls"]["LineStrips2D:strips"] == [[[0, 0], [100, 0], [100, 110], [0, 110], [0, 0]]]
    pillar, bar, wedge = (np.array(strip) for strip in static["/arena/obstacles"]["LineStrips2D:strips"])
    np.testing.assert_allclose(np.hypot(*(pillar - 30).T), 6, rtol=1e-6)
    np.testing.assert_allclose(pillar.mean(axis=0), 30, atol=0.2)
    np.testing.assert_allclose(sorted(np.hypot(*np.diff(bar, axis=0).T)), [4, 4, 30, 30], rtol=1e-5)
    assert wedge.tolist() == [[20, 70], [35, 72], [24, 85], [20, 70]]
    disc = {"shape": "circle", "x_cm": 30, "y_cm": 10, "radius_cm": 10, "brightness": 0.4}
    arena = {"width_cm": 100, "height_cm": 50, "floor": {"patches": [disc]}, "lamps": [{"x_cm": 70, "y_cm": 40}]}
    static = static_of(tmp_path, load_scenario({"arena": arena}))
    floor, lamps = static["/arena/floor"], static["/arena/lamps"]
    levels = np.array(floor["Image:buffer"][0], np.uint8).reshape(512, 1024)
    to_cm = np.array(floor["Transform3D:mat3x3"][0]).reshape(3, 3).T  # columns come first
    for place, level in {(30, 10): 102, (30, 19): 102, (30, 22): 255, (39, 10): 102, (70, 40): 255}.items():
        column, row = np.linalg.solve(to_cm[:2, :2], place - np.array(floor["Transform3D:translation"][0][:2]))
        assert levels[int(row), int(column)] == level, place
    assert lamps["Points2D:positions"] == [[70, 40]]
    assert lamps["Points2D:labels"] == ["30 cm, strength 1"]


def test_a_recording_on_a_floor_whose_picture_is_gone_is_read_without_it(tmp_path) -> None:
    cv2.imwrite(str(tmp_path / "ground.png"), np.array([[0, 255]], np.uint8))
    scenario = load_scenario({"arena": {"floor": {"picture": str(tmp_path / "ground.png")}}})
    static_of(tmp_path, scenario)
    assert read_recording(tmp_path / "t.rrd").scenario == scenario
    (tmp_path / "ground.png").unlink()
    with pytest.warns(UserWarning, match=r"^thesis: the picture of its floor is left out: there is no file .*ground"):
        assert read_recording(tmp_path / "t.rrd").scenario.arena == load_scenario({}).arena
    assert call("plot", tmp_path / "t.rrd").stderr.startswith("note: thesis: the picture of its floor is left out: ")


def test_many_robots_have_no_numbers_beside_them_and_that_of_a_row_is_within_it_left_of_the_picture(tmp_path) -> None:
    for robots in (49, 50):
        swarm = {"arena": {"width_cm": 100, "height_cm": 100}, "robots": [{"count": robots}]}
        drawn = static_of(tmp_path, load_scenario(swarm))
        assert (f"/arena/numbers/{robots - 1}" in drawn) == (robots < 50)
        assert drawn["/arena/robots"]["Points2D:radii"] == [np.float32(3.7)] * robots
    strips = [np.array(strip) for strip in row_numbers(12).strips.as_arrow_array().to_pylist()]
    for row, strip in zip([*range(10), 10, 10, 11, 11], strips, strict=True):
        assert row < strip[:, 1].min() < strip[:, 1].max() < row + 1
        assert strip[:, 0].max() < 0
    assert strips[10][:, 0].max() < strips[11][:, 0].min()


OF_LEVELS = ["stop.max_time_s=12", "stop.order_parameter=1"]


@pytest.fixture(scope="module", params=list(Level))
def of_level(request, tmp_path_factory) -> tuple[Level, Path, TrialResult]:
    path = tmp_path_factory.mktemp("level") / "t.rrd"
    return request.param, path, recorded(path, load_scenario("obstacles", OF_LEVELS), 3, request.param)


def test_each_level_holds_what_it_should_and_no_more_and_says_of_which_trial(of_level) -> None:
    level, path, result = of_level
    found, read = Found(path), read_recording(path)
    assert set(found.moving) == MOVING[level]
    properties = {"/__properties", "/__properties/trial", "/__properties/outcome", SEAL}
    arena = {"/arena", "/arena/walls", "/arena/obstacles", "/legend"} if level is not Level.SUMMARY else set()
    numbers = {"/camera/rows/numbers", "/infrared/numbers"} if level is Level.FULL else set()
    assert set(found.static) == properties | arena | numbers | MOVING[level]
    rows = 0 if level is Level.SUMMARY else 120
    assert found.static["/flashes"]["SeriesPoints:colors"] == [0xE12828FF]  # red
    assert found.static["/order/firings"]["SeriesPoints:colors"] == [0x3C82E6FF]  # blue
    for field, tail in {"phase_ms": (), "positions": (2,), "headings": (), "ring_on": ()}.items():
        assert getattr(read, field).shape == (rows, 10, *tail), field
    assert (len(read.time_s), read.memory) == (120, {})
    for name in ("sightings", "contacts") if level is not Level.FULL else ():
        with pytest.raises(RecordingError, match=f"obstacles: .*level {level} holds no {name}; .*--record-level full"):
            getattr(read, name)
    run_rerun("rrd", "verify", str(path))
    said = found.property("trial")
    assert load_scenario(parse_yaml(said.pop("scenario"), "x")) == load_scenario("obstacles", OF_LEVELS)
    assert json.loads(said.pop("versions")) == {**versions(), "rerun": version("rerun-sdk")}
    assert said == {"format": 1, "level": str(level), "seed": "3"}
    assert (result.cycles > 0, result.censored) == (True, True)
    assert found.property("outcome") == {"cycles": result.cycles, "synchronised": False}


def test_the_layout_is_in_the_file_and_the_viewer_takes_it(of_level) -> None:
    level, path, _ = of_level
    reader = RrdReader(path)
    ((recording,), (layout,)) = reader.recordings(), reader.blueprints()
    assert (recording.application_id, layout.application_id) == ("epuck-sim", "epuck-sim")
    batches = [chunk.to_record_batch().to_pydict() for chunk in reader.store(store=layout).stream().to_chunks()]
    origins = {origin for batch in batches for (origin,) in batch.get("ViewBlueprint:space_origin", [])}
    shown = {entity for entity in MOVING[level] if any(entity.startswith(origin) for origin in origins - {"/"})}
    assert shown == {entity for entity in MOVING[level] if not entity.startswith("/arena")}
    assert all(any(entity.startswith(origin) for entity in {*MOVING[level], "/legend"}) for origin in origins)
    assert ("/" in origins) == (level is not Level.SUMMARY)
    printed = subprocess.run([*PROGRAM, "rrd", "print", str(path)], capture_output=True, text=True, check=True).stdout
    (activation,) = (line for line in printed.splitlines() if line.startswith("BlueprintActivationCommand"))
    assert layout.recording_id in activation
    assert "make_active: true" in activation


def test_a_recording_that_rerun_has_optimised_is_read_the_same(tmp_path, monkeypatch) -> None:
    paths = [tmp_path / f"{name}.rrd" for name in ("whole", "parts", "optimised")]
    for path, rows in zip(paths[:2], (recorder.BUFFER_ROWS, 73), strict=True):
        monkeypatch.setattr(recorder, "BUFFER_ROWS", rows)
        recorded(path, load_scenario("obstacles", ["stop.max_time_s=12"]), 3)
    run_rerun("rrd", "optimize", str(paths[1]), "-o", str(paths[2]))
    chunks = [len(RrdReader(path).store().stream().to_chunks()) for path in paths[1:]]
    assert chunks[0] > chunks[1]
    whole, *others = map(read_recording, paths)
    for read in others:
        for field, value, expected in zip(Recorded._fields, read, whole, strict=True):
            for one, other in zip(value, expected, strict=True) if field == "links" else [(value, expected)]:
                np.testing.assert_array_equal(one, other, err_msg=field)


def test_the_same_trial_is_recorded_alike_and_another_otherwise(tmp_path) -> None:
    scenario = load_scenario("thesis", ["stop.max_time_s=2"])
    given = [(1, Level.FULL), (1, Level.FULL), (2, Level.FULL), (1, Level.POSES)]
    paths = [tmp_path / f"{number}.rrd" for number in range(len(given))]
    for path, (seed, level) in zip(paths, given, strict=True):
        recorded(path, scenario, seed, level)
    unsealed = [str(path.with_suffix(".unsealed.rrd")) for path in paths]  # seals differ: rerun numbers files anew
    for path, left in zip(paths, unsealed, strict=True):
        run_rerun("rrd", "filter", "--drop-entity", SEAL, str(path), "-o", left)
    run_rerun("rrd", "compare", *unsealed[:2])
    for other in unsealed[2:]:
        with pytest.raises(RecordingError, match="rerun rrd compare failed: "):
            run_rerun("rrd", "compare", unsealed[0], other)
    names = [RrdReader(path).recordings()[0].recording_id for path in paths]
    assert names[0] == names[1]
    assert len(set(names)) == 3


@pytest.mark.parametrize("bare", [EmbodiedScenario(), ParticleScenario(model="particles")])
def test_a_trial_of_no_events_has_no_rows_and_what_it_leaves_out_is_written_out(tmp_path, bare: Scenario) -> None:
    with record(tmp_path / "t.rrd", bare, 0, Level.FULL):
        pass
    read = read_recording(tmp_path / "t.rrd")
    assert (read.scenario, read.cycles, read.synchronised) == (load_scenario(bare), 0, False)
    assert {len(value) for value in read if isinstance(value, np.ndarray)} == {0}
    assert not Found(tmp_path / "t.rrd").moving


def test_the_outcome_is_that_of_synchrony_however_long_the_trial_goes_on(tmp_path) -> None:
    result = recorded(tmp_path / "t.rrd", load_scenario("thesis", ["stop.further_cycles=2"]), 2, Level.SUMMARY)
    read = read_recording(str(tmp_path / "t.rrd"))
    assert (read.cycles, read.synchronised) == (result.t_sync_cycles, True)
    assert len(read.firing_s) == result.t_sync_cycles + 2
    texts = Found(tmp_path / "t.rrd").lists("/now", "TextDocument:text")
    assert texts[0] == ["**0 s**, cycle 0: not synchronised"]
    reached = f"T_sync {result.t_sync_cycles} cycles"
    found = [text.partition("**, ")[2] for (text,) in texts if reached in text]
    assert [*dict.fromkeys(found)] == [f"cycle {result.t_sync_cycles + more}: {reached}" for more in range(3)]
    unasked = load_scenario("thesis", ["stop.order_parameter=null", "stop.max_cycles=1"])
    recorded(tmp_path / "t.rrd", unasked, 2, Level.SUMMARY)
    assert Found(tmp_path / "t.rrd").lists("/now", "TextDocument:text")[0] == ["**0 s**, cycle 0"]
    assert "not asked for" in read_recording(tmp_path / "t.rrd")._repr_html_()


def test_a_minute_of_ten_robots_takes_less_than_1100_kb(tmp_path) -> None:
    bytes_of = []
    for seconds in (20, 50):
        recorded(tmp_path / "t.rrd", load_scenario({"stop": {"order_parameter": 1, "max_time_s": seconds}}))
        bytes_of.append((tmp_path / "t.rrd").stat().st_size)
    assert 50_000 < bytes_of[1] - bytes_of[0] < 550_000


def origins(part: rrb.Container | rrb.View) -> set[str]:
    return {part.origin} if isinstance(part, rrb.View) else set().union(*map(origins, part.contents))


def test_what_robots_remember_and_what_changed_is_read_back_and_has_views(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(recorder, "BUFFER_S", 3)  # several chunks
    changing = {
        "robots": [{"count": 3, "controller": "constant"}, {"count": 4}],
        "faults": [{"kind": "ring_dead", "robots": [1, 4], "at_s": 2, "until_s": 4.05}],
        "schedule": [{"at_cycle": 1, "set": {"robots.1.parameters.speed_cm_s": 0}}],
        "stop": {"max_cycles": 2, "order_parameter": None, "reference_robot": 3},
    }
    scenario, fields, rows = load_scenario(changing), ["rotation_time", "phase_ms"], []
    assert series.recorded_fields(scenario, Level.SUMMARY, "phase_ms") == ("phase_ms",)

    def remember(step: Step, _) -> None:
        rows.append([memory_values(step.memories, field) for field in fields])

    result = recorded(tmp_path / "t.rrd", scenario, 1, Level.SUMMARY, remember, memory=[*fields, "phase_ms"])
    read = read_recording(tmp_path / "t.rrd")
    assert list(read.memory) == fields
    for number, field in enumerate(fields):
        assert read.memory[field].tobytes() == np.array([row[number] for row in rows]).tobytes()
    assert np.isnan(read.memory["phase_ms"][:, :3]).all()  # `constant` remembers nothing
    assert np.ptp(read.memory["phase_ms"][:, 3:]) > 1000
    assert [time_s for time_s, _ in read.events] == [event.time_s for event in result.events]
    dead = [f"faults.0: ring_dead {what} in 1, 4" for what in ("begins", "ends")]
    told = [*dead, "schedule.0: robots.1.parameters.speed_cm_s: 0"]
    assert sorted(text for _, text in read.events) == told
    for level in Level:
        whole = make_layout(arrangement_of(scenario, level, fields)).root_container
        assert {"/events", "/memory/phase_ms"} <= origins(whole)
        assert (layers.CAMERA in origins(whole)) == (level is Level.FULL)
        bare = make_layout(arrangement_of(load_scenario("thesis"), level)).root_container
        assert not {"/events", "/memory/phase_ms"} & origins(bare)
