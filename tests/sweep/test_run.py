"""Sweeps from end to end: the same table however they are run, interrupted, or shared out; some end by themselves."""

import json
import os
import re
import signal
import sys
from collections.abc import Iterator
from itertools import accumulate
from pathlib import Path
from random import Random
from subprocess import Popen, TimeoutExpired
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.compatibility import Share
from epuck_sim.runs.reader import FinishedTrials, read_points, read_status
from epuck_sim.scenario.loader import load_scenario, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.sequential import Precision, look_contrast, look_interval, look_sizes
from epuck_sim.statistics.statistic import measure_t_sync, restrict
from epuck_sim.sweep import scheduler
from epuck_sim.sweep.looks import Looks
from epuck_sim.sweep.run import SweepProgress, first_of_each_kind, missing_tasks, run_sweep
from epuck_sim.sweep.worker import run_chunk
from tests.benchmarks.measuring import resident_kb
from tests.cli.commands import call
from tests.processes import processes_marked, start, wait_until
from tests.runs.made_folders import PERIOD, SPEED, edit
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import Stopped, begin, short_sweep, stopper, stored, table

TRIALS = 30
POINTS = 8


@pytest.fixture(scope="module")
def uninterrupted(tmp_path_factory) -> list[tuple]:
    """Return the table that every run of the short sweep must give: of one worker, never stopped."""
    folder = tmp_path_factory.mktemp("uninterrupted")
    run_sweep(load_scenario(short_sweep(folder, TRIALS)), folder / "run", pool_here)
    rows = table(folder / "run")
    assert len(rows) == POINTS * TRIALS
    return rows


def test_more_workers_give_the_same_table_leave_nothing_to_do_and_wrong_calls_make_no_folder(tmp_path, uninterrupted):
    scenario = load_scenario(short_sweep(tmp_path, TRIALS))
    tallies: list[SweepProgress] = []
    run_sweep(scenario, tmp_path / "run", 3, tallies.append)
    assert table(tmp_path / "run") == uninterrupted
    assert [*accumulate(len(tally.last) for tally in tallies)] == [tally.ended for tally in tallies]
    assert tallies[-1].ended == POINTS * TRIALS
    assert tallies[-1].stored == tallies[-1].trials == POINTS * TRIALS
    assert tallies[-1].censored > 0
    assert run_sweep(scenario, tmp_path / "run", lambda: pytest.fail("a pool was opened")).ended == 0
    with pytest.raises(ValueError, match=r"workers is 0; allowed: whole numbers from 1"):
        run_sweep(scenario, tmp_path / "other", workers=0)
    with pytest.raises(EpuckSimError, match="share is 1/20; leave it out: until looks at all trials of a point"):
        run_sweep(short_sweep(tmp_path, 20), tmp_path / "other", pool_here, share=Share(1, 20), until=Looks("10%"))
    assert not (tmp_path / "other").exists()


def test_trial_0_of_all_points_comes_first_and_one_of_each_set_of_controllers_is_compiled_ahead(tmp_path) -> None:
    places = points(load_scenario(short_sweep(tmp_path, 3)))
    tasks = [*missing_tasks(places, [range(3)] * POINTS, FinishedTrials([(2, [0]), (0, [2])]), interpret=False)]
    assert [task.place[::-1] for task in tasks] == sorted(task.place[::-1] for task in tasks)
    assert len(tasks) == POINTS * 3 - 2
    axes = ["robots.0.controller=firefly,oscillator,constant", "robots.0.count=2,3"]
    found = points(load_scenario({"trials": 2}, axes=axes))
    done = [*((number, [0, 1]) for number in (0, 1, 2)), (4, [0])]
    ahead = first_of_each_kind(found, [range(2)] * len(found), FinishedTrials(done), interpret=False)
    assert [task.place for task in ahead] == [(3, 0), (4, 1)]


@pytest.fixture
def temporary() -> Iterator[Path]:
    """A temporary folder with a short name: names of sockets in it may have 107 characters."""
    with TemporaryDirectory(prefix="e") as name:
        yield Path(name)


