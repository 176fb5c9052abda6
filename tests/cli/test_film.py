"""Films, by `run --film`, `film` and `compare-film`: what they write and print, and how mistakes end."""

import json
from itertools import islice
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pyarrow.parquet as pq
import pytest

from epuck_sim import Simulation, film_trial, load_scenario
from epuck_sim.recording.reader import read_recording
from tests.cli.commands import call, called, set_to, trials
from tests.cli.films import frames_and_description, names
from tests.overhead.films import save
from tests.runs.made_folders import rows

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
    ran = trials(called(*command, "--film", "t.mp4", "--record", "t.rrd", *POSES, "--trace", "t.parquet"))
    assert ran == trials(called(*command))
    assert names(here) == sorted(f"t-{trial}.{kind}" for trial in (0, 1) for kind in ("mp4", "rrd", "parquet"))
    assert ran[0]["seed"] != ran[1]["seed"]
    for trial, row in enumerate(ran):
        description, recorded = frames_and_description(f"t-{trial}.mp4")[1], read_recording(here / f"t-{trial}.rrd")
        assert description["seed"] == recorded.seed == row["seed"]
        table = pq.read_table(f"t-{trial}.parquet")
        traced = np.column_stack([table["x_cm"], table["y_cm"]]).astype(np.float32)
        np.testing.assert_array_equal(recorded.positions.reshape(-1, 2), traced)
        assert len(recorded.time_s) == row["steps"]


def test_a_recording_is_filmed_as_the_trial_was_and_settings_change_the_camera_and_nothing_else(shelf, here) -> None:
    assert called("film", shelf / "three.rrd", "t.mp4") == ""
    assert names(here) == ["t.mp4"]
    frames, description = frames_and_description("t.mp4")
    original, described = frames_and_description(shelf / "three.mp4")
    assert description == described
    assert [frame.time_s for frame in frames] == [frame.time_s for frame in original]
    assert max(np.abs(a.picture.astype(int) - b.picture).mean() for a, b in zip(frames, original, strict=True)) < 1
    words = "--set overhead.light=lit --set overhead.width_px=200 --set overhead.frames_per_s=5"
    called("film", shelf / "three.rrd", "lit.mp4", *words.split())
    lit, changed = frames_and_description("lit.mp4")
    assert lit[0].picture.shape == (128, 200, 3)
    assert len(lit) == pytest.approx(len(frames) / 3, abs=1)
    assert lit[0].picture.mean() > 5 * frames[0].picture.mean()
    assert changed["overhead"] == described["overhead"] | {"light": "lit", "width_px": 200, "frames_per_s": 5}
    assert {**changed, "overhead": 0} == {**described, "overhead": 0}


SETTINGS = [
    *("robots.0.count=4", "robots.0.parameters.speed_cm_s=1.5", "robots.0.parameters.period_s=2.0"),
    *("overhead.width_px=160", "overhead.height_px=160"),
]


@pytest.fixture(scope="module")
def film(tmp_path_factory) -> Path:
    """Return a film of twelve seconds."""
    path = tmp_path_factory.mktemp("films") / "swarm.mp4"
    scenario = load_scenario("thesis", SETTINGS)
    with film_trial(path, scenario, seed=1) as observe:
        for step in islice(Simulation(scenario, seed=1), 121):
            observe(step, SimpleNamespace(cycles=0, order_parameter=None))
    return path


def test_a_film_is_shown_beside_trials_and_fitted(film, here) -> None:
    words = ["compare-film", film, "thesis", *set_to(*SETTINGS), "--trials", 3]
    result = call(*words, "--json", "--plot", "b.png", "--fit", "lab.yaml")
    assert result.exit_code == 0, result.stderr
    found = json.loads(result.stdout)
    assert (found["film"], found["scenario"]) == (str(film), "thesis")
    quantities = {each["name"]: each for each in found["quantities"]}
    speed = quantities["speed straight ahead"]
    assert speed["film"] == pytest.approx(1.5, rel=0.06)
    assert speed["trials"] == pytest.approx([1.5] * 3, rel=0.05)
    fitted = found["fitted"]["robots.0.parameters.speed_cm_s"]
    assert fitted["low"] <= 1.5 <= fitted["high"]
    assert names(here) == ["b.csv", "b.png", "lab.yaml"]
    read = rows(here / "b.csv")
    assert [row["trial"] for row in read[:4]] == ["film", "0", "1", "2"]
    assert len(read) == 4 * len(quantities)
    t_sync = quantities["T_sync"]
    statuses = [row["status"] for row in read if row["quantity"] == "T_sync"]
    assert (statuses[0] == "beyond") == t_sync["film_is_beyond"]
    assert [statuses[1:].count(status) for status in ("beyond", "unknown")] == [t_sync["beyond"], t_sync["unknown"]]
    assert "epuck_sim" in found["versions"]
    lab = load_scenario("lab.yaml")
    assert lab.robots[0].parameters["speed_cm_s"] == pytest.approx(fitted["value"], abs=1e-5)
    printed = call(*words).stdout
    assert printed.startswith(
        "3 trials are too few to tell whether the film is like them; give --trials 19 or more.\n\n"
    )
    assert all(said in printed for said in ("speed straight ahead", "A film does not tell coupling"))
    assert "commands" not in called("run", "lab.yaml", "--set", "stop.max_cycles=2", "--json")


def test_a_film_without_a_description_has_the_floor_of_the_scenario(film, here) -> None:
    save(here / "bare.mp4", frames_and_description(film)[0])
    wide = ["robots=[{count: 2, parameters: {speed_cm_s: 1.5, period_s: 2}}, {count: 2}]", "arena.width_cm=90"]
    words = ["--period-s", 2, "--trials", 1, *set_to(*wide)]
    bare = call("compare-film", "bare.mp4", "thesis", *words)
    assert (bare.exit_code, "warning: the film's floor" in bare.stderr) == (0, False), bare.stderr
    described = call("compare-film", film, "thesis", *words, "--set", "robots.1.count=1")
    assert described.exit_code == 0, described.stderr
    assert "warning: the film shows 4 robots, thesis has 3" in described.stderr
    assert "warning: the film's floor is 60 x 60 cm, that of thesis 90 x 60 cm" in described.stderr
