"""A pool without processes: what it is given runs at once, in this process, where compiled code is loaded already."""

from collections.abc import Iterator
from concurrent.futures import Executor, Future
from contextlib import contextmanager

from epuck_sim.sweep.scheduler import Pool


class Here(Executor):
    def submit(self, function, /, *arguments, **named) -> Future:
        future: Future = Future()
        try:
            future.set_result(function(*arguments, **named))
        except Exception as error:
            future.set_exception(error)
        return future


@contextmanager
def pool_here(_workers: int | None = None) -> Iterator[Pool]:
    """Yield a pool without processes, where `local_pool` would start some."""
    yield Pool(Here(), lambda: 1, ())
