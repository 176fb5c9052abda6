"""Pools of processes and Dask clusters: what workers load, how they end, who is none, and dask-jobqueue's lines."""

import ast
import multiprocessing
import os
import re
import socket
import subprocess
import sys
import time
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from functools import partial
from itertools import chain
from pathlib import Path
from threading import Thread
from types import SimpleNamespace

import pytest

from epuck_sim.errors import ClusterError
from epuck_sim.runs.records import Task
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.sweep import cluster
from epuck_sim.sweep.cluster import DaskCluster, SameVersionsExecutor, SchedulerGoneError
from epuck_sim.sweep.executors import ONE_THREAD, Pool, local_pool
from epuck_sim.sweep.run import run_sweep
from epuck_sim.sweep.scheduler import TaskQueue, schedule
from epuck_sim.sweep.worker import make_outcome, run_chunk
from tests.cli.commands import call
from tests.control.bench import EMPTY
from tests.processes import start, wait_until
from tests.sweep.pool_here import Here, pool_here
from tests.sweep.short_sweeps import begin, short_sweep, stored, table
from tests.sweep.test_scheduler import outcomes_of_length, task

UNNEEDED = {
    *("matplotlib", "rerun", "pandas", "pyarrow", "rich", "typer", "cv2", "distributed"),
    *("scipy.linalg", "scipy.stats", "scipy.optimize"),
}

ASKED_OF_A_WORKER = """
import sys
from epuck_sim.__main__ import main
from epuck_sim.sweep.executors import local_pool
if __name__ == "__main__":
    with local_pool(1) as pool:
        print(pool.executor.submit(eval, "[*__import__('sys').modules]").result())
        print(pool.executor.submit(eval, "dict(__import__('os').environ)").result())
"""


def test_workers_load_what_a_simulation_needs_and_run_one_thread_each(tmp_path) -> None:
    (tmp_path / "ask.py").write_text(ASKED_OF_A_WORKER)
    answer = subprocess.run([sys.executable, tmp_path / "ask.py"], check=True, capture_output=True, text=True)
    modules, environment = map(ast.literal_eval, answer.stdout.splitlines())
    assert {"numba", "pymunk", "epuck_sim.embodied.simulation"} <= set(modules)
    assert not UNNEEDED & set(modules)
    assert {environment[name] for name in ONE_THREAD} == {"1"}


def test_an_error_in_the_block_ends_the_workers_at_once_and_leaves_the_environment_as_it_was() -> None:
    def fail_while_they_sleep() -> None:
        with local_pool(2) as pool:
            pool.executor.submit(time.sleep, 600)
            raise RuntimeError("enough")

    environment, before = dict(os.environ), set(multiprocessing.active_children())
    with pytest.raises(RuntimeError, match="enough"):
        fail_while_they_sleep()
    assert dict(os.environ) == environment
    wait_until(lambda: set(multiprocessing.active_children()) <= before)


def test_a_cluster_without_workers_is_told_of_once_whenever_it_has_none(monkeypatch, capsys) -> None:
    monkeypatch.setattr(cluster, "COUNT_S", -1)
    counts = iter([0, 0, 2, 2, 0, 0])
    slots = cluster._slots(SimpleNamespace(nthreads=lambda: {"worker": next(counts)}), "tcp://here")
    assert [slots() for _ in range(6)] == [2, 2, 4, 4, 2, 2]
    assert capsys.readouterr().err == "--dask tcp://here: the scheduler has no workers; waiting for them\n" * 2


def test_a_scheduler_that_has_answered_is_waited_for_and_one_that_never_has_is_not(monkeypatch, capsys) -> None:
    answers = iter([None, "client", None, None, "another"])

    def connect(_: str) -> str:
        answer = next(answers)
        if answer is None:
            raise ClusterError("nobody")
        return answer

    monkeypatch.setattr(cluster, "_connect", connect)
    monkeypatch.setattr(cluster, "LOOK_S", 0)
    asked = DaskCluster("tcp://here")
    with pytest.raises(ClusterError, match="nobody"):
        asked._connect()
    assert [asked._connect(), asked._connect()] == ["client", "another"]
    said = "--dask tcp://here: the scheduler is gone; waiting until it is started again, with workers\n"
    assert capsys.readouterr().err == said


