"""Runs a small sweep that dies at a system call that writes, and goes on with it: `python -m ... FOLDER CALLS FAULT`.

FAULT is 0 for a death before the call, 1 for one after half of it, 2 for a disk that is full from then on.

It needs the library of `die_at_write.c` to be preloaded. All processes are forked from one that has everything loaded.
"""

import ctypes
import json
import mmap
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from random import Random

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.reader import read_points
from epuck_sim.runs.share import Share
from epuck_sim.runs.status import read_status
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.sweep.run import run_sweep
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import table

SHIM = ctypes.CDLL(None)

SCENARIO = load_scenario(
    {"arena": {"width_cm": 40, "height_cm": 40}, "stop": {"max_cycles": 3}, "trials": 4},
    ["robots.0.count=3"],
    ["robots.0.parameters.speed_cm_s=4,8"],
)

SHARE = Share(1, 2)

FULL = 2
"""The fault of a disk that is full."""

EVER = 2**40
"""More calls than a sweep makes."""


def forked(work: Callable[[], None]) -> int:
    """Run `work` in a process of its own; return the number of the signal that killed it, or 0 if it ended well."""
    process = os.fork()
    if not process:
        code = 1
        try:
            work()
            code = 0
        finally:  # an error is printed, and ends the child with 1
            if code:
                sys.excepthook(*sys.exc_info())
            os._exit(code)
    _, status = os.waitpid(process, 0)
    if os.WIFSIGNALED(status):
        return os.WTERMSIG(status)
    assert os.WEXITSTATUS(status) == 0, "see the error above"
    return 0


def die_and_go_on(folder: Path, deaths: list[int], fault: int, expected: list[tuple]) -> None:
    """Run the sweep; each run fails at the call given, and the last one ends. Fail if a row is lost, or is wrong."""
    reported, refused = mmap.mmap(-1, 8), mmap.mmap(-1, 8)  # are shared with the forked processes

    def run(calls: int) -> None:
        SHIM.arm(ctypes.c_long(calls), fault)
        try:
            run_sweep(
                SCENARIO,
                folder,
                pool_here,
                lambda progress: reported.__setitem__(0, progress.stored),
                share=SHARE,
            )
        except EpuckSimError:
            if fault != FULL:
                raise
            refused[0] += 1
        finally:
            SHIM.arm(ctypes.c_long(-1), 0)

    def look() -> None:
        if not (folder / DATABASE).exists():
            assert reported[0] == 0
            return
        status = read_status(folder)
        assert status.share == str(SHARE)
        assert status.stored >= reported[0]
        rows = table(folder)
        assert len(rows) == sum(len(point.times) for point in read_points(folder))
        assert set(rows) <= set(expected)

    for number, calls in enumerate(deaths):
        assert forked(lambda calls=calls: run(calls)) in (0, signal.SIGKILL)
        # where only the closing of the database fails, all is stored
        assert fault != FULL or refused[0] == number + 1 or reported[0] == len(expected)
        forked(look)
    assert forked(lambda: run(EVER)) == 0
    assert table(folder) == expected


def calls_of_a_sweep(folder: Path) -> int:
    """Return how many system calls that write the whole sweep makes."""
    SHIM.calls_left.restype = ctypes.c_long
    SHIM.arm(ctypes.c_long(EVER), 0)
    run_sweep(SCENARIO, folder, pool_here, share=SHARE)
    made = EVER - SHIM.calls_left()
    SHIM.arm(ctypes.c_long(-1), 0)
    return made


def main(folder: Path, wanted: int, fault: int) -> None:
    """Fail at `wanted` calls, spread evenly, or at all if it is 0; then, if at all, at two random ones in a row."""
    run_sweep(SCENARIO, folder / "first", pool_here, share=SHARE)  # compiles
    calls = calls_of_a_sweep(folder / "whole")
    expected = table(folder / "whole")
    chosen = range(calls) if not wanted else sorted({round(k * (calls - 1) / (wanted - 1)) for k in range(wanted)})
    deaths = [[call] for call in chosen]
    random = Random(1)
    deaths += [] if wanted else [[random.randrange(calls), random.randrange(calls)] for _ in range(calls)]
    for number, calls_at in enumerate(deaths):
        try:
            die_and_go_on(folder / str(number), calls_at, fault, expected)
        except BaseException:
            print(f"failed at calls {calls_at} of {calls}", file=sys.stderr)
            raise
    print(json.dumps({"calls": calls, "killed": sum(map(len, deaths))}))


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]))
