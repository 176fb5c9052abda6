"""A sweep from its scenario to its run folder: what is missing is run, and stored as it ends."""

from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import NamedTuple

from epuck_sim.dispatch import run_tasks
from epuck_sim.executors import OpenPool
from epuck_sim.scenario import Scenario
from epuck_sim.store import Store
from epuck_sim.sweep import Point, check_room, points
from epuck_sim.worker import Task


class Tally(NamedTuple):
    """How far a sweep is."""

    trials: int
    """All that are to be."""
    stored: int
    """Those that have a result."""
    censored: int
    """Of these, the ones that were not synchronised."""
    failed: int
    """Those that failed in this run."""
    ended: int
    """Those that ended in this run, one way or the other."""


def run_sweep(
    scenario: Scenario,
    folder: Path,
    open_pool: OpenPool,
    onlooker: Callable[[Tally], None] = lambda _: None,
    *,
    interpret: bool = False,
) -> Tally:
    """Run the trials of a sweep that have no result in the run folder yet, and return how far it is then.

    scenario: as `load_scenario` gives it; open_pool: opens a pool of workers, see `executors`; onlooker: is shown the
    tally before the first trial and after each.
    Raises ScenarioError where a point cannot be run, StoreError where the folder cannot be used, and ClusterError
    where there are no workers; the trials stored so far stay.
    """
    places = points(scenario)
    check_room(places)
    with Store(folder, scenario, places) as store:
        finished = store.finished()
        tasks = missing_tasks(places, finished, interpret)
        total = sum(point.scenario.trials for point in places)
        tally = Tally(total, len(finished), store.censored(), 0, 0)
        onlooker(tally)
        with closing(run_tasks(tasks, open_pool)) as outcomes:
            for outcome in outcomes:
                store.add(outcome)
                result = outcome.result
                tally = tally._replace(
                    stored=tally.stored + (result is not None),
                    censored=tally.censored + (result is not None and result.censored),
                    failed=tally.failed + (result is None),
                    ended=tally.ended + 1,
                )
                onlooker(tally)
    return tally


def missing_tasks(points: Sequence[Point], finished: set[tuple[int, int]], interpret: bool) -> list[Task]:
    """Return the trials that have no result yet, trial 0 of all points first.

    Points take turns, so that slow ones are spread over all workers and over the whole run.
    """
    return [
        Task(point.number, trial, point.seed(trial), point.scenario, interpret)
        for trial in range(max(point.scenario.trials for point in points))
        for point in points
        if trial < point.scenario.trials and (point.number, trial) not in finished
    ]
