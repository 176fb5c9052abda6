"""A command ends when it is asked to, even where a compiled controller never returns."""

import os
import signal
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from epuck_sim.cli.interrupt import GRACE_S
from tests.processes import COMMAND, processes_marked, wait_until

ENDLESS = """
PARAMETERS = {}
MEMORY = {"x": float}

def start(memory, parameters, random):
    pass

def step(sensors, memory, actuators, parameters, random):
    memory.x += 1
    if memory.x > 5:
        print("in the loop")
    while memory.x > 5:
        memory.x += 1
"""
"""A controller that never returns from its sixth step."""


def write_scene(folder: Path) -> Path:
    """Write a scenario whose sixth step never ends."""
    (folder / "endless.py").write_text(ENDLESS)
    path = folder / "scene.yaml"
    path.write_text("name: endless\nrobots: [{controller: endless.py, count: 1}]\nstop: {max_time_s: 60}\n")
    return path


@pytest.fixture(scope="module")
def _compiled(tmp_path_factory) -> None:
    """Compile, into the cache, what the trials need."""
    folder = tmp_path_factory.mktemp("compiled")
    short = ["--set", "stop.max_time_s=0.3", "--record", folder / "t.rrd"]
    subprocess.run([*COMMAND, "run", write_scene(folder), *short], check=True, capture_output=True)


@pytest.fixture
def scene(tmp_path, _compiled) -> Path:
    return write_scene(tmp_path)


def hear_ctrl_c() -> None:
    """Undo what a parent may have set, such as nohup or a shell's background job."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@contextmanager
def running(scene: Path, *arguments: str) -> Iterator[subprocess.Popen]:
    """Yield the command in a process group of its own, whose processes are marked by the scene's folder."""
    process = subprocess.Popen(
        [*COMMAND, "run", str(scene), *arguments],
        cwd=scene.parent,
        env={**os.environ, "EPUCK_SIM_TEST": scene.parent.name, "PYTHONUNBUFFERED": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        preexec_fn=hear_ctrl_c,  # noqa: PLW1509 this process has no other threads
    )
    try:
        yield process
    finally:
        with_what_it_started = processes_marked(scene.parent.name)
        for each in with_what_it_started:
            os.kill(each, signal.SIGKILL)
        process.communicate()


def cpu_s(pid: int) -> float:
    """Return the processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def wait_for_the_loop(process: subprocess.Popen) -> None:
    """Wait until the controller says that it is in its endless loop."""
    assert process.stdout is not None
    assert process.stdout.readline() == "in the loop\n"


@pytest.mark.parametrize("request_", [[signal.SIGTERM], [signal.SIGHUP], [signal.SIGINT, signal.SIGINT]])
def test_a_compiled_controller_in_an_endless_loop_is_ended_and_leaves_nothing(scene, request_) -> None:
    before = sorted(path.name for path in scene.parent.iterdir())
    with running(scene, "--trace", "t.parquet", "--record", "t.rrd") as process:
        wait_for_the_loop(process)
        began = time.monotonic()
        for each in request_:
            os.kill(process.pid, each)
            time.sleep(0.3)
        stdout, stderr = process.communicate(timeout=30)
        assert time.monotonic() - began < GRACE_S + 4
        assert process.returncode == 130
        assert stderr.endswith("ended in the middle of compiled code\n")
        assert "Traceback" not in stdout + stderr
    assert sorted(path.name for path in scene.parent.iterdir()) == before


def test_one_ctrl_c_says_that_another_one_ends_it(scene) -> None:
    with running(scene, "--trace", "t.parquet") as process:
        wait_for_the_loop(process)
        os.kill(process.pid, signal.SIGINT)
        assert process.stderr is not None
        assert process.stderr.readline() == "compiled code does not react to Ctrl-C; press it again to end at once\n"
        assert process.poll() is None
        os.kill(process.pid, signal.SIGINT)
        assert process.wait(timeout=5) == 130


def test_an_interpreted_controller_in_an_endless_loop_is_interrupted_by_one_ctrl_c(scene) -> None:
    with running(scene, "--trace", "t.parquet", "--interpret") as process:
        wait_for_the_loop(process)
        os.kill(process.pid, signal.SIGINT)
        _, stderr = process.communicate(timeout=10)
        assert (process.returncode, stderr) == (130, "interrupted\n")


@pytest.mark.parametrize("request_", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_workers_in_an_endless_loop_end_with_the_command(scene, request_) -> None:
    with running(scene, "--out", "run", "--trials", "4", "--workers", "2") as process:

        def at_work() -> bool:
            others = [each for each in processes_marked(scene.parent.name) if each != process.pid]
            return any(map(is_busy, others))

        wait_until(at_work, 120)
        if request_ == signal.SIGINT:
            os.killpg(process.pid, request_)  # a terminal sends it to all processes
        else:
            os.kill(process.pid, request_)
        process.communicate(timeout=30)
        assert process.returncode == (-signal.SIGKILL if request_ == signal.SIGKILL else 130)
        wait_until(lambda: not processes_marked(scene.parent.name), 15)


def is_busy(pid: int) -> bool:
    """Return whether a process computes all the time, as a loop does."""
    try:
        before = cpu_s(pid)
        time.sleep(0.5)
        return cpu_s(pid) > before + 0.1
    except OSError:
        return False
