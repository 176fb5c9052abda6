"""Torture: every command that writes, beside every way in which writing fails, at system calls spread over its run.

`python -m tests.sweep.test_torture FOLDER CALLS [COMMAND...]` runs it with the library of `torture.c` preloaded, at as
many calls of each command as CALLS says (0: all), and prints the table of docs/reliability.md. Each run is forked from
one process that has everything loaded.
"""

import ctypes
import errno
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from epuck_sim.runs.folder import DATABASE
from epuck_sim.sweep import scheduler
from tests.cli.commands import call
from tests.processes import start
from tests.replication.claim_files import FASTER, claim, write_claims
from tests.sweep.pool_here import pool_here
from tests.sweep.short_sweeps import table
from tests.tools import needs_compiler

SOURCE = Path(__file__).with_name("torture.c")

SWEEP = """
arena: {width_cm: 40, height_cm: 40}
robots: [{count: 3, controller: firefly}]
stop: {max_cycles: 3}
trials: 4
sweep: {grid: {robots.0.parameters.speed_cm_s: [4, 8]}}
"""


def rows(path: Path) -> Any:
    return table(path) if (path / DATABASE).exists() else []


def text(path: Path) -> Any:
    return path.read_text() if path.exists() else None


def ending(path: Path) -> Any:
    """Return the last tag of a page or picture whose contents tell the time."""
    return path.read_text()[-8:].strip() if path.exists() else None


def cells(path: Path) -> Any:
    from pyarrow import parquet  # noqa: PLC0415 not in what is forked

    return parquet.read_table(path).drop_columns(["wall_s"] if path.name == "t.parquet" else []).to_pylist()


def moments(path: Path) -> Any:
    from epuck_sim.recording.reader import last_moment_s  # noqa: PLC0415

    return last_moment_s(path)


def frames(path: Path) -> Any:
    import av  # noqa: PLC0415

    with av.open(path) as film:
        return sum(1 for _ in film.decode(video=0))


class Row(NamedTuple):
    words: str  # the command, in a folder with what `prepare` has made
    target: str  # what it makes
    read: Callable[[Path], Any]
    """Returns what is in that: rows of a run folder, or something that is the same whenever a file is whole."""


ROWS = {
    "sweep": Row("run s.yaml --out new", "new", rows),
    "share": Row("run s.yaml --share 1/2 --out new", "new", rows),
    "merge": Row("merge a b --out new", "new", rows),
    "added measure": Row("run f --measure order_parameter", "f", rows),
    "pool": Row("run s.yaml --workers 2 --out new", "new", rows),
    "replicate": Row("replicate --claims claims.yaml --out new", "new/replication.md", text),
    "export": Row("export f --to t.csv", "t.csv", text),
    "parquet": Row("export f --to t.parquet", "t.parquet", cells),
    "plot": Row("plot f --to t.svg", "t.svg", ending),
    "report": Row("report f --to t.html", "t.html", ending),
    "trace": Row("run pair --set stop.max_cycles=2 --trace r.parquet", "r.parquet", cells),
    "recording": Row("run pair --set stop.max_cycles=2 --record t.rrd", "t.rrd", moments),
    "film": Row("run pair --set stop.max_time_s=1 --film t.mp4", "t.mp4", frames),
    "new": Row("new scenario mine", "mine.yaml", text),
}

QUICK = ("sweep", "merge", "added measure", "new")
"""Commands that `make test` has; the others write as these do, and some take seconds: `make torture` has them."""

DIE, TORN = -1, -2
FAULTS = {"kill": DIE, "torn write": TORN, "disk full": errno.ENOSPC, "EIO": errno.EIO}

LOCKS = {"no flock": errno.ENOLCK, "flock EIO": errno.EIO, "flock ENOSYS": errno.ENOSYS}
"""Faults of locks, which fail from the beginning."""

TEMPORARY = "short temporary folder"

LOCAL_POOL = scheduler.local_pool

EVER = 2**40  # more calls than a command makes


class End(NamedTuple):
    signal: int
    code: int = 0
    says: str = ""
    calls: int = 0


def prepare(folder: Path) -> None:
    """Make what commands need: a sweep, run whole as `f` and in shares `a` and `b`, and claims."""
    (folder / "tmp").mkdir(parents=True)
    (folder / "s.yaml").write_text(SWEEP)
    limits = {"trials": 2, "stop": {"max_cycles": 9}}
    keys = {**limits, "agents": {"count": 3}, "sweep": {"grid": {"response.coupling": [0.05, 0.4]}}}
    between = {"test": "ratio", "between": FASTER["between"], "above": 1}
    tiny = {"scenario": "particles", "keys": keys}
    write_claims(folder, [claim("A1", between)], tiny)
    os.chdir(folder)
    scheduler.local_pool = pool_here
    for words in ("run s.yaml --out f", "run s.yaml --share 1/2 --out a", "run s.yaml --share 2/2 --out b"):
        assert call(*words.split()).exit_code == 0  # in this process, which so has loaded what all need


