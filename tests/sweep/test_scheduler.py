"""Handing out trials: every one gets an outcome, whatever becomes of the workers of pools and of Dask clusters."""

import ast
import math
import multiprocessing
import os
import pickle
import re
import socket
import subprocess
import sys
import threading
import time
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import contextmanager
from functools import partial
from itertools import chain
from pathlib import Path
from threading import Thread
from types import SimpleNamespace
from unittest.mock import Mock

import pytest
from hypothesis import given, settings, strategies as st

from epuck_sim.errors import ClusterError, EpuckSimError, ExtraError
from epuck_sim.runs.store import Outcome
from epuck_sim.scenario.loader import Point, load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep import cluster, scheduler, worker
from epuck_sim.sweep.cluster import DaskCluster, SameVersionsExecutor, SchedulerGoneError
from epuck_sim.sweep.run import run_sweep
from epuck_sim.sweep.scheduler import CHUNK_S, ONE_THREAD, Pool, TaskQueue, local_pool, schedule
from epuck_sim.sweep.worker import Task, make_outcome, run_chunk
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.machine import free_port
from tests.cli.commands import call
from tests.control.bench import EMPTY
from tests.processes import start, wait_until
from tests.sweep.pool_here import Here, pool_here
from tests.sweep.short_sweeps import begin, short_sweep, stored, table

SCENARIO = load_scenario("pair")


def task(trial: int) -> Task:
    return Task(Point(0, "", {}, SCENARIO), trial, False)


def queue(count: int) -> TaskQueue:
    return TaskQueue((task(trial) for trial in range(count)), count)


def outcomes_of_length(wall_s: float, tasks: list[Task]) -> list[Outcome]:
    result = TrialResult("x", 0, 1, False, 1, 1.0, 1, 0.1, wall_s)
    return [make_outcome(each, result, None) for each in tasks]


def test_tasks_are_the_same_on_the_other_side_and_their_scenario_is_pickled_once(monkeypatch) -> None:
    monkeypatch.setattr(worker, "MOST_PACKED", 2)
    monkeypatch.setattr(worker, "_pickled", {})
    pickled = []
    monkeypatch.setattr(Scenario, "__reduce_ex__", lambda self, version: (
        pickled.append(self.name), object.__reduce_ex__(self, version))[1])  # fmt: skip
    scenarios = [SCENARIO.model_copy(update={"name": str(number)}) for number in range(3)]
    found = [Point(number, str(number), {}, scenario) for number, scenario in enumerate(scenarios)]
    for order in ([0, 1, 0, 1, 0], [2, 2], [0]):  # the third makes room for itself, and is the only one that is kept
        sent = [Task(found[number], 3, True) for number in order]
        arrived = pickle.loads(pickle.dumps(sent))
        assert arrived == sent
        assert len({id(each.point) for each in arrived}) == len(set(order))
    assert pickled == ["0", "1", "2", "0"]


def test_tasks_are_taken_in_the_order_of_their_urgency_and_those_that_were_lost_first_and_alone() -> None:
    waiting = queue(6)
    first = waiting.take(3)
    assert ([each.trial for each in first], len(waiting)) == ([0, 1, 2], 3)
    assert (waiting.give_back(first[:2]), len(waiting)) == ([], 5)
    again = [*waiting.take(3), *waiting.take(3)]
    assert sorted(each.trial for each in again) == [0, 1]
    assert [each.trial for each in waiting.take(9)] == [3, 4, 5]
    assert waiting.give_back(again) == again
    assert not waiting
    waiting = queue(3)
    taken = [*waiting.take(2)]
    for trials, urgency in (([10, 11], 2.0), ([20], math.inf), ([30, 31], 5.0), ([40], 2.0)):
        waiting.add([task(trial) for trial in trials], urgency)
    waiting.add(taken[1:], math.inf)
    assert len(waiting) == 8
    order = [each.trial for count in (3, 2, 9) for each in waiting.take(count)]
    assert order == [2, 20, 1, 30, 31, 10, 11, 40]
    assert not waiting


class FakeExecutor:
    """Answers at once; a task in `deadly` breaks it for ever, as a worker's death does."""

    def __init__(self, deadly: set[int], raises: Exception | None = None) -> None:
        self.deadly, self.raises, self.broken = deadly, raises, False

    def submit(self, function, tasks) -> Future:
        if self.broken:
            raise BrokenExecutor("broken before")
        future: Future = Future()
        if function is not run_chunk:
            future.set_result(None)
        elif self.raises is not None:
            future.set_exception(self.raises)
        elif self.deadly & {each.trial for each in tasks}:
            self.broken = True
            future.set_exception(BrokenExecutor("killed"))
        else:
            future.set_result(outcomes_of_length(0.01, tasks))
        return future


def opened(deadly: set[int], slots: int, raises: Exception | None = None, kind=FakeExecutor):
    @contextmanager
    def open_pool():
        yield Pool(kind(deadly, raises), lambda: slots, (BrokenExecutor,))

    return open_pool


