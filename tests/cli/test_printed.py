"""What commands print, of which size they say that trials are, how far they come, what failed, and how they end."""

import errno
import json
import re
import signal
import sys
import time
from contextlib import suppress
from io import StringIO
from pathlib import Path
from threading import Event
from types import SimpleNamespace
from unittest.mock import Mock

import numpy as np
import pytest
from rich.console import Console

from epuck_sim import ParticleSimulation, TrialResult, __version__, load_scenario, run_trial
from epuck_sim.cli import errors, progress, tables
from epuck_sim.cli.errors import note_if_slow, print_stderr
from epuck_sim.cli.plan import Duration, print_plan
from epuck_sim.cli.progress import LINE_S, SweepProgressBar
from epuck_sim.cli.tables import MOST_LISTED, describe_at_limit, print_status
from epuck_sim.estimate import Estimate
from epuck_sim.runs.reader import Failure, PointAtLimit, Status, TrialsByOrigin
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.statistic import Measured, estimate
from epuck_sim.sweep.run import SweepProgress
from epuck_sim.util import atomic_write, jit, native
from epuck_sim.util.provenance import PROVENANCE
from epuck_sim.util.yaml_io import parse_yaml
from tests.cli.commands import call, called, cells, read, refused, set_to, trials
from tests.processes import start, wait_until

pytestmark = pytest.mark.usefixtures("sweeps_run_here")


def test_json_is_one_object_a_trial_as_the_library_gives_it_and_its_seed_gives_it_alone() -> None:
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


def test_trials_that_look_hopeless_or_have_no_oscillator_say_so_once_and_end_as_they_would() -> None:
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
        with note_if_slow("reading big.yaml"):
            time.sleep(lasts_s)
        assert capsys.readouterr().err == said


def test_a_log_on_a_full_disk_or_a_closed_stderr_ends_nothing_but_a_reader_who_is_gone(monkeypatch, capsys) -> None:
    monkeypatch.setattr(sys, "stderr", None)
    print_stderr("not among what is printed on stdout, such as JSON")
    assert capsys.readouterr().out == ""
    monkeypatch.setattr(sys, "stderr", StringIO())
    monkeypatch.setattr(sys.stderr, "flush", Mock(side_effect=[OSError(errno.ENOSPC, ""), OSError(errno.EPIPE, "")]))
    print_stderr("lost")
    with pytest.raises(BrokenPipeError):
        print_stderr("in vain")
    assert errors._message(FileNotFoundError(errno.ENOENT, "is gone")) == "the current folder: is gone"


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


@pytest.fixture
def clock(monkeypatch) -> SimpleNamespace:
    """Return a clock that stands until its `now` is moved."""
    clock = SimpleNamespace(now=1e6, monotonic=lambda: clock.now)
    monkeypatch.setattr(progress, "time", clock)
    return clock


def tally(ended: int, before: int = 0, censored: int = 0, failed: int = 0) -> SweepProgress:
    return SweepProgress(1000, before + ended - failed, censored, failed, ended)


def shown(clock, capsys, steps: list[tuple[float, SweepProgress]]) -> list[str]:
    """Return the lines on stderr after tallies came at these times; nothing may be on stdout."""
    began = clock.now
    with SweepProgressBar() as tell:
        for at_s, each in steps:
            clock.now = began + at_s
            tell(each)
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err.splitlines()


def test_a_line_tells_trials_done_and_time_left_no_more_often_than_it_should_and_the_last_always(clock, capsys) -> None:
    # the first trial, which waits for the workers to start, is no measure, nor is what was stored before
    resumed = [(0, tally(0, 100, 7)), (5, tally(1, 100, 7)), (65, tally(301, 100, 42))]
    failing = [(0, tally(1)), (60, tally(501, failed=100))]
    failed = "401 of 1000 trials, 0 censored, 100 failed, 500 a minute, 60 s left"
    for steps, *lines in (
        ([(20, tally(1))], "1 of 1000 trials, 0 censored"),
        (resumed, "100 of 1000 trials, 7 censored", "401 of 1000 trials, 42 censored, 300 a minute, 2 min left"),
        (failing, "1 of 1000 trials, 0 censored", failed),
    ):
        assert shown(clock, capsys, steps) == [f"{lines[0]}; starting workers", *lines[1:]]
    now_and_then = [(number / 10, tally(number)) for number in range(600)]
    after_a_pause = [(0, tally(0)), (95, tally(1)), (95.1, tally(2)), (104.9, tally(3)), (105.1, tally(4))]
    for steps, told in (
        (now_and_then, [*range(0, 600, round(10 * LINE_S))]),
        (after_a_pause, [0, 1, 4]),
        ([(0, tally(998, failed=1)), (0.1, tally(999, failed=1)), (0.2, tally(1000, failed=2))], [997, 998]),
        ([(0, tally(0)), (10, tally(1)), (10, tally(500)), (10, tally(1000))], [0, 1, 1000]),  # at one moment
    ):
        assert [int(line.split()[0]) for line in shown(clock, capsys, steps)] == told


