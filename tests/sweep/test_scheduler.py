"""Handing out trials: every one gets an outcome, whatever becomes of workers."""

import math
import pickle
import re
import threading
from concurrent.futures import BrokenExecutor, CancelledError, Future
from contextlib import contextmanager
from itertools import chain

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuck_sim.errors import ClusterError
from epuck_sim.runs import records
from epuck_sim.runs.records import Outcome, Task
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.executors import Pool
from epuck_sim.sweep.scheduler import CHUNK_S, ChunkSizer, TaskQueue, schedule
from epuck_sim.sweep.worker import make_outcome, run_chunk
from epuck_sim.trial.result import TrialResult

SCENARIO = load_scenario("pair")


def task(trial: int) -> Task:
    return Task(0, trial, "", SCENARIO, False)


def queue(count: int) -> TaskQueue:
    return TaskQueue((task(trial) for trial in range(count)), count)


def outcomes_of_length(wall_s: float, count: int) -> list[Outcome]:
    result = TrialResult("x", 0, 1, False, 1, 1.0, 1, 0.1, wall_s)
    return [Outcome(0, trial, 0, result, None, {}) for trial in range(count)]


def test_tasks_are_the_same_on_the_other_side_and_their_scenario_is_pickled_once(monkeypatch) -> None:
    monkeypatch.setattr(records, "MOST_PACKED", 2)
    pickled = []
    monkeypatch.setattr(Scenario, "__reduce_ex__", lambda self, version: (
        pickled.append(self.name), object.__reduce_ex__(self, version))[1])  # fmt: skip
    scenarios = [SCENARIO.model_copy(update={"name": str(number)}) for number in range(3)]
    for order in ([0, 1, 0, 1, 0], [2, 2], [0]):  # the third makes room for itself, and is the only one that is kept
        sent = [Task(number, 3, str(number), scenarios[number], True) for number in order]
        arrived = pickle.loads(pickle.dumps(sent))
        assert arrived == sent
        assert len({id(each.scenario) for each in arrived}) == len(set(order))
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
            future.set_result([make_outcome(each, *outcomes_of_length(0.01, 1)[0][3:5]) for each in tasks])
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
    assert all((each.result is None) == (each.error is not None) for each in found)
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


def test_chunks_that_end_while_others_are_stored_are_stored_together() -> None:
    sizes = [len(outcomes) for outcomes in schedule(queue(100), [], opened(set(), 8))]
    assert sizes[0] == 8  # of one trial each
    assert sum(sizes) == 100


def test_tasks_are_made_when_they_are_handed_over_not_before() -> None:
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
    sizer = ChunkSizer()
    sizer.note([Outcome(0, trial, 0, None, "it raised after minutes", {}) for trial in range(5)])
    assert sizer.chunk(100_000, 16) == 1
    sizer.note(outcomes_of_length(CHUNK_S, 1))
    assert sizer.chunk(100_000, 16) == 1
    for wall_s, size in ((0.01, 50), (0.1, 5), (0.4, 1), (30.0, 1)):
        sizer = ChunkSizer()
        sizer.note(outcomes_of_length(wall_s, 7))
        assert sizer.chunk(100_000, 4) == pytest.approx(size, abs=1)
    assert CHUNK_S == 0.5


@settings(max_examples=30)
@given(st.integers(1, 10_000), st.integers(2, 64), st.floats(1e-4, 10))
def test_no_chunk_is_so_long_that_others_wait_for_it_at_the_end(waiting: int, slots: int, wall_s: float) -> None:
    sizer = ChunkSizer()
    sizer.note(outcomes_of_length(wall_s, 3))
    size = sizer.chunk(waiting, slots)
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
