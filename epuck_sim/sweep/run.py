"""A sweep from its scenario to its run folder: the trials that are missing are run, and stored as they end."""

import heapq
import math
import random
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import closing
from itertools import repeat, starmap
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.runs.reader import FinishedTrials
from epuck_sim.runs.share import Share
from epuck_sim.runs.store import Outcome, Store
from epuck_sim.scenario.axes import check_figure_axes, check_labels
from epuck_sim.scenario.loader import Point, describe_axes, load_scenario, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.scheduler import OpenPool, TaskQueue, local_pool, schedule
from epuck_sim.sweep.worker import Task, TrialTimeoutError
from epuck_sim.trial.model import check_interpretable, check_room, run_trial, simulate
from epuck_sim.trial.result import TrialState
from epuck_sim.util.machine import NEGLIGIBLE_BYTES, available_bytes, in_bytes, lack_of_memory
from epuck_sim.util.messages import counted

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
    last: Outcome | None = None  # the last of these
    narrow: int | None = None  # number of points whose intervals are narrow enough; None if that was not asked for


def run_sweep(
    scenario: Scenario | str | Path | Mapping[str, Any],
    folder: Path | str,
    open_pool: OpenPool = local_pool,
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
        open_pool: Opens a pool of workers, see `epuck_sim.sweep.scheduler`; processes on all cores by default.
        observer: Called with the progress before the first trial and after each.
        interpret: Run controllers as plain Python, with the same outcome.
        share: Share of the trials to run; by default the folder's own, which is the whole sweep in a new folder.
        until: Decides by looks at the points where trials are added; `trials` of the scenario is the most at a point.
        begin: Called with all points once they are checked, before the folder is opened.

    Returns:
        How far the sweep is at the end.

    Raises:
        EpuckSimError: A point cannot be run, or not until an interval is narrow enough.
        StoreError: The folder cannot be used.
        ClusterError: There are no workers; the trials stored so far stay.
    """
    loaded = load_scenario(scenario)
    if interpret:
        check_interpretable(loaded)
    all_points = points(loaded)
    check_sweep(all_points)
    if until is not None:
        until.check(all_points)
    begin(all_points)
    with Store(Path(folder), loaded, all_points, share) as store:
        finished = store.finished()
        ours = store.share
        counts = [point.scenario.trials for point in all_points]
        if until is not None:
            counts = until.begin(store, all_points, finished)
        wanted = [ours.trials(number, count) for number, count in enumerate(counts)]
        total = sum(map(len, wanted))
        # a share that got further points may have trials that now belong to others
        stored = sum(starmap(finished.count, enumerate(wanted)))
        progress = SweepProgress(total, stored, store.censored(), 0, 0, narrow=None if until is None else until.narrow)
        observer(progress)
        queue = TaskQueue(missing_tasks(all_points, wanted, finished, interpret), total - stored)
        kinds = first_of_each_kind(all_points, wanted, finished, interpret)
        with closing(schedule(queue, kinds, open_pool)) as chunks:
            for outcomes in chunks:
                for outcome, is_stored in zip(outcomes, store.add(outcomes), strict=True):
                    if until is not None and (added := until.end_trial(outcome.point)):
                        tasks = [_task(all_points[number], trial, interpret) for number, trial in added]
                        queue.add(tasks, until.width(outcome.point))
                        progress = progress._replace(trials=progress.trials + len(added))
                    progress = progress._replace(
                        narrow=None if until is None else until.narrow,
                        stored=progress.stored + is_stored,
                        censored=_censored(progress.censored, outcome) if is_stored else progress.censored,
                        failed=progress.failed + (not is_stored),
                        ended=progress.ended + 1,
                        last=outcome,
                    )
                    observer(progress)
    return progress


def _censored(before: int | None, outcome: Outcome) -> int | None:
    """Return how many trials are censored with one more; None as long as none has a T_sync."""
    censored = outcome.result and outcome.result.censored
    return before if censored is None else (before or 0) + censored


def missing_tasks(
    points: Sequence[Point], wanted: Sequence[range], finished: FinishedTrials, interpret: bool
) -> Iterator[Task]:
    """Yield the trials wanted of each point that have no result yet, trial 0 of all points first.

    Points take turns, so that slow ones are spread over all workers and over the whole run.
    """
    missing = (zip(finished.missing(point.number, wanted[place]), repeat(place)) for place, point in enumerate(points))
    for turn, place in heapq.merge(*missing):
        yield _task(points[place], wanted[place][turn], interpret)


def first_of_each_kind(
    points: Sequence[Point], wanted: Sequence[range], finished: FinishedTrials, interpret: bool
) -> list[Task]:
    """Return a missing one of the trials wanted for each kind of scenario that is compiled by itself."""
    kinds: dict[tuple[str, ...], Task] = {}
    for point, trials in zip(points, wanted, strict=True):
        if point.scenario.compiled in kinds:
            continue
        first = next(finished.missing(point.number, trials), None)
        if first is not None:
            kinds[point.scenario.compiled] = _task(point, trials[first], interpret)
    return list(kinds.values())


def _task(point: Point, trial: int, interpret: bool) -> Task:
    return Task(point.number, trial, point.key, point.scenario, interpret)


ENOUGH_TIMED = 20
"""Trials that are timed, if there is time, of all points together."""

TRIAL_BYTES = 145
"""Size of a trial in a run folder, without measures; as measured with 10,000 to 1,000,000 trials (docs/speed.md)."""


def check_sweep(points: Sequence[Point]) -> None:
    """Raise ScenarioError for a sweep that cannot be run, or cannot be drawn as its section `figure` says."""
    scenario = points[0].scenario
    try:
        check_figure_axes(scenario.figure, [point.axes for point in points])
        measures = (measure.name for measure in scenario.measures)
        check_labels(scenario.figure.labels, points[0].axes, measures, "figure.labels")
    except EpuckSimError as error:
        raise ScenarioError(f"{scenario.name}: {error}") from error
    for point in points:
        try:
            check_room(point.scenario)
        except ScenarioError as error:
            name = f"{point.scenario.name}: "
            where = f"sweep: point {point.number} ({describe_axes(point.axes)}): " if point.axes else ""
            raise ScenarioError(f"{name}{where}{str(error).removeprefix(name)}") from error


def check_memory(points: Iterable[Point], workers: int) -> None:
    """Raise ScenarioError for a sweep whose trials need more memory on this machine than there is."""
    largest = max(point.scenario.memory_bytes for point in points)
    if lack := lack_of_memory(workers * largest):
        raise ScenarioError(
            f"a trial on each of {workers} workers {lack}; "
            f"{in_bytes(largest)} each: give --workers {max(1, available_bytes() // largest)}, or smaller swarms"
        )


def describe_size(points: Sequence[Point]) -> str:
    """Return how many points and trials a sweep has, how much disk it takes, and how much memory if that is much."""
    count = sum(point.scenario.trials for point in points)
    measures = ", besides its measures" if points[0].scenario.measures else ""
    memory = max(point.scenario.memory_bytes for point in points)
    needed = f"; up to {in_bytes(memory)} of memory for a trial" if memory > NEGLIGIBLE_BYTES else ""
    words = f"{counted(len(points), 'point')}, {counted(count, 'trial')}"
    return f"{words}: about {in_bytes(TRIAL_BYTES * count)} on disk{measures}{needed}"


class TimedTrial(NamedTuple):
    """A trial that was timed."""

    point: int
    wall_s: float
    is_cut: bool  # whether time was up before the trial ended: it takes longer than this
    is_censored: bool = False  # whether it reached its limit without synchrony


def time_trials(points: Sequence[Point], budget_s: float) -> list[TimedTrial]:
    """Time a trial of each point, and more until there are `ENOUGH_TIMED`, for as long as there is time.

    Points come in random order, so that the mean is that of all. Compilation is not counted, nor is what makes a
    simulation, as workers keep theirs. The last trial may be cut.
    """
    order = random.Random(0).sample(range(len(points)), len(points))
    _time_trial(points[order[0]], 0, 0)
    timed: list[TimedTrial] = []
    end = time.perf_counter() + budget_s
    for trial in range(math.ceil(ENOUGH_TIMED / len(points))):
        for place in order:
            left = end - time.perf_counter()
            if left <= 0 or (trial and len(timed) >= ENOUGH_TIMED):
                return timed
            timed.append(_time_trial(points[place], trial, left))
    return timed


def _time_trial(point: Point, trial: int, budget_s: float) -> TimedTrial:
    simulation, begin = simulate(point.scenario, point.seed(trial)), time.perf_counter()

    def look_at_clock(_: TrialState) -> None:
        if time.perf_counter() - begin > budget_s:
            raise TrialTimeoutError

    is_cut = is_censored = False
    try:
        result = run_trial(simulation, progress=look_at_clock)
        is_censored = result.censored is True
    except TrialTimeoutError:
        is_cut = True
    except Exception as error:
        raise ScenarioError(f"point {point.number}: a trial fails: {error!r}") from error
    return TimedTrial(point.number, time.perf_counter() - begin, is_cut, is_censored)
