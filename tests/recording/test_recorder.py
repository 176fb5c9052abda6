"""A recording holds what the simulation's arrays held, as rerun's own reader finds it."""

import json
import subprocess
from collections import Counter, defaultdict
from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import numpy as np
import numpy.typing as npt
import pyarrow as pa
import pyarrow.compute as pc
import pytest
from rerun.chunk import RrdReader

from epuck_sim.embodied.observers import find_contacts, make_scene
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step
from epuck_sim.errors import RecordingError
from epuck_sim.recording import Level, recorder
from epuck_sim.recording.layers import robots as layers
from epuck_sim.recording.layers.robots import UNBOUNDED_VIEW_CM
from epuck_sim.recording.process import PROGRAM, run_rerun
from epuck_sim.recording.reader import read_recording
from epuck_sim.recording.recorder import record
from epuck_sim.recording.rrd_file import SEAL
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.trial.model import run_trial
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import versions
from tests.recording.comparing import compare

Array = npt.NDArray[Any]

RADIUS_CM = CAMERA_FORWARD_CM = 3.7

FIELDS = ("poses", "camera", "distance_mm", "wheels_cm_s", "ring_on", "phase_ms")

SUMMARY = {"/now", "/flashes", "/order/steps", "/order/firings", "/order/threshold"}
POSES = SUMMARY | {"/phases", "/phase_lead", "/arena/robots", "/arena/headings"}
NUMBERS = {f"/arena/numbers/{robot}" for robot in range(10)}
FULL = POSES | {
    *("/wheels", "/infrared", "/camera/rows", "/camera/space_time"),
    *("/arena/views", "/arena/sightings", "/arena/contacts"),
}
MOVING = {Level.SUMMARY: SUMMARY, Level.POSES: POSES | NUMBERS, Level.FULL: FULL | NUMBERS}

MIXED = {
    "name": "mixed",
    "arena": {
        "width_cm": 90,
        "height_cm": 70,
        "obstacles": [{"shape": "circle", "x_cm": 45, "y_cm": 35, "radius_cm": 5}],
    },
    "robots": [
        {"count": 3, "camera": {"pixels": 31, "field_of_view_deg": 100, "central_pixels": 11}},
        {
            "count": 2,
            "controller": "constant",
            "parameters": {"ring_on": True, "left_cm_s": 2, "right_cm_s": 1},
            "camera": {"pixels": 12, "field_of_view_deg": 300, "range_cm": 25},
        },
        {"count": 2, "parameters": {"period_s": 3}, "infrared": {"distance": "firmware_table"}},
    ],
    "stop": {"max_time_s": 40, "reference_robot": 6, "metric": "reference"},
}

DAZZLED = {"name": "dazzled", "robots": [{"parameters": {"flash_fraction": 0.15, "coupling": 10, "speed_cm_s": 2}}]}
"""Robots that fire again while their rings are lit."""

SOURCES = {"mixed": MIXED, "dazzled": DAZZLED}


class Watched:
    """An observer that copies what it is shown."""

    def __init__(self) -> None:
        self._fields: dict[str, list[Array]] = {field: [] for field in FIELDS}
        self.order: list[float] = []
        self.firings: list[tuple[int, float]] = []
        self._cycles = 0

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        for field, copies in self._fields.items():
            copies.append(np.array(getattr(step, field)))
        self.order.append(float(watch.measure(step.phase_ms)))
        if watch.cycles > self._cycles and watch.order_parameter is not None:
            self.firings.append((step.number, watch.order_parameter))
        self._cycles = watch.cycles

    def __getitem__(self, field: str) -> Array:
        return np.array(self._fields[field])


