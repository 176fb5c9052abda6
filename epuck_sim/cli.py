"""The `epuck-sim` command: parse, call, print."""

import errno
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim import __version__
from epuck_sim.errors import EpuckSimError, ScenarioError

app = typer.Typer(
    help="Simulate swarms of e-puck robots that synchronise like fireflies.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

ScenarioArgument = Annotated[str, typer.Argument(help="A YAML file, or the name of a shipped arena (see `list`).")]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value: robots.0.parameters.speed_cm_s=1.0"),
]


@contextmanager
def _readable_errors() -> Iterator[None]:
    """Turn a user's mistake into one message and exit code 2, Ctrl-C into exit code 130."""
    try:
        yield
    except EpuckSimError as error:
        typer.echo(f"error: {error}", err=True)
        raise typer.Exit(2) from error
    except OSError as error:
        if error.errno == errno.EPIPE:  # who reads the output has had enough
            raise
        what = f"{error.filename}" if error.filename else "the output cannot be written"
        typer.echo(f"error: {what}: {error.strerror or error}", err=True)
        raise typer.Exit(2) from error
    except KeyboardInterrupt as interrupt:
        typer.echo("interrupted", err=True)
        raise typer.Exit(130) from interrupt


@contextmanager
def _naming(scenario: str) -> Iterator[None]:
    """Have errors of a scenario that is loaded already name its file, too."""
    try:
        yield
    except ScenarioError as error:
        raise ScenarioError(f"{scenario}: {error}") from error


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"epuck-sim {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Hold what all commands share."""


@app.command()
def run(
    scenario: ScenarioArgument,
    seed: Annotated[int | None, typer.Option(min=0, help="Master seed; the scenario's own by default.")] = None,
    trials: Annotated[int | None, typer.Option(min=1, help="How many; the scenario's own number by default.")] = None,
    settings: SetOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object a trial.")] = False,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.parquet", help="Write every robot and step; of several trials to FILE-0, FILE-1, ..."
        ),
    ] = None,
    interpret: Annotated[bool, typer.Option("--interpret", help="Run controllers as plain Python.")] = False,
) -> None:
    """Simulate SCENARIO until the swarm is synchronised, once or several times."""
    with _readable_errors():
        from epuck_sim.randomness import trial_seed
        from epuck_sim.report import Progress, print_json, print_table
        from epuck_sim.scenario_file import load_scenario
        from epuck_sim.simulation import Simulation
        from epuck_sim.trace import Trace, trace_paths
        from epuck_sim.trial import Onlooker, TrialResult, run_trial

        loaded = load_scenario(scenario, settings or ())
        master = loaded.seed if seed is None else seed
        count = loaded.trials if trials is None else trials
        traces = None if trace is None else trace_paths(trace, count)
        results: list[TrialResult] = []
        try:
            with Progress(count) as progress, _naming(scenario):
                for trial in range(count):
                    own_seed = trial_seed(master, trial)
                    with ExitStack() as stack:
                        onlookers: list[Onlooker] = [progress]
                        if traces is not None:
                            onlookers.append(stack.enter_context(Trace(traces[trial], loaded, own_seed)))
                        simulation = Simulation(loaded, own_seed, interpret=interpret)
                        progress.begin(trial)
                        results.append(run_trial(simulation, onlookers))
                    if as_json:
                        print_json(results[-1])
        finally:
            if not as_json:
                print_table(results)


@app.command()
def check(scenario: ScenarioArgument, settings: SetOption = None) -> None:
    """Validate SCENARIO and print it with every default written out."""
    with _readable_errors():
        import numpy as np

        from epuck_sim.placement import place_robots
        from epuck_sim.scenario_file import load_scenario, write_scenario

        loaded = load_scenario(scenario, settings or ())
        with _naming(scenario):
            place_robots(loaded, np.random.SeedSequence(loaded.seed))
        sys.stdout.write(write_scenario(loaded))


@app.command("list")
def list_shipped() -> None:
    """List the shipped arenas and controllers."""
    with _readable_errors():
        from epuck_sim.shipped import describe_arenas, describe_controllers

        for heading, entries in (("arenas", describe_arenas()), ("controllers", describe_controllers())):
            typer.echo(heading)
            for name, description in entries.items():
                typer.echo(f"  {name:20} {description}")


def main() -> None:
    """Run the command; a polite request to end is as good as Ctrl-C."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    app()
