"""A command ends when it is asked to, even where compiled code never returns, and leaves terminals as they were; and
the docs' job array, with stand-ins for what SLURM brings, ends in time and is queued again."""

import os
import pty
import re
import select
import signal
import subprocess
import sys
import termios
import time
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from epuck_sim.cli import app as command, terminal
from epuck_sim.cli.terminal import pressed_keys
from epuck_sim.runs.folder import STORED
from epuck_sim.runs.reader import read_status
from tests.cli.commands import called, write_scene
from tests.control.bench import with_step
from tests.processes import COMMAND, processes_marked, start, wait_until
from tests.sweep.short_sweeps import short_sweep, stored

ROOT = Path(terminal.__file__).parents[2]
ENDLESS = with_step("""memory.x += 1
    if memory.x > 5:
        print("in the loop")
    while memory.x > 5:
        memory.x += 1""")  # a controller that never returns from its sixth step


@pytest.fixture
def scene(tmp_path) -> Path:
    called("run", write_scene(tmp_path, ENDLESS, 0.3))  # which compiles what the trials need
    return write_scene(tmp_path, ENDLESS, 60)


def running(scene: Path, *arguments: str) -> subprocess.Popen:
    """Start the command, whose processes are marked by the scene's folder; they end with the test."""
    impatient = "from epuck_sim.cli import terminal; terminal.GRACE_S = 0.3"  # with a main thread that does not react
    program = [sys.executable, "-c", f"{impatient}; from epuck_sim.__main__ import main; main()"]
    environment = {"PYTHONUNBUFFERED": "1", "PYTHONPATH": str(ROOT)}
    return start([*program, "run", scene, *arguments], cwd=scene.parent, env=environment, mark=scene.parent.name)


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
            assert said == "the running code does not react to Ctrl-C; press it again to end at once\n"
            assert process.poll() is None
        os.kill(process.pid, each)
    stdout, stderr = process.communicate(timeout=300)  # the trial itself would never end
    assert process.returncode == 130
    assert stderr.endswith("ended by force: the running code does not react to Ctrl-C\n")
    assert "Traceback" not in stdout + stderr
    assert sorted(path.name for path in scene.parent.iterdir()) == before


@pytest.mark.parametrize("raised", [ValueError("what an extension makes of it"), KeyboardInterrupt()])
def test_a_request_that_an_extension_turns_into_an_error_or_that_comes_twice_is_one(monkeypatch, capfd, raised) -> None:
    def fail() -> None:
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
            time.sleep(5)
        raise raised

    before = {request: signal.getsignal(request) for request in terminal.REQUESTS}
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell ignores it in what it runs in the background
    hook = sys.unraisablehook
    monkeypatch.setattr(command, "app", fail)
    monkeypatch.setattr(terminal.atexit, "register", lambda _: None)  # or pytest would end with the command's exit code
    try:
        with pytest.raises(SystemExit) as ended:
            command.main()
    finally:
        signal.set_wakeup_fd(-1)
        sys.unraisablehook = hook
        for request, handler in before.items():
            signal.signal(request, handler)
    assert ended.value.code == terminal.EXIT_CODE
    assert capfd.readouterr().err == "interrupted\n"


DEAF = """
import time
while True:
    try:
        time.sleep(600)
    except BaseException:
        print('caught', flush=True)
"""  # one that goes on whatever is raised


def importing(folder: Path, end: str) -> subprocess.Popen:
    """Start the command with a controller whose import does not end, and wait until it is there."""
    (folder / "endless.py").write_text(f"{ENDLESS}\nprint('importing', flush=True)\n{end}")
    process = start([*COMMAND, "run", "pair", "--controller", folder / "endless.py"], mark=folder.name)
    assert process.stdout.readline() == "importing\n"
    time.sleep(0.2)
    return process


@pytest.mark.parametrize(
    ("end", "request_"),
    [("while True:\n    pass\n", signal.SIGTERM), ("import re\nre.match('(a*)*b', 'a' * 40)\n", signal.SIGINT)],
)
def test_one_request_ends_an_import_that_never_does(tmp_path, end: str, request_) -> None:
    process = importing(tmp_path, end)
    os.kill(process.pid, request_)
    assert end_of(process) == (130, "interrupted\n")


def test_ctrl_c_while_the_command_itself_is_imported_leaves_no_traceback(tmp_path) -> None:
    (tmp_path / "typer.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGINT)")
    assert end_of(start([*COMMAND, "--version"], cwd=tmp_path)) == (-signal.SIGINT, "")


def test_the_third_request_in_a_row_ends_what_catches_every_one(tmp_path) -> None:
    process = importing(tmp_path, DEAF)
    for _ in range(2):
        os.kill(process.pid, signal.SIGINT)
        assert process.stdout.readline() == "caught\n"
        time.sleep(0.2)  # until it sleeps again: what catches one request is not to be hit by the next
    os.kill(process.pid, signal.SIGINT)
    assert end_of(process) == (130, "ended at the third request to stop\n")


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
from epuck_sim.cli.terminal import end_on_request
from epuck_sim.cli.errors import exit_on_error

class Slow:
    def __del__(self):
        print("ready", flush=True)
        time.sleep(60)

class HalfMade:
    def __init__(self):
        print("ready", flush=True)
        time.sleep(60)

    def __del__(self):
        del self.part

end_on_request()
with exit_on_error():
    {}()
    time.sleep(60)