class Found:
    """What rerun's reader finds in a file."""

    def __init__(self, path: Path) -> None:
        self.static: dict[str, dict[str, Any]] = defaultdict(dict)
        self.moving: dict[str, list[Any]] = defaultdict(list)
        for chunk in RrdReader(path).store().stream().to_chunks():
            batch = chunk.to_record_batch()
            if chunk.is_static:
                self.static[chunk.entity_path].update({key: each[0] for key, each in batch.to_pydict().items()})
            else:
                self.moving[chunk.entity_path].append(batch)
        for batches in self.moving.values():
            batches.sort(key=lambda batch: batch.column("sim_time")[0].value)

    def property(self, name: str) -> dict[str, Any]:
        columns = self.static[f"/__properties/{name}"].items()
        return {key: each[0] for key, each in columns if not key.startswith("rerun.")}

    def times(self, entity: str) -> list[int]:
        return [time for batch in self.moving[entity] for time in batch.column("sim_time").cast(pa.int64()).to_pylist()]

    def lists(self, entity: str, component: str) -> list[Any]:
        return [row for batch in self.moving[entity] for row in batch.column(component).to_pylist()]

    def array(self, entity: str, component: str) -> Array:
        """Return (rows, ...) values, of as many dimensions as the lists are deep; every list is as long."""
        column = pa.concat_arrays([batch.column(component) for batch in self.moving[entity]])
        shape = [len(column)]
        while pa.types.is_list(column.type) or pa.types.is_fixed_size_list(column.type):
            (length,) = set(pc.list_value_length(column).to_pylist())
            shape.append(length)
            column = column.flatten()
        return column.to_numpy(zero_copy_only=False).reshape(shape)


class Trial(NamedTuple):
    """A trial that was recorded, and the same one as it was watched without a recorder."""

    scenario: EmbodiedScenario
    window: int
    found: Found
    watched: Watched
    result: TrialResult

    @property
    def steps(self) -> int:
        return self.result.steps

    @property
    def ring_before(self) -> Array:
        ring_on = self.watched["ring_on"]
        return np.concatenate([np.zeros_like(ring_on[:1]), ring_on[:-1]])

    @property
    def cameras(self) -> Array:
        """(steps, robots, 2) cm."""
        return self.watched["poses"][..., :2] + CAMERA_FORWARD_CM * towards(self.watched["poses"][..., 2])


def towards(angles: Array) -> Array:
    return np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def recorded(
    path: Path, scenario: EmbodiedScenario, seed: int = 1, level: Level = Level.FULL, *others: Watched
) -> TrialResult:
    with record(path, scenario, seed, level) as observer:
        return run_trial(Simulation(scenario, seed), [observer, *others])


def load(source: str | Mapping[str, Any], seconds: float = 30) -> EmbodiedScenario:
    return load_scenario(source, [f"stop.max_time_s={seconds}"])


WINDOWS = {
    "one window": {},
    "a second": {"BUFFER_S": 1},
    "73 rows": {"BUFFER_ROWS": 73},
    "one step": {"BUFFER_ROWS": 1},
}


@pytest.fixture(
    scope="module",
    params=[
        *(("thesis", 30, window) for window in WINDOWS),
        ("mixed", 40, "73 rows"),
        ("mixed", 40, "one window"),
        ("dazzled", 60, "one step"),
        ("obstacles", 30, "73 rows"),
        ("spotlight", 3, "73 rows"),
        ("push", 5, "a second"),
        ("arc", 5, "one window"),
    ],
    ids=lambda param: f"{param[0]} in {param[2]}",
)
def trial(request, tmp_path_factory) -> Trial:
    source, seconds, window = request.param
    scenario = load(SOURCES.get(source, source), seconds)
    path = tmp_path_factory.mktemp("recording") / "t.rrd"
    with pytest.MonkeyPatch.context() as patch:
        for name, value in WINDOWS[window].items():
            patch.setattr(recorder, name, value)
        recorded(path, scenario)
        of_time, of_rows = recorder.BUFFER_S * scenario.timing.control_hz, recorder.BUFFER_ROWS // scenario.robot_count
    watched = Watched()
    result = run_trial(Simulation(scenario, 1), [watched])
    return Trial(scenario, max(1, min(of_time, of_rows)), Found(path), watched, result)


# --- what every robot did ---------------------------------------------------------------------------


def test_each_step_has_its_time(trial: Trial) -> None:
    step_ns = 1_000_000 * trial.scenario.timing.step_ms
    entities = FULL - {"/flashes", "/order/firings", "/phase_lead", "/order/threshold", "/camera/space_time", "/now"}
    for entity in entities:
        assert trial.found.times(entity) == [step * step_ns for step in range(trial.steps)], entity


