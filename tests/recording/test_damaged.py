"""A damaged recording is refused in words; it ends neither in a traceback nor in the end of the process."""

from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from epuck_sim.embodied.simulation import Simulation
from epuck_sim.errors import RecordingError
from epuck_sim.recording import reader as entities
from epuck_sim.recording.reader import last_moment_s, read_layout, read_recording
from epuck_sim.recording.recorder import record
from epuck_sim.recording.rrd_file import is_whole
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.trial.model import run_trial

SCENARIO = load_scenario(
    {"arena": {"width_cm": 40, "height_cm": 40}, "robots": [{"count": 2}], "stop": {"max_time_s": 2}}
)
FLIPS = st.lists(st.tuples(st.floats(0, 1, exclude_max=True), st.integers(1, 255)), min_size=1, max_size=3)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("whole") / "t.rrd"
    with record(path, SCENARIO, 1) as observer:
        run_trial(Simulation(SCENARIO, 1), [observer])
    return path


def refusals(path: Path) -> int:
    """Return how many of the functions that read a recording refuse it; they raise nothing else."""
    readers: tuple[Callable, ...] = (read_recording, last_moment_s, read_layout)
    count = 0
    for read in readers:
        message = ""
        try:
            read(path)
        except RecordingError as error:
            message = str(error)
        count += bool(message)
        assert not message or message.startswith(f"{path}: ")
    return count


@settings(max_examples=220, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(flips=FLIPS)
def test_changed_bytes_are_refused_in_words(whole: Path, tmp_path, flips) -> None:
    damaged = bytearray(whole.read_bytes())
    for place, change in flips:
        damaged[int(place * len(damaged))] ^= change
    path = tmp_path / "t.rrd"
    path.write_bytes(damaged)
    if is_whole(path) is None:  # the mark or the length within the seal was hit
        refusals(path)
    else:
        assert refusals(path) == (0 if damaged == whole.read_bytes() else 3)


@settings(max_examples=20, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(share=st.floats(0, 1, exclude_max=True))
def test_a_recording_that_is_cut_off_is_refused(whole: Path, tmp_path, share: float) -> None:
    path = tmp_path / "t.rrd"
    path.write_bytes(whole.read_bytes()[: int(share * whole.stat().st_size)])
    assert refusals(path) == 3


def test_a_recording_over_which_rerun_breaks_down_is_not_read(tmp_path, monkeypatch) -> None:
    program = tmp_path / "rerun"
    program.write_text("#!/bin/sh\nexit 101\n")
    program.chmod(0o700)
    monkeypatch.setattr("epuck_sim.recording.process.PROGRAM", (str(program),))
    monkeypatch.setattr(entities, "RrdReader", None)
    path = tmp_path / "t.rrd"
    path.write_bytes((Path(__file__).parents[1] / "old" / "0.1.0" / "robots.rrd").read_bytes())  # has no seal
    with pytest.raises(RecordingError, match="is not a complete recording: it is damaged; record the trial again"):
        read_recording(path)
