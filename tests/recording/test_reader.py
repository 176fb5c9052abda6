"""What was recorded is read back as the simulation had it, and what is not a recording is refused."""

import re
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest
import rerun as rr
import rerun.blueprint as rrb
from rerun.chunk import Chunk, LazyChunkStream, RrdReader

from epuck_sim.arrays import BoolArray, FloatArray
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.embodied.step import Step, memory_values
from epuck_sim.errors import RecordingError, ScenarioError
from epuck_sim.recording import Level, recorder
from epuck_sim.recording.layout import arrangement_of, layout_file, layout_of
from epuck_sim.recording.process import run_rerun
from epuck_sim.recording.reader import read_layout, read_recording
from epuck_sim.recording.recorded import Recorded
from epuck_sim.recording.recorder import record
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.trial.model import run_trial
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import versions

THESIS = load_scenario("thesis", ["stop.max_time_s=30", "stop.order_parameter=1"])
PAIR = load_scenario("pair")
SWITCHED = load_scenario(
    {"name": "switched", "robots": [{"count": 3, "controller": "constant"}, {"count": 4}], "stop": {"max_time_s": 12}}
)

OF_POSES = ("phase_ms", "positions", "headings", "ring_on")
"""Fields that a summary leaves out."""


class Watched:
    """An observer that copies what it is shown."""

    def __init__(self) -> None:
        self.time_s: list[float] = []
        self.order: list[float] = []
        self.poses: list[FloatArray] = []
        self.phase_ms: list[FloatArray] = []
        self.ring_on: list[BoolArray] = []
        self.firings: list[tuple[float, float | None]] = []

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        self.time_s.append(step.time_s)
        self.order.append(float(watch.measure(step.phase_ms)))
        self.poses.append(step.poses.copy())
        self.phase_ms.append(step.phase_ms)
        self.ring_on.append(step.ring_on.copy())
        if watch.cycles > len(self.firings):
            self.firings.append((step.time_s, watch.order_parameter))

    def flashes(self) -> list[tuple[float, int, int]]:
        """Return when, who and which of its own: a ring lights up, or is lit already while the phase falls."""
        cycles, found = [0] * len(self.ring_on[0]), []
        for number, (time_s, rings, phases) in enumerate(zip(self.time_s, self.ring_on, self.phase_ms, strict=True)):
            for robot in np.flatnonzero(rings).tolist():
                was_lit = number > 0 and self.ring_on[number - 1][robot]
                if not was_lit or phases[robot] < self.phase_ms[number - 1][robot]:
                    cycles[robot] += 1
                    found.append((time_s, robot, cycles[robot]))
        return found


def recorded(path: Path, scenario: Scenario = THESIS, seed: int = 1, level: Level = Level.FULL) -> TrialResult:
    with record(path, scenario, seed, level) as observer:
        return run_trial(Simulation(scenario, seed), [observer])


class Trial(NamedTuple):
    """A trial that was recorded, and the same one as it was watched without a recorder."""

    scenario: Scenario
    level: Level
    path: Path
    watched: Watched
    result: TrialResult


@pytest.fixture(
    scope="module",
    params=[(*trial, level) for trial in ((THESIS, 1), (PAIR, 2**64 + 5), (SWITCHED, 2)) for level in Level],
    ids=lambda param: f"{param[0].name} {param[1]} {param[2]}",
)
def trial(request, tmp_path_factory) -> Trial:
    scenario, seed, level = request.param
    path = tmp_path_factory.mktemp("recording") / "t.rrd"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder, "BUFFER_ROWS", 73)
        recorded(path, scenario, seed, level)
    watched = Watched()
    return Trial(scenario, level, path, watched, run_trial(Simulation(scenario, seed), [watched]))


def assert_equal(one: Recorded, other: Recorded) -> None:
    for field, value, its_twin in zip(Recorded._fields, one, other, strict=True):
        if isinstance(value, np.ndarray):
            np.testing.assert_array_equal(value, its_twin, err_msg=field, strict=True)
        elif field == "links" and value is not None:
            for links, their_twins in zip(value, its_twin, strict=True):
                np.testing.assert_array_equal(links, their_twins, strict=True)
        else:
            assert value == its_twin, field