def run(folder: Path, words: str, arm: Callable[[Any], None] = lambda _: None) -> End:
    """Run a command in a process of its own, in which `arm` has armed the preloaded library."""
    reader, writer = os.pipe()
    process = os.fork()
    if not process:
        os.close(reader)
        signal.alarm(300)
        os.chdir(folder)
        os.environ["TMPDIR"] = str(folder / "tmp")
        shim = ctypes.CDLL(None)
        shim.calls_left.restype = ctypes.c_long
        scheduler.local_pool = LOCAL_POOL if "--workers" in words else pool_here
        arm(shim)
        done = call(*words.split())
        left = shim.calls_left()
        shim.arm(ctypes.c_long(-1), 0, b"")
        shim.lock(0)
        raised = done.exception if not isinstance(done.exception, SystemExit) else None
        says = f"{done.stderr}{f'Traceback: {raised!r}' if raised else ''}"
        os.write(writer, json.dumps([done.exit_code, says[-2000:], EVER - left]).encode())
        os._exit(0)
    os.close(writer)
    with os.fdopen(reader) as pipe:
        said = pipe.read()
    _, status = os.waitpid(process, 0)
    return End(os.WTERMSIG(status)) if os.WIFSIGNALED(status) else End(0, *json.loads(said))


def read(row: Row, folder: Path) -> Any:
    return row.read(folder / row.target) if row.read is rows or (folder / row.target).exists() else None


def faults(row: Row, calls: int, wanted: int) -> Iterator[tuple[str, Callable[[Any], None]]]:
    """Yield the names of faults, each with what arms it: at `wanted` calls, or at all if that is 0."""
    chosen = range(calls) if not wanted else sorted({round((k + 0.5) * calls / wanted) for k in range(wanted)})
    for name, number in FAULTS.items():
        for at in chosen:
            yield name, lambda shim, at=at, number=number: shim.arm(ctypes.c_long(at), number, b"")
    for name, number in list(LOCKS.items())[: wanted or None]:
        yield name, lambda shim, number=number: shim.lock(number)
    if row.read is not text:
        yield TEMPORARY, lambda shim: shim.arm(ctypes.c_long(0), errno.ENOSPC, f"{os.environ['TMPDIR']}/".encode())


def attack(row: Row, made: Path, folder: Path, expected: Any, name: str, arm: Callable[[Any], None]) -> None:
    """Let a command fail, look at what it leaves, and give it again; fail if anything is lost, wrong or not said."""
    shutil.copytree(made, folder)
    before = read(row, folder)
    end = run(folder, row.words, arm)
    assert end.signal in (0, signal.SIGKILL), f"ended by signal {end.signal}"
    assert "Traceback" not in end.says, end.says
    assert end.code in (0, 1, 2), end
    assert end.code != 2 or "error: " in end.says, end.says
    found = read(row, folder)
    if row.read is rows:
        assert set(found) <= {*before, *expected}, "rows are wrong"
        assert len(found) >= len(before), "rows are lost"
    else:
        assert found in (None, before, expected), "what stands there is not whole"
    if not end.signal and name != "EIO":
        assert end.code != 0 or found == expected, "it says that it is done"
        assert not list(folder.rglob("*.part")), "a half file is left"
    again = run(folder, row.words)
    assert again.code == 0 or found == expected, again.says
    assert read(row, folder) == expected, "not the same when it is given again"
    shutil.rmtree(folder)


def main(folder: Path, wanted: int, *names: str) -> None:
    """Attack the commands, print how often each was, and what failed as errors."""
    made, failures = folder / "made", []
    prepare(made)
    print(f"| command | calls | {' | '.join([*FAULTS, *LOCKS, TEMPORARY])} |")
    for name in names or ROWS:
        row, whole = ROWS[name], folder / "whole"
        shutil.copytree(made, whole)
        end = run(whole, row.words, lambda shim: shim.arm(ctypes.c_long(EVER), 0, b""))
        assert end.code == 0, (name, end)
        expected = read(row, whole)
        assert expected, name
        tried = dict.fromkeys([*FAULTS, *LOCKS, TEMPORARY], 0)
        for number, (fault, arm) in enumerate(faults(row, end.calls, wanted)):
            tried[fault] += 1
            try:
                attack(row, made, folder / str(number), expected, fault, arm)
            except Exception as error:
                failures.append(f"{name}: {fault}, {tried[fault]}th of {end.calls} calls: {error}")
                print(failures[-1], file=sys.stderr, flush=True)
                shutil.rmtree(folder / str(number), ignore_errors=True)
        print(f"| {name} | {end.calls} | {' | '.join(map(str, tried.values()))} |", flush=True)
        shutil.rmtree(whole)
    sys.exit(bool(failures))


@needs_compiler
@pytest.mark.skipif(sys.platform != "linux", reason="libraries are preloaded in another way")
@pytest.mark.parametrize(
    "names", [QUICK, pytest.param(ROWS.keys() - QUICK, marks=pytest.mark.slow)], ids=["quick", "dear"]
)
def test_a_command_whose_writing_fails_loses_nothing_says_so_and_goes_on(tmp_path, names) -> None:
    library = tmp_path / "torture.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-O1", "-o", library, SOURCE, "-ldl"], check=True)
    calls = os.environ.get("TORTURE", "1")
    with tempfile.TemporaryDirectory() as folder:  # sockets of a pool have short paths
        arguments = [sys.executable, "-m", "tests.sweep.test_torture", Path(folder) / "t", calls, *sorted(names)]
        process = start(arguments, env={"LD_PRELOAD": str(library)}, cwd=SOURCE.parents[2])
        stdout, stderr = process.communicate(timeout=3600)
    print(stdout)
    assert process.returncode == 0, stderr


if __name__ == "__main__":
    main(Path(sys.argv[1]), int(sys.argv[2]), *sys.argv[3:])
