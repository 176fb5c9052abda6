"""Claims about what people see of a sweep: how far it is, how long it takes, what a folder holds, what has failed."""

import json
import re
from io import StringIO

import numpy as np
import pytest
from rich.console import Console

from epuck_sim.cli import progress as progress_module
from epuck_sim.cli import tables
from epuck_sim.cli.progress import LINE_S, SweepProgressBar
from epuck_sim.cli.tables import MOST_LISTED, describe_at_limit, print_status
from epuck_sim.display.html import in_words
from epuck_sim.runs.records import SweepProgress
from epuck_sim.runs.status import Failure, PointAtLimit, Status, TrialsByOrigin
from epuck_sim.statistics.measured import Measured
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.statistic import estimate
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import PROVENANCE
from tests.cli.commands import call, called

TRIALS = 1000


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now = 1e6

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def clock(monkeypatch) -> Clock:
    clock = Clock()
    monkeypatch.setattr(progress_module, "time", clock)
    return clock


def tally(ended: int, before: int = 0, censored: int = 0, failed: int = 0) -> SweepProgress:
    return SweepProgress(TRIALS, before + ended - failed, censored, failed, ended)


def shown(clock: Clock, capsys, steps: list[tuple[float, SweepProgress]]) -> list[str]:
    """Return the lines on stderr after tallies came at these times; nothing may be on stdout."""
    began = clock.now
    with SweepProgressBar() as progress:
        for at_s, each in steps:
            clock.now = began + at_s
            progress(each)
    captured = capsys.readouterr()
    assert captured.out == ""
    return captured.err.splitlines()


# Without a terminal


def test_a_line_tells_trials_done_and_censored_per_minute_and_time_left(clock, capsys) -> None:
    first = tally(0, before=100, censored=7)
    last = shown(clock, capsys, [(0, first), (5, tally(1, 100, 7)), (65, tally(301, 100, 42))])[-1]
    # the first trial, which waits for the workers to start, is no measure: 300 trials in a minute
    assert last == "401 of 1000 trials, 42 censored, 300 a minute, 2 min left"


def test_at_first_workers_are_starting(clock, capsys) -> None:
    assert shown(clock, capsys, [(0, tally(0))]) == ["0 of 1000 trials, 0 censored; starting workers"]


def test_one_trial_is_no_measure_of_the_others(clock, capsys) -> None:
    assert shown(clock, capsys, [(20, tally(1))]) == ["1 of 1000 trials, 0 censored; starting workers"]


def test_failed_trials_are_reported_and_not_waited_for(clock, capsys) -> None:
    (*_, last) = shown(clock, capsys, [(0, tally(1)), (60, tally(501, failed=100))])
    assert last == "401 of 1000 trials, 0 censored, 100 failed, 500 a minute, 60 s left"


def test_what_was_stored_before_does_not_count_as_speed(clock, capsys) -> None:
    (*_, last) = shown(clock, capsys, [(0, tally(1, before=898)), (60, tally(11, before=898))])
    assert last == "909 of 1000 trials, 0 censored, 10 a minute, 9 min left"


def test_lines_come_no_more_often_than_they_should(clock, capsys) -> None:
    tenths = [(number / 10, tally(number)) for number in range(600)]
    lines = shown(clock, capsys, tenths)
    assert len(lines) == 60 / LINE_S
    assert [int(line.split()[0]) for line in lines] == [*range(0, 600, round(10 * LINE_S))]


def test_after_a_pause_there_is_one_line_not_many(clock, capsys) -> None:
    steps = [(0, tally(0)), (95, tally(1)), (95.1, tally(2)), (104.9, tally(3)), (105.1, tally(4))]
    assert [line.split()[0] for line in shown(clock, capsys, steps)] == ["0", "1", "4"]


@pytest.mark.parametrize("pause_s", [0.0, 3.0])
def test_the_pause_is_a_constant_of_the_module(clock, capsys, monkeypatch, pause_s: float) -> None:
    monkeypatch.setattr(progress_module, "LINE_S", pause_s)
    lines = shown(clock, capsys, [(number, tally(number)) for number in range(12)])
    assert len(lines) == (12 if pause_s == 0 else 4)


