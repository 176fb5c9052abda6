"""Progress on stderr while trials, sweeps and films last."""

import math
import sys
import threading
import time
from collections import Counter
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from rich.console import Console
from rich.progress import BarColumn, Progress, ProgressColumn, SpinnerColumn, TextColumn

from epuck_sim.cli.errors import print_stderr
from epuck_sim.cli.tables import describe_at_limit
from epuck_sim.display.html import in_words
from epuck_sim.runs.reader import FEW_TRIALS, PointAtLimit
from epuck_sim.scenario.loader import Point
from epuck_sim.scenario.scenario import StopSection
from epuck_sim.sweep.worker import AtWork, never_returned
from epuck_sim.trial.result import WINDOW, TrialState, hopelessness_watch
from epuck_sim.util.cache_folder import is_kept
from epuck_sim.util.messages import counted

if TYPE_CHECKING:  # single trials need no pools
    from epuck_sim.sweep.run import SweepProgress

REFRESH_S = 0.2  # seconds between two updates on a terminal
LINE_S = 10.0  # seconds between two lines in a log
COMPILING_S, COMPILING_IN_A_LOG_S = 1.0, 4.0  # seconds between looks at how much is compiled, on a terminal, in a log
AT_WORK_S = 10.0  # seconds between two looks at whose code is running
FEWER_CYCLES = 300  # limit of cycles that is proposed for trials that look hopeless