def test_everything_is_as_the_simulation_had_it(trial: Trial) -> None:
    read, watched = read_recording(trial.path), trial.watched
    np.testing.assert_array_equal(read.time_s, watched.time_s)
    np.testing.assert_array_equal(read.order_parameter, watched.order)
    flashes = zip(read.flash_s.tolist(), read.flash_robot.tolist(), read.flash_cycle.tolist(), strict=True)
    assert list(flashes) == watched.flashes()
    measured = [(time_s, order) for time_s, order in watched.firings if order is not None]
    assert list(zip(read.firing_s.tolist(), read.firing_order.tolist(), strict=True)) == measured


def test_poses_phases_and_rings_are_read_as_far_as_the_level_holds_them(trial: Trial) -> None:
    read, poses = read_recording(trial.path), np.array(trial.watched.poses)
    if trial.level is Level.SUMMARY:
        for field in OF_POSES:
            tail = (2,) if field == "positions" else ()
            assert getattr(read, field).shape == (0, trial.scenario.robot_count, *tail), field
        return
    np.testing.assert_array_equal(read.positions, poses[..., :2].astype(np.float32), strict=True)
    np.testing.assert_array_equal(read.phase_ms, trial.watched.phase_ms, strict=True)
    np.testing.assert_array_equal(read.ring_on, trial.watched.ring_on, strict=True)
    turned = read.headings - poses[..., 2]
    np.testing.assert_allclose(np.angle(np.exp(1j * turned)), 0, atol=1e-6)
    assert (np.abs(read.headings) <= np.pi).all()


def test_what_was_run_and_how_it_ended_is_read(trial: Trial) -> None:
    read, result = read_recording(trial.path), trial.result
    assert (read.scenario, read.seed, read.level) == (trial.scenario, result.seed, trial.level)
    assert read.versions == {**versions(), "rerun": version("rerun-sdk")}
    assert (read.cycles, read.synchronised) == (result.cycles, result.t_sync_cycles is not None)


@pytest.mark.parametrize("scenario", [THESIS, PAIR], ids=lambda scenario: scenario.name)
def test_trials_that_end_in_both_ways_are_among_them(scenario: Scenario) -> None:
    assert run_trial(Simulation(scenario, 2**64 + 5)).censored == (scenario is THESIS)


def test_a_recording_that_rerun_has_optimised_is_read_the_same(trial: Trial, tmp_path) -> None:
    run_rerun("rrd", "optimize", str(trial.path), "-o", str(tmp_path / "t.rrd"))
    chunks = [len(RrdReader(path).store().stream().to_chunks()) for path in (trial.path, tmp_path / "t.rrd")]
    assert chunks[0] > chunks[1]
    assert_equal(read_recording(tmp_path / "t.rrd"), read_recording(trial.path))


@pytest.mark.parametrize("level", Level)
def test_a_trial_of_no_steps_has_no_steps(tmp_path, level: Level) -> None:
    with record(tmp_path / "t.rrd", THESIS, 1, level):
        pass
    read = read_recording(tmp_path / "t.rrd")
    assert (read.scenario, read.level, read.cycles, read.synchronised) == (THESIS, level, 0, False)
    assert {len(value) for value in read if isinstance(value, np.ndarray)} == {0}


# --- what is not a recording of ours -------------------------------------------------------------------


def refusal(path: Path, capfd: pytest.CaptureFixture[str]) -> str:
    """Return what is said of a file, after its name; nothing else is said."""
    capfd.readouterr()
    with pytest.raises(RecordingError) as caught:
        read_recording(path)
    assert capfd.readouterr() == ("", "")
    said = str(caught.value)
    assert said.startswith(f"{path}: ")
    assert "Traceback" not in said
    return said.removeprefix(f"{path}: ")


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> bytes:
    path = tmp_path_factory.mktemp("whole") / "t.rrd"
    recorded(path)
    return path.read_bytes()


def test_there_must_be_a_file(tmp_path, capfd) -> None:
    assert refusal(tmp_path / "gone.rrd", capfd) == "there is no such file"
    assert refusal(tmp_path, capfd) == "is not a file"


@pytest.mark.parametrize("content", [b"Not a recording, but a text.\n" * 50, bytes(range(256)) * 50, b"PAR1" * 50])
def test_another_kind_of_file_is_no_recording(tmp_path, capfd, content: bytes) -> None:
    (tmp_path / "t.rrd").write_bytes(content)
    assert "is not a recording" in refusal(tmp_path / "t.rrd", capfd)


