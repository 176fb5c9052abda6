"""Claims about this machine: what is missing is not missed, what is too much is refused, estimates are right."""

import os
import socket
import subprocess
import sys
from pathlib import Path

import pytest

from epuck_sim import Simulation, film_trial, load_scenario, points
from epuck_sim.errors import FilmError, PortError, ScenarioError
from epuck_sim.sweep.demand import check_memory
from epuck_sim.util import machine
from epuck_sim.util.machine import HOST, check_port, free_port, signals

ELSEWHERE = """
import platformdirs.unix, psutil  # which have files of their own for each system
import errno, fcntl, multiprocessing, os, pathlib, signal, sys

flags, sync = fcntl.fcntl, os.fsync

def sync_written(number, of_file=fcntl.F_GETFL):
    if flags(number, of_file) & os.O_ACCMODE == os.O_RDONLY:
        raise OSError(errno.EBADF, "Bad file descriptor")
    sync(number)

def of_closed(do):
    def done(path, *given, **options):
        if str(path.resolve()) in map(os.path.realpath, pathlib.Path("/proc/self/fd").glob("*")):
            raise PermissionError(errno.EACCES, "is being used by another process")
        return do(path, *given, **options)
    return done

os.fsync = sync_written
for name in ("replace", "unlink"):
    setattr(pathlib.Path, name, of_closed(getattr(pathlib.Path, name)))
sys.modules.update(fcntl=None, resource=None, termios=None)
for module, names in {os: ("getuid", "geteuid", "fork"), signal: ("SIGHUP", "pthread_sigmask", "pthread_kill")}.items():
    for name in names:
        delattr(module, name)
multiprocessing.get_all_start_methods = lambda: ["spawn"]
"""  # takes away, from every process that is started, what Windows does not have, or does not do with open files

COMMANDS = """
from tests.cli.commands import call
if __name__ == "__main__":
    for words in ("thesis", "thesis --trials 2 --workers 1 --out o"):
        done = call("run", *words.split(), "--set", "stop.max_cycles=5")
        assert done.exit_code == 0, done.stderr
        print(done.stdout)
    assert "2" in call("summarize", "o").stdout
    try:
        import fcntl
    except ImportError:
        raise SystemExit(0)
    raise SystemExit("nothing was taken away")
"""


