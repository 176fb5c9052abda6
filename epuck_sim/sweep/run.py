"""Run a sweep from its scenario into its run folder: missing trials are run, and stored as they end."""

import heapq
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from functools import partial
from importlib import import_module
from itertools import compress, repeat, starmap
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from epuck_sim.errors import EpuckSimError
from epuck_sim.runs.compatibility import WHOLE, Share
from epuck_sim.runs.reader import FinishedTrials
from epuck_sim.runs.store import Outcome, Store
from epuck_sim.scenario.loader import Point, load_scenario, points
from epuck_sim.scenario.scenario import ScenarioLike
from epuck_sim.sweep import scheduler
from epuck_sim.sweep.demand import check_sweep
from epuck_sim.sweep.worker import Task, step_limit_s
from epuck_sim.trial.model import check_interpretable

if TYPE_CHECKING:  # it takes scipy
    from epuck_sim.sweep.looks import Looks


class SweepProgress(NamedTuple):
    """How far a sweep is."""

    trials: int  # number of trials in the whole sweep
    stored: int  # number of trials that have a result
    censored: int | None
    """Number of stored trials that were not synchronised; None as long as none of them has a T_sync."""
    failed: int  # number of trials that failed in this run, as trials or for a measure that was added
    ended: int  # number of trials that ended in this run, with a result or with an error
    last: Sequence[Outcome] = ()  # the last of these, which were stored together
    narrow: int | None = None  # number of points whose intervals are narrow enough; None without `until`


def run_sweep(
    scenario: ScenarioLike,
    folder: Path | str,
    workers: int | scheduler.OpenPool | None = None,
    observer: Callable[[SweepProgress], None] = lambda _: None,
    *,
    interpret: bool = False,
    share: Share | None = None,
    until: "Looks | None" = None,
    begin: Callable[[Sequence[Point]], None] = lambda _: None,
) -> SweepProgress:
    """Run the trials of a sweep that have no result in the run folder yet, or lack measures that were added.

    Args:
        scenario: A Scenario, or what `load_scenario` takes.
        folder: The run folder, which is made if it does not exist.
        workers: Number of processes, by default as many as there are cores; or a function that opens a pool of
            workers elsewhere, such as `epuck_sim.sweep.cluster.DaskCluster(address).open`.
        observer: Called with the progress before the first trial, and each time when trials have been stored.
        interpret: Run controllers as plain Python, with the same outcome.
        share: Share of the trials to run; by default the folder's own, which is the whole sweep in a new folder.
        until: Decides at which points trials are added; `trials` of the scenario is the most at a point.
        begin: Called with all points once they are checked, before the folder is opened.

    Returns:
        How far the sweep is at the end.

    Raises:
        EpuckSimError: A point cannot be run, or `until` does not suit the sweep.
        StoreError: The folder cannot be used.
        ClusterError: There are no workers; the trials stored so far stay.
    """
    # a wrong number is refused before there is a folder
    open_pool = workers if callable(workers) else partial(scheduler.local_pool, scheduler.count_workers(workers))
    loaded = load_scenario(scenario)
    if interpret:
        check_interpretable(loaded)
    all_points = points(loaded)
    check_sweep(all_points)
    step_limit_s()  # raises for a wrong limit here, as workers could not report it as well
    if os.environ.get("NUMBA_DISABLE_JIT"):  # otherwise workers alone load numba
        import_module("epuck_sim.util.native")  # raises if numba compiles nothing
    if until is not None:
        until.check(all_points)
        if share not in (None, WHOLE):
            raise EpuckSimError(f"share is {share}; leave it out: until looks at all trials of a point")
        share = WHOLE
    begin(all_points)
    with Store(Path(folder), loaded, all_points, share) as store:
        finished = store.finished()
        counts = [point.scenario.trials for point in all_points]
        if until is not None:
            counts = until.begin(store, all_points, finished)
        wanted = [store.share.trials(number, count) for number, count in enumerate(counts)]
        total = sum(map(len, wanted))
        # if points were added, a share may have trials that now belong to others
        stored = sum(starmap(finished.count, enumerate(wanted)))
        progress = SweepProgress(total, stored, store.censored(), 0, 0, narrow=None if until is None else until.narrow)
        observer(progress)
        queue = scheduler.TaskQueue(missing_tasks(all_points, wanted, finished, interpret), total - stored)
        kinds = first_of_each_kind(all_points, wanted, finished, interpret)
        with closing(scheduler.schedule(queue, kinds, open_pool)) as chunks:
            for outcomes in chunks:
                ends = [outcome.censored for outcome in compress(outcomes, store.add(outcomes))]
                known, trials = [end for end in ends if end is not None], progress.trials
                if until is not None:
                    for point in (outcome.point for outcome in outcomes):
                        if added := until.end_trial(point):
                            tasks = [Task(all_points[number], trial, interpret) for number, trial in added]
                            queue.add(tasks, until.width(point))
                            trials += len(added)
                progress = SweepProgress(
                    trials=trials,
                    stored=progress.stored + len(ends),
                    censored=(progress.censored or 0) + sum(known) if known else progress.censored,
                    failed=progress.failed + len(outcomes) - len(ends),
                    ended=progress.ended + len(outcomes),
                    last=outcomes,
                    narrow=None if until is None else until.narrow,
                )
                observer(progress)
    return progress


def missing_tasks(
    points: Sequence[Point], wanted: Sequence[range], finished: FinishedTrials, interpret: bool
) -> Iterator[Task]:
    """Yield the trials wanted of each point that have no result yet, trial 0 of all points first.

    Points take turns, so that slow ones are spread over all workers and over the whole run.
    """
    missing = (zip(finished.missing(point.number, wanted[place]), repeat(place)) for place, point in enumerate(points))
    for turn, place in heapq.merge(*missing):
        yield Task(points[place], wanted[place][turn], interpret)


def first_of_each_kind(
    points: Sequence[Point], wanted: Sequence[range], finished: FinishedTrials, interpret: bool
) -> list[Task]:
    """Return the first missing trial, of those wanted, for each kind of scenario that is compiled separately."""
    kinds: dict[tuple[str, ...], Task] = {}
    for point, trials in zip(points, wanted, strict=True):
        kind = point.scenario.compiled
        if kind not in kinds and (first := next(finished.missing(point.number, trials), None)) is not None:
            kinds[kind] = Task(point, trials[first], interpret)
    return list(kinds.values())
