"""A recording's file appears when it is whole and leaves nothing else behind; what is not a whole recording of ours is
refused in words."""

import os
import re
import sys
from pathlib import Path
from typing import Any

import pytest
import rerun as rr
from hypothesis import HealthCheck, example, given, settings, strategies as st
from rerun.chunk import Chunk, LazyChunkStream

from epuck_sim import EpuckSimError, RecordingError, Simulation, Step, load_scenario, read_recording, record
from epuck_sim.recording import Level, reader as entities, recorder
from epuck_sim.recording.reader import last_moment_s, read_layout
from epuck_sim.recording.recorder import arrangement_of, layout_file
from epuck_sim.recording.rerun import _BLANK, is_whole, run_rerun
from epuck_sim.trial.model import Observer, run_trial
from tests.processes import start, wait_until
from tests.recording.recordings import recorded
from tests.recording.viewers import replace_rerun
from tests.tools import no_file_larger_than

THESIS = load_scenario("thesis", ["stop.max_time_s=30", "stop.order_parameter=1"])


def record_thesis(path: Path, *others: Observer) -> None:
    recorded(path, THESIS, 1, Level.FULL, *others)


def test_of_a_trial_that_fails_nothing_is_left_and_a_full_disk_ends_it_soon(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(recorder, "BUFFER_ROWS", 73)
    (tmp_path / "older.rrd").write_text("older")
    for number, error in ((0, ZeroDivisionError), (200, KeyboardInterrupt)):

        def fail(step: Step, _, at: int = number, error: type[BaseException] = error) -> None:
            if step.number == at:
                raise error

        for name in ("older.rrd", "new.rrd"):
            with pytest.raises(error):
                record_thesis(tmp_path / name, fail)
            assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"older.rrd": "older"}
    calls, steps = [], []

    def write_some(*_, **__) -> None:
        calls.append(len(steps))
        if len(calls) > 4:  # the seal, what does not change, and two buffers
            raise RuntimeError("No space left on device")

    monkeypatch.setattr(LazyChunkStream, "write_rrd", write_some)
    with pytest.raises(EpuckSimError) as caught:
        record_thesis(tmp_path / "t.rrd", lambda step, _: steps.append(step.number))
    assert str(caught.value) == f"{tmp_path / 't.rrd'}: cannot be written: No space left on device"
    assert calls == [0, 0, 6, 13, 20]
    assert list(tmp_path.iterdir()) == [tmp_path / "older.rrd"]


def test_runs_that_record_to_the_same_file_one_through_a_link_do_not_harm_each_other(tmp_path) -> None:
    path, link = tmp_path / "t.rrd", tmp_path / "link.rrd"
    link.symlink_to(path)
    with record(path, THESIS, 2) as other:
        record_thesis(link)
        first = path.read_bytes()
        run_trial(Simulation(THESIS, 2), [other])
    assert len(read_recording(path).time_s) == 300
    assert path.read_bytes() != first
    assert {*tmp_path.iterdir()} == {path, link}
    assert link.is_symlink()


