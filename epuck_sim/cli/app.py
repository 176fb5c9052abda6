"""The `epuck-sim` command: parse, call, print."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim import __version__
from epuck_sim.cli.errors import exit_on_error, prefix_scenario, reject_first
from epuck_sim.cli.film import films
from epuck_sim.cli.interrupt import end_on_request
from epuck_sim.cli.replay import WEB_PORT, replays
from epuck_sim.cli.results import results
from epuck_sim.errors import EpuckSimError
from epuck_sim.recording.level import Level

app = typer.Typer(
    help="Simulate swarms of e-puck robots that synchronise like fireflies.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

app.add_typer(replays)
app.add_typer(films)
app.add_typer(results)

ScenarioArgument = Annotated[
    str, typer.Argument(help="A YAML file, a shipped scenario's name (see `list`), or a run folder to go on with.")
]
SetOption = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="Change one value: robots.0.parameters.speed_cm_s=1.0"),
]
AxesOption = Annotated[
    list[str] | None,
    typer.Option("--sweep", metavar="KEY=V1,V2,...", help="Add an axis to the sweep: robots.0.count=5,10,20"),
]
QuickOption = Annotated[bool, typer.Option("--quick", help="Take the scenario's quick version, if it has one.")]


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
    trials: Annotated[
        int | None,
        typer.Option(min=1, max=10_000_000, help="How many, at each point; the scenario's own number by default."),
    ] = None,
    settings: SetOption = None,
    axes: AxesOption = None,
    quick: QuickOption = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print JSON: an object a trial, or of a whole sweep.")
    ] = False,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.parquet", help="Write every robot and step; of several trials to FILE-0, FILE-1, ..."
        ),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE.rrd", help="Record for rerun's viewer; of several trials to FILE-0, FILE-1, ..."),
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mp4", help="Film with the camera above the arena; of several trials to FILE-0, ..."),
    ] = None,
    level: Annotated[
        Level | None, typer.Option("--record-level", help="How much is recorded, or shown live; full by default.")
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the trial in rerun's viewer while it runs.")] = False,
    speed: Annotated[
        float | None, typer.Option(min=0.01, max=1000, help="Of --live: times as fast as real robots; 1 by default.")
    ] = None,
    web: Annotated[bool, typer.Option("--web", help="Of --live: in a browser instead of a window.")] = False,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help=f"Of --web; {WEB_PORT} by default.")] = None,
    interpret: Annotated[bool, typer.Option("--interpret", help="Run controllers as plain Python.")] = False,
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Run all points and trials into this run folder.")
    ] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes; all cores by default.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Run on this Dask scheduler's workers.")] = None,
    status: Annotated[bool, typer.Option("--status", help="Only show what the run folder holds.")] = False,
    point: Annotated[int | None, typer.Option(min=0, help="Run one trial of a sweep: its point, from 0.")] = None,
    trial: Annotated[int | None, typer.Option(min=0, help="And its trial, from 0.")] = None,
) -> None:
    """Simulate SCENARIO until the swarm is synchronised: some trials, or a sweep of thousands into a run folder."""
    with exit_on_error():
        from epuck_sim.scenario.loader import find_scenario, load_scenario

        single = point is not None or trial is not None
        found = find_scenario(scenario)
        folder = out or (found.parent if found.parent == Path(scenario) and not single else None)
        reject_first(
            (
                single and (point is None or trial is None or out is not None),
                "--point and --trial go together, and without --out",
            ),
            (
                folder is None and (workers is not None or dask is not None or status),
                "--workers, --dask and --status need a run folder: --out FOLDER",
            ),
            (
                folder is not None and (trace is not None or record is not None or film is not None or live),
                "a sweep keeps no traces, recordings and films; --point and --trial run one trial again, with them",
            ),
            (
                trace is not None and trace in (record, film),
                f"--trace and {'--record' if trace == record else '--film'} name the same file",
            ),
            (film is not None and film.suffix != ".mp4", f"--film is {film}; allowed: a name that ends in .mp4"),
            (workers is not None and dask is not None, "--workers and --dask exclude each other"),
            (level is not None and record is None and not live, "--record-level is for --record and --live"),
            ((speed is not None or web) and not live, "--speed and --web are for --live"),
            (port is not None and not web, "--port is for --web"),
        )
        if folder is not None and status:
            if any((seed is not None, trials, settings, axes, quick, interpret, workers, dask)):
                raise EpuckSimError("--status shows what is in the run folder; give no other option but --json")
            from epuck_sim.cli.tables import print_status
            from epuck_sim.runs.reader import read_status

            print_status(read_status(folder), as_json)
            return
        from epuck_sim.cli.observers import LiveView, RunOptions
        from epuck_sim.cli.run import run_into, run_one, run_some

        loaded = load_scenario(scenario, settings or (), axes or (), quick=quick)
        given = {"seed": seed, "trials": trials}
        loaded = loaded.model_copy(update={key: value for key, value in given.items() if value is not None})
        showing = LiveView(speed or 1.0, (port or WEB_PORT) if web else None) if live else None
        output = RunOptions(as_json, trace, record, showing, film, level or Level.FULL, interpret)
        if point is not None and trial is not None:
            run_one(scenario, loaded, point, trial, output)
        elif folder is not None:
            run_into(scenario, loaded, folder, workers, dask, output)
        else:
            run_some(scenario, loaded, output)


@app.command()
def check(
    scenario: ScenarioArgument, settings: SetOption = None, axes: AxesOption = None, quick: QuickOption = False
) -> None:
    """Validate SCENARIO, with every point of its sweep, and print it with every default written out."""
    with exit_on_error():
        from epuck_sim.scenario.loader import load_scenario, write_scenario
        from epuck_sim.scenario.points import points
        from epuck_sim.sweep.checks import check_room

        loaded = load_scenario(scenario, settings or (), axes or (), quick=quick)
        with prefix_scenario(scenario):
            check_room(points(loaded))
        sys.stdout.write(write_scenario(loaded))


@app.command("list")
def list_shipped() -> None:
    """List the shipped arenas, sweeps and controllers."""
    with exit_on_error():
        from epuck_sim.cli.listing import describe_controllers, describe_scenarios
        from epuck_sim.util.builtin import ARENAS, SWEEPS

        shipped = {"arenas": describe_scenarios(ARENAS), "sweeps": describe_scenarios(SWEEPS)}
        for heading, entries in {**shipped, "controllers": describe_controllers()}.items():
            typer.echo(heading)
            for name, description in entries.items():
                typer.echo(f"  {name:20} {description}")


def main() -> None:
    """Run the command; a polite request to end, or a terminal that is closed, is as good as Ctrl-C."""
    end_on_request()
    app()