@pytest.mark.parametrize("width", [120, 60])
def test_a_terminal_has_a_bar_whose_words_stay_whole_and_its_cursor_after_ctrl_c(clock, capsys, monkeypatch, width):
    written = StringIO()
    console = Console(file=written, force_terminal=True, width=width, color_system=None, legacy_windows=False)
    monkeypatch.setattr(progress, "Console", lambda *, stderr: console if stderr else pytest.fail("on stdout"))
    assert shown(clock, capsys, [(0, tally(0)), (5, tally(1)), (65, tally(501, censored=3))]) == []
    last = re.sub(r"\x1b\[[?\d]*[a-zA-Z]", "", written.getvalue().rpartition("\r")[2]).strip()
    assert 0 < last.count("━") <= 20  # of 40
    assert last.endswith("501 of 1000 trials, 3 censored, 500 a minute, 60 s left")
    with suppress(KeyboardInterrupt), SweepProgressBar() as tell:
        tell(tally(1))
        raise KeyboardInterrupt
    assert written.getvalue().rfind("\x1b[?25h") > written.getvalue().rfind("\x1b[?25l") >= 0


FAILURES = [Failure(point, 3 * point, 77, f"ValueError: {point}") for point in range(MOST_LISTED + 5)]
MADE_BY = "epuck_sim 1, pymunk 7, numba 0.65, numpy 2, python 3.11"


def status(**changes) -> Status:
    versions = [TrialsByOrigin("1", "7", "0.65", "2", "3.11", host, n) for host, n in (("a", 1000), ("b", 234))]
    done = {"stored": 1234, "censored": 56, "failed": [], "wall_s": 7200.0, "versions": versions, "at_work": None}
    return Status(scenario="fig-4-2a", points=100, trials=20_000, **done)._replace(**changes)


def test_the_status_tells_what_made_trials_who_is_at_work_and_the_first_failures_or_as_json_all(capsys) -> None:
    print_status(status(at_work="process 5 on here", failed=FAILURES), as_json=False)
    assert capsys.readouterr().out.splitlines() == [
        "fig-4-2a: 100 points, 1234 of 20000 trials have a result",
        "  censored: 56; failed: 15; computing time: 2.0 h",
        f"  1000 trials: {MADE_BY}, host a",
        f"  234 trials: {MADE_BY}, host b",
        "  process 5 on here is at work on it",
        *(f"  failed: --point {n} --trial {3 * n}: ValueError: {n}" for n in range(MOST_LISTED)),
        "  and 5 more",
    ]
    boom = "thesis: robot {0}, step {1}, seed {1}{0}: /my files/my.py:18: RuntimeError: boom"
    died = "its worker died: killed; see --point 0 --trial {}, or else"
    kinds = [Failure(0, n, n, error.format(n, n + 1)) for n in range(20) for error in (boom, died)]
    bang = Failure(1, 5, 9, boom.format(0, 3).replace("boom", "bang\n(two lines)"))
    print_status(status(failed=[*kinds, FAILURES[3], bang]), False)
    assert capsys.readouterr().out.splitlines()[4:] == [
        "  failed: 20 trials: my.py:18: RuntimeError: boom; the first: --point 0 --trial 0",
        f"  failed: 20 trials: {died.replace('0 --trial {}', 'N --trial N')}; the first: --point 0 --trial 0",
        "  failed: --point 3 --trial 9: ValueError: 3",
        f"  failed: --point 1 --trial 5: {' '.join(bang.error.splitlines())}",
    ]
    at_limit = (PointAtLimit(3, {"coupling": 0.1}, 20),)
    given = status(at_work="process 5 on here", failed=FAILURES, at_limit=at_limit)
    print_status(given, as_json=True)
    (line,) = capsys.readouterr().out.splitlines()
    read = json.loads(line)
    assert [Failure(**each) for each in read["failed"]] == given.failed
    assert [TrialsByOrigin(**each) for each in read["versions"]] == given.versions
    assert {*read["versions"][0]} == {*PROVENANCE, "trials"}
    assert read["at_limit"] == [{"point": 3, "axes": {"coupling": 0.1}, "trials": 20}]
    lists = {"failed": None, "versions": None, "at_limit": None, "axes": None}
    assert {**read, **lists} == {**given._asdict(), **lists}


