"""What `epuck-sim run` does: some trials at once, one trial of a sweep again, or a sweep into its run folder."""

import shlex
from collections.abc import Iterable, Sequence
from contextlib import ExitStack, nullcontext
from functools import partial
from pathlib import Path

import typer

from epuck_sim.cli.errors import prefix_scenario
from epuck_sim.cli.observers import RunOptions, open_observers
from epuck_sim.cli.progress import SweepProgressBar, TrialProgress, print_stderr, word_if_slow
from epuck_sim.cli.status_tables import print_status
from epuck_sim.cli.sweep_size import describe_size
from epuck_sim.cli.tables import print_trial_json, print_trials
from epuck_sim.errors import ScenarioError
from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.status import read_outcome, read_status
from epuck_sim.scenario.loader import RUN_SCENARIO, load_scenario
from epuck_sim.scenario.points import Point, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.checks import check_memory
from epuck_sim.sweep.cluster import DaskCluster
from epuck_sim.sweep.executors import available_cores, local_pool
from epuck_sim.sweep.run import run_sweep
from epuck_sim.trial.model import run_trial, simulate
from epuck_sim.trial.observer import Observer
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.provenance import format_versions, versions
from epuck_sim.util.seeds import trial_seed

LARGE = 1000
"""Population from which on a trial takes long to set up even if everything is compiled."""


def run_some(origin: str, scenario: Scenario, options: RunOptions) -> None:
    """Run the scenario's trials one after the other, and print them."""
    if scenario.sweep is not None:
        raise ScenarioError(
            f"{origin}: holds a sweep of {len(points(scenario))} points; give --out FOLDER to run it, or --point K "
            "--trial J to run one of its trials"
        )
    seeds = (trial_seed(scenario.seed, trial) for trial in range(scenario.trials))
    _run(origin, scenario, seeds, scenario.trials, options)


def run_one(origin: str, scenario: Scenario, point: int, trial: int, options: RunOptions) -> TrialResult:
    """Run one trial of a sweep, with the outcome that it has there, and return that."""
    all_points = points(scenario)
    if point >= len(all_points):
        raise ScenarioError(f"{origin}: --point is {point}; allowed: 0 to {len(all_points) - 1}")
    chosen = all_points[point]
    if trial >= chosen.scenario.trials:
        raise ScenarioError(f"{origin}: --trial is {trial}; allowed: 0 to {chosen.scenario.trials - 1}")
    (result,) = _run(origin, chosen.scenario, [chosen.seed(trial)], 1, options)
    return result


def record_again(folder: Path, point: int, trial: int, options: RunOptions) -> None:
    """Simulate a trial of a run folder again, and say so if its outcome differs from the stored one."""
    stored = read_outcome(folder, point, trial)
    result = run_one(str(folder), load_scenario(folder / RUN_SCENARIO), point, trial, options)
    if stored is not None and stored != (result.cycles, result.censored):
        made = "; ".join(format_versions(row.made_by) for row in read_status(folder).versions)
        print_stderr(
            f"note: this is not the trial that is stored, which lasted {stored[0]} cycles; its controller or the "
            f"versions may have changed: the folder was made by {made}, this is {format_versions(versions())}"
        )


def _run(origin: str, scenario: Scenario, seeds: Iterable[int], trials: int, options: RunOptions) -> list[TrialResult]:
    results: list[TrialResult] = []
    with open_observers(options, scenario, trials) as factories:
        try:
            with TrialProgress(trials, interpret=options.interpret) as progress, prefix_scenario(origin):
                for trial, seed in enumerate(seeds):
                    with ExitStack() as stack:
                        observers = [stack.enter_context(factory(trial, seed)) for factory in factories]
                        results.append(_run_trial(scenario, seed, trial, options, observers, progress))
                        if options.as_json:
                            print_trial_json(results[-1])
        finally:
            if not options.as_json:
                print_trials(results)
    return results


def _run_trial(
    scenario: Scenario,
    seed: int,
    trial: int,
    options: RunOptions,
    observers: Sequence[Observer],
    progress: TrialProgress,
) -> TrialResult:
    """Run one trial; its simulation is gone when this returns, as Ctrl-C may be lost while pymunk frees a space."""
    setting_up = f"setting up a trial with a population of {scenario.population:,}"
    with word_if_slow(setting_up) if scenario.population >= LARGE else nullcontext():
        simulation = simulate(scenario, seed, interpret=options.interpret)
    if options.live is not None:
        from epuck_sim.embodied.changes.controller_files import ControllerFiles  # numba takes a while
        from epuck_sim.embodied.simulation import Simulation

        assert isinstance(simulation, Simulation), "what is shown live has bodies"
        observers = [*observers, ControllerFiles(simulation, print_stderr)]
    progress.begin(trial)
    return run_trial(simulation, observers, progress)


def sweep_into(origin: str, scenario: Scenario, folder: Path, options: RunOptions) -> None:
    """Run a sweep into its folder, print how far it is, and end with exit code 1 if trials have failed."""
    _note_other_versions(folder)
    again = _command_to_go_on(folder, options)
    open_pool = partial(local_pool, options.workers) if options.dask is None else DaskCluster(options.dask).open
    with SweepProgressBar() as bar, prefix_scenario(origin):
        try:
            with word_if_slow(f"checking every point of {scenario.name}") as over:

                def begin(found: Sequence[Point]) -> None:
                    over()
                    _begin_sweep(found, options)

                run_sweep(
                    scenario, folder, open_pool, bar, interpret=options.interpret, share=options.share, begin=begin
                )
        except KeyboardInterrupt:
            progress = bar.progress
            if not (folder / DATABASE).exists():
                print_stderr("stopped before the first trial; nothing was written")
                raise typer.Exit(130) from None
            # the last progress may lack a trial that was just stored
            stored = f"{read_status(folder).stored} of {progress.trials} trials are stored" if progress else ""
            print_stderr(f"stopped; {stored or 'nothing is lost'}; go on with: {again}")
            raise typer.Exit(130) from None
    status = read_status(folder)
    print_status(status, options.as_json)
    if status.failed:
        print_stderr(f"{len(status.failed)} trials failed; run again to retry them: {again}")
        raise typer.Exit(1)


def _begin_sweep(found: Sequence[Point], options: RunOptions) -> None:
    """Say how large a sweep is; raise ScenarioError if its trials need more memory than this machine has."""
    if options.dask is None:
        check_memory(found, options.workers or available_cores())
    print_stderr(f"{found[0].scenario.name}: {describe_size(found)}")


def _command_to_go_on(folder: Path, options: RunOptions) -> str:
    given = {"--workers": options.workers, "--dask": options.dask}
    words = [word for name, value in given.items() if value is not None for word in (name, str(value))]
    return shlex.join(["epuck-sim", "run", f"{folder}/", *words, *["--interpret"] * options.interpret])


def _note_other_versions(folder: Path) -> None:
    if not (folder / DATABASE).exists():
        return
    now = versions()
    for row in read_status(folder).versions:
        if {**row.made_by, **now} != row.made_by:
            made = format_versions(row.made_by)
            print_stderr(
                f"note: {row.trials} trials were made by {made}; this is {format_versions(now)}: last digits may differ"
            )