@settings(max_examples=30)
@given(st.sets(st.integers(0, 59), max_size=12), st.integers(1, 9), st.integers(0, 60))
def test_every_trial_has_one_outcome_and_only_those_that_kill_their_worker_fail(deadly, slots: int, count: int) -> None:
    found = list(chain.from_iterable(schedule(queue(count), [task(0)], opened(deadly, slots))))
    assert sorted(each.trial for each in found) == list(range(count))
    assert {each.trial for each in found if each.error} == {trial for trial in deadly if trial < count}
    assert all((each.wall_s is None) == (each.error is not None) for each in found)
    told = r"its worker died: .*; run it alone to see why, by --point 0 --trial \d+, or give fewer --workers if memory"
    assert all(re.match(told, each.error) for each in found if each.error)


def test_a_kind_whose_compilation_kills_its_worker_is_compiled_ahead_once() -> None:
    opens = []

    class Dies(FakeExecutor):
        def __init__(self, *given) -> None:
            super().__init__(*given)
            opens.append(self)

        def submit(self, function, tasks) -> Future:
            future = super().submit(function, tasks)
            if function is run_chunk:
                return future
            self.broken, died = True, Future()
            died.set_exception(BrokenExecutor("killed"))
            return died

    found = list(chain.from_iterable(schedule(queue(10), [task(0)], opened(set(), 2, kind=Dies))))
    assert sorted(each.trial for each in found) == list(range(10))
    assert not any(each.error for each in found)
    assert len(opens) == 2


def test_chunks_that_end_together_are_stored_together_and_tasks_are_made_when_they_are_handed_over() -> None:
    sizes = [len(outcomes) for outcomes in schedule(queue(100), [], opened(set(), 8))]
    assert sizes[0] == 8  # of one trial each
    assert sum(sizes) == 100
    made = []

    def tasks():
        for trial in range(10**7):
            made.append(trial)
            yield task(trial)

    chunks = schedule(TaskQueue(tasks(), 10**7), [task(0)], opened(set(), 4))
    outcomes = chain.from_iterable(chunks)
    for count in range(1, 500):
        next(outcomes)
        assert len(made) - count <= 5 * 2 * CHUNK_S / 0.01  # chunks that are under way, of 0.01 s a trial
    chunks.close()


@pytest.mark.parametrize(
    ("raised", "message"),
    [
        (CancelledError(), "the cluster has given up this run"),
        (ModuleNotFoundError("no epuck_sim"), "a worker cannot run trials: ModuleNotFoundError: no epuck_sim"),
    ],
)
def test_a_cluster_that_cannot_run_trials_ends_the_run_and_no_trial_is_blamed(raised, message: str) -> None:
    with pytest.raises(ClusterError, match=message):
        list(schedule(queue(2), [task(0)], opened(set(), 2, raised)))


def test_a_chunk_is_half_a_second_of_work_and_trials_that_failed_do_not_make_it_longer() -> None:
    waiting = queue(100_000)
    waiting.note([make_outcome(task(trial), None, "it raised after minutes") for trial in range(5)])
    assert waiting.chunk(16) == 1
    waiting.note(outcomes_of_length(CHUNK_S, [task(0)]))
    assert waiting.chunk(16) == 1
    for wall_s, size in ((0.01, 50), (0.1, 5), (0.4, 1), (30.0, 1)):
        waiting = queue(100_000)
        waiting.note(outcomes_of_length(wall_s, [task(0)] * 7))
        assert waiting.chunk(4) == pytest.approx(size, abs=1)
    assert CHUNK_S == 0.5


@settings(max_examples=30)
@given(st.integers(1, 10_000), st.integers(2, 64), st.floats(1e-4, 10))
def test_no_chunk_is_so_long_that_others_wait_for_it_at_the_end(waiting: int, slots: int, wall_s: float) -> None:
    tasks = queue(waiting)
    tasks.note(outcomes_of_length(wall_s, [task(0)] * 3))
    size = tasks.chunk(slots)
    assert 1 <= size <= waiting
    assert size == 1 or size <= waiting / (2 * slots) + 1


class CountedLock(threading.Condition):
    taken = 0

    def __enter__(self) -> bool:
        self.taken += 1
        return super().__enter__()

    def acquire(self, *arguments) -> bool:
        self.taken += 1
        return self._lock.acquire(*arguments)


def test_waiting_does_not_lock_futures_that_are_under_way_again_and_again() -> None:
    """An interruption between lock and unlock would leave the pool's thread, and so the process, waiting for ever."""
    pending: list[Future] = []

    class Counted(FakeExecutor):
        def submit(self, function, tasks) -> Future:
            future = super().submit(function, tasks)
            if function is run_chunk and not pending:
                future = Future()
                future._condition = CountedLock()
                pending.append(future)
            return future

    taken = []
    for outcomes in schedule(queue(100), [], opened(set(), 3, kind=Counted)):
        if len(taken) == 9:
            pending[0].set_result([])
        taken.append(len(outcomes) and pending[0]._condition.taken)
    assert taken[1] == taken[8] <= 2


