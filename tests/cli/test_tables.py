"""Claims about what people see: how far a run is, how long it takes, what a folder holds, what failed or compiles."""

import json
import re
from contextlib import suppress
from io import StringIO
from pathlib import Path
from threading import Event
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from epuck_sim import TrialResult, load_scenario
from epuck_sim.cli import progress, tables
from epuck_sim.cli.plan import Duration, print_plan
from epuck_sim.cli.progress import LINE_S, SweepProgressBar
from epuck_sim.cli.tables import MOST_LISTED, describe_at_limit, print_status
from epuck_sim.estimate import Estimate
from epuck_sim.runs.reader import Failure, PointAtLimit, Status, TrialsByOrigin
from epuck_sim.statistics import Statistic
from epuck_sim.statistics.statistic import Measured, estimate
from epuck_sim.sweep.run import SweepProgress
from epuck_sim.util import jit, native
from epuck_sim.util.provenance import PROVENANCE
from tests.cli.commands import call, called


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


def test_a_line_tells_trials_done_censored_and_failed_per_minute_and_time_left(clock, capsys) -> None:
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


def test_lines_come_no_more_often_than_they_should_and_the_last_always(clock, capsys) -> None:
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
    return Status(
        scenario="fig-4-2a",
        points=100,
        trials=20_000,
        stored=1234,
        censored=56,
        failed=[],
        wall_s=7200.0,
        versions=[TrialsByOrigin("1", "7", "0.65", "2", "3.11", host, n) for host, n in (("a", 1000), ("b", 234))],
        at_work=None,
    )._replace(**changes)


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
    bang = Failure(1, 5, 9, boom.format(0, 3).replace("boom", "bang"))
    print_status(status(failed=[*kinds, FAILURES[3], bang]), False)
    assert capsys.readouterr().out.splitlines()[4:] == [
        "  failed: 20 trials: my.py:18: RuntimeError: boom; the first: --point 0 --trial 0",
        f"  failed: 20 trials: {died.replace('0 --trial {}', 'N --trial N')}; the first: --point 0 --trial 0",
        "  failed: --point 3 --trial 9: ValueError: 3",
        f"  failed: --point 1 --trial 5: {bang.error}",
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


@pytest.mark.usefixtures("sweeps_run_here")
def test_while_a_sweep_runs_it_is_said_of_the_first_such_point_and_then_of_all(tmp_path) -> None:
    """Of twenty trials, or of as many as there are; one that is synchronised is enough for a point not to be one."""
    for trials in (3, 22):
        folder = tmp_path / str(trials)
        axes = ["--sweep", "coupling=1e-6,2e-6,10", "--set", "max_cycles=6", "--set", "order_parameter=0.9"]
        result = call("run", "thesis", *axes, "--trials", trials, "--out", folder)
        (said,) = [line for line in result.stderr.splitlines() if "reaches the limit" in line]
        first, reached = "robots.0.parameters.coupling = 1e-06, every trial so far", f"reaches the limit{WHAT_TO_DO}"
        assert said == f"at {first} ({min(trials, 20)}) {reached}"
        for printed in (result.stdout, called("status", folder), called("plan", folder)):
            (shown,) = [line.strip() for line in printed.splitlines() if "reaches the limit" in line]
            assert shown == f"at 2 points, the first with {first} ({2 * trials}) {reached}"


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
        assert "T_sync of" not in shown
    late = {"t_sync_cycles": None, "censored": True, "cycles": 25}
    tables.print_trials([trial(n, **late if n > 15 else {}) for n in range(20)], 25)
    measured = Measured(np.minimum(10.0 + np.arange(20), 25), np.arange(20) <= 15, 25, 0)
    mean, median = (estimate(measured, statistic) for statistic in (Statistic.MEAN, Statistic.MEDIAN))
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"T_sync of 20 trials: restricted mean {mean} cycles, median {median}; 20 % censored"
    tables.print_trials([trial(n, **late) for n in range(20)], 25)
    assert capsys.readouterr().out.splitlines()[-1] == "T_sync of 20 trials: all are censored"


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
        said = re.findall(r"compiled \d+ functions? so far, now test_tables.py; later", capsys.readouterr().err)
        counts = [each[0] for each in looks if each]
        assert (len(said), bool(counts)) == (times_said, bool(times_said))
        assert counts == sorted(counts)
        assert compiling() is None


@pytest.mark.parametrize("is_fleeting", [False, True])
def test_a_log_names_each_file_once_that_takes_long_to_compile(monkeypatch, capsys, is_fleeting: bool) -> None:
    monkeypatch.setattr(progress, "is_kept", lambda: not is_fleeting)
    looks = [None, None, Path("mine.py"), Path("mine.py"), None]
    monkeypatch.setattr(progress, "COMPILING_IN_A_LOG_S", 0.001)
    monkeypatch.setattr(native, "compiling", lambda: (2, looks.pop(0)) if looks[1:] else shown._is_over.set())
    with progress.TrialProgress(1, load_scenario("pair").stop) as shown:
        shown.begin(0, None)  # interpreted controllers call what is compiled then
        assert shown._is_over.wait(10)
    said = "compiled 2 functions so far{}; {}\n"
    kept = "none is kept" if is_fleeting else "later runs reuse them"
    assert capsys.readouterr().err == said.format("", kept) + said.format(", now mine.py", kept)
