"""A run folder: what it holds, takes in and refuses, and that nothing of it is ever lost or half-written."""

import json
import math
import random
import re
import shutil
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.runs.compatibility import StoredPoint, check_same_sweep, stored_point
from epuck_sim.runs.database import check_database
from epuck_sim.runs.export import export
from epuck_sim.runs.reader import read_points, read_status
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario, points
from epuck_sim.util.provenance import host, versions
from tests.cli.commands import contents
from tests.control.bench import with_step
from tests.runs import made_folders
from tests.runs.made_folders import COUNT, DATABASE, DEMO, SPEED, fill, outcome, refusal, scenario_of, stored
from tests.tools import needs_compiler, no_file_larger_than

KILLED = {".lock": b"", ".lock-holder": b"process 1 on x", f"{DATABASE}.0123abcd.part": b"half"}
OF_ROBOTS = [f"robots.0.parameters.{name}" for name in ("speed_cm_s", "period_s", "coupling", "refractory_fraction")]


def test_a_trial_s_row_has_axes_in_the_sweep_s_order_its_seed_its_result_the_versions_and_the_host(tmp_path) -> None:
    many = {key: [0.2] for key in OF_ROBOTS}  # so that a set of their names is hardly ever in this order
    fill(tmp_path / "many", scenario_of({"grid": {COUNT: [2]} | many}, trials=1))
    assert [*stored(tmp_path / "many")[0]][3:8] == [COUNT, *OF_ROBOTS]
    found = made_folders.put(tmp_path / "demo", (1, 2))
    (row,) = stored(tmp_path / "demo")
    assert isinstance(row.pop("checksum"), int)
    place = {"number": 1, "point": found[1].key, "trial": 2, COUNT: 2, SPEED: 0.5, "seed": found[1].seed(2)}
    ends = {"t_sync_cycles": 1002, "censored": 0, "order_parameter": 0.96 + 1002 / 1e6, "cycles": 1002}
    lasts = {"simulated_s": 5010.0, "wall_s": 0.001 * 1002, "steps": 50_100}
    empty = dict.fromkeys(("error", "measured", "measuring_error", "events"))
    assert row == {**place, **ends, **lasts, **versions(), "host": host(), **empty}


@given(
    result=st.fixed_dictionaries(
        {
            "t_sync_cycles": st.none() | st.integers(0, 10**9) | st.just(np.int64(7)),
            "censored": st.none() | st.booleans(),
            "order_parameter": st.sampled_from([None, -0.0, math.nan, 1, 0.5]),
            "simulated_s": st.floats(0, 1e9) | st.integers(0, 10**9) | st.just(np.float64(0.1)),
        }
    ),
    axis=st.booleans() | st.integers(-(2**70), 2**70) | st.floats(allow_nan=False, allow_infinity=False) | st.text(),
)
@settings(max_examples=40)
def test_checksums_are_of_what_the_file_holds_whatever_kind_of_number_was_given(result: dict, axis: Any) -> None:
    with tempfile.TemporaryDirectory() as folder:
        found = [points(DEMO)[0]._replace(axes={COUNT: axis, SPEED: None})]
        with Store(Path(folder) / "written", DEMO, found) as store:
            store.add([outcome(found[0], 0, **result)])
        shutil.copytree(Path(folder) / "written", Path(folder) / "copied")  # which nobody has checked yet
        check_database(Path(folder) / "copied" / DATABASE)


def test_a_trial_that_has_a_result_is_never_overwritten_and_one_that_failed_by_its_next_outcome(tmp_path) -> None:
    found = points(DEMO)
    with Store(tmp_path / "run", DEMO, found) as store:
        store.add([outcome(found[0], 0)])
        before = stored(tmp_path / "run")
        for change in ({}, {"t_sync_cycles": 99}, {"error": "too late"}):
            store.add([outcome(found[0], 0, **change)])
            assert stored(tmp_path / "run") == before
        store.add([outcome(found[1], 0, t_sync_cycles=None, censored=True)])
        assert (set(store.finished()), store.censored()) == ({(0, 0), (1, 0)}, 1)
    with Store(tmp_path / "other", DEMO, found) as store:
        store.add([outcome(found[0], 0, error="first")])
        store.add([outcome(found[0], 0, error="second")])
        assert [row["error"] for row in stored(tmp_path / "other")] == ["second"]
        assert set(store.finished()) == set()
        ended = outcome(found[0], 0)
        store.add([ended._replace(provenance=(*ended.provenance[:-1], "elsewhere"))])
        assert set(store.finished()) == {(0, 0)}
    (row,) = stored(tmp_path / "other")
    assert (row["error"], row["t_sync_cycles"], row["steps"], row["host"]) == (None, 0, 0, "elsewhere")