@pytest.mark.parametrize("part", ["layout", "data", "whole"])
def test_where_there_is_no_room_nothing_is_left(tmp_path, part: str) -> None:
    path = tmp_path / "t.rrd"
    record_thesis(path)
    whole, layout = path.stat().st_size, len(layout_file(arrangement_of(load_scenario("thesis"), Level.FULL)))
    room = {"layout": layout // 2, "data": whole // 2, "whole": whole - layout // 2}
    assert room["layout"] < layout < room["data"] < whole - layout < room["whole"] < whole
    path.write_text("older")
    layout_file.cache_clear()  # it is made without a disk
    with no_file_larger_than(room[part]), pytest.raises(EpuckSimError, match=r"t\.rrd: "):
        record_thesis(path)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


LONG = """
import sys
from epuck_sim import Simulation, load_scenario, record, run_trial
from epuck_sim.recording import recorder
recorder.BUFFER_ROWS = 100
scenario = load_scenario("thesis", ["stop.order_parameter=1", "stop.max_cycles=1000000"])
with record(sys.argv[1], scenario, 1) as observer:
    run_trial(Simulation(scenario, 1), [observer])
"""


def test_a_run_that_is_killed_leaves_no_recording(tmp_path) -> None:
    path = tmp_path / "t.rrd"
    run = start([sys.executable, "-c", LONG, path], stdout=None, stderr=None)
    wait_until(lambda: any(tmp_path.glob("t.rrd.*.part/5.rrd")) or run.poll() is not None, 180)
    assert run.poll() is None
    run.kill()
    run.wait()
    assert not path.exists()
    assert len(list(tmp_path.iterdir())) == 1  # what was written so far


def used() -> tuple[int, float]:
    """Return how many threads this process has, and megabytes of memory."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return len(list(Path("/proc/self/task").iterdir())), pages * os.sysconf("SC_PAGE_SIZE") / 1e6


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="there is no /proc")
def test_many_recordings_need_no_more_threads_nor_memory_than_a_few(tmp_path) -> None:
    scenario = load_scenario("thesis", ["stop.max_time_s=0.5"])
    for trial in range(15):
        if trial == 3:
            threads, megabytes = used()
        recorded(tmp_path / f"{trial}.rrd", scenario, trial, list(Level)[trial % 3])
    threads_after, megabytes_after = used()
    assert threads_after - threads < 12 / 2  # one each; a thread that libraries share may begin late
    assert megabytes_after - megabytes < 12 / 2  # half a MB each; what memory a process holds varies by 3 MB by itself
    run_rerun("rrd", "verify", *map(str, tmp_path.iterdir()))


SMALL = {"arena": {"width_cm": 40, "height_cm": 40}, "robots": [{"count": 2}], "stop": {"max_time_s": 2}}
SCENARIO = load_scenario(SMALL)
NEWER = '{"epuck_sim": "9.1"}'
FLIPS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "t.rrd"
    recorded(path, SCENARIO)
    return path


def refusals(path: Path) -> list[str]:
    """Return what functions that read a recording say of a file, after its name; they raise nothing else."""
    said = []
    for read in (read_recording, last_moment_s, read_layout):
        try:
            read(path)
        except RecordingError as error:
            said.append(str(error))
    assert all(each.startswith(f"{path}: ") for each in said)
    return [each.removeprefix(f"{path}: ") for each in said]


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=FLIPS)
def test_changed_bytes_are_refused_in_words(whole: Path, tmp_path, flips) -> None:
    assert is_whole(whole)
    damaged = bytearray(whole.read_bytes())
    for place, change in flips:
        damaged[int(place * len(damaged))] ^= change
    path = tmp_path / "t.rrd"
    path.write_bytes(damaged)
    if is_whole(path) is None:  # the mark or the length within the seal was hit
        refusals(path)
    else:
        assert len(refusals(path)) == (0 if damaged == whole.read_bytes() else 3)


@settings(max_examples=8, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True))
@example(share=1e-5)
@example(share=1 - 1e-9)  # one byte is missing
def test_a_recording_that_is_cut_off_is_refused(whole: Path, tmp_path, share: float) -> None:
    assert not re.search(b"[0-9a-f]{4}|[0-9A-F]{4}", _BLANK)  # with which no id of a chunk is packed
    path = tmp_path / "t.rrd"
    path.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
    said = refusals(path)
    assert len(said) == 3
    assert all("is not a " in each or "holds 0 recordings" in each for each in said)  # but a part of its layout


def test_a_recording_over_which_rerun_breaks_down_is_not_read(tmp_path, monkeypatch) -> None:
    replace_rerun(tmp_path / "stand", monkeypatch).acts("sys.exit(101)")
    monkeypatch.setattr(entities, "RrdReader", None)
    path = tmp_path / "t.rrd"
    path.write_bytes((Path(__file__).parents[1] / "old" / "0.1.0" / "robots.rrd").read_bytes())  # has no seal
    with pytest.raises(RecordingError, match="is not a complete recording: it is damaged; record the trial again"):
        read_recording(path)


def written(path: Path, application: str, **properties: Any) -> None:
    """Write a recording with no more than a trial's properties, if any."""
    said = [Chunk.from_property("trial", rr.AnyValues(**properties))] if properties else []
    about = Chunk.from_property("camera", rr.AnyValues(pixels=60))
    LazyChunkStream.from_iter([*said, about]).write_rrd(path, application_id=application, recording_id="x")


def without_outcome(path: Path) -> None:
    recorded(path.with_name("whole.rrd"), SCENARIO)
    drop = ("--drop-entity", "/__properties/outcome", "-o", str(path))
    run_rerun("rrd", "filter", str(path.with_name("whole.rrd")), *drop)


def two_in_one(path: Path) -> None:
    parts = [path.with_name(f"{seed}.rrd") for seed in range(2)]
    for seed, part in enumerate(parts):
        recorded(part, SCENARIO, seed, Level.SUMMARY)
    run_rerun("rrd", "merge", *map(str, parts), "-o", str(path))


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda path: path.write_bytes(layout_file(arrangement_of(SCENARIO, Level.FULL))), "holds 0 recordings"),
        (lambda path: written(path, "other"), "made by other; allowed: one made by epuck-sim"),
        (lambda path: written(path, "epuck-sim"), "this version of epuck-sim reads format 1"),
        (lambda path: written(path, "epuck-sim", format=1, level="full"), "is not a complete recording: 'scenario'"),
        (two_in_one, "holds 2 recordings"),
        (without_outcome, "is not a complete recording: 'cycles'"),
        (lambda path: written(path, "epuck-sim", format=7, versions=NEWER), "format 7, made by epuck_sim 9.1"),
    ],
)
def test_what_is_no_recording_of_ours_is_refused(tmp_path, capfd, make, message: str) -> None:
    path = tmp_path / "t.rrd"
    make(path)
    capfd.readouterr()
    assert message in refusals(path)[0]
    assert capfd.readouterr() == ("", "")


def test_a_scenario_that_this_version_does_not_know_is_refused(tmp_path, monkeypatch) -> None:
    for text in ("wings: 2", "]["):
        monkeypatch.setattr(recorder, "write_scenario", lambda _, text=text: text)
        recorded(tmp_path / "t.rrd", SCENARIO, level=Level.SUMMARY)
        (said,) = refusals(tmp_path / "t.rrd")
        assert said.startswith("holds a scenario that this version cannot read: ")
        assert read_layout(tmp_path / "t.rrd") is None  # it can be looked at all the same
