"""A sweep from its scenario to its run folder: what is missing is run, and stored as it ends."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any

from epuck_sim.runs.records import SweepProgress, Task
from epuck_sim.runs.store import Store
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import Point, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.checks import check_room
from epuck_sim.sweep.executors import OpenPool, local_pool
from epuck_sim.sweep.scheduler import run_tasks
from epuck_sim.trial.model import check_interpretable


def run_sweep(
    scenario: Scenario | str | Path | Mapping[str, Any],
    folder: Path | str,
    open_pool: OpenPool = local_pool,
    observer: Callable[[SweepProgress], None] = lambda _: None,
    *,
    interpret: bool = False,
) -> SweepProgress:
    """Run the trials of a sweep that have no result in the run folder yet, and return how far it is then.

    scenario: a Scenario, or what `load_scenario` takes; open_pool: opens a pool of workers, see `executors`, processes
    on all cores by default; observer: is shown the tally before the first trial and after each.
    Raises ScenarioError where a point cannot be run, StoreError where the folder cannot be used, and ClusterError
    where there are no workers; the trials stored so far stay.
    """
    loaded = load_scenario(scenario)
    if interpret:
        check_interpretable(loaded)
    places = points(loaded)
    check_room(places)
    with Store(Path(folder), loaded, places) as store:
        finished = store.finished()
        total = sum(point.scenario.trials for point in places)
        tally = SweepProgress(total, len(finished), store.censored(), 0, 0)
        observer(tally)
        tasks = missing_tasks(places, finished, interpret)
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
                observer(tally)
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