def test_the_last_trial_is_always_reported(clock, capsys) -> None:
    lines = shown(clock, capsys, [(0, tally(998)), (0.1, tally(999)), (0.2, tally(1000))])
    assert [line.split()[0] for line in lines] == ["998", "1000"]
    assert lines[-1].endswith(" 0 s left")


def test_the_last_trial_is_reported_even_if_some_have_failed(clock, capsys) -> None:
    lines = shown(clock, capsys, [(0, tally(998, failed=1)), (0.2, tally(1000, failed=2))])
    assert lines[-1].startswith("998 of 1000 trials, 0 censored, 2 failed")


def test_trials_that_end_at_one_moment_are_no_trouble(clock, capsys) -> None:
    lines = shown(clock, capsys, [(0, tally(0)), (10, tally(1)), (10, tally(500)), (10, tally(1000))])
    assert lines[-1].startswith("1000 of 1000 trials, 0 censored, ")
    assert lines[-1].endswith(" a minute, 0 s left")


@pytest.mark.usefixtures("clock")
def test_progress_keeps_the_last_tally_also_when_it_shows_none() -> None:
    progress = SweepProgressBar()
    assert progress.progress is None
    for number in range(3):
        progress(tally(number))
    assert progress.progress == tally(2)


def stopped() -> None:
    """Show a tally, and stop the sweep as Ctrl-C does."""
    with SweepProgressBar() as progress:
        progress(tally(1))
        raise KeyboardInterrupt


@pytest.mark.usefixtures("clock")
def test_ctrl_c_goes_through() -> None:
    with pytest.raises(KeyboardInterrupt):
        stopped()


# On a terminal


def on_terminal(monkeypatch, width: int = 120) -> StringIO:
    """Let stderr be a terminal of this width; return what is written to it."""
    written = StringIO()

    def console(stderr: bool) -> Console:
        assert stderr
        return Console(file=written, force_terminal=True, width=width, color_system=None, legacy_windows=False)

    monkeypatch.setattr(progress_module, "Console", console)
    return written


def last_of(written: StringIO) -> str:
    """Return what is on the terminal at the end: the last of the lines that were written over each other."""
    last = written.getvalue().rpartition("\r")[2]
    return re.sub(r"\x1b\[[?\d]*[a-zA-Z]", "", last).strip()


def test_on_a_terminal_there_is_a_bar_with_the_same_words(clock, capsys, monkeypatch) -> None:
    written = on_terminal(monkeypatch)
    steps = [(0, tally(0)), (5, tally(1)), (65, tally(501, censored=3))]
    assert shown(clock, capsys, steps) == []
    last = last_of(written)
    assert "━" in last
    assert last.endswith("501 of 1000 trials, 3 censored, 500 a minute, 60 s left")


@pytest.mark.usefixtures("clock")
def test_the_bar_grows_with_trials_that_have_ended_one_way_or_the_other(capsys, monkeypatch) -> None:
    def bar_at(ended: int, failed: int) -> tuple[float, float]:
        on_terminal(monkeypatch)
        with SweepProgressBar() as progress:
            progress(tally(ended, failed=failed))
            (task,) = progress._bar.tasks
        return task.completed, task.total

    assert bar_at(0, 0) == (0, TRIALS)
    assert bar_at(400, 0) == bar_at(400, 100) == (400, TRIALS)
    assert capsys.readouterr() == ("", "")


def test_the_bar_moves_more_often_than_a_log_has_lines_but_not_with_every_trial(clock, monkeypatch) -> None:
    updates = []
    on_terminal(monkeypatch)
    began = clock.now
    with SweepProgressBar() as progress:
        monkeypatch.setattr(progress._bar, "refresh", lambda: updates.append(clock.now))
        for number in range(1000):
            clock.now = began + number / 100
            progress(tally(number))
    assert 10 * 10 / LINE_S < len(updates) < 100