def test_trials_sweeps_and_summaries_need_nothing_that_windows_lacks_and_signals_are_those_there(tmp_path) -> None:
    (tmp_path / "sitecustomize.py").write_text(ELSEWHERE)
    (tmp_path / "program.py").write_text(COMMANDS)
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{Path(__file__).parents[2]}"}
    program = [sys.executable, "program.py"]
    done = subprocess.run(program, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "T_sync" in done.stdout
    assert [each.name for each in signals("SIGINT", "SIGNOTHING", "SIGTERM")] == ["SIGINT", "SIGTERM"]


LARGE = {"arena": {"width_cm": 3000, "height_cm": 3000}, "robots": [{"count": 20_000, "camera": {"pixels": 400}}]}
TOO_LARGE = 1.4  # an estimate that is off by more than this factor misleads


def test_what_is_available_is_less_than_the_machine_has_and_limited_by_a_limit_on_addresses() -> None:
    assert 0 < machine.available_bytes() < 10**14
    limit = "import resource; resource.setrlimit(resource.RLIMIT_AS, (2 * 10**9,) * 2)"
    code = f"{limit}; from epuck_sim.util.machine import available_bytes; print(available_bytes())"
    assert 10**9 < int(subprocess.check_output([sys.executable, "-c", code])) < 2 * 10**9


def cgroup(folder: Path, names: tuple[str, str, str], *, limit: str, droppable: int) -> None:
    limit_file, usage_file, key = names
    folder.mkdir(parents=True, exist_ok=True)
    (folder / limit_file).write_text(f"{limit}\n")
    (folder / usage_file).write_text("3000\n")
    (folder / "memory.stat").write_text(f"anon 5\n{key} {droppable}\n")


def test_a_control_group_and_those_around_it_limit_what_is_available(tmp_path) -> None:
    first = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
    second = ("memory.max", "memory.current", "inactive_file")
    for names, line, root in ((second, "0::/job/step", ""), (first, "7:memory:/job/step", "memory")):
        cgroup(tmp_path / root / "job", names, limit="5000", droppable=500)
        cgroup(tmp_path / root / "job" / "step", names, limit="max", droppable=500)
        assert list(machine._of_cgroups(tmp_path, f"3:cpu:/other\n{line}\n")) == [2500]
        cgroup(tmp_path / root / "job" / "step", names, limit="4000", droppable=0)
        assert sorted(machine._of_cgroups(tmp_path, line)) == [1000, 2500]


def test_what_needs_more_memory_than_there_is_is_refused_with_both_numbers_also_a_sweep(tmp_path, monkeypatch) -> None:
    little = 70_000_000
    monkeypatch.setattr(machine, "available_bytes", lambda: little)
    assert machine.lack_of_memory(little) is None
    assert machine.lack_of_memory(9 * little) == "needs about 630 MB of memory, and 70 MB are available here"
    scenario = load_scenario(LARGE)
    assert scenario.memory_bytes > little
    with pytest.raises(ScenarioError, match="a trial needs about 160 MB of memory, and 70 MB are available here; give"):
        Simulation(scenario)
    scenario = load_scenario({"overhead": {"width_px": 7680, "height_px": 7680}})
    said = "a film of 7680 x 7680 pixels needs about 6.7 GB of memory, and 70 MB are"
    with pytest.raises(FilmError, match=said), film_trial(tmp_path / "film.mp4", scenario, 0):
        pass
    assert not list(tmp_path.iterdir())
    found = points(load_scenario(LARGE, axes=["robots.0.camera.pixels=1,400"]))
    for module in ("epuck_sim.util.machine", "epuck_sim.sweep.demand"):
        monkeypatch.setattr(f"{module}.available_bytes", lambda: 500_000_000)
    check_memory(found, 3)
    with pytest.raises(ScenarioError, match=r"4 workers needs about 640 MB of memory, and 500 MB .* give --workers 3"):
        check_memory(found, 4)


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="reads the peak of memory as Linux gives it")
def test_a_trial_takes_the_memory_that_is_estimated() -> None:
    """Whether pictures have a pace of their own or not, each in a process that has imported and done nothing else."""
    code = f"""
import os
from pathlib import Path
from epuck_sim.embodied.simulation import Simulation
from epuck_sim.scenario.loader import load_scenario
def most():
    # the peak of this process alone: that of getrusage begins with what it was before
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM"))
    return int(line.split()[1]) * 1024
def take(scenario):
    simulation = Simulation(scenario)
    next(simulation), next(simulation)
    return simulation
for camera in ({{"pixels": 1000}}, {{"pixels": 400, "frames_per_s": 8}}):
    if os.fork():
        os.wait()
        continue
    take(load_scenario({{"robots": [{{"camera": camera}}]}}))
    before = most()
    large = load_scenario({LARGE!r} | {{"robots": [{{"count": 8_000, "camera": camera}}]}})
    kept = take(large)
    print((most() - before) / large.memory_bytes, flush=True)
    os._exit(0)
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout.split()
    assert len(told) == 2
    assert all(1 / TOO_LARGE < float(ratio) < TOO_LARGE for ratio in told)


@pytest.mark.parametrize("address", [HOST, "0.0.0.0"])
def test_a_free_port_can_be_used_until_a_program_has_it_and_none_at_which_browsers_open_no_page(address: str) -> None:
    port = free_port()
    check_port(port)
    with socket.socket() as taken:
        taken.bind((address, port))
        taken.listen()
        with pytest.raises(PortError, match=f"^port {port} cannot be used: Address already in use; give another"):
            check_port(port)
    check_port(port)
    with pytest.raises(PortError, match=r"^port 6000 cannot be used: browsers open no pages there; .* --port$"):
        check_port(6000)