def test_a_chunk_holds_a_flushed_buffer(trial: Trial) -> None:
    batches = trial.found.moving["/order/steps"]
    full, left = divmod(trial.steps, trial.window)
    assert [batch.num_rows for batch in batches] == [trial.window] * full + [left] * (left > 0)


def test_discs_are_where_robots_are_in_single_precision(trial: Trial) -> None:
    positions = trial.found.array("/arena/robots", "Points2D:positions")
    assert positions.dtype == np.float32
    np.testing.assert_array_equal(positions, trial.watched["poses"][..., :2].astype(np.float32), strict=True)


def test_discs_are_of_class_1_while_the_ring_is_lit(trial: Trial) -> None:
    classes = trial.found.array("/arena/robots", "Points2D:class_ids")
    np.testing.assert_array_equal(classes, trial.watched["ring_on"].astype(np.uint16), strict=True)


def test_arrows_show_the_headings(trial: Trial) -> None:
    poses = trial.watched["poses"]
    vectors, origins = (trial.found.array("/arena/headings", f"Arrows2D:{part}") for part in ("vectors", "origins"))
    np.testing.assert_allclose(vectors, RADIUS_CM * towards(poses[..., 2]), rtol=0, atol=1e-6, strict=False)
    assert vectors.shape == poses[..., :2].shape
    np.testing.assert_array_equal(origins, poses[..., :2].astype(np.float32), strict=True)


def test_phases_are_those_of_the_controllers(trial: Trial) -> None:
    phases = trial.found.array("/phases", "Scalars:scalars")
    np.testing.assert_array_equal(phases, trial.watched["phase_ms"], strict=True)


def test_wheels_are_left_and_right_of_each_robot(trial: Trial) -> None:
    wheels = trial.found.array("/wheels", "Scalars:scalars")
    np.testing.assert_array_equal(wheels, trial.watched["wheels_cm_s"].reshape(trial.steps, -1), strict=True)
    names = trial.found.static["/wheels"]["SeriesLines:names"]
    assert names == [
        f"robot {robot} {side}" for robot in range(trial.scenario.robot_count) for side in ("left", "right")
    ]


# --- synchrony --------------------------------------------------------------------------------------


def test_the_order_parameter_at_each_step_is_that_of_the_watch(trial: Trial) -> None:
    order = trial.found.array("/order/steps", "Scalars:scalars")
    np.testing.assert_array_equal(order[:, 0], trial.watched.order)


def test_the_order_parameter_at_firings_is_the_one_that_decides(trial: Trial) -> None:
    step_ns = 1_000_000 * trial.scenario.timing.step_ms
    measured = trial.found.lists("/order/firings", "Scalars:scalars")
    firings = list(zip(trial.found.times("/order/firings"), measured, strict=True))
    assert firings == [(step * step_ns, [order]) for step, order in trial.watched.firings]
    if trial.scenario.name in {"thesis", "mixed", "obstacles"}:
        assert len(firings) == trial.result.cycles > 3


def test_the_threshold_lasts_from_the_first_step_to_the_last(trial: Trial) -> None:
    step_ns = 1_000_000 * trial.scenario.timing.step_ms
    times = trial.found.times("/order/threshold")
    assert (times[0], times[-1]) == (0, (trial.steps - 1) * step_ns)
    assert set(trial.found.array("/order/threshold", "Scalars:scalars").ravel()) == {0.95}


def slow_flashes(trial: Trial) -> list[tuple[int, int, int]]:
    """Return time, robot and cycle: a ring that lights up, or that is lit already while the phase falls."""
    step_ns = 1_000_000 * trial.scenario.timing.step_ms
    rings, phases = trial.watched["ring_on"].tolist(), trial.watched["phase_ms"].tolist()
    found, cycles = [], Counter[int]()
    for step in range(trial.steps):
        for robot, is_lit in enumerate(rings[step]):
            was_lit = step > 0 and rings[step - 1][robot]
            if is_lit and (not was_lit or phases[step][robot] < phases[step - 1][robot]):
                cycles[robot] += 1
                found.append((step * step_ns, robot, cycles[robot]))
    return found


