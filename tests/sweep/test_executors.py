"""Workers: what they load, how they end, and what is said where no cluster of them is."""

import ast
import multiprocessing
import os
import socket
import subprocess
import sys
import time
from threading import Thread
from types import SimpleNamespace

import pytest

from epuck_sim.errors import ClusterError
from epuck_sim.sweep import cluster
from epuck_sim.sweep.cluster import DaskCluster
from epuck_sim.sweep.executors import ONE_THREAD, local_pool
from tests.cli.commands import call
from tests.processes import wait_until
from tests.sweep.short_sweeps import short_sweep

UNNEEDED = {
    "matplotlib",
    "rerun",
    "scipy.linalg",
    "scipy.stats",
    "scipy.optimize",
    "pandas",
    "pyarrow",
    "rich",
    "typer",
    "cv2",
    "distributed",
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
    script = tmp_path / "ask.py"
    script.write_text(ASKED_OF_A_WORKER)
    answer = subprocess.run([sys.executable, script], check=True, capture_output=True, text=True)
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
def test_where_no_scheduler_is_the_address_is_named_and_nothing_is_left_behind(
    address: str, tmp_path, monkeypatch
) -> None:
    monkeypatch.setattr(cluster, "CONNECT_S", 0.5)
    result = call("run", short_sweep(tmp_path), "--out", tmp_path / "run", "--dask", address)
    assert result.exit_code == 2
    assert f"error: --dask {address}: no Dask scheduler answers there" in result.stderr


def test_without_distributed_the_extra_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(ClusterError, match=r'pip install "epuck-sim\[cluster\]"'),
        DaskCluster("tcp://127.0.0.1:9").open(),
    ):
        pass