UNNEEDED = {
    *("matplotlib", "rerun", "pandas", "pyarrow", "rich", "typer", "cv2", "distributed"),
    *("scipy.linalg", "scipy.stats", "scipy.optimize"),
}

ASKED_OF_A_WORKER = """
import sys
from epuck_sim.__main__ import main
from epuck_sim.sweep.scheduler import local_pool
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


def _die(_: object) -> None:
    os._exit(1)


def test_workers_that_die_as_they_begin_end_the_run_and_no_trial_is_blamed(tmp_path, monkeypatch) -> None:
    monkeypatch.setattr(scheduler, "_begin", _die)
    with pytest.raises(EpuckSimError, match="workers cannot start: they die as they begin"):
        run_sweep(short_sweep(tmp_path), tmp_path / "run", workers=2)
    monkeypatch.setattr(scheduler, "_uninterrupted", Mock(side_effect=EOFError))  # their server has died
    with pytest.raises(EpuckSimError, match="workers cannot start: they die as they begin"):
        run_sweep(short_sweep(tmp_path), tmp_path / "run", workers=2)
    assert stored(tmp_path / "run") == 0


def test_all_workers_start_before_one_works_and_an_error_in_the_block_ends_them_and_leaves_the_environment() -> None:
    def fail_while_they_sleep() -> None:
        with local_pool(2) as pool:
            assert len({*multiprocessing.active_children()} - before) == 2  # one that dies finds no other half started
            pool.executor.submit(time.sleep, 600)
            raise RuntimeError("enough")

    environment, before = dict(os.environ), set(multiprocessing.active_children())
    with pytest.raises(RuntimeError, match="enough"):
        fail_while_they_sleep()
    assert dict(os.environ) == environment
    wait_until(lambda: set(multiprocessing.active_children()) <= before)


def test_a_cluster_without_workers_is_told_of_and_a_scheduler_that_has_answered_is_waited_for(monkeypatch, capsys):
    monkeypatch.setattr(cluster, "COUNT_S", -1)
    counts = iter([0, 0, 2, 2, 0, 0])
    slots = cluster._slots(SimpleNamespace(nthreads=lambda: {"worker": next(counts)}), "tcp://here")
    assert [slots() for _ in range(6)] == [2, 2, 4, 4, 2, 2]
    assert capsys.readouterr().err == "--dask tcp://here: the scheduler has no workers; waiting for them\n" * 2
    nobody = ClusterError("nobody")
    monkeypatch.setattr(cluster, "_connect", Mock(side_effect=[nobody, "client", nobody, nobody, "another"]))
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
    assert not (tmp_path / "run").exists()


def test_without_distributed_the_extra_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    refusal = pytest.raises(ExtraError, match=r'pip install "epuck-sim\[cluster\]"')
    with refusal, DaskCluster("tcp://127.0.0.1:9").open():
        pass


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


def test_a_worker_with_another_version_or_controller_is_refused_and_a_closed_client_is_a_loss(tmp_path, monkeypatch):
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
    given = [Task(Point(0, "", {}, scenario), 0, False)]
    assert executor.submit(answer, given).result() == "done"
    path.write_text(path.read_text().replace("pass", "actuators.ring_on = True"))
    with pytest.raises(ClusterError, match=r"has own\.py with digest \w{12}, this command own\.py with digest \w{12}"):
        executor.submit(answer, given).result()
    path.unlink()
    with pytest.raises(ClusterError, match="cannot run trials: no controller file"):
        executor.submit(answer, given).result()
    closed = Mock(submit=Mock(side_effect=OSError("closed")))
    with pytest.raises(SchedulerGoneError, match="closed"):
        SameVersionsExecutor(closed).submit(answer, [task(0)]).result()


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
                future.set_result(outcomes_of_length(0.1, tasks))
            return future

    @contextmanager
    def open_pool():
        opened.append(1)
        yield Pool(Lost(), lambda: 4, (), (CancelledError, SchedulerGoneError))

    outcomes = [*chain.from_iterable(schedule(queue(30), [task(0)], open_pool))]
    assert sorted(outcome.trial for outcome in outcomes) == list(range(30))
    assert len(opened) == 4


def cluster_process(*arguments: str | Path, folder: Path) -> subprocess.Popen:
    nowhere = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    here = ("--host", "127.0.0.1", "--no-dashboard")
    return start([sys.executable, "-m", "dask", *arguments, *here], cwd=folder, **nowhere)


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
    docs = (Path(__file__).parents[2] / "docs" / "clusters.md").read_text()
    blocks = re.findall(r"```text\n(.*?)```", docs, re.DOTALL)
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