class _ProgressLine:
    """One line, in a `with` block: redrawn on a terminal or in a notebook, printed anew now and then in a log."""

    def __init__(self, *columns: ProgressColumn, is_redrawn: bool = True) -> None:
        console = Console(stderr=True)
        can_redraw = console.is_terminal or (console.is_jupyter and find_spec("ipywidgets") is not None)
        self._bar = Progress(*columns, console=console) if can_redraw and is_redrawn else None
        self._pause_s = REFRESH_S if self._bar else LINE_S
        self._next = 0.0

    def show(self, text: str, completed: int | None = None, total: int | None = None) -> None:
        """Show how far the task is."""
        if self._bar is None:
            print_stderr(text)
            return
        if not self._bar.task_ids:
            self._bar.start()
            self._bar.add_task("", total=total)
        self._bar.update(self._bar.task_ids[0], completed=completed, total=total, description=text, refresh=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._bar:
            self._bar.stop()


class TrialProgress(_ProgressLine):
    """Shows how far trials are that run one after the other."""

    def __init__(self, trials: int, stop: StopSection, *, interpret: bool = False) -> None:
        # interpreted controllers may stop at breakpoints: a spinner would write over the debugger's prompt
        super().__init__(SpinnerColumn(), TextColumn("{task.description}"), is_redrawn=not interpret)
        self._trials = trials
        self._stop = stop
        self._trial = 0
        self._is_over = threading.Event()
        self._at_work: AtWork | None = None
        looks = (self._tell_of_compiling, self._tell_of_what_never_returns)
        self._looks = [threading.Thread(target=look, daemon=True) for look in looks]

    def _tell_of_compiling(self) -> None:
        """Show how much is compiled, if anything is: again and again on a terminal, once for each file in a log."""
        told: set[Path | None] = set()
        while not self._is_over.wait(COMPILING_S if self._bar else COMPILING_IN_A_LOG_S):
            native: Any = sys.modules.get("epuck_sim.util.native")  # loaded when something compiles, perhaps now
            found = native.compiling() if hasattr(native, "compiling") else None
            if found and (self._bar or found[1] not in told):
                done, file = found
                told.add(file)
                now = f", now {file.name}" if file else ""
                kept = "later runs reuse them" if is_kept() else "none is kept"
                self.show(f"compiled {counted(done, 'function')} so far{now}; {kept}")

    def _tell_of_what_never_returns(self) -> None:
        told, last = -1, None
        while not self._is_over.wait(AT_WORK_S):
            now = self._at_work() if self._at_work else None
            if now is not None and now == last and self._trial != told:
                told = self._trial
                print_stderr(f"{never_returned(*now, AT_WORK_S)}; press Ctrl-C twice to end it")
            last = now

    def __enter__(self) -> Self:
        for look in self._looks:
            look.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._is_over.set()
        super().__exit__(*error)

    def begin(self, trial: int, at_work: AtWork | None) -> None:
        """Begin to show trial number `trial`; `at_work` returns whose code is running in it, if that is watched."""
        from epuck_sim.util.native import working_s  # numba takes a while

        self._at_work = at_work
        self._watch = hopelessness_watch(self._stop.metric, self._tell_of_hopelessness)
        self._trial = trial
        self._clock_s, self._began = working_s, working_s()
        self._next = self._began + self._pause_s

    def __call__(self, state: TrialState) -> None:
        """Show how far the trial is, if it is time to; say once if it looks hopeless."""
        if self._stop.order_parameter is not None and self._stop.max_cycles > FEWER_CYCLES:
            self._is_alone = state.oscillators == 1
            self._watch(state)
        now = self._clock_s()
        if now < self._next:
            return
        self._next = now + self._pause_s
        r = "" if state.order_parameter is None else f", order parameter {state.order_parameter:.3f}"
        passed = max(state.cycles / self._stop.max_cycles, state.time_s / (self._stop.max_time_s or math.inf))
        cycles = f"cycle {state.cycles}, {100 * passed:.2g} % of the limit{r}"
        lasted = f"{state.time_s:.1f} s simulated, {state.time_s / (now - self._began):.0f} x real time"
        self.show(f"trial {self._trial + 1} of {self._trials}: {cycles}, {lasted}")

    def _tell_of_hopelessness(self, order: float) -> None:
        alone = "will end at its limit: its one oscillator has no other to synchronise with"
        found = f"over {WINDOW} cycles the order parameter, {order:.2f}, is that of random phases or stands still"
        said = alone if self._is_alone else f"looks hopeless: {found}"
        print_stderr(f"trial {self._trial + 1} of {self._trials} {said}; sooner: --set stop.max_cycles={FEWER_CYCLES}")


class SweepProgressBar(_ProgressLine):
    """Shows how far a sweep is."""

    def __init__(self) -> None:
        super().__init__(BarColumn(), TextColumn("{task.description}"))
        self._began, self._first = 0.0, 0  # when the first trials had ended, which waited for workers, and their number
        self._trials: Counter[int] = Counter()  # number of trials of each point that have a result
        self._censored: Counter[int] = Counter()  # number of these that have reached their limit
        self._has_told = False  # whether a line was printed about a point at its limit
        self.progress: SweepProgress | None = None
        self.points: Sequence[Point] = ()
        """Points of the sweep; a line is printed about the first whose trials reach their limit."""

    def __call__(self, progress: "SweepProgress") -> None:
        """Show the progress, if it is time to."""
        if self.progress is None and progress.stored:
            self._has_told = True  # nothing is said, as stored ends are unknown
        self.progress = progress
        for outcome in progress.last if self.points else ():
            if outcome.error is None and not self._has_told:
                self._note(self.points[outcome.point], is_censored=outcome.censored == 1)
        now = time.monotonic()
        if not self._first:
            self._began, self._first = now, progress.ended
        done = progress.stored + progress.failed
        if now < self._next and done < progress.trials:
            return
        self._next = now + self._pause_s
        self.show(self._words(progress, now), done, progress.trials)

    def _note(self, point: Point, *, is_censored: bool) -> None:
        """Count a trial of a point; print one line once enough trials, and no other ones, have reached their limit."""
        self._trials[point.number] += 1
        self._censored[point.number] += is_censored
        count = self._trials[point.number]
        if self._censored[point.number] == count == min(FEW_TRIALS, point.scenario.trials):
            self._has_told = True
            print_stderr(*describe_at_limit([PointAtLimit(point.number, point.axes, count)]))

    def _words(self, progress: "SweepProgress", now: float) -> str:
        failed = f", {progress.failed} failed" if progress.failed else ""
        censored = "" if progress.censored is None else f", {progress.censored} censored"
        words = f"{progress.stored} of {progress.trials} trials{censored}{failed}"
        if progress.narrow is not None:
            words = f"{words}, {progress.narrow} of {counted(len(self.points), 'point')} narrow enough"
        left = progress.trials - progress.stored - progress.failed
        if progress.ended == self._first:
            return f"{words}; starting workers" if left else words
        a_minute = (progress.ended - self._first) / max(now - self._began, 1e-9) * 60
        words = f"{words}, {a_minute:.0f} a minute"
        return words if progress.narrow is not None else f"{words}, {in_words(left / a_minute * 60)} left"