@pytest.mark.parametrize("width", [80, 60])
def test_on_a_narrow_terminal_the_words_stay_whole(clock, capsys, monkeypatch, width: int) -> None:
    written = on_terminal(monkeypatch, width)
    shown(clock, capsys, [(0, tally(0)), (5, tally(1)), (65, tally(501, censored=3))])
    assert last_of(written).endswith("501 of 1000 trials, 3 censored, 500 a minute, 60 s left")


@pytest.mark.usefixtures("clock")
def test_after_ctrl_c_the_terminal_has_its_cursor_again(monkeypatch) -> None:
    written = on_terminal(monkeypatch)
    with pytest.raises(KeyboardInterrupt):
        stopped()
    assert written.getvalue().rfind("\x1b[?25h") > written.getvalue().rfind("\x1b[?25l") >= 0


# Words


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (0, "0 s"),
        (0.4, "0 s"),
        (42, "42 s"),
        (89.4, "89 s"),
        (95, "2 min"),
        (200, "3 min"),
        (5399, "90 min"),
        (5400, "1.5 h"),
        (20_000, "5.6 h"),
        (1e6, "277.8 h"),
    ],
)
def test_times_are_written_as_people_do(seconds: float, words: str) -> None:
    assert in_words(seconds) == words


# What a folder holds


def failures(count: int) -> list[Failure]:
    return [Failure(point, 3 * point, 77, f"ValueError: {point}") for point in range(count)]


HOSTS = {"a": 1000, "b": 234}
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
        versions=[TrialsByOrigin("1", "7", "0.65", "2", "3.11", host, trials) for host, trials in HOSTS.items()],
        at_work=None,
    )._replace(**changes)


def test_the_status_tells_points_trials_time_and_what_made_them(capsys) -> None:
    print_status(status(), as_json=False)
    assert capsys.readouterr() == (
        "fig-4-2a: 100 points, 1234 of 20000 trials have a result\n"
        "  censored: 56; failed: 0; computing time: 2.0 h\n"
        f"  1000 trials: {MADE_BY}, host a\n"
        f"  234 trials: {MADE_BY}, host b\n",
        "",
    )


def test_the_status_names_the_process_at_work_and_the_failures(capsys) -> None:
    print_status(status(at_work="process 5 on here", failed=failures(2)), as_json=False)
    assert capsys.readouterr().out.splitlines()[1:] == [
        "  censored: 56; failed: 2; computing time: 2.0 h",
        f"  1000 trials: {MADE_BY}, host a",
        f"  234 trials: {MADE_BY}, host b",
        "  process 5 on here is at work on it",
        "  failed: --point 0 --trial 0: ValueError: 0",
        "  failed: --point 1 --trial 3: ValueError: 1",
    ]


def test_the_status_as_json_has_all_failures_and_every_field(capsys) -> None:
    at_limit = (PointAtLimit(3, {"coupling": 0.1}, 20),)
    given = status(at_work="process 5 on here", failed=failures(MOST_LISTED + 5), at_limit=at_limit)
    print_status(given, as_json=True)
    (line,) = capsys.readouterr().out.splitlines()
    read = json.loads(line)
    assert [Failure(**each) for each in read["failed"]] == given.failed
    assert [TrialsByOrigin(**each) for each in read["versions"]] == given.versions
    assert {*read["versions"][0]} == {*PROVENANCE, "trials"}
    assert read["at_limit"] == [{"point": 3, "axes": {"coupling": 0.1}, "trials": 20}]
    lists = {"failed": None, "versions": None, "at_limit": None}
    assert {**read, **lists} == {**given._asdict(), **lists}


@pytest.mark.parametrize("count", [0, 1, MOST_LISTED - 1, MOST_LISTED])
def test_up_to_some_failures_all_are_listed(capsys, count: int) -> None:
    print_failures(failures(count))
    lines = capsys.readouterr().out.splitlines()
    assert lines == [f"  failed: --point {n} --trial {3 * n}: ValueError: {n}" for n in range(count)]


