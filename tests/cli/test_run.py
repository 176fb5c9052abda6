"""The command: what it prints of trials, where, of which size it says that they are, and how it ends."""

import json
import re
import signal
import sys
import time
from pathlib import Path

import pytest

from epuck_sim import ParticleSimulation, __version__, load_scenario, run_trial
from epuck_sim.cli import errors, progress
from epuck_sim.cli.errors import word_if_slow
from epuck_sim.scenario.yaml_io import parse_yaml
from epuck_sim.util import atomic_write
from tests.cli.commands import call, called, cells, read, refused, set_to, trials
from tests.processes import start, wait_until

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


def test_json_is_one_object_a_trial_and_the_seed_of_one_gives_the_same_trial_alone() -> None:
    rows = trials(called("run", "thesis", "--trials", "3", "--seed", "5", "--json"))
    assert (len({row["seed"] for row in rows}), rows[0]["seed"]) == (3, 5)
    wanted = {"scenario", "seed", "t_sync_cycles", "censored", "order_parameter", "simulated_s", "wall_s", "steps"}
    for row in rows:
        assert wanted <= row.keys()
        assert (row["scenario"], row["censored"], row["versions"]["epuck_sim"]) == ("thesis", False, __version__)
        assert row["order_parameter"] >= 0.95
        assert row["simulated_s"] == row["steps"] / 10
    for row in (rows[0], rows[2]):
        assert trials(called("run", "thesis", "--seed", row["seed"], "--json")) == [row]


def test_of_millions_of_traces_only_those_that_are_there_already_are_checked_one_by_one(tmp_path, monkeypatch) -> None:
    checked = []
    check = atomic_write.check_target
    monkeypatch.setattr(atomic_write, "check_target", lambda path: checked.append(path.name) or check(path))
    for name in ("t-5.parquet", "t-x.parquet", "t-99999999.parquet", "u-5.parquet"):
        (tmp_path / name).touch()
    atomic_write.check_trial_paths(tmp_path / "t.parquet", 10_000_000)
    assert checked == ["t.parquet", "t-9999999.parquet", "t-5.parquet"]


def test_without_a_terminal_progress_is_a_line_now_and_then(monkeypatch) -> None:
    monkeypatch.setattr(progress, "LINE_S", 0.0)
    result = call("run", "pair", "--json")
    *_, before_last, _ = result.stderr.splitlines()
    cycle, per_cent, r, simulated_s, factor = re.fullmatch(
        r"trial 1 of 1: cycle (\d+), ([\d.]+) % of the limit, order parameter ([\d.]+), ([\d.]+) s simulated, "
        r"(\d+) x real time",
        before_last,
    ).groups()
    limit = load_scenario("pair").stop.max_cycles
    assert float(per_cent) == pytest.approx(100 * int(cycle) / limit, rel=0.06)
    assert float(r) <= 1
    assert min(float(simulated_s), int(factor)) > 0
    assert len(result.stdout.splitlines()) == 1


def test_a_trial_that_looks_hopeless_says_so_once_and_what_to_do_and_ends_as_it_would() -> None:
    for changes, says in (
        (["count=1", "coupling=0"], "will end at its limit: its one oscillator has no other to synchronise with"),
        (["count=3", "coupling=0"], "looks hopeless: over 200 cycles the order parameter, 0."),
    ):
        alone = ("run", "thesis", *set_to(*changes), "--json")
        result = call(*alone, "--set", "max_cycles=700", "--trials", "2")
        assert [json.loads(line)["cycles"] for line in result.stdout.splitlines()] == [700, 700]
        said = [line for line in result.stderr.splitlines() if " of 2 " in line]
        assert len(said) == 2
        assert said[1].startswith(f"trial 2 of 2 {says}")
        assert said[1].endswith("; sooner: --set stop.max_cycles=300")
        called(*alone, "--set", "max_cycles=300")  # which is what to do
        called(*alone, "--set", "max_cycles=700", "--set", "order_parameter=null")  # nobody waits for synchrony


def test_without_an_oscillator_and_a_limit_trials_end_after_ten_minutes_and_the_command_says_so() -> None:
    wanders = ("run", "thesis", *set_to("controller=constant", "parameters={}", "count=1"))
    result = call(*wanders, "--json")
    assert json.loads(result.stdout)["simulated_s"] == 600
    said = "note: robot 0 is no oscillator, so trials have no T_sync; they end after 600 simulated seconds"
    assert result.stderr == f"{said}; for another limit: --set stop.max_time_s=3600\n"
    for limit, simulated_s in {"max_time_s=700": 700, "max_time_s=600": 600}.items():
        assert read(*wanders, "--set", limit)["simulated_s"] == simulated_s
    result = call(*wanders, "--json", "--set", "max_cycles=130")
    assert json.loads(result.stdout)["simulated_s"] == 650
    assert "no T_sync; they end after 130 cycles of 5 s; for another limit" in result.stderr


