"""What `epuck-sim run` does: some trials at once, one trial of a sweep again, or a sweep into its run folder."""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import NamedTuple

import typer

from epuck_sim.batch import run_sweep
from epuck_sim.database import DATABASE
from epuck_sim.errors import ScenarioError
from epuck_sim.executors import dask_pool, local_pool
from epuck_sim.mistakes import naming
from epuck_sim.provenance import in_text, versions
from epuck_sim.randomness import trial_seed
from epuck_sim.report import Progress, print_json, print_table
from epuck_sim.results import read_status
from epuck_sim.scenario import Scenario
from epuck_sim.simulation import Simulation
from epuck_sim.sweep import points
from epuck_sim.sweep_report import SweepProgress, print_status
from epuck_sim.trace import Trace, trace_paths
from epuck_sim.trial import Onlooker, TrialResult, run_trial


class Output(NamedTuple):
    """What is shown and kept of a trial."""

    as_json: bool
    trace: Path | None
    interpret: bool


def run_some(origin: str, scenario: Scenario, output: Output) -> None:
    """Run the scenario's trials one after the other, and print them."""
    if scenario.sweep is not None:
        raise ScenarioError(
            f"{origin}: holds a sweep of {len(points(scenario))} points; give --out FOLDER to run it, or --point K "
            "--trial J to run one of its trials"
        )
    _run(origin, [(scenario, trial_seed(scenario.seed, trial)) for trial in range(scenario.trials)], output)


def run_one(origin: str, scenario: Scenario, point: int, trial: int, output: Output) -> None:
    """Run one trial of a sweep, with the outcome that it has there."""
    places = points(scenario)
    if point >= len(places):
        raise ScenarioError(f"{origin}: --point is {point}; allowed: 0 to {len(places) - 1}")
    chosen = places[point]
    if trial >= chosen.scenario.trials:
        raise ScenarioError(f"{origin}: --trial is {trial}; allowed: 0 to {chosen.scenario.trials - 1}")
    _run(origin, [(chosen.scenario, chosen.seed(trial))], output)


def _run(origin: str, trials: Sequence[tuple[Scenario, int]], output: Output) -> None:
    traces = None if output.trace is None else trace_paths(output.trace, len(trials))
    results: list[TrialResult] = []
    try:
        with Progress(len(trials)) as progress, naming(origin):
            for trial, (scenario, seed) in enumerate(trials):
                with ExitStack() as stack:
                    onlookers: list[Onlooker] = [progress]
                    if traces is not None:
                        onlookers.append(stack.enter_context(Trace(traces[trial], scenario, seed)))
                    simulation = Simulation(scenario, seed, interpret=output.interpret)
                    progress.begin(trial)
                    results.append(run_trial(simulation, onlookers))
                if output.as_json:
                    print_json(results[-1])
    finally:
        if not output.as_json:
            print_table(results)


def run_into(
    origin: str, scenario: Scenario, folder: Path, workers: int | None, dask: str | None, output: Output
) -> None:
    """Run a sweep into its folder, print how far it is, and end with exit code 1 if trials have failed."""
    _tell_of_other_versions(folder)
    options = {"--workers": workers, "--dask": dask, "--interpret": "" if output.interpret else None}
    told = [f" {name} {value}".rstrip() for name, value in options.items() if value is not None]
    again = f"epuck-sim run {folder}/{''.join(told)}"
    open_pool = partial(local_pool, workers) if dask is None else partial(dask_pool, dask)
    with SweepProgress() as progress, naming(origin):
        try:
            run_sweep(scenario, folder, open_pool, progress, interpret=output.interpret)
        except KeyboardInterrupt:
            tally = progress.tally
            stored = f"{tally.stored} of {tally.trials} trials are stored" if tally else "nothing is lost"
            print(f"stopped; {stored}; go on with: {again}", file=sys.stderr)
            raise typer.Exit(130) from None
    status = read_status(folder)
    print_status(status, output.as_json)
    if status.failed:
        print(f"{len(status.failed)} trials failed; run again to retry them: {again}", file=sys.stderr)
        raise typer.Exit(1)


def _tell_of_other_versions(folder: Path) -> None:
    if not (folder / DATABASE).exists():
        return
    now = in_text(versions())
    for made, count in read_status(folder).versions.items():
        if not made.startswith(f"{now}, "):
            print(f"note: {count} trials were made by {made}; this is {now}: last digits may differ", file=sys.stderr)