def test_a_folder_grows_by_points_and_trials_and_numbers_follow_the_new_sweep(tmp_path) -> None:
    fill(tmp_path)
    before = {(row["point"], row["trial"]): row for row in stored(tmp_path)}
    grown = scenario_of({"grid": {SPEED: [0.25, 0.5, 1.0], COUNT: [1, 2.0, 3]}}, trials=5)
    found = points(grown)
    numbers = {point.key: point.number for point in found}
    assert numbers.keys() > {key for key, _ in before}
    with Store(tmp_path, grown, found) as store:
        assert set(store.finished()) == {(numbers[key], trial) for key, trial in before}
        store.add([outcome(found[0], 4)])
    after = {(row["point"], row["trial"]): row for row in stored(tmp_path)}
    new = after.pop((found[0].key, 4))
    assert (new["number"], new[COUNT], new[SPEED], new["seed"]) == (0, 1, 0.25, found[0].seed(4))
    assert after == {place: {**row, "number": numbers[place[0]]} for place, row in before.items()}
    assert load_scenario(tmp_path) == grown


def test_what_has_no_effect_on_a_trial_may_change_and_the_scenario_s_file_is_written_anew(tmp_path) -> None:
    fill(tmp_path)
    before = stored(tmp_path)
    for trials in (3000, 3):
        changed = load_scenario(DEMO, ["name=other", "description=other", f"trials={trials}"])
        with Store(tmp_path, changed, points(changed)) as store:
            assert len(set(store.finished())) == 12
        assert stored(tmp_path) == before
        assert load_scenario(tmp_path) == changed
    for spoil in (lambda path: path.unlink(), lambda path: path.write_text("spoilt")):
        spoil(tmp_path / "scenario.yaml")
        with Store(tmp_path, DEMO, points(DEMO)):
            assert load_scenario(tmp_path) == DEMO
    for place in ("here", "there"):  # the file of a robot moves
        (tmp_path / place).mkdir()
        (tmp_path / place / "small.yaml").write_text("mass_g: 140")
        fill(tmp_path / "moved", scenario_of(None, robot=str(tmp_path / place / "small.yaml")))


@pytest.mark.parametrize("left", [{}, {".lock": b""}, KILLED])
def test_a_folder_that_is_empty_but_for_what_a_killed_run_left_is_taken(tmp_path, left: dict[str, bytes]) -> None:
    for name, data in left.items():
        (tmp_path / name).write_bytes(data)
    assert len(fill(tmp_path)) == 4
    assert len(stored(tmp_path)) == 12
    assert set(contents(tmp_path)) == made_folders.FILES


def test_of_many_differences_from_another_scenario_the_first_eight_are_said(tmp_path) -> None:
    fill(tmp_path)
    stop = "stop={order_parameter: 0.9, max_cycles: 9, max_time_s: 9}"
    changes = ["arena={width_cm: 70, height_cm: 70}", "noise=off", "contact.friction=1", "seed=1", stop]
    first, *differences = refusal(tmp_path, load_scenario(DEMO, changes)).splitlines()
    assert first == f"{tmp_path}: holds results of another scenario; give another folder:"
    assert (len(differences), differences[-1]) == (9, "  ...")
    assert len(stored(tmp_path)) == 12


def test_an_axis_value_beyond_64_bits_is_stored(tmp_path) -> None:
    (tmp_path / "mine.py").write_text(made_folders.MINE)
    robots = [{"controller": str(tmp_path / "mine.py")}]
    fill(tmp_path / "r", scenario_of({"grid": {"robots.0.parameters.pace": [10**30]}}, robots=robots, trials=1))
    assert float(stored(tmp_path / "r")[0]["robots.0.parameters.pace"]) == 1e30


def test_a_sweep_of_which_nothing_was_run_gives_its_folder_up(tmp_path) -> None:
    with Store(tmp_path, DEMO, points(DEMO)):
        pass
    mended = load_scenario(DEMO, ["seed=1"], [f"{COUNT}=4,5"])
    fill(tmp_path, mended)
    assert [point.axes for point in read_points(tmp_path)] == [point.axes for point in points(mended)]