@pytest.mark.parametrize("share", [0, 1e-5, 0.01, 0.1, 0.3, 0.6, 0.9, 0.999])
def test_a_recording_that_was_cut_short_is_refused(tmp_path, capfd, whole: bytes, share: float) -> None:
    (tmp_path / "t.rrd").write_bytes(whole[: int(share * len(whole))])
    said = refusal(tmp_path / "t.rrd", capfd)
    assert said.startswith("is not a complete recording: ") or "holds 0 recordings" in said  # but a part of its layout


@pytest.mark.parametrize("missing", [1, 10, 100, 1000])
def test_a_recording_without_its_last_bytes_is_refused(tmp_path, capfd, whole: bytes, missing: int) -> None:
    (tmp_path / "t.rrd").write_bytes(whole[:-missing])
    assert "is not a complete recording: " in refusal(tmp_path / "t.rrd", capfd)
    (tmp_path / "t.rrd").write_bytes(whole)
    assert len(read_recording(tmp_path / "t.rrd").time_s) == 300


def test_a_path_may_be_text(tmp_path, whole: bytes) -> None:
    (tmp_path / "t.rrd").write_bytes(whole)
    assert len(read_recording(str(tmp_path / "t.rrd")).time_s) == 300


def test_a_layout_is_no_recording(tmp_path, capfd) -> None:
    (tmp_path / "t.rrd").write_bytes(layout_file(arrangement_of(load_scenario("thesis"), Level.FULL)))
    assert "holds 0 recordings" in refusal(tmp_path / "t.rrd", capfd)


def write(path: Path, application: str, **properties: Any) -> None:
    """Write a recording with no more than a trial's properties, if any."""
    said = [Chunk.from_property("trial", rr.AnyValues(**properties))] if properties else []
    about = Chunk.from_property("camera", rr.AnyValues(pixels=60))
    LazyChunkStream.from_iter([*said, about]).write_rrd(path, application_id=application, recording_id="x")


def test_a_recording_of_another_program_is_refused(tmp_path, capfd) -> None:
    write(tmp_path / "t.rrd", "other")
    said = refusal(tmp_path / "t.rrd", capfd)
    assert "made by other" in said
    assert "made by epuck-sim" in said


def test_two_recordings_in_one_file_are_refused(tmp_path, capfd) -> None:
    parts = [str(tmp_path / f"{seed}.rrd") for seed in range(2)]
    for seed, part in enumerate(parts):
        recorded(Path(part), THESIS, seed, Level.SUMMARY)
    run_rerun("rrd", "merge", *parts, "-o", str(tmp_path / "t.rrd"))
    assert "holds 2 recordings" in refusal(tmp_path / "t.rrd", capfd)


def test_a_recording_that_says_nothing_of_its_trial_is_refused(tmp_path, capfd) -> None:
    write(tmp_path / "t.rrd", "epuck-sim")
    assert "this version of epuck-sim reads format 1" in refusal(tmp_path / "t.rrd", capfd)


def test_a_recording_that_does_not_say_all_of_its_trial_is_refused(tmp_path, capfd) -> None:
    write(tmp_path / "t.rrd", "epuck-sim", format=1, level="full")
    assert refusal(tmp_path / "t.rrd", capfd)


def test_a_recording_that_does_not_say_how_it_ended_is_refused(tmp_path, capfd, whole: bytes) -> None:
    (tmp_path / "whole.rrd").write_bytes(whole)
    ending = "--drop-entity", "/__properties/outcome"
    run_rerun("rrd", "filter", str(tmp_path / "whole.rrd"), *ending, "-o", str(tmp_path / "t.rrd"))
    assert refusal(tmp_path / "t.rrd", capfd)


def test_a_recording_of_another_format_is_refused_with_the_version_that_made_it(tmp_path, capfd, monkeypatch) -> None:
    monkeypatch.setattr(recorder, "FORMAT", 7)
    recorded(tmp_path / "t.rrd", level=Level.SUMMARY)
    said = refusal(tmp_path / "t.rrd", capfd)
    for part in (f"epuck_sim {versions()['epuck_sim']}", "format 7", "this version of epuck-sim reads format 1"):
        assert part in said


@pytest.mark.parametrize("scenario", ["wings: 2", "robots: []", "][", "3", ""])
def test_a_scenario_that_this_version_does_not_know_is_refused(tmp_path, capfd, monkeypatch, scenario: str) -> None:
    monkeypatch.setattr(recorder, "write_scenario", lambda _: scenario)
    recorded(tmp_path / "t.rrd", level=Level.SUMMARY)
    assert "holds a scenario that this version cannot read: " in refusal(tmp_path / "t.rrd", capfd)
    assert read_layout(tmp_path / "t.rrd") is None  # it can be looked at all the same