def test_flashes_are_counted_robot_by_robot(trial: Trial) -> None:
    robots, cycles = trial.found.lists("/flashes", "Scalars:scalars"), trial.found.lists("/flashes", "cycle")
    flashes = [
        (time, *robot, *cycle) for time, robot, cycle in zip(trial.found.times("/flashes"), robots, cycles, strict=True)
    ]
    assert flashes == slow_flashes(trial)
    if trial.scenario.name == "dazzled":
        assert len(flashes) > (trial.watched["ring_on"] & ~trial.ring_before).sum()


def test_flashes_of_the_reference_are_its_firings(trial: Trial) -> None:
    reference = trial.scenario.stop.reference_robot
    flashes = zip(trial.found.times("/flashes"), trial.found.lists("/flashes", "Scalars:scalars"), strict=True)
    if trial.watched.firings:
        assert [time for time, (robot,) in flashes if robot == reference] == trial.found.times("/order/firings")


# --- what every robot saw ---------------------------------------------------------------------------


def test_camera_rows_are_those_of_the_robots(trial: Trial) -> None:
    rows = trial.found.array("/camera/rows", "SegmentationImage:buffer")
    camera = trial.watched["camera"]
    np.testing.assert_array_equal(rows, camera.reshape(trial.steps, 1, -1).astype(np.uint8), strict=True)
    (picture,) = trial.found.static["/camera/rows"]["SegmentationImage:format"]
    assert (picture["height"], picture["width"]) == camera.shape[1:]
    if trial.scenario.name in {"thesis", "mixed", "obstacles", "spotlight"}:
        assert rows.any()


def test_infrared_distances_are_those_of_the_robots(trial: Trial) -> None:
    buffers = trial.found.array("/infrared", "DepthImage:buffer")
    distances = np.frombuffer(buffers.tobytes(), "<u2").reshape(trial.watched["distance_mm"].shape)
    np.testing.assert_array_equal(distances, trial.watched["distance_mm"])
    assert (distances == 65535).any()
    (picture,) = trial.found.static["/infrared"]["DepthImage:format"]
    assert (picture["height"], picture["width"]) == (trial.scenario.robot_count, 8)


def arrows(trial: Trial) -> tuple[Array, Array, Array, Array]:
    """Return step, observer, robot seen and class of each; the ends of an arrow show which robots it belongs to."""
    parts = [trial.found.lists("/arena/sightings", f"Arrows2D:{part}") for part in ("origins", "vectors", "class_ids")]
    lengths = [[len(row) for row in part] for part in parts]
    assert lengths[0] == lengths[1] == lengths[2]
    steps = np.repeat(np.arange(trial.steps), lengths[0])
    origins, vectors = (np.array([each for row in part for each in row]).reshape(-1, 1, 2) for part in parts[:2])
    from_cameras = np.linalg.norm(trial.cameras[steps] - origins, axis=2)
    from_middles = np.linalg.norm(trial.watched["poses"][steps, :, :2] - origins - vectors, axis=2)
    assert (from_cameras.min(axis=1) < 1e-4).all()
    assert (from_middles.min(axis=1) < 1e-4).all()
    classes = np.array([each for row in parts[2] for each in row], int)
    return steps, from_cameras.argmin(axis=1), from_middles.argmin(axis=1), classes


def test_an_arrow_is_of_class_1_where_the_ring_was_lit_a_step_before(trial: Trial) -> None:
    steps, observers, seen, classes = arrows(trial)
    np.testing.assert_array_equal(classes, trial.ring_before[steps, seen])
    assert (observers != seen).all()
    assert len(np.unique(np.stack([steps, observers, seen]), axis=1).T) == len(steps)
    if trial.scenario.name in {"thesis", "mixed", "obstacles", "spotlight"}:
        assert set(classes) == {0, 1}