def test_a_database_that_another_program_has_locked_is_reported_and_stays_intact(tmp_path) -> None:
    found = points(DEMO)
    with Store(tmp_path, DEMO, found) as store, closing(sqlite3.connect(tmp_path / DATABASE)) as other:
        store.add([outcome(found[0], 0)])
        store._connection.execute("PRAGMA busy_timeout = 1")
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(StoreError, match="database is locked; stored results are intact"):
            store.add([outcome(found[0], 1)])
        other.rollback()
        store.add([outcome(found[0], 2)])
    assert [row["trial"] for row in stored(tmp_path)] == [0, 2]


@pytest.fixture(scope="module")
def big(tmp_path_factory) -> bytes:
    folder = tmp_path_factory.mktemp("big")
    fill(folder, load_scenario(DEMO, ["trials=100"]))
    return (folder / DATABASE).read_bytes()


def foreign_database(_: bytes) -> bytes:
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.execute("CREATE TABLE trials (point, trial)")
        connection.execute("CREATE TABLE points (key, number)")
        return connection.serialize()


def after(statement: str) -> Callable[[bytes], bytes]:
    """Return what another program may make of a database."""

    def change(whole: bytes) -> bytes:
        with closing(sqlite3.connect(":memory:", isolation_level=None)) as connection:
            connection.deserialize(whole)
            connection.execute(statement)
            return connection.serialize()

    return change


