"""The commands `run` and `status`, and their options."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, print_traceback, print_warnings, reject_first
from epuck_sim.cli.replay import WEB_PORT
from epuck_sim.cli.scenarios import (
    SCENARIO_PANEL,
    AxesOption,
    ControllerOption,
    MeasureOption,
    QuickOption,
    ScenarioArgument,
    SetOption,
    TrialsOption,
)
from epuck_sim.errors import EpuckSimError
from epuck_sim.recording.level import Level

runs = typer.Typer()

OUTPUT, LIVE, CONTROLLERS, SWEEPS = "Output", "Live view", "Controllers", "Sweeps"
"""Headings of groups of options in the help of `run`."""


def _refuse_status(wanted: bool) -> None:
    if wanted:
        with exit_on_error():
            raise EpuckSimError("--status is now a command of its own: epuck-sim status FOLDER")


def _note_durable(given: bool) -> None:
    if given:
        typer.echo("note: --durable is needed no more: what is stored is synced at each commit", err=True)


@runs.command()
def run(
    scenario: ScenarioArgument,
    seed: Annotated[
        int | None,
        typer.Option(min=0, help="Master seed; the scenario's own by default.", rich_help_panel=SCENARIO_PANEL),
    ] = None,
    trials: TrialsOption = None,
    settings: SetOption = None,
    axes: AxesOption = None,
    measures: MeasureOption = None,
    controller: ControllerOption = None,
    quick: QuickOption = False,
    as_json: Annotated[
        bool,
        typer.Option(
            "--json", help="Print JSON: one object for each trial, or one for a whole sweep.", rich_help_panel=OUTPUT
        ),
    ] = False,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.parquet",
            help="Write every robot and step; several trials to FILE-0, FILE-1, ...",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    memory: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD",
            help="Add a field of the controllers' MEMORY to --trace, --record and --live; repeatable.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    relations: Annotated[
        bool,
        typer.Option(
            "--relations", help="Add to --trace whom each robot sees lit, and whom it touches.", rich_help_panel=OUTPUT
        ),
    ] = False,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.rrd",
            help="Record for rerun's viewer; several trials to FILE-0, FILE-1, ...",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mp4",
            help="Film with the camera above the arena; several trials to FILE-0, ...",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    level: Annotated[
        Level | None,
        typer.Option(
            "--record-level", help="How much is recorded, or shown live; full by default.", rich_help_panel=OUTPUT
        ),
    ] = None,
    live: Annotated[
        bool, typer.Option("--live", help="Show the trial in rerun's viewer while it runs.", rich_help_panel=LIVE)
    ] = False,
    speed: Annotated[
        float | None,
        typer.Option(
            min=0.01, max=1000, help="Speed of --live, relative to real robots; 1 by default.", rich_help_panel=LIVE
        ),
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Show --live in a browser instead of a window.", rich_help_panel=LIVE)
    ] = False,
    port: Annotated[
        int | None, typer.Option(min=1, max=65535, help=f"Port of --web; {WEB_PORT} by default.", rich_help_panel=LIVE)
    ] = None,
    interpret: Annotated[
        bool, typer.Option("--interpret", help="Run controllers as plain Python.", rich_help_panel=CONTROLLERS)
    ] = False,
    traceback: Annotated[
        bool,
        typer.Option(
            "--traceback",
            help="Print the traceback of what a controller raises; for --interpret.",
            rich_help_panel=CONTROLLERS,
        ),
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Run all points and trials into this run folder.", rich_help_panel=SWEEPS),
    ] = None,
    share: Annotated[
        str | None,
        typer.Option(
            metavar="K/N",
            help="Run only share K of N, into a folder of its own; `merge` puts shares together.",
            rich_help_panel=SWEEPS,
        ),
    ] = None,
    workers: Annotated[
        int | None, typer.Option(min=1, help="Worker processes; all cores by default.", rich_help_panel=SWEEPS)
    ] = None,
    dask: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="Run on this Dask scheduler's workers.", rich_help_panel=SWEEPS),
    ] = None,
    point: Annotated[
        int | None, typer.Option(min=0, help="Run one trial of a sweep: its point, from 0.", rich_help_panel=SWEEPS)
    ] = None,
    trial: Annotated[
        int | None, typer.Option(min=0, help="Run one trial of a sweep: its number, from 0.", rich_help_panel=SWEEPS)
    ] = None,
    status: Annotated[bool, typer.Option("--status", hidden=True, callback=_refuse_status)] = False,  # noqa: ARG001
    durable: Annotated[bool, typer.Option("--durable", hidden=True, callback=_note_durable)] = False,  # noqa: ARG001
) -> None:
    """Simulate SCENARIO until the swarm is synchronised: some trials, or a sweep of thousands into a run folder."""
    with exit_on_error(), print_traceback() if traceback else nullcontext():
        reject_first(
            (traceback and not interpret, "--traceback is for --interpret: compiled code has none"),
            (
                traceback and out is not None,
                "--traceback is for single trials: give --point and --trial, without --out",
            ),
            (level is not None and record is None and not live, "--record-level is for --record and --live"),
            ((speed is not None or web) and not live, "--speed and --web are for --live"),
            (port is not None and not web, "--port is for --web"),
            (trace is None and relations, "--relations is for --trace"),
            (
                trace is None and record is None and not live and bool(memory),
                "--memory is for --trace, --record and --live",
            ),
        )
        from epuck_sim.cli.conflicts import find_conflicts
        from epuck_sim.cli.observers import LiveView, RunOptions
        from epuck_sim.cli.progress import word_if_slow
        from epuck_sim.cli.trials import run_one, run_some, sweep_into
        from epuck_sim.runs.share import Share
        from epuck_sim.scenario.loader import find_scenario, load_scenario

        view = LiveView(speed or 1.0, (port or WEB_PORT) if web else None) if live else None
        options = RunOptions(as_json, trace, record, view, film, level or Level.FULL, interpret, workers, dask)
        options = options._replace(
            memory=tuple(memory or ()),
            relations=relations,
            share=Share.parse(share) if share else None,
        )
        one = point is not None or trial is not None
        file = find_scenario(scenario)
        folder = out or (file.parent if file.parent == Path(scenario) and not one else None)
        reject_first(
            (
                one and (point is None or trial is None or out is not None),
                "--point and --trial go together, and without --out",
            ),
            *find_conflicts(options, folder),
        )
        with word_if_slow(f"reading {scenario}"), print_warnings():
            loaded = load_scenario(
                scenario, settings or (), axes or (), measures=measures or (), controller=controller, quick=quick
            )
        given = {"seed": seed, "trials": trials}
        loaded = loaded.model_copy(update={key: value for key, value in given.items() if value is not None})
        if point is not None and trial is not None:
            run_one(scenario, loaded, point, trial, options)
        elif folder is not None:
            sweep_into(scenario, loaded, folder, options)
        else:
            run_some(scenario, loaded, options)