def test_robots_with_an_arrow_of_class_1_see_red(trial: Trial) -> None:
    steps, observers, _, classes = arrows(trial)
    sees_lit = np.zeros(trial.watched["ring_on"].shape, bool)
    sees_lit[steps[classes == 1], observers[classes == 1]] = True
    np.testing.assert_array_equal(sees_lit, trial.watched["camera"].any(axis=2))


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
    with record(tmp_path / "t.rrd", scenario := load_scenario(sections), 3) as recorder:
        run_trial(Simulation(scenario, 3), [recorder, watched])
    poses, found = watched["poses"], Found(tmp_path / "t.rrd")
    strips = found.array("/arena/views", "LineStrips2D:strips").astype(float)
    np.testing.assert_allclose(strips[:, :, 1], poses[..., :2], atol=1e-4)
    for place, side in ((0, 1), (2, -1)):
        edges = strips[:, :, place] - strips[:, :, 1]
        longest = np.linalg.norm(edges, axis=-1).max(axis=0).reshape(-1, 2).max(axis=1)
        np.testing.assert_allclose(longest, [25, 30, UNBOUNDED_VIEW_CM, 0, 0], atol=1e-3)
        turned = np.arctan2(edges[..., 1], edges[..., 0]) - poses[..., 2]
        halves = np.repeat(np.radians([50, 135, 30]), 2)
        np.testing.assert_allclose(
            np.exp(1j * turned[:, :6]), np.exp(1j * side * np.broadcast_to(halves, (len(poses), 6))), atol=1e-3
        )
    centers = found.array("/arena/ranges", "Ellipses2D:centers")
    np.testing.assert_allclose(centers, poses[:, 6:8, :2], atol=1e-4)
    assert found.static["/arena/ranges"]["Ellipses2D:half_sizes"] == [[40, 40]] * 2


def test_a_view_shows_the_outermost_rays_of_the_central_window_up_to_the_walls(trial: Trial) -> None:
    strips = trial.found.array("/arena/views", "LineStrips2D:strips").astype(float)
    assert strips.shape == (trial.steps, trial.scenario.robot_count, 3, 2)
    eyes = strips[:, :, 1]
    np.testing.assert_allclose(eyes, trial.cameras, rtol=0, atol=1e-5)
    views = [group.camera for group in trial.scenario.robots for _ in range(group.count)]
    shares = np.array([(view.central_pixels or view.pixels) / view.pixels for view in views])
    half = np.radians([view.field_of_view_deg for view in views]) * shares / 2
    longest = np.array([view.range_cm or UNBOUNDED_VIEW_CM for view in views])
    walls = trial.scenario.arena.width_cm, trial.scenario.arena.height_cm
    for place, side in ((0, 1), (2, -1)):
        ends = strips[:, :, place]
        lengths = np.hypot(*np.moveaxis(ends - eyes, 2, 0))
        rays = lengths[..., None] * towards(trial.watched["poses"][..., 2] + side * half)
        np.testing.assert_allclose(ends, eyes + rays, rtol=0, atol=2e-5)
        beyond = np.maximum(-ends, ends - walls).max(axis=2)  # how far outside of the nearest wall
        assert ((np.abs(np.maximum(lengths - longest, beyond)) < 1e-4) | (lengths == 0)).all()
    assert lengths.any()


def test_contacts_are_those_of_the_bodies(trial: Trial) -> None:
    scene = make_scene(trial.scenario.robots, trial.scenario.group_kinds, trial.scenario.arena.build())
    found, points = find_contacts(scene, trial.watched["poses"])
    steps = found[:, 0]
    rows = trial.found.lists("/arena/contacts", "Points2D:positions")
    assert [step for step, row in enumerate(rows) for _ in row] == steps.tolist()
    assert [point for row in rows for point in row] == points.astype(np.float32).tolist()
    if trial.scenario.name == "push":
        assert 0 < len(steps) < trial.steps


# --- a minute of camera rows ------------------------------------------------------------------------

ROWS_OF = {"robots": [{"count": 3, "camera": {"pixels": 12}}], "timing": {"control_hz": 2}}


@pytest.fixture(params=["one window", "73 rows", "one step"])
def space_time(request, tmp_path, monkeypatch) -> tuple[Found, Watched]:
    """Record two and a half pictures, of 120 steps each."""
    monkeypatch.setattr(layers, "PICTURE_STEPS", 120)
    for name, value in WINDOWS[request.param].items():
        monkeypatch.setattr(recorder, name, value)
    scenario = load_scenario({**ROWS_OF, "stop": {"max_time_s": 150, "order_parameter": 1}})
    watched = Watched()
    recorded(tmp_path / "t.rrd", scenario, 1, Level.FULL, watched)
    return Found(tmp_path / "t.rrd"), watched