"""  # a program that is asked to end while Python raises nothing, in a destructor, or while it makes an object


@pytest.mark.parametrize("name", ["Slow", "HalfMade"])
def test_a_request_in_a_destructor_is_not_lost_and_what_is_half_made_complains_of_nothing(name: str) -> None:
    process = start([sys.executable, "-c", DROPPED.format(name)])
    assert process.stdout.readline() == "ready\n"
    process.send_signal(signal.SIGTERM)
    _, stderr = end_of(process)
    assert stderr.startswith("interrupted\n")
    assert "Exception ignored" not in stderr


READS = """
import sys
from epuck_sim.cli.terminal import pressed_keys
with pressed_keys(echo={echo}) as wait:
    print("ready", flush=True)
    keys = ""
    while "q" not in keys:
        keys += wait(0.5)
    print(repr(keys), flush=True)
"""


@pytest.mark.parametrize("echo", [False, True])
def test_keys_are_read_one_by_one_and_the_terminal_is_set_back_and_what_is_none_is_left_alone(echo: bool) -> None:
    with pressed_keys(echo=echo) as wait:
        assert wait is None
    controller, terminal = pty.openpty()
    before = termios.tcgetattr(terminal)
    session = f"import os, fcntl, termios; fcntl.ioctl(0, termios.TIOCSCTTY, 0){READS.format(echo=echo)}"
    process = start([sys.executable, "-c", session], stdin=terminal)
    assert process.stdout.readline() == "ready\n"
    flags = termios.tcgetattr(terminal)[3]
    assert not flags & termios.ICANON
    assert bool(flags & termios.ECHO) == echo
    assert flags & termios.ISIG  # Ctrl-C does what it always does
    os.write(controller, b" n")
    time.sleep(0.1)
    os.write(controller, b"q")
    assert process.stdout.readline() == "' nq'\n"
    wait_until(lambda: process.poll() is not None)
    assert process.returncode == 0
    assert termios.tcgetattr(terminal) == before
    with suppress(OSError):
        os.close(controller)
    os.close(terminal)


def test_the_debugger_has_the_terminal_to_itself_and_leaving_it_ends_the_command_quietly(tmp_path) -> None:
    scene = write_scene(tmp_path, with_step("breakpoint(); memory.x = 7"), 0.5)
    ours, theirs = pty.openpty()
    command = [*COMMAND, "run", scene, "--interpret", "--trace", tmp_path / "t.parquet"]
    process = start(command, stdin=theirs, stdout=theirs, stderr=theirs)
    os.close(theirs)
    assert "(Pdb) " in read_until_silent(ours, 60)
    time.sleep(0.3)
    assert not select.select([ours], [], [], 0)[0]
    os.write(ours, b"p 6 * 7\n")
    assert read_until_silent(ours, 10).replace("\r", "").endswith("p 6 * 7\n42\n(Pdb) ")
    os.write(ours, b"q\n")
    said = read_until_silent(ours, 10)
    assert "interrupted" in said
    assert "BdbQuit" not in said
    assert process.wait(timeout=20) == 130
    assert sorted(path.name for path in tmp_path.iterdir()) == ["mine.py", "scene.yaml"]
    os.close(ours)


def read_until_silent(terminal: int, limit_s: float) -> str:
    """Return what is written to a terminal until nothing more comes for half a second."""
    found = b""
    while select.select([terminal], [], [], 0.5 if b"(Pdb) " in found or b"interrupted" in found else limit_s)[0]:
        try:
            found += os.read(terminal, 4096)
        except OSError:  # the program has ended
            break
    return found.decode()


def queue(folder: Path, scenario: Path, number: int, of: int) -> subprocess.Popen:
    """Start the script as SLURM would start job `number` of an array of `of`, for a scenario of ours."""
    blocks = re.findall(r"^```bash\n(.*?)^```", (ROOT / "docs/clusters.md").read_text(), re.M | re.S)
    (script,) = [block for block in blocks if "#SBATCH" in block]
    (folder / "array.sh").write_text(script.replace("fig-4-2a", str(scenario)).replace("/40", f"/{of}"))
    tools = {"epuck-sim": f'exec {sys.executable} -m epuck_sim "$@"', "scontrol": f'echo "$@" >> {folder}/requeued'}
    (folder / "bin").mkdir(exist_ok=True)
    for name, line in tools.items():
        (folder / "bin" / name).write_text(f"#!/bin/sh\n{line}\n")
        (folder / "bin" / name).chmod(0o755)
    given = {"SLURM_ARRAY_TASK_ID": str(number), "SLURM_ARRAY_JOB_ID": "77", "SLURM_CPUS_PER_TASK": "1"}
    path = {"PATH": f"{folder / 'bin'}:{os.environ['PATH']}", "SLURM_TMPDIR": str(folder / "node")}
    return subprocess.Popen(["bash", "array.sh"], cwd=folder, env={**os.environ, **given, **path})


def test_a_job_whose_time_is_nearly_up_is_queued_again_and_goes_on_to_the_end_of_its_share(tmp_path) -> None:
    scenario, local = short_sweep(tmp_path, 60), tmp_path / "node" / "share-77-2"
    job = queue(tmp_path, scenario, 2, 3)
    wait_until(lambda: stored(local) > 0, 300)
    job.send_signal(signal.SIGUSR1)
    assert job.wait(300) == 0
    assert (tmp_path / "requeued").read_text() == "requeue 77_2\n"
    kept = tmp_path / "runs/shares/2"
    assert 0 < stored(kept) < 160
    (local / STORED).write_text("999")  # of a later job that was killed on this node, whose log is beside the database
    assert queue(tmp_path, scenario, 2, 3).wait(300) == 0
    status = read_status(kept)
    assert (status.share, status.stored, status.trials) == ("2/3", 160, 160)
    assert (tmp_path / "requeued").read_text() == "requeue 77_2\n"