FORMAT_1 = "has format 1, this version of epuck-sim reads 2; to convert it, go on with the run in version 0.1.0"
SPOILT: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "empty": (lambda _: b"", "is not a database of epuck-sim"),
    "foreign": (foreign_database, "is not a database of epuck-sim"),
    "cut after its header": (lambda whole: whole[:100], "is damaged"),
    "cut in half": (lambda whole: whole[: len(whole) // 2], "is damaged"),
    "cut within its last page": (lambda whole: whole[:-10], "is damaged"),
    "with a part of a page": (lambda whole: whole + bytes(10), "is damaged: its end is missing"),
    "with bytes that are no text": (after("UPDATE points SET axes = CAST(x'ff' AS TEXT)"), "points holds text that is"),
    "without tables": (lambda whole: whole[:100] + random.Random(4).randbytes(3996) + whole[4096:], "is damaged"),
    "without points": (after("DELETE FROM points"), "is damaged: it has no points"),
    "without a point": (after("DELETE FROM points WHERE number = 0"), "it has trials of a point that is gone"),
    "without a table": (after("DROP TABLE trials"), "is damaged: it has no table trials"),
    "without checksums": (after("ALTER TABLE trials DROP COLUMN checksum"), "is damaged: trials has no checksums"),
    "changed": (after("UPDATE trials SET cycles = 0"), 'a row with a wrong checksum, point {"robots.0.count": 2.0, '),
    "of the format before the first release": (after("PRAGMA user_version = 1"), FORMAT_1),
    "of another format": (after("PRAGMA user_version = 3"), "has format 3, this version of epuck-sim reads 2"),
}


@pytest.mark.parametrize("kind", SPOILT)
def test_a_database_that_is_not_ours_or_is_damaged_is_refused_by_all_and_untouched(tmp_path, big, kind: str) -> None:
    spoil, message = SPOILT[kind]
    folder = tmp_path / "r"
    folder.mkdir()
    (folder / DATABASE).write_bytes(spoil(big))
    (folder / "scenario.yaml").write_text("older")
    before = contents(folder)
    for use in (
        lambda: Store(folder, DEMO, points(DEMO)),
        lambda: read_status(folder),
        lambda: read_points(folder),
        lambda: export(folder, tmp_path / "results.csv"),
    ):
        with pytest.raises(StoreError) as caught:
            use()
        assert str(caught.value).startswith(f"{folder / DATABASE}: ")
        assert message in str(caught.value)
        assert before.items() <= contents(folder).items()
    assert not (tmp_path / "results.csv").exists()


def test_where_the_disk_is_full_no_half_database_is_made_and_what_is_stored_stays_whole(tmp_path) -> None:
    with no_file_larger_than(5000), pytest.raises(EpuckSimError, match=DATABASE):
        Store(tmp_path, DEMO, points(DEMO))
    assert set(contents(tmp_path)) <= {".lock"}
    found = points(load_scenario(DEMO, ["trials=50"]))
    with Store(tmp_path, DEMO, found) as store:
        for trial in range(5):
            store.add([outcome(found[1], trial)])
        size = (tmp_path / f"{DATABASE}-wal").stat().st_size
        with no_file_larger_than(size + 100), pytest.raises(StoreError, match="stored results are intact"):
            store.add([outcome(found[1], 5)])
        assert len(set(store.finished())) == 5
        store.add([outcome(found[1], 6)])
    assert [row["trial"] for row in stored(tmp_path)] == [0, 1, 2, 3, 4, 6]


FOLDER = Path("runs/old")


def described(*settings: str, scenario: str = "thesis") -> StoredPoint:
    return stored_point(points(load_scenario(scenario, settings))[0])._replace(trials=1)


def without(point: StoredPoint, *keys: str) -> StoredPoint:
    """Return a stored point as it was before there were these dotted keys."""
    scenario = json.loads(point.scenario)
    for key in keys:
        *path, last = key.split(".")
        section = scenario
        for part in path:
            section = section[int(part) if part.isdigit() else part]
        del section[last]
    return point._replace(scenario=json.dumps(scenario))


NEW = ("spread", "stuck", "stop.further_cycles", "robots.0.camera.frames_per_s", "robots.0.camera.latency_ms")


def test_a_folder_that_lacks_newer_keys_belongs_to_the_scenario_with_their_defaults_and_to_no_other():
    check_same_sweep(FOLDER, [without(described(), *NEW, "overhead")], [described()])
    now = described(scenario="particles")
    check_same_sweep(FOLDER, [without(now, "clocks.jitter")], [now])
    old, scenario = without(described(), *NEW), json.loads(described().scenario)
    scenario["contact"]["bounce"] = 0.5  # which today's keys do not fit
    unfit = described()._replace(scenario=json.dumps(scenario))
    for stored_now, now, difference in (
        (old, described("spread.clock_rate=0.01"), "spread.clock_rate: 0.0 in the folder, 0.01 now"),
        (old, described("stuck.per_hour=2"), "stuck.per_hour: 0.0 in the folder, 2.0 now"),
        (old, described("robots.0.camera.frames_per_s=8"), "robots.0.camera.frames_per_s: null in the folder, 8.0 now"),
        (old, described("arena.width_cm=70"), "arena.width_cm: 60.0 in the folder, 70.0 now"),
        (unfit, described(), "contact.bounce: 0.5 in the folder, 'nothing' now"),
    ):
        with pytest.raises(StoreError) as caught:
            check_same_sweep(FOLDER, [stored_now], [now])
        assert str(caught.value).splitlines()[1:] == [f"  {difference}"]


EYE = "READINGS = {'eye': float}\ndef sense(w, robot, readings, p, r): readings.eye = NUMBER\n"
CURVE = "def phase_shift(phase, coupling, parameters):\n    return NUMBER * coupling\n"
FIRMWARE = "#define PARAMETERS\n#define MEMORY\n#include <epuck.h>\nvoid start(void) {}\nvoid step(void) { NUMBER; }\n"
OWN = {  # the key that names each file of a user's, and what is in it
    "eye.py": ("robots.0.sensors=[{}]", EYE),
    "mine.py": ("robots=[{{count: 2, controller: {}}}]", with_step("actuators.left_cm_s = NUMBER")),
    "mine.c": ("robots=[{{count: 2, controller: {}}}]", FIRMWARE),
    "curve.py": ("response.curve={}", CURVE),
    "ground.png": ("arena.floor.picture={}", ""),
}


@pytest.mark.parametrize("name", [pytest.param(name, marks=[needs_compiler] * (name == "mine.c")) for name in OWN])
def test_trials_with_another_version_of_a_file_are_refused_wherever_it_lies(tmp_path, name):
    key, text = OWN[name]

    def write(path: Path, number: int) -> None:
        if text:
            path.write_text(text.replace("NUMBER", str(number)))
        else:
            cv2.imwrite(str(path), np.full((2, 2), number, np.uint8))

    versions = []
    for folder, number in (("here", 0), ("there", 0), ("edited", 255)):
        (tmp_path / folder).mkdir()
        write(tmp_path / folder / name, number)
        scenario = "particles" if name == "curve.py" else "thesis"
        versions.append(described(key.format(tmp_path / folder / name), scenario=scenario))
    here, there, edited = versions
    check_same_sweep(FOLDER, [here], [there])
    with pytest.raises(StoreError, match=rf"'{re.escape(name)} with digest .* in the folder, '{re.escape(name)} with"):
        check_same_sweep(FOLDER, [here], [edited])
