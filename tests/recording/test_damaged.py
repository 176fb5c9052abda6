"""What is not a whole recording of ours is refused in words; neither a traceback nor a crash ends it."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import rerun as rr
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from rerun.chunk import Chunk, LazyChunkStream

from epuck_sim import RecordingError, load_scenario
from epuck_sim.recording import Level, recorder
from epuck_sim.recording import reader as entities
from epuck_sim.recording.layout import arrangement_of, layout_file
from epuck_sim.recording.process import run_rerun
from epuck_sim.recording.reader import last_moment_s, read_layout, read_recording
from epuck_sim.recording.rrd_file import is_whole
from tests.recording.recordings import recorded
from tests.recording.viewers import replace_rerun

SCENARIO = load_scenario(
    {"arena": {"width_cm": 40, "height_cm": 40}, "robots": [{"count": 2}], "stop": {"max_time_s": 2}}
)
FLIPS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "t.rrd"
    recorded(path, SCENARIO)
    return path


def refusals(path: Path) -> list[str]:
    """Return what functions that read a recording say of a file, after its name; they raise nothing else."""
    readers: tuple[Callable, ...] = (read_recording, last_moment_s, read_layout)
    said = []
    for read in readers:
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


MADE_BY = '{"epuck_sim": "9.1"}'


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda _: None, "there is no such file"),
        (Path.mkdir, "is not a file"),
        (lambda path: path.write_bytes(b"Not a recording, but a text.\n" * 50), "is not a recording"),
        (lambda path: path.write_bytes(layout_file(arrangement_of(SCENARIO, Level.FULL))), "holds 0 recordings"),
        (lambda path: written(path, "other"), "made by other; allowed: one made by epuck-sim"),
        (lambda path: written(path, "epuck-sim"), "this version of epuck-sim reads format 1"),
        (lambda path: written(path, "epuck-sim", format=1, level="full"), "is not a complete recording: 'scenario'"),
        (two_in_one, "holds 2 recordings"),
        (without_outcome, "is not a complete recording: 'cycles'"),
        (lambda path: written(path, "epuck-sim", format=7, versions=MADE_BY), "format 7, made by epuck_sim 9.1"),
    ],
)
def test_what_is_no_recording_of_ours_is_refused(tmp_path, capfd, make: Callable[[Path], None], message: str) -> None:
    path = tmp_path / "t.rrd"
    make(path)
    capfd.readouterr()
    assert message in refusals(path)[0]
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("scenario", ["wings: 2", "]["])
def test_a_scenario_that_this_version_does_not_know_is_refused(tmp_path, monkeypatch, scenario: str) -> None:
    monkeypatch.setattr(recorder, "write_scenario", lambda _: scenario)
    recorded(tmp_path / "t.rrd", SCENARIO, level=Level.SUMMARY)
    (said,) = refusals(tmp_path / "t.rrd")
    assert said.startswith("holds a scenario that this version cannot read: ")
    assert read_layout(tmp_path / "t.rrd") is None  # it can be looked at all the same