def pictures_of(found: Found) -> tuple[dict[int, Array], tuple[int, int]]:
    """Return the pictures by their times, each as it was in the end, and their (height, width)."""
    (picture,) = found.static["/camera/space_time"]["SegmentationImage:format"]
    shape = picture["height"], picture["width"]
    buffers = found.array("/camera/space_time", "SegmentationImage:buffer")
    rows = found.lists("/camera/space_time", "rerun.controls.RowId")
    each = zip(found.times("/camera/space_time"), rows, buffers, strict=True)
    return {time: buffer.reshape(shape) for time, _, buffer in sorted(each, key=lambda one: one[:2])}, shape


def test_time_runs_down_a_picture_and_robots_stand_side_by_side(space_time: tuple[Found, Watched]) -> None:
    found, watched = space_time
    shown, shape = pictures_of(found)
    assert shape == (120, 3 * (12 + 4))
    assert list(shown) == [minute * 60_000_000_000 for minute in range(3)]
    camera = watched["camera"]
    assert [camera[minute * 120 : minute * 120 + 120].any() for minute in range(3)] == [True] * 3
    for minute, picture in enumerate(shown.values()):
        rows = camera[minute * 120 : minute * 120 + 120]
        columns = picture.reshape(120, 3, 16)
        np.testing.assert_array_equal(columns[: len(rows), :, :12], rows)
        assert not columns[len(rows) :, :, :12].any()
        assert (columns[:, :, 12:] == 2).all()


