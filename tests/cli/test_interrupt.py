"""A command ends when it is asked to, even where a compiled controller never returns."""

import os
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from epuck_sim.cli import app as command
from epuck_sim.cli import interrupt
from tests.cli.commands import called
from tests.control.bench import with_step
from tests.processes import COMMAND, processes_marked, start, wait_until

ROOT = Path(interrupt.__file__).parents[2]

ENDLESS = with_step("""memory.x += 1
    if memory.x > 5:
        print("in the loop")
    while memory.x > 5:
        memory.x += 1""")
"""A controller that never returns from its sixth step."""


def write_scene(folder: Path) -> Path:
    (folder / "endless.py").write_text(ENDLESS)
    path = folder / "scene.yaml"
    path.write_text("name: endless\nrobots: [{controller: endless.py, count: 1}]\nstop: {max_time_s: 60}\n")
    return path


@pytest.fixture(scope="module")
def _compiled(tmp_path_factory) -> None:
    """Compile, into the cache, what the trials need."""
    folder = tmp_path_factory.mktemp("compiled")
    called("run", write_scene(folder), "--set", "stop.max_time_s=0.3")


@pytest.fixture
def scene(tmp_path, _compiled) -> Path:
    return write_scene(tmp_path)


IMPATIENT = """
import sys
from epuck_sim.__main__ import main
from epuck_sim.cli import interrupt
interrupt.GRACE_S = 0.3
sys.argv[0] = "epuck-sim"
main()
"""
"""The command, that waits less long for a main thread that does not react."""


def running(scene: Path, *arguments: str) -> subprocess.Popen:
    """Start the command, whose processes are marked by the scene's folder; they end with the test."""
    options = {"cwd": scene.parent, "env": {"PYTHONUNBUFFERED": "1", "PYTHONPATH": str(ROOT)}}
    return start([sys.executable, "-c", IMPATIENT, "run", scene, *arguments], mark=scene.parent.name, **options)


def end_of(process: subprocess.Popen) -> tuple[int, str]:
    """Return the exit code of a process that would run for ever without a request, and what it says."""
    _, stderr = process.communicate(timeout=300)
    return process.returncode, stderr


@pytest.mark.parametrize("request_", [[signal.SIGTERM], [signal.SIGINT] * 2], ids=["SIGTERM", "Ctrl-C twice"])
def test_a_compiled_controller_in_an_endless_loop_is_ended_and_leaves_nothing(scene, request_) -> None:
    before = sorted(path.name for path in scene.parent.iterdir())
    process = running(scene, "--trace=t.parquet")
    assert process.stdout.readline() == "in the loop\n"
    for number, each in enumerate(request_):
        if number:
            said = process.stderr.readline()
            assert said == "Ctrl-C is not heard in here; press it again to end at once\n"
            assert process.poll() is None
        os.kill(process.pid, each)
    stdout, stderr = process.communicate(timeout=300)  # the trial itself would never end
    assert process.returncode == 130
    assert stderr.endswith("ended where Ctrl-C is not heard\n")
    assert "Traceback" not in stdout + stderr
    assert sorted(path.name for path in scene.parent.iterdir()) == before


IMPORTS = {
    "while True:\n    pass\n": signal.SIGTERM,
    "import re\nre.match('(a*)*b', 'a' * 40)\n": signal.SIGINT,
}
"""Ends of controllers' files that keep their import from ending, and requests that end it all the same."""


@pytest.mark.parametrize("raised", [ValueError("what an extension makes of it"), KeyboardInterrupt()])
def test_a_request_that_an_extension_turns_into_an_error_or_that_comes_twice_is_one(monkeypatch, capfd, raised) -> None:
    def fail() -> None:
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)
        raise raised

    before = {request: signal.getsignal(request) for request in interrupt.REQUESTS}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in what it runs in the background
    hook = sys.unraisablehook
    monkeypatch.setattr(command, "app", fail)
    try:
        with pytest.raises(SystemExit) as ended:
            command.main()
    finally:
        signal.set_wakeup_fd(-1)
        sys.unraisablehook = hook
        for request, handler in before.items():
            signal.signal(request, handler)
    assert ended.value.code == interrupt.EXIT_CODE
    assert capfd.readouterr().err == "interrupted\n"


DEAF = """
import time
while True:
    try:
        time.sleep(600)
    except BaseException:
        print('caught', flush=True)
"""
"""One that goes on whatever is raised."""


def importing(folder: Path, end: str) -> subprocess.Popen:
    """Start the command with a controller whose import does not end, and wait until it is there."""
    (folder / "endless.py").write_text(f"{ENDLESS}\nprint('importing', flush=True)\n{end}")
    process = start([*COMMAND, "run", "pair", "--controller", folder / "endless.py"], mark=folder.name)
    assert process.stdout.readline() == "importing\n"
    time.sleep(0.2)
    return process


@pytest.mark.parametrize(("end", "request_"), IMPORTS.items(), ids=["loops", "matches"])
def test_one_request_ends_an_import_that_never_does(tmp_path, end: str, request_) -> None:
    process = importing(tmp_path, end)
    os.kill(process.pid, request_)
    assert end_of(process) == (130, "interrupted\n")


def test_the_third_request_in_a_row_ends_what_catches_every_one(tmp_path) -> None:
    process = importing(tmp_path, DEAF)
    for _ in range(2):
        os.kill(process.pid, signal.SIGINT)
        assert process.stdout.readline() == "caught\n"
        time.sleep(0.2)  # until it sleeps again: what catches one request is not to be hit by the next
    os.kill(process.pid, signal.SIGINT)
    assert end_of(process) == (130, "ended at the third request\n")


@pytest.mark.parametrize("request_", [signal.SIGTERM, signal.SIGKILL])
def test_workers_in_an_endless_loop_end_with_the_command(scene, request_) -> None:
    process = running(scene, "--out", "run", "--trials", "4", "--workers", "2")

    wait_until(lambda: any(map(is_busy, {*processes_marked(scene.parent.name)} - {process.pid})), 120)
    os.kill(process.pid, request_)
    process.communicate(timeout=300)
    assert process.returncode == (-signal.SIGKILL if request_ == signal.SIGKILL else 130)
    wait_until(lambda: not processes_marked(scene.parent.name))


def is_busy(pid: int) -> bool:
    """Return whether a process computes all the time, as a loop does."""
    with suppress(psutil.NoSuchProcess):
        return psutil.Process(pid).cpu_percent(0.5) > 20
    return False


DROPPED = """
import sys, time
from epuck_sim.cli.interrupt import end_on_request
from epuck_sim.cli.errors import exit_on_error

class Slow:
    def __del__(self):
        print("in a destructor", flush=True)
        time.sleep(60)

end_on_request()
with exit_on_error():
    Slow()
    time.sleep(60)
"""
"""A program that is asked to end while Python raises nothing: in a destructor."""


def test_a_request_in_a_destructor_is_not_lost() -> None:
    process = start([sys.executable, "-c", DROPPED])
    assert process.stdout.readline() == "in a destructor\n"
    process.send_signal(signal.SIGTERM)
    _, stderr = process.communicate(timeout=300)
    assert stderr.startswith("interrupted\n")
    assert "Exception ignored" not in stderr
