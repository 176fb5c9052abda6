"""A sweep from its scenario to its run folder: the trials that are missing are run, and stored as they end."""

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from epuck_sim.runs.records import Outcome, SweepProgress, Task
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import Point, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.checks import check_sweep
from epuck_sim.sweep.executors import OpenPool, local_pool
from epuck_sim.sweep.scheduler import TaskQueue, schedule
from epuck_sim.trial.model import check_interpretable


def run_sweep(
    scenario: Scenario | str | Path | Mapping[str, Any],
    folder: Path | str,
    open_pool: OpenPool = local_pool,
    observer: Callable[[SweepProgress], None] = lambda _: None,
    *,
    interpret: bool = False,
) -> SweepProgress:
    """Run the trials of a sweep that have no result in the run folder yet, or lack measures that were added.

    Args:
        scenario: A Scenario, or what `load_scenario` takes.
        folder: The run folder, which is made if it does not exist.
        open_pool: Opens a pool of workers, see `epuck_sim.sweep.executors`; processes on all cores by default.
        observer: Called with the progress before the first trial and after each.
        interpret: Run controllers as plain Python, with the same outcome.

    Returns:
        How far the sweep is at the end.

    Raises:
        ScenarioError: A point cannot be run.
        StoreError: The folder cannot be used.
        ClusterError: There are no workers; the trials stored so far stay.
    """
    loaded = load_scenario(scenario)
    if interpret:
        check_interpretable(loaded)
    all_points = points(loaded)
    check_sweep(all_points)
    with Store(Path(folder), loaded, all_points) as store:
        finished = store.finished()
        total = sum(point.scenario.trials for point in all_points)
        progress = SweepProgress(total, len(finished), store.censored(), 0, 0)
        observer(progress)
        queue = TaskQueue(missing_tasks(all_points, finished, interpret), total - len(finished))
        with closing(schedule(queue, first_of_each_kind(all_points, finished, interpret), open_pool)) as outcomes:
            for outcome in outcomes:
                is_stored = store.add(outcome)
                progress = progress._replace(
                    stored=progress.stored + is_stored,
                    censored=_censored(progress.censored, outcome),
                    failed=progress.failed + (not is_stored),
                    ended=progress.ended + 1,
                )
                observer(progress)
    return progress


def _censored(before: int | None, outcome: Outcome) -> int | None:
    """Return how many trials are censored with one more; None as long as none has a T_sync."""
    censored = outcome.result and outcome.result.censored
    return before if censored is None else (before or 0) + censored


def missing_tasks(points: Sequence[Point], finished: set[tuple[int, int]], interpret: bool) -> Iterator[Task]:
    """Yield the trials that have no result yet, trial 0 of all points first.

    Points take turns, so that slow ones are spread over all workers and over the whole run.

    Args:
        points: All points of the sweep.
        finished: Numbers of point and trial of the trials that have a result.
        interpret: Run controllers as plain Python.
    """
    for trial in range(max(point.scenario.trials for point in points)):
        for point in points:
            if trial < point.scenario.trials and (point.number, trial) not in finished:
                yield _task(point, trial, interpret)


def first_of_each_kind(points: Sequence[Point], finished: set[tuple[int, int]], interpret: bool) -> list[Task]:
    """Return a missing trial for each kind of scenario that is compiled by itself."""
    stored = Counter(number for number, _ in finished)
    kinds: dict[tuple[str, ...], Task] = {}
    for point in points:
        if point.scenario.compiled not in kinds and stored[point.number] < point.scenario.trials:
            trial = next(trial for trial in range(point.scenario.trials) if (point.number, trial) not in finished)
            kinds[point.scenario.compiled] = _task(point, trial, interpret)
    return list(kinds.values())


def _task(point: Point, trial: int, interpret: bool) -> Task:
    return Task(point.number, trial, point.seed(trial), point.scenario, interpret)