# --- memory ---------------------------------------------------------------------------------------


class Remembered:
    """An observer that copies fields of what robots remember."""

    def __init__(self, *fields: str) -> None:
        self.rows: dict[str, list[FloatArray]] = {field: [] for field in fields}

    def __call__(self, step: Step, _: SynchronyWatch) -> None:
        for field, rows in self.rows.items():
            rows.append(memory_values(step.memories, field))


@pytest.mark.parametrize("level", Level)
def test_what_robots_remember_is_read_back_by_name_to_the_bit(level: Level, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(recorder, "BUFFER_S", 3)  # several chunks
    fields, watched = ["rotation_time", "phase_ms"], Remembered("rotation_time", "phase_ms")
    with record(tmp_path / "t.rrd", SWITCHED, 1, level, memory=[*fields, "phase_ms"]) as observer:
        run_trial(Simulation(SWITCHED, 1), [observer, watched])
    found = read_recording(tmp_path / "t.rrd")
    assert list(found.memory) == fields
    for field, rows in watched.rows.items():
        assert found.memory[field].tobytes() == np.array(rows).tobytes()
    assert np.isnan(found.memory["phase_ms"][:, :3]).all()  # `constant` remembers nothing
    assert np.ptp(found.memory["phase_ms"][:, 3:]) > 1000


def origins(level: Level, scenario: Scenario, fields: list[str]) -> list[str]:
    """Return the origins of the views in a layout."""
    found, parts = [], [layout_of(scenario, level, fields).root_container]
    while parts:
        part = parts.pop(0)
        if isinstance(part, rrb.View):
            found.append(part.origin)
        else:
            parts.extend(part.contents)
    return found


def plots_of_memory(level: Level, fields: list[str]) -> list[str]:
    """Return the origins of the plots of memory in a layout."""
    return [origin for origin in origins(level, SWITCHED, fields) if origin.startswith("/memory")]


@pytest.mark.parametrize("level", Level)
def test_each_field_has_a_plot_of_its_own(level: Level) -> None:
    assert plots_of_memory(level, []) == []
    assert plots_of_memory(level, ["phase_ms", "turn"]) == ["/memory/phase_ms", "/memory/turn"]


CHANGING = load_scenario(
    {
        "faults": [{"kind": "ring_dead", "robots": [1, 4], "at_s": 2, "until_s": 4.05}],
        "schedule": [{"at_cycle": 1, "set": {"robots.0.parameters.speed_cm_s": 0}}],
        "stop": {"max_cycles": 2, "order_parameter": None},
    }
)


@pytest.mark.parametrize("level", Level)
def test_what_changed_is_a_text_log_that_is_read_back(level: Level, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(recorder, "BUFFER_S", 3)  # several chunks
    with record(tmp_path / "t.rrd", CHANGING, 1, level) as observer:
        events = run_trial(Simulation(CHANGING, 1), [observer]).events
    found = read_recording(tmp_path / "t.rrd").events
    assert [time_s for time_s, _ in found] == [event.time_s for event in events]
    assert sorted(text for _, text in found) == [
        "faults.0: ring_dead begins in 1, 4",
        "faults.0: ring_dead ends in 1, 4",
        "schedule.0: robots.0.parameters.speed_cm_s: 0",
    ]
    assert "/events" in origins(level, CHANGING, [])
    assert "/events" not in origins(level, SWITCHED, [])


def test_recordings_without_memory_have_none(tmp_path) -> None:
    recorded(tmp_path / "t.rrd", PAIR)
    assert read_recording(tmp_path / "t.rrd").memory == {}


@pytest.mark.parametrize(
    ("scenario", "field", "message"),
    [
        ("thesis", "phase", "memory: unknown 'phase', did you mean 'phase_ms'"),
        ("particles", "phase_ms", "model is 'particles'; robots alone have a memory to record"),
    ],
)
def test_fields_that_nobody_remembers_are_refused(scenario: str, field: str, message: str, tmp_path) -> None:
    with (
        pytest.raises(ScenarioError, match=re.escape(message)),
        record(tmp_path / "t.rrd", load_scenario(scenario), 1, memory=[field]),
    ):
        pass
    assert list(tmp_path.iterdir()) == []
