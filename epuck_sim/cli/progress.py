"""What people see of a run: progress while it lasts, a table or JSON when it is done."""

import json
import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.status import Status
from rich.table import Table
from rich.text import Text

from epuck_sim.embodied.step import Step
from epuck_sim.particles.simulation import Swarm
from epuck_sim.trial.embodied import TrialResult
from epuck_sim.trial.synchrony import SynchronyWatch
from epuck_sim.util.provenance import versions

REFRESH_S = 0.2
"""How often a terminal shows how far a trial is."""

LINE_S = 10.0
"""How often a log does."""


class Progress:
    """An onlooker of trials that shows on stderr how far they are; to be used in a `with` block."""

    def __init__(self, trials: int) -> None:
        self._trials = trials
        self._trial = 0
        console = Console(stderr=True)
        text = "preparing; a first run compiles what it needs, which takes some seconds"
        self._status = Status(text, console=console) if console.is_terminal else None
        self._pause_s = REFRESH_S if self._status else LINE_S
        self._next = 0.0
        self._began = 0.0

    def begin(self, trial: int) -> None:
        """Say that trial number `trial` begins."""
        self._trial = trial
        self._began = time.perf_counter()
        self._next = self._began + self._pause_s

    def __call__(self, step: Step, watch: SynchronyWatch) -> None:
        """Show a step, if it is time to."""
        if time.perf_counter() >= self._next:
            self._show(step.time_s, watch.cycles, watch.order_parameter)

    def of_swarm(self, swarm: Swarm) -> None:
        """Show a swarm of point-like agents, if it is time to."""
        if time.perf_counter() >= self._next:
            self._show(swarm.time_s, swarm.cycles, swarm.order_parameter)

    def _show(self, time_s: float, cycles: int, order_parameter: float | None) -> None:
        now = time.perf_counter()
        self._next = now + self._pause_s
        r = "" if order_parameter is None else f", order parameter {order_parameter:.3f}"
        text = (
            f"trial {self._trial + 1} of {self._trials}: {time_s:.1f} s simulated, {cycles} cycles{r}, "
            f"{time_s / (now - self._began):.0f} x real time"
        )
        if self._status:
            self._status.update(text)
        else:
            print(text, file=sys.stderr)

    def __enter__(self) -> Self:
        if self._status:
            self._status.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        if self._status:
            self._status.stop()


def tell(line: str) -> None:
    """Print a line on stderr, at once."""
    print(line, file=sys.stderr, flush=True)


def print_table(results: Sequence[TrialResult]) -> None:
    """Print a readable table of trials of one scenario on stdout."""
    if not results:
        return
    table = Table(title=Text(results[0].scenario), title_justify="left")
    for heading in ("seed", "T_sync [cycles]", "censored", "order par.", "simulated [s]", "wall [s]", "x real time"):
        table.add_column(heading, justify="right")
    for result in results:
        table.add_row(
            str(result.seed),
            "-" if result.t_sync_cycles is None else str(result.t_sync_cycles),
            f"yes, at {result.cycles}" if result.censored else "no",
            "-" if result.order_parameter is None else f"{result.order_parameter:.3f}",
            f"{result.simulated_s:.1f}",
            f"{result.wall_s:.2f}",
            f"{result.real_time_factor:.0f}",
        )
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def print_json(result: TrialResult) -> None:
    """Print a trial as one JSON object on a line of stdout, at once."""
    print(json.dumps({**result._asdict(), "versions": versions()}), flush=True)
