"""The command with particles, from a run to its figures: what it prints, writes, and refuses."""

import csv
import json
import signal
import sys
from pathlib import Path

import pyarrow.parquet as pq
import pytest
from matplotlib import image

from epuck_sim.cli import progress
from epuck_sim.estimate import significant
from epuck_sim.particles.simulation import ParticleSimulation
from epuck_sim.runs.reader import read_points
from epuck_sim.runs.status import read_outcome
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import points
from epuck_sim.trial.model import run_trial
from tests.cli.commands import call, cells, refused
from tests.processes import start, wait_until
from tests.runs.made_folders import rows
from tests.sweep.short_sweeps import table

pytestmark = pytest.mark.usefixtures("sweeps_run_here")

SPEED, RADIUS, REORIENT, COUNT = (
    "agents.speed_cm_s",
    "neighbourhood.radius_cm",
    "agents.reorient_on",
    "agents.count",
)
TINY = f"""
name: tiny
model: particles
agents: {{count: 6}}
neighbourhood: {{kind: cone_of_vision, angle_deg: 90}}
stop: {{max_cycles: 300}}
trials: 3
sweep:
  grid:
    {REORIENT}: [[], [emitting], [emitting, receiving]]
    {RADIUS}: [null, 50]
    {SPEED}: [3, 30]
"""
OVER_TIME = f"""
name: over-time
model: particles
agents: {{count: 5}}
start: {{phases: synchronised, displacement: 0.01}}
stop: {{order_parameter: null, max_cycles: 10}}
trials: 2
sweep: {{grid: {{{COUNT}: [4, 5], {SPEED}: [3, 30]}}}}
"""
UNTIL_SYNCHRONY = OVER_TIME.replace("start: {phases: synchronised, displacement: 0.01}\n", "").replace(
    "order_parameter: null, max_cycles: 10", "max_cycles: 300"
)


def called(*arguments: str | Path) -> str:
    """Return what a command prints that ends well."""
    result = call(*arguments)
    assert result.exit_code == 0, result.stderr
    return result.stdout