@pytest.mark.parametrize("more", [1, 500])
def test_of_more_failures_the_first_are_listed_and_the_others_counted(capsys, more: int) -> None:
    print_failures(failures(MOST_LISTED + more))
    *listed, last = capsys.readouterr().out.splitlines()
    assert listed == [f"  failed: --point {n} --trial {3 * n}: ValueError: {n}" for n in range(MOST_LISTED)]
    assert last == f"  and {more} more"


WHAT_TO_DO = "; go on, or take another limit in a new folder: --set stop.max_cycles=N"


def test_points_whose_trials_all_reach_their_limit_are_named_the_first_of_many(capsys) -> None:
    rows = [PointAtLimit(n, {"coupling": n} if n else {}, 24) for n in range(MOST_LISTED + 2)]
    print_status(status(at_limit=rows), as_json=False)
    *_, first, second = capsys.readouterr().out.splitlines()[: -MOST_LISTED + 1]
    assert first == "  every trial so far (24) reaches the limit"
    assert second == "  at coupling = 1, every trial so far (24) reaches the limit"
    assert describe_at_limit(rows)[-1] == f"so it is at 2 further points{WHAT_TO_DO}"
    assert describe_at_limit(rows[:1]) == [f"every trial so far (24) reaches the limit{WHAT_TO_DO}"]


def test_while_a_sweep_runs_it_is_said_once_of_each_such_point_of_a_run(tmp_path) -> None:
    """Of twenty trials, or of as many as there are; one that is synchronised is enough for a point not to be one."""
    for trials in (3, 22):
        folder = tmp_path / str(trials)
        axes = ["--sweep", "coupling=1e-6,2e-6,10", "--set", "max_cycles=30", "--set", "order_parameter=0.9"]
        result = call("run", "thesis", *axes, "--trials", trials, "--out", folder)
        said = [line for line in result.stderr.splitlines() if "reaches the limit" in line]
        at = "at robots.0.parameters.coupling = {}, every trial so far ({}) reaches the limit"
        assert sorted(said) == [at.format(coupling, min(trials, 20)) + WHAT_TO_DO for coupling in ("1e-06", "2e-06")]
        ends = [at.format(coupling, trials) for coupling in ("1e-06", "2e-06")]
        for printed in (result.stdout, called("status", folder), called("plan", folder)):
            shown = [line.strip() for line in printed.splitlines() if "reaches the limit" in line]
            assert shown == [ends[0], ends[1] + WHAT_TO_DO]


@pytest.mark.parametrize("width", [200, 80, None])
def test_a_table_of_trials_has_units_and_whole_seeds_on_any_terminal(monkeypatch, capsys, width: int | None) -> None:
    monkeypatch.setattr(tables, "terminal_width", lambda: width)
    seed = 2**53 - 1
    tables.print_trials([TrialResult("thesis", seed, 24, False, 24, 0.964, 1050, 104.9, 0.39)], 100)
    shown = capsys.readouterr().out
    assert str(seed) in shown
    assert shown.count("(s)") == 2
    assert "(cycles)" in shown
    assert "T_sync of" not in shown


def test_several_trials_end_with_a_line_of_statistics(capsys) -> None:
    results = [
        TrialResult("thesis", n, None if n > 15 else 10 + n, n > 15, min(10 + n, 25), 0.9, 9, 9.0, 0.4)
        for n in range(20)
    ]
    tables.print_trials(results, 25)
    measured = Measured(np.minimum(10.0 + np.arange(20), 25), np.arange(20) <= 15, 25, 0)
    mean, median = (estimate(measured, statistic) for statistic in (Statistic.MEAN, Statistic.MEDIAN))
    last = capsys.readouterr().out.splitlines()[-1]
    assert last == f"T_sync of 20 trials: restricted mean {mean} cycles, median {median}; 20 % censored"


@pytest.mark.parametrize("has_widgets", [True, False])
def test_a_notebook_redraws_progress_if_it_has_widgets(has_widgets: bool, monkeypatch) -> None:
    monkeypatch.setattr(progress_module, "Console", lambda **_: Console(force_jupyter=True, file=StringIO()))
    monkeypatch.setattr(progress_module, "find_spec", lambda _: has_widgets or None)
    assert (SweepProgressBar()._bar is not None) == has_widgets
