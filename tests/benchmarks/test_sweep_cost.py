"""What a sweep costs beside its trials, and whether trials stay as cheap as they begin. Run by `make bench`."""

import ctypes
import os
import resource
import statistics
import subprocess
import sys
import time
from functools import partial

from epuck_sim import load_scenario, points
from epuck_sim.runs.reader import FinishedTrials, read_status
from epuck_sim.sweep.run import missing_tasks
from epuck_sim.sweep.worker import run_chunk
from tests.benchmarks.measuring import cpu_s, status

SPEEDS = "0.05,0.1,0.2,0.4,0.8,1.6,3.2,6.4,9.6,12.8"
TRIALS = 40
SHARE_TARGET = 0.05

SET_CHILD_SUBREAPER = 36
"""Linux's prctl: processes whose parent has ended become ours, so that their CPU time is counted."""


def cpu_of_command(*arguments: str) -> float:
    """Return the CPU seconds of a command and of all processes that it starts."""
    ctypes.CDLL(None).prctl(SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-m", "epuck_sim", *arguments], check=True, capture_output=True)
    while True:
        try:
            os.waitpid(-1, 0)
        except ChildProcessError:
            break
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def test_the_share_of_a_sweep_that_is_not_simulation(tmp_path) -> None:
    """CPU seconds of the command on two workers beside those of the same trials in a plain loop."""
    axis = f"robots.0.parameters.speed_cm_s={SPEEDS}"
    found = points(load_scenario("thesis", [f"trials={TRIALS}"], [axis]))
    tasks = [*missing_tasks(found, [range(TRIALS)] * len(found), FinishedTrials([]), interpret=False)]
    run_chunk(tasks[:1])
    plain = cpu_s(lambda: run_chunk(tasks))
    folder = tmp_path / "run"
    arguments = ("run", "thesis", "--sweep", axis, "--trials", str(TRIALS), "--out", str(folder), "--workers", "2")
    began = time.perf_counter()
    swept = cpu_of_command(*arguments)
    wall = time.perf_counter() - began
    nothing_to_do = cpu_of_command("run", str(folder))
    assert read_status(folder).stored == len(tasks)
    print(
        f"\n{len(tasks)} trials: {swept:.1f} CPU s in a sweep, {plain:.1f} in a loop, {wall:.1f} s on the wall; "
        f"{len(tasks) / wall:.1f} trials a second, {swept / len(tasks):.3f} CPU s a trial, "
        f"not simulation: {1 - plain / swept:.1%} (target <= {SHARE_TARGET:.0%}; a command with nothing to do: "
        f"{nothing_to_do:.1f} CPU s)"
    )


def test_ten_thousand_short_trials_in_one_process() -> None:
    """Time and memory of the last thousand beside the second thousand; the first warms caches up."""
    found = points(load_scenario("pair", ["trials=10000", "stop.max_cycles=1"]))
    tasks = [*missing_tasks(found, [range(10000)], FinishedTrials([]), interpret=False)]
    blocks = [tasks[first : first + 1000] for first in range(0, len(tasks), 1000)]
    seconds, resident = [], []
    for block in blocks:
        seconds.append(statistics.median(cpu_s(partial(run_chunk, [task])) for task in block))
        resident.append(status("VmRSS"))
    assert resident[-1] <= 1.05 * resident[1]
    print(
        f"\n10,000 trials: {seconds[1] * 1e3:.2f} ms each in the second thousand, {seconds[-1] / seconds[1]:.3f} x "
        f"that in the last; memory {resident[1] / 1024:.0f} MB, {resident[-1] / resident[1]:.3f} x (targets 1.05)"
    )