def test_on_a_narrow_terminal_lines_end_between_words(capsys, monkeypatch) -> None:
    results = list(map(trial, range(20)))
    duration = Duration(1, 1, 1, 2, Estimate(0.0), 1, is_cut=True)
    for show in (
        lambda: print_status(status(), as_json=False),
        lambda: tables.print_trials(results, 25),
        lambda: print_plan("short.yaml", duration, None, as_json=False),
    ):
        monkeypatch.setattr(tables, "terminal_width", lambda: None)
        show()
        words = capsys.readouterr().out.splitlines()[-1].split()
        monkeypatch.setattr(tables, "terminal_width", lambda: 50)
        show()
        lines = capsys.readouterr().out.splitlines()
        assert max(map(len, lines)) <= 50
        assert " ".join(lines[-3:]).split()[-len(words) :] == words


WHAT_TO_DO = "; go on, or take another limit in a new folder: --set stop.max_cycles=N, or stop.max_time_s=S"


def test_points_whose_trials_all_reach_their_limit_are_counted_and_the_first_is_named(capsys) -> None:
    points = [PointAtLimit(n, {"coupling": n}, 24) for n in range(1, 4)]
    print_status(status(at_limit=points), as_json=False)
    reached = "every trial so far (24) reaches the limit"
    said = capsys.readouterr().out.splitlines()[-1]
    assert said == f"  at 3 points, the first with coupling = 1, {reached.replace('24', '72')}{WHAT_TO_DO}"
    assert describe_at_limit(points[:1]) == [f"at coupling = 1, {reached}{WHAT_TO_DO}"]
    assert describe_at_limit([PointAtLimit(0, {}, 24)]) == [f"{reached}{WHAT_TO_DO}"]
    assert not describe_at_limit([])


def test_while_a_sweep_runs_it_is_said_of_the_first_such_point_and_then_of_all(tmp_path) -> None:
    """Of twenty trials, or of as many as there are; one that is synchronised is enough for a point not to be one."""
    for count in (3, 22):
        folder = tmp_path / str(count)
        axes = ["--sweep", "coupling=1e-6,2e-6,10", "--set", "max_cycles=6", "--set", "order_parameter=0.9"]
        result = call("run", "thesis", *axes, "--trials", count, "--out", folder)
        (said,) = [line for line in result.stderr.splitlines() if "reaches the limit" in line]
        first, reached = "robots.0.parameters.coupling = 1e-06, every trial so far", f"reaches the limit{WHAT_TO_DO}"
        assert said == f"at {first} ({min(count, 20)}) {reached}"
        for printed in (result.stdout, called("status", folder), called("plan", folder)):
            (shown,) = [line.strip() for line in printed.splitlines() if "reaches the limit" in line]
            assert shown == f"at 2 points, the first with {first} ({2 * count}) {reached}"


def trial(number: int, **changes) -> TrialResult:
    return TrialResult("thesis", number, 10 + number, False, 10 + number, 0.9, 9, 9.0, 0.4)._replace(**changes)