def test_robots_for_whom_there_is_no_room_are_left_out(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(layers, "MAX_COLUMNS", 38)
    monkeypatch.setattr(layers, "PICTURE_STEPS", 120)
    watched = Watched()
    recorded(tmp_path / "t.rrd", load(ROWS_OF, 60), 1, Level.FULL, watched)
    shown, shape = pictures_of(Found(tmp_path / "t.rrd"))
    (picture,) = shown.values()
    assert shape == (120, 2 * (12 + 4))
    rows = watched["camera"][:, :2]
    np.testing.assert_array_equal(picture.reshape(120, 2, 16)[: len(rows), :, :12], rows)


# --- how much it is -----------------------------------------------------------------------------------


def test_a_minute_of_ten_robots_takes_less_than_1100_kb(tmp_path) -> None:
    bytes_of = []
    for seconds in (60, 120):
        recorded(tmp_path / "t.rrd", load({"stop": {"order_parameter": 1}}, seconds), 1, Level.FULL)
        bytes_of.append((tmp_path / "t.rrd").stat().st_size)
    assert 100_000 < bytes_of[1] - bytes_of[0] < 1_100_000


# --- what does not move -----------------------------------------------------------------------------


def test_the_arena_is_shown_with_y_up(tmp_path) -> None:
    with record(tmp_path / "t.rrd", load_scenario("obstacles", ["arena.height_cm=110"]), 0):
        pass
    static = Found(tmp_path / "t.rrd").static
    assert static["/arena"]["Transform3D:translation"] == [[0, 110, 0]]
    assert static["/arena"]["Transform3D:mat3x3"] == [[1, 0, 0, 0, -1, 0, 0, 0, 1]]
    assert static["/arena/walls"]["LineStrips2D:strips"] == [[[0, 0], [100, 0], [100, 110], [0, 110], [0, 0]]]
    pillar, bar, wedge = (np.array(strip) for strip in static["/arena/obstacles"]["LineStrips2D:strips"])
    np.testing.assert_allclose(np.hypot(*(pillar - 30).T), 6, rtol=1e-6)
    np.testing.assert_allclose(pillar.mean(axis=0), 30, atol=0.2)
    sides = np.hypot(*np.diff(bar, axis=0).T)
    np.testing.assert_allclose(sorted(sides), [4, 4, 30, 30], rtol=1e-5)
    assert wedge.tolist() == [[20, 70], [35, 72], [24, 85], [20, 70]]


def test_floor_and_lamps_are_shown_where_they_are(tmp_path) -> None:
    disc = {"shape": "circle", "x_cm": 30, "y_cm": 10, "radius_cm": 10, "brightness": 0.4}
    arena = {"width_cm": 100, "height_cm": 50, "floor": {"patches": [disc]}, "lamps": [{"x_cm": 70, "y_cm": 40}]}
    with record(tmp_path / "t.rrd", load_scenario({"arena": arena}), 0, Level.POSES):
        pass
    static = Found(tmp_path / "t.rrd").static
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
    with record(tmp_path / "t.rrd", scenario, 0, Level.POSES):
        pass
    assert read_recording(tmp_path / "t.rrd").scenario == scenario
    (tmp_path / "ground.png").unlink()
    with pytest.warns(UserWarning, match=r"^thesis: the picture of its floor is left out: there is no file .*ground"):
        assert read_recording(tmp_path / "t.rrd").scenario.arena == load_scenario({}).arena


@pytest.mark.parametrize(("robots", "are_shown"), [(49, True), (50, False)])
def test_many_robots_have_no_numbers_beside_them(tmp_path, robots: int, are_shown: bool) -> None:
    swarm = {"arena": {"width_cm": 100, "height_cm": 100}, "robots": [{"count": robots}]}
    with record(tmp_path / "t.rrd", load_scenario(swarm), 0, Level.POSES):
        pass
    drawn = Found(tmp_path / "t.rrd").static
    assert (f"/arena/numbers/{robots - 1}" in drawn) == are_shown
    assert drawn["/arena/robots"]["Points2D:radii"] == [np.float32(RADIUS_CM)] * robots


# --- levels -----------------------------------------------------------------------------------------


CENSORED = ["stop.max_time_s=30", "stop.order_parameter=1"]


@pytest.fixture(scope="module", params=list(Level))
def of_level(request, tmp_path_factory) -> tuple[Level, Path, TrialResult]:
    path = tmp_path_factory.mktemp("level") / "t.rrd"
    scenario = load_scenario("obstacles", CENSORED)
    return request.param, path, recorded(path, scenario, 3, request.param)


def test_each_level_holds_what_it_should_and_no_more(of_level: tuple[Level, Path, TrialResult]) -> None:
    level, path, _ = of_level
    found = Found(path)
    assert set(found.moving) == MOVING[level]
    properties = {"/__properties", "/__properties/trial", "/__properties/outcome", SEAL}
    arena = {"/arena", "/arena/walls", "/arena/obstacles", "/legend"} if level is not Level.SUMMARY else set()
    numbers = {"/camera/rows/numbers", "/infrared/numbers"} if level is Level.FULL else set()
    assert set(found.static) == properties | arena | numbers | MOVING[level]


def test_a_recording_says_what_was_run(of_level: tuple[Level, Path, TrialResult]) -> None:
    level, path, _ = of_level
    said = Found(path).property("trial")
    assert load_scenario(parse_yaml(said.pop("scenario"), "x")) == load_scenario("obstacles", CENSORED)
    assert json.loads(said.pop("versions")) == {**versions(), "rerun": version("rerun-sdk")}
    assert said == {"format": 1, "level": str(level), "seed": "3"}


def test_a_recording_says_how_it_ended(of_level: tuple[Level, Path, TrialResult], tmp_path) -> None:
    _, path, result = of_level
    assert (result.cycles > 0, result.censored) == (True, True)
    assert Found(path).property("outcome") == {"cycles": result.cycles, "synchronised": False}
    path = tmp_path / "t.rrd"
    result = recorded(path, load_scenario("pair"), 1)
    assert Found(path).property("outcome") == {"cycles": result.t_sync_cycles, "synchronised": True}


def test_the_outcome_is_that_of_synchrony_however_long_the_trial_goes_on(tmp_path) -> None:
    path, scenario = tmp_path / "trial.rrd", load_scenario("thesis", ["stop.further_cycles=2"])
    with record(path, scenario, 2, Level.SUMMARY) as observer:
        result = run_trial(Simulation(scenario, 2), [observer])
    found = Found(path)
    assert found.property("outcome") == {"cycles": result.t_sync_cycles, "synchronised": True}
    assert len(found.times("/order/firings")) == result.t_sync_cycles + 2


def test_the_layout_is_in_the_file(of_level: tuple[Level, Path, TrialResult]) -> None:
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


def test_the_viewer_takes_the_layout_of_the_file(of_level: tuple[Level, Path, TrialResult]) -> None:
    _, path, _ = of_level
    (layout,) = RrdReader(path).blueprints()
    printed = subprocess.run([*PROGRAM, "rrd", "print", str(path)], capture_output=True, text=True, check=True).stdout
    (activation,) = (line for line in printed.splitlines() if line.startswith("BlueprintActivationCommand"))
    assert layout.recording_id in activation
    assert "make_active: true" in activation


def test_rerun_finds_no_fault(of_level: tuple[Level, Path, TrialResult]) -> None:
    run_rerun("rrd", "verify", str(of_level[1]))


@pytest.mark.parametrize("level", Level)
@pytest.mark.usefixtures("small_buffers")
def test_a_recorded_trial_is_the_same_trial(tmp_path, level: Level) -> None:
    scenario, alone, beside = load("obstacles"), Watched(), Watched()
    result = recorded(tmp_path / "t.rrd", scenario, 2, level, beside)
    assert result._replace(wall_s=0) == run_trial(Simulation(scenario, 2), [alone])._replace(wall_s=0)
    for field in FIELDS:
        assert beside[field].tobytes() == alone[field].tobytes()


@pytest.fixture
def small_buffers(monkeypatch) -> None:
    monkeypatch.setattr(recorder, "BUFFER_ROWS", 73)


# --- again ------------------------------------------------------------------------------------------


def test_the_same_trial_is_recorded_alike(tmp_path) -> None:
    one, other = tmp_path / "1.rrd", tmp_path / "2.rrd"
    for path in (one, other):
        recorded(path, load("thesis"))
    compare(one, other)
    assert RrdReader(one).recordings()[0].recording_id == RrdReader(other).recordings()[0].recording_id


def test_a_trial_of_another_seed_or_level_is_recorded_otherwise(tmp_path) -> None:
    paths = [tmp_path / f"{number}.rrd" for number in range(3)]
    for path, seed, level in zip(paths, (1, 2, 1), (Level.FULL, Level.FULL, Level.POSES), strict=True):
        recorded(path, load("thesis"), seed, level)
    for other in paths[1:]:
        with pytest.raises(RecordingError, match="rerun rrd compare failed: "):
            compare(paths[0], other)
    assert len({RrdReader(path).recordings()[0].recording_id for path in paths}) == 3


@pytest.mark.parametrize("seed", [0, 2**63, 2**64 + 1, 2**128 + 7])
def test_a_seed_may_be_of_any_size(tmp_path, seed: int) -> None:
    recorded(tmp_path / "t.rrd", load("pair", 1), seed)
    assert Found(tmp_path / "t.rrd").property("trial")["seed"] == str(seed)


def test_what_the_scenario_leaves_out_is_written_out(tmp_path) -> None:
    with record(tmp_path / "t.rrd", EmbodiedScenario(), 0, Level.SUMMARY):
        pass
    found = Found(tmp_path / "t.rrd")
    assert EmbodiedScenario.model_validate(parse_yaml(found.property("trial")["scenario"], "x")) == load_scenario(
        EmbodiedScenario()
    )
    assert found.property("outcome") == {"cycles": 0, "synchronised": False}
    assert not found.moving


def test_phases_are_shown_ahead_of_the_reference_at_its_firings(tmp_path) -> None:
    scenario, watched = load_scenario(MIXED), Watched()
    recorded(tmp_path / "t.rrd", scenario, 1, Level.POSES, watched)
    found = Found(tmp_path / "t.rrd")
    lead = found.array("/phase_lead", "Scalars:scalars")
    at = found.times("/order/firings")
    np.testing.assert_array_equal(found.times("/phase_lead"), at)
    phases = watched["phase_ms"][np.isin(found.times("/phases"), at)]
    period_ms = 1000 * np.array([5.0] * 3 + [np.nan] * 2 + [3.0] * 2)
    ahead = 2j * np.pi * (phases / period_ms - phases[:, [6]] / 3000)
    np.testing.assert_allclose(np.exp(2j * np.pi * lead), np.exp(ahead), atol=1e-9)
    assert np.nanmax(np.abs(lead)) <= 0.5
    assert len(lead) > 5
