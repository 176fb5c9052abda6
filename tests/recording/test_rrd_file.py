"""A recording's file appears when it is whole, is written as the trial goes on, and leaves nothing else behind."""

import os
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from rerun.chunk import LazyChunkStream

from epuck_sim import EpuckSimError, Simulation, Step, load_scenario, read_recording, record
from epuck_sim.recording import Level, recorder
from epuck_sim.recording.layout import arrangement_of, layout_file
from epuck_sim.recording.process import run_rerun
from epuck_sim.trial.embodied import SynchronyWatch
from epuck_sim.trial.model import Observer, run_trial
from tests.processes import start, wait_until
from tests.recording import recordings

SCENARIO = load_scenario("thesis", ["stop.max_time_s=30", "stop.order_parameter=1"])


def recorded(path: Path, *others: Observer) -> None:
    recordings.recorded(path, SCENARIO, 1, Level.FULL, *others)


def is_whole(path: Path) -> bool:
    return len(read_recording(path).time_s) == 300


@pytest.fixture
def small_buffers(monkeypatch) -> None:
    monkeypatch.setattr(recorder, "BUFFER_ROWS", 73)


def fail_at(number: int, error: type[BaseException]) -> Observer:
    def fail(step: Step, _: SynchronyWatch) -> None:
        if step.number == number:
            raise error

    return fail


@pytest.mark.usefixtures("small_buffers")
def test_where_the_trial_fails_nothing_is_left_and_an_older_recording_stays(tmp_path) -> None:
    (tmp_path / "older.rrd").write_text("older")
    for number, error in ((0, ZeroDivisionError), (200, KeyboardInterrupt)):
        for name in ("older.rrd", "new.rrd"):
            with pytest.raises(error):
                recorded(tmp_path / name, fail_at(number, error))
            assert {file.name: file.read_text() for file in tmp_path.iterdir()} == {"older.rrd": "older"}


def test_runs_that_record_to_the_same_file_one_through_a_link_do_not_harm_each_other(tmp_path) -> None:
    path, link = tmp_path / "t.rrd", tmp_path / "link.rrd"
    link.symlink_to(path)
    with record(path, SCENARIO, 2) as other:
        recorded(link)
        first = path.read_bytes()
        run_trial(Simulation(SCENARIO, 2), [other])
    assert is_whole(path)
    assert path.read_bytes() != first
    assert {*tmp_path.iterdir()} == {path, link}
    assert link.is_symlink()


@contextmanager
def room_for(largest: int) -> Iterator[None]:
    """Limit the size of files that this process, and rerun within it, can write."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (largest, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("part", ["layout", "data", "whole"])
def test_where_there_is_no_room_nothing_is_left(tmp_path, part: str) -> None:
    path = tmp_path / "t.rrd"
    recorded(path)
    whole, layout = path.stat().st_size, len(layout_file(arrangement_of(load_scenario("thesis"), Level.FULL)))
    room = {"layout": layout // 2, "data": whole // 2, "whole": whole - layout // 2}
    assert room["layout"] < layout < room["data"] < whole - layout < room["whole"] < whole
    path.write_text("older")
    layout_file.cache_clear()  # it is made without a disk
    with room_for(room[part]), pytest.raises(EpuckSimError, match=r"t\.rrd: "):
        recorded(path)
    assert path.read_text() == "older"
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.usefixtures("small_buffers")
def test_a_full_disk_ends_the_trial_when_the_next_buffer_is_written(tmp_path, monkeypatch) -> None:
    calls, steps = [], []

    def write_some(*_, **__) -> None:
        calls.append(len(steps))
        if len(calls) > 4:  # the seal, what does not change, and two buffers
            raise RuntimeError("No space left on device")

    monkeypatch.setattr(LazyChunkStream, "write_rrd", write_some)
    with pytest.raises(EpuckSimError) as caught:
        recorded(tmp_path / "t.rrd", lambda step, _: steps.append(step.number))
    assert str(caught.value) == f"{tmp_path / 't.rrd'}: cannot be written: No space left on device"
    assert calls == [0, 0, 6, 13, 20]
    assert list(tmp_path.iterdir()) == []


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
        recordings.recorded(tmp_path / f"{trial}.rrd", scenario, trial, list(Level)[trial % 3])
    threads_after, megabytes_after = used()
    assert threads_after == threads
    assert megabytes_after - megabytes < 12 / 2  # half a MB each; what memory a process holds varies by 3 MB by itself
    run_rerun("rrd", "verify", *map(str, tmp_path.iterdir()))