def trials(*arguments: str | Path) -> list[dict]:
    return [json.loads(line) for line in called("run", *arguments, "--json").splitlines()]


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / f"{name}.yaml"
    path.write_text(text)
    return path


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Return a run folder of a sweep over speeds, radii and occasions to reorient, which no test changes."""
    place = tmp_path_factory.mktemp("tiny")
    called("run", written(place, "tiny", TINY), "--out", place / "run", "--workers", 2)
    return place / "run"


@pytest.fixture(scope="module")
def over_time(tmp_path_factory) -> Path:
    """Return a run folder of a sweep with a displaced agent, which no test changes."""
    place = tmp_path_factory.mktemp("over_time")
    called("run", written(place, "over", OVER_TIME), "--out", place / "run", "--workers", 1)
    return place / "run"


@pytest.fixture(scope="module")
def until_synchrony(tmp_path_factory) -> Path:
    """Return a run folder of the same sweep whose trials end with synchrony, which no test changes."""
    place = tmp_path_factory.mktemp("until_synchrony")
    called("run", written(place, "over", UNTIL_SYNCHRONY), "--out", place / "run", "--workers", 1)
    return place / "run"


# Trials


def test_the_table_shows_each_trial() -> None:
    stdout = called("run", "particles", "--trials", 2)
    lines = cells(stdout)
    expected = run_trial(ParticleSimulation("particles", 0))
    assert stdout.startswith("particles")
    assert len(lines) == 2
    assert "censored no; order parameter 1\n" in stdout
    assert lines[0][:3] == ["0", str(expected.t_sync_cycles), significant(expected.simulated_s)]


def test_json_holds_what_the_library_gives() -> None:
    (row,) = trials("particles", "--seed", 5)
    expected = run_trial(ParticleSimulation("particles", 5))._asdict()
    del row["versions"]
    assert {**row, "wall_s": 0} == {**expected, "wall_s": 0, "events": []}


def test_trials_have_seeds_of_their_own_with_which_each_can_be_run_alone() -> None:
    found = trials("particles", "--trials", 3, "--seed", 5)
    assert found[0]["seed"] == 5
    assert len({row["seed"] for row in found}) == len({row["simulated_s"] for row in found}) == 3
    for row in found:
        (alone,) = trials("particles", "--seed", row["seed"])
        assert {**alone, "wall_s": 0} == {**row, "wall_s": 0}


def test_a_censored_trial_says_so() -> None:
    never = ("particles", "--set", "stop.max_cycles=7", "--set", "stop.order_parameter=1")
    assert "yes, at 7" in called("run", *never)
    (row,) = trials(*never)
    assert (row["censored"], row["t_sync_cycles"], row["cycles"]) == (True, None, 7)


def test_a_trial_in_which_the_reference_never_fires_has_no_order_parameter() -> None:
    settings = [
        "agents={count: 2, speed_cm_s: 0}",
        "response={curve: sawtooth, coupling: 1}",
        "clocks.jitter=0.2",
        "stop.max_cycles=3",
    ]
    scenario = load_scenario("particles", settings)
    seed = next(seed for seed in range(500) if run_trial(ParticleSimulation(scenario, seed)).order_parameter is None)
    options = [word for setting in settings for word in ("--set", setting)]
    (row,) = trials("particles", "--seed", seed, *options)
    assert (row["order_parameter"], row["cycles"], row["censored"]) == (None, 0, True)
    ((_, t_sync, censored, order, *_),) = cells(called("run", "particles", "--seed", seed, *options))
    assert (t_sync, censored, order) == ("-", "yes, at 0", "-")


def test_progress_is_a_line_now_and_then(monkeypatch) -> None:
    monkeypatch.setattr(progress, "LINE_S", 0.0)
    result = call("run", "particles", "--json")
    first, *_ = result.stderr.splitlines()
    assert first.startswith("trial 1 of 1: ")
    assert first.endswith(" x real time")
    assert len(result.stdout.splitlines()) == 1


# What is refused


# A sweep


def test_all_trials_of_all_points_are_run_by_the_workers(folder) -> None:
    found = read_points(folder)
    expected = points(load_scenario(folder))
    assert [(point.key, point.axes, point.scenario) for point in found] == [
        (point.key, point.axes, point.scenario) for point in expected
    ]
    for point in expected[::5]:
        results = [run_trial(ParticleSimulation(point.scenario, point.seed(trial))) for trial in range(3)]
        assert found[point.number].times.tolist() == [result.cycles for result in results]
        assert found[point.number].observed.tolist() == [not result.censored for result in results]


def test_to_run_a_folder_again_adds_nothing(folder) -> None:
    before = table(folder)
    for again in ((folder,), (folder.parent / "tiny.yaml", "--out", folder)):
        stdout = called("run", *again, "--workers", 1)
        assert "tiny: 12 points, 36 of 36 trials have a result" in stdout
        assert table(folder) == before


def test_more_trials_and_points_are_added_to_those_there_are(tmp_path) -> None:
    path = written(tmp_path, "tiny", OVER_TIME)
    called("run", path, "--trials", 1, "--out", tmp_path / "run", "--workers", 1)
    before = table(tmp_path / "run")
    called("run", path, "--sweep", f"{SPEED}=3,30,90", "--out", tmp_path / "run", "--workers", 1)
    assert len(before) == 4
    assert len(table(tmp_path / "run")) == 12
    assert {row[:2] for row in before} < {row[:2] for row in table(tmp_path / "run")}


def test_status_tells_how_far_it_is(folder) -> None:
    assert "tiny: 12 points, 36 of 36 trials have a result" in called("status", folder)
    status = json.loads(called("status", folder, "--json"))
    wanted = {"scenario": "tiny", "points": 12, "trials": 36, "stored": 36, "failed": [], "at_work": None}
    assert {key: status[key] for key in wanted} == wanted
    assert status["censored"] == sum((~point.observed).sum() for point in read_points(folder))


def test_a_changed_scenario_is_refused_with_the_difference(folder) -> None:
    before = table(folder)
    for setting, difference in (
        ("agents.count=7", "agents.count: 6 in the folder, 7 now"),
        ("clocks.jitter=0.1", "clocks.jitter: 0.0 in the folder, 0.1 now"),
        ("neighbourhood.kind=cone_of_emission", "neighbourhood.kind: 'cone_of_vision' in the folder, 'cone_of_"),
    ):
        result = call("run", folder.parent / "tiny.yaml", "--set", setting, "--out", folder)
        assert (result.exit_code, result.stdout) == (2, "")
        assert f"{folder}: holds results of another scenario; give another folder:\n  {difference}" in result.stderr
    assert table(folder) == before


def test_a_sweep_of_robots_is_refused_in_a_folder_of_particles(folder) -> None:
    result = call("run", "pair", "--out", folder)
    assert (result.exit_code, result.stdout) == (2, "")
    assert "holds another sweep; axes in the folder and now: " in result.stderr


def test_a_trial_of_robots_is_refused_in_a_folder_of_particles_that_is_no_sweep(tmp_path) -> None:
    called("run", "particles", "--set", "stop.max_cycles=2", "--out", tmp_path / "run", "--workers", 1)
    result = call("run", "pair", "--out", tmp_path / "run")
    assert result.exit_code == 2
    assert "  model: 'particles' in the folder, 'embodied' now\n" in result.stderr


@pytest.mark.parametrize(("point", "trial"), [(0, 0), (3, 1), (7, 2), (11, 2)])
def test_one_trial_of_the_folder_run_again_comes_out_as_it_is_stored(folder, point: int, trial: int) -> None:
    (row,) = trials(folder, "--point", point, "--trial", trial)
    assert (row["cycles"], row["censored"]) == read_outcome(folder, point, trial)
    assert row["seed"] == points(load_scenario(folder))[point].seed(trial)


# Tables


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_export_has_a_column_for_each_axis_with_lists_as_json_and_null_as_nothing(folder, tmp_path, ending) -> None:
    target = tmp_path / f"t{ending}"
    assert called("export", folder, "--to", target) == ""
    found = rows(target) if ending == ".csv" else pq.read_table(target).to_pylist()
    assert [*found[0]][:4] == [REORIENT, RADIUS, SPEED, "seed"]
    nothing, text = ("", str) if ending == ".csv" else (None, lambda value: value)
    expected = [
        (json.dumps(point.axes[REORIENT]), point.axes[RADIUS] and text(50), text(point.axes[SPEED]), text(trial))
        for point in points(load_scenario(folder))
        for trial in range(3)
    ]
    read = [(row[REORIENT], row[RADIUS] if row[RADIUS] != nothing else None, row[SPEED], row["trial"]) for row in found]
    assert read == expected
    assert {row[REORIENT] for row in found} == {"[]", '["emitting"]', '["emitting", "receiving"]'}
    cycles = [int(row["cycles"]) for row in found]
    assert cycles == [int(time) for point in read_points(folder) for time in point.times]


def test_summarize_has_a_row_for_each_point(folder) -> None:
    shown = cells(called("summarize", folder))
    assert len(shown) == 12
    summaries = [json.loads(line) for line in called("summarize", folder, "--json").splitlines()]
    found = summaries[0] if len(summaries) == 1 else summaries
    assert [each["axes"] for each in found] == [point.axes for point in points(load_scenario(folder))]


# Figures


@pytest.mark.parametrize(
    ("options", "name"),
    [
        ((), "T_sync"),
        (("--form", "curves"), "T_sync"),
        (("--form", "map", "--y", COUNT), "T_sync"),
        (("--form", "violins"), "T_sync"),
        (("--form", "violins", "--x", COUNT, "--censored-at", 200), "T_sync"),
        (("--form", "perturbation"), "perturbation"),
        (("--form", "course"), "course"),
    ],
)
def test_every_form_is_drawn_with_its_table_and_the_same_again(request, tmp_path, options, name: str) -> None:
    run = request.getfixturevalue("until_synchrony" if name == "T_sync" else "over_time")
    files = [Path(line) for line in called("plot", run, *options).splitlines()]
    assert [file.name for file in files[:3]] == [f"{name}.png", f"{name}.svg", f"{name}.csv"]
    assert all(file.parent == run for file in files)
    assert image.imread(files[0]).std() > 0.03
    assert len(rows(files[2])) >= 4
    for file in called("plot", run, *options, "--to", tmp_path / name).splitlines():
        assert Path(file).read_bytes() == (run / Path(file).name).read_bytes()
    for file in files:
        file.unlink()


@pytest.mark.parametrize("form", ["curves", "violins", "course"])
def test_axes_of_lists_and_null_are_drawn_too(folder, tmp_path, form: str) -> None:
    files = [Path(line) for line in called("plot", folder, "--form", form, "--to", tmp_path / "f").splitlines()]
    with files[2].open(newline="") as text:
        header = next(csv.reader(text))
    assert header[:2] == [REORIENT, RADIUS]
    assert len({tuple(row.values())[:2] for row in rows(files[2])}) == 6
    assert image.imread(files[0]).std() > 0.03


def test_curves_have_a_panel_for_each_value_of_the_axis_that_the_scenario_names(folder, tmp_path) -> None:
    text = TINY.replace("trials: 3", f"trials: 1\nfigure: {{panels: {REORIENT}}}").replace("300", "20")
    called("run", written(tmp_path, "tiny", text), "--out", tmp_path / "run", "--workers", 1)
    svg = (tmp_path / "run" / "T_sync.svg").read_text() if called("plot", tmp_path / "run") else ""
    for words in ("reorienting on = nothing", "reorienting on = emitting", "reorienting on = emitting and receiving"):
        assert svg.count(f">{words}<") == 1
    assert "reorienting on" not in called("plot", folder, "--to", tmp_path / "other")


def test_panels_are_those_wanted_rather_than_the_scenario_s(until_synchrony, tmp_path) -> None:
    called("plot", until_synchrony, "--panels", COUNT, "--to", tmp_path / "f")
    drawn = (tmp_path / "f.svg").read_text()
    assert [drawn.count(f">N = {count}<") for count in (4, 5)] == [1, 1]


def test_the_scenario_says_which_form_is_drawn(tmp_path) -> None:
    path = written(tmp_path, "over", f"{OVER_TIME}figure: {{form: course}}\n")
    called("run", path, "--out", tmp_path / "run", "--workers", 1)
    first, *_ = called("plot", tmp_path / "run").splitlines()
    assert Path(first).name == "course.png"


def test_fit_tells_that_there_are_too_few_speeds(folder) -> None:
    stdout = called("fit", folder)
    assert "Not looked for on 6 of 6 curves: 2 speeds; a minimum and a peak take 6." in stdout
    assert "No laws: no curve has a local minimum and a peak." in stdout
    fitted = json.loads(called("fit", folder, "--json"))
    assert [curve["axes"][RADIUS] for curve in fitted["curves"]] == [None, 50] * 3


def test_fit_of_one_speed_alone_is_refused(tmp_path) -> None:
    path = written(tmp_path, "sizes", UNTIL_SYNCHRONY.replace(f", {SPEED}: [3, 30]", ""))
    called("run", path, "--out", tmp_path / "run", "--workers", 1)
    assert "speed_cm_s" in refused("fit", tmp_path / "run")


# Ctrl-C

LOUD = """
import runpy, sys
from epuck_sim.cli import progress
progress.LINE_S = 0.05
sys.argv[0] = "epuck-sim"
runpy.run_module("epuck_sim", run_name="__main__")
"""
"""The command, that tells more often how far it is."""


@pytest.mark.parametrize("speed", [2, 0])
@pytest.mark.parametrize("signalled", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_long_trial_soon(tmp_path, speed: int, signalled: signal.Signals) -> None:
    settings = [f"agents.speed_cm_s={speed}", "response.coupling=0", "stop.max_cycles=1000000000"]
    options = [word for setting in settings for word in ("--set", setting)]
    errors = tmp_path / "stderr"
    with errors.open("w") as stderr:
        path = {"PYTHONPATH": str(Path(progress.__file__).parents[2])}
        process = start([sys.executable, "-c", LOUD, "run", "particles", *options], env=path, stderr=stderr)
    wait_until(lambda: errors.read_text().count("x real time") > 3)
    process.send_signal(signalled)
    stdout, _ = process.communicate(timeout=20)  # the trial itself would take hours
    assert (process.returncode, stdout) == (130, "")
    lines = errors.read_text().splitlines()
    assert lines[-1] == "interrupted"
    told = [line for line in lines[:-1] if not line.startswith("trial 1 of 1: ")]
    assert set(told) <= {"compiled code does not react to Ctrl-C; press it again to end at once"}  # a busy machine