def greet(server: socket.socket, greeting: bytes) -> None:
    connection, _ = server.accept()
    with connection:
        connection.sendall(greeting)
        while connection.recv(100):  # until the other side has given up
            pass


@pytest.mark.parametrize("greeting", [b"", b"SSH-2.0-OpenSSH_9.6\r\n", b"HTTP/1.1 400 Bad Request\r\n\r\n"])
def test_what_listens_but_is_no_scheduler_is_named(greeting: bytes, monkeypatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    with socket.create_server(("127.0.0.1", 0)) as server:
        Thread(target=greet, args=(server, greeting), daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        refusal = pytest.raises(ClusterError, match=f"--dask {address}: no Dask scheduler answers there")
        with refusal, DaskCluster(address).open():
            pass


@pytest.mark.parametrize("address", ["nonsense", "127.0.0.1", "ftp://x:1", "tcp://127.0.0.1:9"])
def test_where_no_scheduler_is_the_address_is_named_and_nothing_is_left_behind(address, tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    result = call("run", short_sweep(tmp_path), "--out", tmp_path / "run", "--dask", address)
    assert result.exit_code == 2
    assert f"error: --dask {address}: no Dask scheduler answers there" in result.stderr


def test_without_distributed_the_extra_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    refusal = pytest.raises(ClusterError, match=r'pip install "epuck-sim\[cluster\]"')
    with refusal, DaskCluster("tcp://127.0.0.1:9").open():
        pass


DOCS = Path(__file__).parents[2] / "docs" / "clusters.md"

HERE = ("--host", "127.0.0.1", "--no-dashboard")

JOBQUEUE = '''
"""Stands in for dask-jobqueue: its SLURMCluster starts a local process, however many are asked for."""
from distributed import LocalCluster


class SLURMCluster(LocalCluster):
    def __init__(self, cores, processes, memory, walltime):
        assert cores == processes and memory and walltime
        super().__init__(n_workers=0, threads_per_worker=1, dashboard_address=None)

    def scale(self, count):
        assert count == 64
        super().scale(1)
'''


def answer(_: list[Task]) -> str:
    return "done"


def test_a_worker_with_another_version_or_controller_is_refused_in_words(tmp_path, monkeypatch) -> None:
    executor = SameVersionsExecutor(Here())
    assert executor.submit(answer, [task(0)]).result() == "done"
    real = cluster.versions()
    asked = iter([real, {**real, "numba": "0.1", "python": "3.99.0"}])
    monkeypatch.setattr(cluster, "versions", lambda: next(asked))
    message = f"has numba 0.1, python 3.99.0, this command has numba {real['numba']}, python {real['python']}"
    with pytest.raises(ClusterError, match=re.escape(message)):
        executor.submit(answer, [task(0)]).result()
    monkeypatch.undo()
    path = tmp_path / "own.py"
    path.write_text(EMPTY)
    scenario = load_scenario({"robots": [{"controller": str(path)}]})
    given = [Task(0, 0, "", scenario, False)]
    assert executor.submit(answer, given).result() == "done"
    path.write_text(path.read_text().replace("pass", "actuators.ring_on = True"))
    with pytest.raises(ClusterError, match=r"has own\.py with digest \w{12}, this command own\.py with digest \w{12}"):
        executor.submit(answer, given).result()
    path.unlink()
    with pytest.raises(ClusterError, match="cannot run trials: no controller file"):
        executor.submit(answer, given).result()


def test_a_client_that_is_closed_counts_as_a_lost_scheduler() -> None:
    class Closed(Executor):
        def submit(self, *_) -> Future:
            raise OSError("closed")

    with pytest.raises(SchedulerGoneError, match="closed"):
        SameVersionsExecutor(Closed()).submit(answer, [task(0)]).result()


@pytest.mark.parametrize("loss", [CancelledError, SchedulerGoneError])
def test_what_was_under_way_when_all_workers_were_lost_is_run_again_and_blamed_for_nothing(loss) -> None:
    opened, asked = [], []

    class Lost(Executor):
        def submit(self, function, tasks) -> Future:
            future: Future = Future()
            if function is run_chunk:
                asked.append([each.trial for each in tasks])
            if len(opened) < 4 and len(asked) % 3 == 0:
                future.set_exception(loss())
            else:
                future.set_result([make_outcome(each, *outcomes_of_length(0.1, 1)[0][3:5]) for each in tasks])
            return future

    @contextmanager
    def open_pool():
        opened.append(1)
        yield Pool(Lost(), lambda: 4, (), (CancelledError, SchedulerGoneError))

    queue = TaskQueue((task(trial) for trial in range(30)), 30)
    outcomes = [*chain.from_iterable(schedule(queue, [task(0)], open_pool))]
    assert sorted(outcome.trial for outcome in outcomes) == list(range(30))
    assert len(opened) == 4


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


def cluster_process(*arguments: str | Path, folder: Path) -> subprocess.Popen:
    nowhere = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    return start([sys.executable, "-m", "dask", *arguments, *HERE], cwd=folder, **nowhere)


@pytest.mark.slow
def test_a_sweep_outlives_workers_that_come_and_go_and_a_scheduler_that_is_started_again(tmp_path) -> None:
    path, folder, port = short_sweep(tmp_path, 100), tmp_path / "run", str(free_port())
    address = f"tcp://127.0.0.1:{port}"
    worker = partial(cluster_process, "worker", address, "--nthreads", "1", "--no-nanny", folder=tmp_path)
    scheduler = partial(cluster_process, "scheduler", "--port", port, folder=tmp_path)
    first = scheduler()
    wait_until(lambda: is_listening(int(port)))
    run = begin(path, "--out", folder, "--dask", address, folder=tmp_path)
    assert run.stderr is not None
    assert f"--dask {address}: the scheduler has no workers; waiting for them\n" in iter(run.stderr.readline, "")
    one, other = worker(), worker()
    wait_until(lambda: stored(folder) >= 10)
    one.kill()
    before = stored(folder)
    wait_until(lambda: stored(folder) > before)
    assert other.poll() is None
    first.kill()
    other.kill()
    said = f"--dask {address}: the scheduler is gone; waiting until it is started again, with workers\n"
    assert said in iter(run.stderr.readline, "")
    assert stored(folder) < 8 * 100
    scheduler()
    worker()
    _, err = run.communicate(timeout=300)
    assert run.returncode == 0, err
    run_sweep(load_scenario(path), tmp_path / "here", pool_here)
    assert table(folder) == table(tmp_path / "here")


def is_listening(port: int) -> bool:
    with socket.socket() as client:
        return client.connect_ex(("127.0.0.1", port)) == 0


def test_the_lines_for_dask_jobqueue_give_workers_to_a_sweep(tmp_path) -> None:
    """They run with a local cluster that stands in for SLURM."""
    blocks = re.findall(r"```text\n(.*?)```", DOCS.read_text(), re.DOTALL)
    (block,) = (text for text in blocks if "SLURMCluster" in text)
    (tmp_path / "dask_jobqueue.py").write_text(JOBQUEUE)
    (tmp_path / "cluster.py").write_text(f"if __name__ == '__main__':\n{re.sub('^', '    ', block, flags=re.M)}")
    keeper = start([sys.executable, tmp_path / "cluster.py"], cwd=tmp_path, stdin=-1)
    assert keeper.stdout is not None
    address = keeper.stdout.readline().strip()
    assert address.startswith("tcp://"), keeper.stderr and keeper.stderr.read()
    run = begin(short_sweep(tmp_path, 1), "--out", tmp_path / "run", "--dask", address, folder=tmp_path)
    _, err = run.communicate(timeout=300)
    assert run.returncode == 0, err
    assert stored(tmp_path / "run") == 8
    keeper.communicate("\n", timeout=300)