def test_a_table_of_trials_has_units_and_whole_seeds_and_several_a_line_of_statistics(monkeypatch, capsys) -> None:
    for width in (200, 80, None):
        monkeypatch.setattr(tables, "terminal_width", lambda width=width: width)
        tables.print_trials([trial(24, seed=2**53 - 1)], 100)
        shown = capsys.readouterr().out
        assert str(2**53 - 1) in shown
        assert shown.count("(s)") == 2
        assert "(cycles)" in shown
        assert "T_sync:" not in shown
    late = {"t_sync_cycles": None, "censored": True, "cycles": 25}
    tables.print_trials([trial(n, **late if n > 15 else {}) for n in range(20)], 25)
    measured = Measured(np.minimum(10.0 + np.arange(20), 25), np.arange(20) <= 15, 25, 0)
    mean, median = (estimate(measured, statistic) for statistic in (Statistic.MEAN, Statistic.MEDIAN))
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"T_sync: restricted mean {mean}, median {median}; 4 censored"
    assert len(last) <= 80
    tables.print_trials([trial(n, **late) for n in range(20)], 25)
    assert capsys.readouterr().out.splitlines()[-1] == "T_sync: all of 20 trials are censored"
    monkeypatch.setattr(tables, "terminal_width", lambda: 20)
    assert tables.folded("in computing, 0 s") == "in computing,\n    0 s"


def test_a_notebook_redraws_progress_if_it_has_widgets(monkeypatch) -> None:
    monkeypatch.setattr(progress, "Console", lambda **_: Console(force_jupyter=True, file=StringIO()))
    for has_widgets in (True, False):
        monkeypatch.setattr(progress, "find_spec", lambda _, found=has_widgets: found or None)
        assert (SweepProgressBar()._bar is not None) == has_widgets


def test_code_that_is_found_at_the_same_step_of_a_robot_again_is_named_once_a_trial(monkeypatch, capsys) -> None:
    monkeypatch.setattr(progress, "AT_WORK_S", 0.001)

    def said_of(steps: list[tuple[int, int, str] | None]) -> str:
        """Return what is said of code whose steps these are, at one look after the other."""
        looked, left = Event(), iter(steps)
        with progress.TrialProgress(1, load_scenario("pair").stop) as shown:
            shown.begin(0, lambda: next(left, None) or looked.set())
            assert looked.wait(10)
        return capsys.readouterr().err

    same = (4, 7, "sensor eye")
    named = "robot 4, step 7: its sensor eye has not returned for 0.001 s; press Ctrl-C twice to end it\n"
    assert said_of([same] * 4) == named
    assert said_of([same, (4, 8, "sensor eye"), (5, 8, "sensor eye"), (5, 8, "controller")]) == ""


def test_what_has_been_compiled_is_counted_and_said_while_something_is(tmp_path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(jit, "cache_root", lambda **_: tmp_path)
    monkeypatch.setattr(progress, "COMPILING_IN_A_LOG_S", 0.001)
    global leaf  # noqa: PLW0603 kernels find each other among global names

    @jit.jit_inline
    def leaf(number):
        return number + 1

    @jit.jit_no_alloc
    def root(number):
        return leaf(number) + leaf(number + 1)

    looks, compiling = [], native.compiling
    monkeypatch.setattr(native, "compiling", lambda: looks.append(compiling()) or looks[-1])
    for times_said in (1, 0):  # the second time it is compiled
        looks.clear()
        with progress.TrialProgress(1, load_scenario("pair").stop):
            assert root(1) == 5
        said = re.findall(r"compiled \d+ functions? so far, now test_printed.py; later", capsys.readouterr().err)
        counts = [each[0] for each in looks if each]
        assert (len(said), bool(counts)) == (times_said, bool(times_said))
        assert counts == sorted(counts)
        assert compiling() is None


@pytest.mark.parametrize("is_fleeting", [False, True])
def test_a_log_names_each_file_once_that_takes_long_to_compile(monkeypatch, capsys, is_fleeting: bool) -> None:
    monkeypatch.setattr(progress, "is_kept", lambda: not is_fleeting)
    looks = [None, None, Path("mine.py"), Path("mine.py"), None]
    monkeypatch.setattr(progress, "COMPILING_IN_A_LOG_S", 0.001)
    shown = progress.TrialProgress(1, load_scenario("pair").stop)
    monkeypatch.setattr(native, "compiling", lambda: (2, looks.pop(0)) if looks[1:] else shown._is_over.set())
    with shown:
        shown.begin(0, None)  # interpreted controllers call what is compiled then
        assert shown._is_over.wait(10)
    said = "compiled 2 functions so far{}; {}\n"
    kept = "none is kept" if is_fleeting else "later runs reuse them"
    assert capsys.readouterr().err == said.format("", kept) + said.format(", now mine.py", kept)