@pytest.mark.parametrize(("starting", "running"), [(1, 1), pytest.param(4, 6, marks=pytest.mark.slow)])
def test_a_run_killed_at_random_and_resumed_gives_the_same_table(tmp_path, uninterrupted, temporary, starting, running):
    path, folder, random = short_sweep(tmp_path, TRIALS), tmp_path / "run", Random(4)
    everything = POINTS * TRIALS
    while_starting = [random.uniform(0.05, 1.5) for _ in range(starting)]
    while_running = sorted(random.sample(range(1, everything // 2), running))
    kept = 0

    def started(mark: str) -> Popen:
        return begin(path, "--out", folder, "--workers", 2, folder=tmp_path, mark=mark, env={"TMPDIR": str(temporary)})

    for number, moment in enumerate([*while_starting, *while_running]):
        run = started(f"{tmp_path.name}-{number}")
        if isinstance(moment, float):
            with pytest.raises(TimeoutExpired):
                run.wait(moment)
        else:
            wait_until(lambda moment=moment: stored(folder) >= moment)
        assert run.poll() is None
        run.kill()
        run.communicate()
        assert stored(folder) >= kept
        kept = stored(folder)
        if kept:
            assert set(table(folder)) <= set(uninterrupted)
        wait_until(lambda number=number: not processes_marked(f"{tmp_path.name}-{number}"))
    assert 0 < kept < everything
    last = started("")
    last.communicate(timeout=300)
    assert last.returncode == 0
    assert table(folder) == uninterrupted


def test_a_request_ends_a_sweep_cleanly_and_it_says_how_to_go_on(tmp_path, uninterrupted, temporary) -> None:
    path, folder = short_sweep(tmp_path, TRIALS), tmp_path / "run"
    options = {"folder": tmp_path, "mark": tmp_path.name, "env": {"TMPDIR": str(temporary)}}
    run = begin(path, "--out", folder, "--workers", 2, **options)
    wait_until(lambda: stored(folder) > 5)
    os.killpg(run.pid, signal.SIGHUP)  # a terminal sends it to all processes
    out, err = run.communicate(timeout=300)
    assert run.returncode == 130
    kept = stored(folder)
    assert err.splitlines()[-1].startswith("stopped; ")
    assert f"{kept} of {POINTS * TRIALS} trials are stored" in err
    assert f"go on with: epuck-sim run {folder}" in err
    assert not {"Traceback", "Warning"} & set((out + err).replace(":", " ").split())
    wait_until(lambda: not processes_marked(tmp_path.name))
    assert list(temporary.glob("pymp-*")) == []
    run_sweep(load_scenario(folder), folder, pool_here)
    assert table(folder) == uninterrupted


@pytest.mark.parametrize("times", [1, pytest.param(6, marks=pytest.mark.slow)])
def test_ctrl_c_while_workers_start_is_quiet_too(tmp_path, times: int) -> None:
    path, random = short_sweep(tmp_path, 20 * TRIALS), Random(1)
    for number in range(times):
        mark = f"{tmp_path.name}-{number}"
        run = begin(path, "--out", tmp_path / f"run-{number}", "--workers", 2, folder=tmp_path, mark=mark)
        with pytest.raises(TimeoutExpired):
            run.wait(random.uniform(0.8, 2.2))
        os.killpg(run.pid, signal.SIGINT)
        out, err = run.communicate(timeout=300)
        assert run.returncode == 130, err
        assert "Traceback" not in out + err
        wait_until(lambda mark=mark: not processes_marked(mark))


CTRL_C_AS_A_WORKER_STARTS = """
import _thread, time
from multiprocessing import forkserver
from epuck_sim.sweep.scheduler import local_pool

read_number, pipes = forkserver.read_signed, []

def interrupted(pipe):
    pipes.append(pipe)
    if len(pipes) > 2:  # a first process has begun and ended
        _thread.interrupt_main()
        time.sleep(0.1)  # the main thread reacts before the worker has read what it needs
    return read_number(pipe)

if __name__ == "__main__":
    forkserver.read_signed = interrupted
    try:
        with local_pool(1):
            pass
    except KeyboardInterrupt:
        print("interrupted")
"""


def test_ctrl_c_never_leaves_a_worker_half_started(tmp_path) -> None:
    (tmp_path / "script.py").write_text(CTRL_C_AS_A_WORKER_STARTS)
    run = start([sys.executable, "script.py"], tmp_path.name, cwd=tmp_path)
    assert run.communicate(timeout=300) == ("interrupted\n", "")
    wait_until(lambda: not processes_marked(tmp_path.name))


@pytest.mark.parametrize("name", [["script.py"], []], ids=["file", "stdin"])
def test_a_script_that_begins_a_sweep_wherever_it_is_imported_or_is_no_file_is_told_so(tmp_path, name) -> None:
    short_sweep(tmp_path, 1)
    script = 'from epuck_sim import load_scenario, run_sweep\nrun_sweep(load_scenario("short.yaml"), "run")\n'
    (tmp_path / "script.py").write_text(script)
    with (tmp_path / "script.py").open() as given:
        run = start([sys.executable, *name], cwd=tmp_path, stdin=given)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 1
    assert err.endswith('a script must be a file, and begin sweeps below `if __name__ == "__main__":`\n')
    assert stored(tmp_path / "run") == 0


def test_a_temporary_folder_whose_path_is_too_long_for_sockets_is_named(tmp_path) -> None:
    (long := tmp_path / ("d" * 99)).mkdir()
    run = begin(short_sweep(tmp_path, 1), "--out", tmp_path / "run", folder=tmp_path, env={"TMPDIR": str(long)})
    _, err = run.communicate(timeout=300)
    said = r"error: workers cannot start: .*TMPDIR's path be short\n$"
    assert run.returncode == 0 or re.search(said, err), err  # later versions of Python take another folder


def test_trials_leave_nothing_behind_in_their_process(tmp_path) -> None:
    found = points(load_scenario(short_sweep(tmp_path, 32)))
    tasks = [*missing_tasks(found, [range(32)] * POINTS, FinishedTrials([]), interpret=False)]
    run_chunk(tasks[:100])
    before = resident_kb()
    run_chunk(tasks[100:250])
    assert resident_kb() <= 1.02 * before


def test_other_versions_that_made_trials_are_reported(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(scheduler, "local_pool", pool_here)
    folder = tmp_path / "run"
    run_sweep(load_scenario(short_sweep(tmp_path, 2)), folder, pool_here)
    assert "note: " not in call("run", folder).stderr
    edit(folder, "UPDATE trials SET pymunk = '6.0' WHERE trial = 1")
    noisy = call("run", folder)
    assert noisy.exit_code == 0
    assert re.search(r"note: 8 trials were made by epuck_sim .*, pymunk 6.0, .*; this is epuck_sim ", noisy.stderr)


MOST, ASKED, MORE, TOO_MUCH = 67, "24%", "19%", "14%"
"""Most trials at a point, and what is asked: some points end sooner than others, and the last is too much for some."""


def four_points(folder: Path, *changes: str) -> Scenario:
    return load_scenario(short_sweep(folder, MOST), changes, [f"{SPEED}=4,12"])


@pytest.fixture(scope="module")
def all_trials(tmp_path_factory) -> Path:
    """Return the run folder of the plain sweep, with all trials at all points."""
    folder = tmp_path_factory.mktemp("all_trials")
    run_sweep(four_points(folder), folder / "run", pool_here)
    return folder / "run"


def expected(all_trials: Path, asked: str, ended_well=lambda _: True) -> tuple[list[int], list[tuple]]:
    """Return where each point of the plain sweep would end, and the rows until there, if these seeds end well."""
    ends: dict[str, int] = {}
    for point in read_points(all_trials):
        is_kept = np.array([ended_well(seed) for seed in point.seeds])
        for size in look_sizes(MOST):
            times, observed = (each[:size][is_kept[:size]] for each in (point.times, point.observed))
            found = look_interval(measure_t_sync(point._replace(times=times, observed=observed)), MOST)
            ends[point.key] = size
            if Precision.parse(asked).width(found) <= 1:
                break
    return [*ends.values()], [row for row in table(all_trials) if row[1] < ends[row[0]]]


def test_the_trials_are_the_first_ones_of_a_plain_sweep_to_the_first_narrow_look(tmp_path, all_trials) -> None:
    scenario, folder = four_points(tmp_path), tmp_path / "run"
    for asked in (ASKED, MORE):  # a smaller one goes on in the folder
        ends, rows = expected(all_trials, asked)
        assert len(set(ends)) > 1
        looks = Looks(asked)
        progress = run_sweep(scenario, folder, pool_here, until=looks)
        assert table(folder) == rows
        assert (progress.trials, progress.stored) == (sum(ends), sum(ends))
        assert read_status(folder)[2:4] == (sum(ends), sum(ends))
        assert [row.cells["trials"] for row in looks.table().rows] == ends
    run_sweep(scenario, folder, pool_here)  # so does the plain sweep
    assert table(folder) == table(all_trials)
    again = run_sweep(scenario, folder, pool_here, until=Looks(ASKED))  # what else is stored changes nothing
    assert (again.trials, again.ended) == (sum(expected(all_trials, ASKED)[0]), 0)
    assert read_status(folder)[2:4] == (4 * MOST, 4 * MOST)


def test_trials_that_fail_are_left_out_of_intervals_and_interruptions_do_not_change_what_is_run(tmp_path, all_trials):
    measure = tmp_path / "picky.py"
    measure.write_text("def picky(simulation):\n    return 1 // (simulation.seed % 3)\n")
    looks, scenario = Looks(ASKED), four_points(tmp_path, f"measures=[{measure}]")
    progress = run_sweep(scenario, tmp_path / "run", pool_here, until=looks)
    ends, rows = expected(all_trials, ASKED, lambda seed: seed % 3 > 0)
    assert [row.cells["trials"] for row in looks.table().rows] == ends
    assert 0 < progress.failed == sum(row[5] % 3 == 0 for row in rows)
    assert progress.stored + progress.failed == progress.trials == sum(ends)
    scenario, folder = four_points(tmp_path), tmp_path / "stopped"
    ends, rows = expected(all_trials, ASKED)
    with pytest.raises(Stopped):
        run_sweep(scenario, folder, 2, stopper(sum(ends) - 30), until=Looks(ASKED))
    assert set(table(folder)) < set(rows)
    run_sweep(scenario, folder, pool_here, until=Looks(ASKED))
    assert table(folder) == rows


@pytest.mark.parametrize(("asked", "name"), [("33%", "ratio"), ("2.65", "difference")])
def test_points_of_a_contrast_end_together_at_the_first_look_that_is_narrow(tmp_path, all_trials, asked, name) -> None:
    looks, folder = Looks(asked, PERIOD), tmp_path / "run"
    progress = run_sweep(four_points(tmp_path), folder, pool_here, until=looks)
    precision, plain = Precision.parse(asked), {point.key: point for point in read_points(all_trials)}
    rows = dict(zip([point.key for point in read_points(folder)], looks.table().rows, strict=True))
    ends = {key: row.cells["trials"] for key, row in rows.items()}
    for speed in (4, 12):
        pair = [key for key, row in rows.items() if row.axes[SPEED] == speed]
        for size in look_sizes(MOST):
            both = [plain[key] for key in pair]
            cut = [each._replace(times=each.times[:size], observed=each.observed[:size]) for each in both]
            first, other = (look_interval(measure_t_sync(each), MOST) for each in cut)
            found = look_contrast(first, other, is_relative=name == "ratio")
            if precision.width(found) <= 1:
                break
        assert [ends[key] for key in pair] == [size, size]
        assert [rows[key].cells[name] for key in pair] == [None, found]
        assert rows[pair[1]].cells["is_narrow"] == (precision.width(found) <= 1)
    assert len(set(ends.values())) > 1
    assert table(folder) == [row for row in table(all_trials) if row[1] < ends[row[0]]]
    assert progress.trials == sum(ends.values())


def test_points_of_a_contrast_are_compared_up_to_the_same_cycle(tmp_path) -> None:
    looks = Looks("90%", "period_s")
    scenario = load_scenario("particles", ["max_time_s=280", "trials=20"], ["period_s=1,4"])
    run_sweep(scenario, tmp_path / "run", pool_here, until=looks)
    samples = restrict([measure_t_sync(point) for point in read_points(tmp_path / "run")])
    assert all(0 < each.censored < 1 for each in samples)
    expected = look_contrast(*(look_interval(each, 20) for each in samples), is_relative=True)
    assert looks.table().rows[1].cells["ratio"] == expected


def test_the_command_says_how_narrow_intervals_are(all_trials) -> None:
    ends, _ = expected(all_trials, TOO_MUCH)
    text, as_json = (call("run", f"{all_trials}/", "--until", TOO_MUCH, *words) for words in ([], ["--json"]))
    said = json.loads(as_json.stdout)["until"]
    assert [row["trials"] for row in said] == ends
    narrow = sum(row["is_narrow"] for row in said)
    assert 0 < narrow < 4
    for row in said:
        assert row["half_width"] == pytest.approx((row["mean_high"] - row["mean_low"]) / 2 / row["mean"])
        assert row["is_narrow"] == (row["half_width"] <= 0.14)
    assert f"Narrow enough: {narrow} of 4 points; the others have reached the limit of {MOST} trials" in text.stdout
    assert f"{narrow} of 4 points narrow enough" in text.stderr
