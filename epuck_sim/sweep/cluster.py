"""A Dask cluster as a pool of workers: it may lose and gain workers, and its scheduler may be started again."""

import asyncio
import logging
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import CancelledError, Executor, Future
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from epuck_sim.errors import ClusterError, EpuckSimError, extras_named
from epuck_sim.runs.sources import own_files
from epuck_sim.sweep.scheduler import Pool
from epuck_sim.sweep.worker import Task
from epuck_sim.util.provenance import format_versions, host, versions

if TYPE_CHECKING:
    from distributed import Client

CONNECT_S = 6  # time in seconds within which a cluster must answer
LOOK_S = 3.0  # time in seconds between two looks whether a scheduler is back
COUNT_S = 1.0  # shortest time in seconds between two counts of a cluster's workers


class SchedulerGoneError(Exception):
    """Raised when the scheduler no longer answers."""


class DaskCluster:
    """The workers of a Dask scheduler."""

    def __init__(self, address: str) -> None:
        """Use the scheduler at an address, such as tcp://127.0.0.1:8786."""
        self._address = address
        self._has_answered = False

    @contextmanager
    def open(self) -> Iterator[Pool]:
        """Yield a pool of all workers that the cluster has at the time.

        If the scheduler has answered before, and is gone, wait for it.
        """
        with extras_named():
            from distributed import KilledWorker  # noqa: PLC0415 an extra, and slow to import
        log = logging.getLogger("distributed")
        level = log.level
        log.setLevel(logging.CRITICAL + 1)  # our messages say the same
        try:
            client = self._connect()
            with client:
                executor = SameVersionsExecutor(client.get_executor(pure=False))
                losses = CancelledError, SchedulerGoneError
                yield Pool(executor, _slots(client, self._address), (KilledWorker,), losses)
        finally:
            log.setLevel(level)

    def _connect(self) -> "Client":
        has_said = False
        while True:
            try:
                client = _connect(self._address)
            except ClusterError:
                if not self._has_answered:
                    raise
                if not has_said:
                    _say(self._address, "the scheduler is gone; waiting until it is started again, with workers")
                has_said = True
                time.sleep(LOOK_S)
            else:
                self._has_answered = True
                return client


def _connect(address: str) -> "Client":
    from distributed import Client, rpc  # noqa: PLC0415 see `DaskCluster.open`

    async def ask() -> None:
        async with rpc(address) as scheduler:
            await scheduler.identity()

    try:
        # another program may listen there, and keep a client waiting for ever
        asyncio.run(asyncio.wait_for(ask(), CONNECT_S))
        return Client(address, timeout=CONNECT_S, set_as_default=False)
    except Exception as error:  # of any kind, for any program may have answered
        reason = str(error) or f"nothing within {CONNECT_S} s"
        raise ClusterError(f"--dask {address}: no Dask scheduler answers there: {reason}") from error


def _slots(client: "Client", address: str) -> Callable[[], int]:
    """Return a function for the number of chunks in progress, which prints a message when there are no workers."""
    counted_at, threads = -COUNT_S, 1

    def slots() -> int:
        nonlocal counted_at, threads
        if time.monotonic() - counted_at > COUNT_S:
            before = threads
            try:
                threads = sum(client.nthreads().values())
            except Exception as error:  # of any kind: the client was closed when it lost the scheduler
                raise SchedulerGoneError from error
            if before and not threads:
                _say(address, "the scheduler has no workers; waiting for them")
            counted_at = time.monotonic()
        return 2 * max(1, threads)

    return slots


OwnFiles = dict[tuple[str, ...], tuple[str, ...]]  # users' files of scenarios, see `own_files`, by `Scenario.compiled`


class SameVersionsExecutor(Executor):
    """Hands work to workers that refuse it if they are not like this process."""

    def __init__(self, executor: Executor) -> None:
        self._executor = executor
        self._files: OwnFiles = {}

    def submit(self, function: Callable[[Sequence[Task]], Any], tasks: Sequence[Task]) -> Future[Any]:  # type: ignore[override]
        """Have a worker call a function with tasks; its future raises ClusterError if the worker refuses."""
        used = {task.point.scenario.compiled: task.point.scenario for task in tasks}
        for names in used.keys() - self._files.keys():
            self._files[names] = own_files(used[names])
        files = {names: self._files[names] for names in used}
        try:
            return self._executor.submit(call_if_same, versions(), files, function, tasks)
        except Exception as error:  # of any kind: the client was closed when it lost the scheduler
            gone: Future[Any] = Future()
            gone.set_exception(SchedulerGoneError(str(error)))
            return gone


def call_if_same(
    theirs: dict[str, str], files: OwnFiles, function: Callable[[Sequence[Task]], Any], tasks: Sequence[Task]
) -> Any:
    """Call a function with tasks, on a worker; raise ClusterError if its versions or files are not the command's."""
    other = {name: value for name, value in versions().items() if value != theirs.get(name)}
    if other:
        wanted = {name: theirs.get(name, "none") for name in other}
        said = f"a worker on {host()} has {format_versions(other)}, this command has {format_versions(wanted)}"
        raise ClusterError(f"{said}; start workers with the same versions")
    for scenario in {task.point.scenario.compiled: task.point.scenario for task in tasks}.values():
        try:
            found = own_files(scenario)
        except EpuckSimError as error:
            raise ClusterError(f"a worker on {host()} cannot run trials: {error}") from error
        for here, there in zip(found, files[scenario.compiled], strict=True):
            if here != there:
                raise ClusterError(f"a worker on {host()} has {here}, this command {there}; give both the same")
    return function(tasks)


def _say(address: str, what: str) -> None:
    print(f"--dask {address}: {what}", file=sys.stderr, flush=True)
