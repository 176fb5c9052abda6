"""Films of trials, by `run --film` and by `film`: what they write and print, and how mistakes end."""

from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from epuck_sim.recording.reader import read_recording
from tests.cli.commands import called, trials
from tests.cli.films import frames_and_description, names

THREE = """
name: three
arena: {width_cm: 40, height_cm: 40}
robots: [{count: 3, controller: firefly}]
stop: {max_cycles: 2}
overhead: {width_px: 160, height_px: 128}
"""

POSES = ("--record-level", "poses")
"""What cameras see is not recorded: to compile that takes a while."""


@pytest.fixture(scope="module")
def shelf(tmp_path_factory) -> Path:
    """Return a folder of a trial's scenario, film and recordings that no test changes."""
    folder = tmp_path_factory.mktemp("shelf")
    (folder / "three.yaml").write_text(THREE)
    run = "run", folder / "three.yaml"
    called(*run, "--record", folder / "three.rrd", *POSES, "--film", folder / "three.mp4")
    called(*run, "--record", folder / "summary.rrd", "--record-level", "summary")
    return folder


def test_several_trials_are_the_same_filmed_recorded_and_traced_into_files_of_their_own(shelf, here) -> None:
    command = ["run", shelf / "three.yaml", "--trials", "2", "--seed", "7", "--json"]
    rows = trials(called(*command, "--film", "t.mp4", "--record", "t.rrd", *POSES, "--trace", "t.parquet"))
    assert rows == trials(called(*command))
    assert names(here) == sorted(f"t-{trial}.{kind}" for trial in (0, 1) for kind in ("mp4", "rrd", "parquet"))
    assert rows[0]["seed"] != rows[1]["seed"]
    for trial, row in enumerate(rows):
        description, recorded = frames_and_description(f"t-{trial}.mp4")[1], read_recording(here / f"t-{trial}.rrd")
        assert description["seed"] == recorded.seed == row["seed"]
        table = pq.read_table(f"t-{trial}.parquet")
        traced = np.column_stack([table["x_cm"], table["y_cm"]]).astype(np.float32)
        np.testing.assert_array_equal(recorded.positions.reshape(-1, 2), traced)
        assert len(recorded.time_s) == row["steps"]


def test_a_recording_is_filmed_as_the_trial_was(shelf, here) -> None:
    assert called("film", shelf / "three.rrd", "t.mp4") == ""
    assert names(here) == ["t.mp4"]
    frames, description = frames_and_description("t.mp4")
    original, described = frames_and_description(shelf / "three.mp4")
    assert description == described
    assert [frame.time_s for frame in frames] == [frame.time_s for frame in original]
    assert max(np.abs(a.picture.astype(int) - b.picture).mean() for a, b in zip(frames, original, strict=True)) < 1


@pytest.mark.usefixtures("here")
def test_settings_change_the_camera_and_nothing_else(shelf) -> None:
    called("film", shelf / "three.rrd", "dark.mp4")
    words = "--set overhead.light=lit --set overhead.width_px=200 --set overhead.frames_per_s=5"
    called("film", shelf / "three.rrd", "lit.mp4", *words.split())
    (dark, described), (lit, changed) = frames_and_description("dark.mp4"), frames_and_description("lit.mp4")
    assert lit[0].picture.shape == (128, 200, 3)
    assert len(lit) == pytest.approx(len(dark) / 3, abs=1)
    assert lit[0].picture.mean() > 5 * dark[0].picture.mean()
    assert changed["overhead"] == described["overhead"] | {"light": "lit", "width_px": 200, "frames_per_s": 5}
    assert {**changed, "overhead": 0} == {**described, "overhead": 0}
