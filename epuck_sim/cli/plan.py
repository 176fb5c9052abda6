"""The command `plan`: how long a sweep will take, and how many trials show a difference."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, prefix_scenario, reject_first
from epuck_sim.cli.results import OfOption
from epuck_sim.cli.scenarios import AxesOption, QuickOption, SetOption, TrialsOption

if TYPE_CHECKING:  # or --help would wait for numpy
    from epuck_sim.cli.plan_tables import Duration
    from epuck_sim.scenario.points import Point

plans = typer.Typer()

BUDGET_S = 20.0
"""Wall time to time trials for, by default."""

DIFFERENCE_PERCENT = 20.0
"""Difference to be seen, by default."""


@plans.command()
def plan(
    sweep: Annotated[
        str, typer.Argument(metavar="SCENARIO|FOLDER", help="A scenario that is to be run, or a run folder.")
    ],
    difference: Annotated[
        float | None,
        typer.Option(
            metavar="PERCENT", min=0.1, max=10_000, help="Of a run folder: the difference to be seen; 20 by default."
        ),
    ] = None,
    of: OfOption = None,
    power: Annotated[
        float,
        typer.Option(metavar="PERCENT", min=5.0, max=99.9, help="How often it is to be seen, with p < 0.05."),
    ] = 80.0,
    trials: TrialsOption = None,
    settings: SetOption = None,
    axes: AxesOption = None,
    quick: QuickOption = False,
    seconds: Annotated[
        float | None,
        typer.Option(min=0.1, max=3600, help="Seconds to spend on timing trials of a scenario; 20 by default."),
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Worker processes; all cores by default.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Print how long a sweep will take, by timing some of its trials, or how long one will take to go on.

    For a run folder, also print how many trials a point needs to show --difference: of T_sync or a measure in per cent,
    with the spread of the stored trials; of a truth value, whose share of trials is compared, in percentage points.
    """
    with exit_on_error():
        from epuck_sim.cli.plan_tables import print_plan, print_power
        from epuck_sim.runs.folder import DATABASE
        from epuck_sim.sweep.executors import available_cores

        folder = Path(sweep)
        is_folder = (folder / DATABASE).is_file()
        reject_first(
            (is_folder and bool(settings or axes or quick), "--set, --sweep and --quick are for scenarios"),
            (is_folder and seconds is not None, "--seconds is for scenarios; the trials of a run folder are timed"),
            (not is_folder and of is not None, "--of needs trials: give a run folder"),
            (
                not is_folder and difference is not None,
                "--difference needs trials: give a run folder, as `run --trials 20 --out FOLDER` makes it",
            ),
        )
        processes = workers or available_cores()
        if is_folder:
            from epuck_sim.runs.reader import read_points
            from epuck_sim.statistics.planning import plan_trials

            planned = plan_trials(read_points(folder, of=of), (difference or DIFFERENCE_PERCENT) / 100, power / 100)
            duration = _duration_of_folder(folder, trials, processes)
            print_power(sweep, planned, duration, as_json)
        else:
            duration = _duration_of_scenario(sweep, settings, axes, quick, trials, seconds or BUDGET_S, processes)
            print_plan(sweep, duration, as_json)


def _duration_of_folder(folder: Path, trials: int | None, workers: int) -> "Duration":
    from epuck_sim.cli.plan_tables import Duration
    from epuck_sim.runs.share import WHOLE, Share
    from epuck_sim.runs.status import read_status, read_wall_times
    from epuck_sim.scenario.loader import RUN_SCENARIO, load_scenario
    from epuck_sim.statistics.estimate import without_interval

    stored, of_sweep = read_wall_times(folder), read_status(folder).share
    share = Share.parse(of_sweep) if of_sweep else WHOLE
    wanted = trials or load_scenario(folder / RUN_SCENARIO).trials
    times = [time for of_point in stored.values() for time in of_point]
    mean = sum(times) / len(times) if times else 0.0
    left = {number: max(0, len(share.trials(number, wanted)) - len(of_point)) for number, of_point in stored.items()}
    means = {number: sum(of_point) / len(of_point) if of_point else mean for number, of_point in stored.items()}
    seconds = sum(left[number] * means[number] for number in left)
    compute = without_interval(seconds)
    return Duration(len(stored), wanted, sum(left.values()), workers, compute, len(times), is_cut=False)


def _duration_of_scenario(
    sweep: str,
    settings: list[str] | None,
    axes: list[str] | None,
    quick: bool,
    trials: int | None,
    budget_s: float,
    workers: int,
) -> "Duration":
    from epuck_sim.scenario.loader import load_scenario
    from epuck_sim.scenario.points import points
    from epuck_sim.sweep.checks import check_sweep

    loaded = load_scenario(sweep, settings or (), axes or (), quick=quick)
    with prefix_scenario(sweep):
        found = points(loaded)
        check_sweep(found)
        return estimate_duration(found, trials or loaded.trials, budget_s, workers)


def estimate_duration(found: "Sequence[Point]", wanted: int, budget_s: float, workers: int) -> "Duration":
    """Return how long a sweep will take, from some trials that are run now.

    Args:
        found: The points of the sweep.
        wanted: Number of trials at each.
        budget_s: Wall time to time trials for.
        workers: Number of worker processes.

    Raises:
        ScenarioError: A trial fails.
    """
    import numpy as np

    from epuck_sim.cli.plan_tables import Duration
    from epuck_sim.statistics.estimate import Estimate
    from epuck_sim.statistics.mean import estimate_mean
    from epuck_sim.statistics.measured import Measured
    from epuck_sim.sweep.pilot import time_trials

    timed = time_trials(found, budget_s)
    times = np.array([each.wall_s for each in timed])
    count = wanted * len(found)
    estimate = estimate_mean(Measured(times, np.ones(len(times), bool), float("inf"), 0))
    compute = Estimate(*(count * each for each in estimate))
    is_cut = any(each.is_cut for each in timed)
    return Duration(len(found), wanted, count, workers, compute, len(times), is_cut)