def test_of_what_happens_in_a_trial_nothing_is_noted() -> None:
    frozen = [{"kind": "oscillator_frozen", **whom} for whom in ({"count": 0}, {"robots": [1, 2], "share": 0.5})]
    begins = {"faults": [{"kind": "ring_dead", "at_s": 9}, *frozen], "stop": {"max_time_s": 9.5}}
    comes_back = {"schedule": [{"at_s": 5, "add": [1]}, {"at_s": 2, "remove": [1]}]}
    reached = {"model": "particles", "clocks": {"jitter": 0.01}, "stop": {"order_parameter": 0.95}}
    for given in (begins, comes_back, reached, {"robots": [{"count": 3, "parameters": {"flash_pixels": 2}}]}):
        assert load_scenario(given).notes == []
    ends = {"model": "particles", "schedule": [{"at_s": 9, "displace": {"by_cycles": 1}}], "stop": {"max_time_s": 9}}
    assert load_scenario(ends).notes == []
    assert [event.time_s for event in run_trial(ParticleSimulation(ends)).events] == [9]


SWEEP = ("particles", "--sweep", "agents.speed_cm_s=1,2,3", "--set", "trials=400", "--set", "stop.max_cycles=3")
LARGE = ("arena.width_cm=5000", "arena.height_cm=5000", "robots.0.count=20000", "robots.0.camera.pixels=900")


def test_check_and_sweeps_say_what_points_and_trials_take_and_too_much_memory_is_refused(tmp_path, monkeypatch) -> None:
    printed = called("check", *SWEEP)
    assert printed.endswith("\n# 3 points, 1200 trials: about 174 kB on disk\n")
    assert load_scenario(parse_yaml(printed, "stdout")).trials == 400
    last = called("check", "thesis", *set_to(*LARGE, "measures=[order_parameter]")).splitlines()[-1]
    assert last == "# 1 point, 1 trial: about 0.14 kB on disk, besides its measures; up to 240 MB of memory for a trial"
    result = call("run", *SWEEP, "--trials", "2", "--out", tmp_path / "run", "--json", "--workers", "1")
    assert result.exit_code == 0
    assert result.stderr.startswith("particles: 3 points, 6 trials: about 0.87 kB on disk\n")
    assert json.loads(result.stdout)["stored"] == 6
    monkeypatch.setattr("epuck_sim.util.machine.available_bytes", lambda: 1000)
    monkeypatch.setattr("epuck_sim.sweep.demand.available_bytes", lambda: 1000)
    (tmp_path / "new").mkdir()
    message = refused("run", "thesis", *set_to(*LARGE[:3]), "--out", tmp_path / "new" / "large", "--workers", "2")
    assert "on each of 2 workers needs about 211 MB of memory, and 1 kB are available here" in message
    assert not list((tmp_path / "new").iterdir())


def test_what_takes_long_is_named_once(monkeypatch, capsys) -> None:
    monkeypatch.setattr(errors, "SLOW_S", 0.05)
    for lasts_s, said in ((0.0, ""), (0.3, "reading big.yaml takes a while; Ctrl-C ends it\n")):
        with word_if_slow("reading big.yaml"):
            time.sleep(lasts_s)
        assert capsys.readouterr().err == said


def test_json_holds_what_the_library_gives_also_where_the_reference_never_fires() -> None:
    (row,) = trials(called("run", "particles", "--seed", 5, "--json"))
    expected = run_trial(ParticleSimulation("particles", 5))._asdict()
    del row["versions"]
    assert row == {**expected, "wall_s": 0, "events": []}
    settings = ["agents={count: 2, speed_cm_s: 0}", "response={curve: sawtooth, coupling: 1}", "clocks.jitter=0.2"]
    settings += ["stop.max_cycles=3", "stop.order_parameter=0.95"]
    scenario = load_scenario("particles", settings)
    seed = next(seed for seed in range(500) if run_trial(ParticleSimulation(scenario, seed)).order_parameter is None)
    command = ["run", "particles", "--seed", seed, *set_to(*settings)]
    row = read(*command)
    assert (row["order_parameter"], row["cycles"], row["censored"]) == (None, 0, True)
    ((_, t_sync, censored, order, *_),) = cells(called(*command))
    assert (t_sync, censored, order) == ("-", "yes, at 0", "-")


def test_ctrl_c_ends_a_long_trial_soon(tmp_path) -> None:
    options = set_to("agents.speed_cm_s=0", "response.coupling=0", "stop.max_cycles=1000000000")
    errors, path = tmp_path / "stderr", {"PYTHONPATH": str(Path(progress.__file__).parents[2])}
    loud = "from epuck_sim.cli import progress; progress.LINE_S = 0.05; from epuck_sim.__main__ import main; main()"
    with errors.open("w") as stderr:
        process = start([sys.executable, "-c", loud, "run", "particles", *options], env=path, stderr=stderr)
    wait_until(lambda: errors.read_text().count("x real time") > 3)
    process.send_signal(signal.SIGINT)
    stdout, _ = process.communicate(timeout=300)  # the trial itself would take hours
    assert (process.returncode, stdout) == (130, "")
    lines = errors.read_text().splitlines()
    assert lines[-1] == "interrupted"
    told = [line for line in lines[:-1] if not line.startswith("trial 1 of 1: ")]
    assert set(told) <= {"the running code does not react to Ctrl-C; press it again to end at once"}  # a busy machine
