"""The commands that run trials, and tell how far sweeps are: `run`, `status` and `merge`."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, print_traceback, reject_first
from epuck_sim.cli.options import (
    CONTROLLERS,
    LIVE,
    MORE_OUTPUT,
    OUTPUT,
    SCENARIO,
    SWEEPS,
    WEB_PORT,
    AxesOption,
    ControllerOption,
    DaskOption,
    FoldedCommand,
    FolderArgument,
    FoldersArgument,
    HelpAllOption,
    InterpretOption,
    JsonOption,
    MeasureOption,
    PointOption,
    PortOption,
    QuickOption,
    ScenarioArgument,
    SetOption,
    TrialOption,
    TrialsOption,
    TrustOption,
    WebOption,
    WorkersOption,
    read_scenario,
)
from epuck_sim.recording import Level

runs = typer.Typer()


@runs.command(cls=FoldedCommand)
def run(
    scenario: ScenarioArgument,
    settings: SetOption = None,
    axes: AxesOption = None,
    trials: TrialsOption = None,
    seed: Annotated[
        int | None,
        typer.Option(metavar="N", min=0, help="Master seed; the scenario's own by default.", rich_help_panel=SCENARIO),
    ] = None,
    controller: ControllerOption = None,
    measures: MeasureOption = None,
    quick: QuickOption = False,
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Run all points and trials into a run folder.", rich_help_panel=OUTPUT),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE.rrd", help="Record for rerun's viewer, see `replay`.", rich_help_panel=OUTPUT),
    ] = None,
    film: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mp4", help="Film with the camera above the arena.", rich_help_panel=OUTPUT),
    ] = None,
    live: Annotated[bool, typer.Option("--live", help="Show the trial while it runs.", rich_help_panel=OUTPUT)] = False,
    as_json: JsonOption = False,
    trace: Annotated[
        Path | None,
        typer.Option(metavar="FILE.parquet", help="Write every robot and step.", rich_help_panel=MORE_OUTPUT),
    ] = None,
    memory: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FIELD",
            help="Add a field of the controllers' MEMORY to --trace, --record and --live; repeatable.",
            rich_help_panel=MORE_OUTPUT,
        ),
    ] = None,
    relations: Annotated[
        bool,
        typer.Option(
            "--relations",
            help="Add to --trace whom each robot sees lit, and whom it touches.",
            rich_help_panel=MORE_OUTPUT,
        ),
    ] = False,
    level: Annotated[
        Level | None,
        typer.Option(
            "--record-level", help="How much is recorded, or shown live; full by default.", rich_help_panel=MORE_OUTPUT
        ),
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            metavar="X",
            min=0.01,
            max=1000,
            help="Speed of --live, relative to real robots; 1 by default.",
            rich_help_panel=LIVE,
        ),
    ] = None,
    web: WebOption = False,
    port: PortOption = None,
    interpret: InterpretOption = False,
    traceback: Annotated[
        bool,
        typer.Option(
            "--traceback",
            help="Print the traceback of what a controller raises; for --interpret.",
            rich_help_panel=CONTROLLERS,
        ),
    ] = False,
    workers: WorkersOption = None,
    dask: DaskOption = None,
    share: Annotated[
        str | None,
        typer.Option(
            metavar="K/N",
            help="Run only share K of N, into a folder of its own; `merge` puts shares together.",
            rich_help_panel=SWEEPS,
        ),
    ] = None,
    take_over: Annotated[
        bool,
        typer.Option(
            "--take-over",
            help="Take a run folder over from a process that is gone, on a file system without locks.",
            rich_help_panel=SWEEPS,
        ),
    ] = False,
    trust: TrustOption = False,
    point: PointOption = None,
    trial: TrialOption = None,
    help_all: HelpAllOption = False,  # noqa: ARG001
) -> None:
    """Simulate SCENARIO until the swarm is synchronised: some trials, or a sweep.

    Of several trials, files are FILE-0, FILE-1, ... A sweep needs --out FOLDER.
    """
    with exit_on_error(), print_traceback() if traceback else nullcontext():
        has_rows = trace is not None or record is not None or live
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
            (not has_rows and bool(memory), "--memory is for --trace, --record and --live"),
            (workers is not None and dask is not None, "--workers and --dask exclude each other"),
            *(
                (
                    path is not None and path.suffix != ending,
                    f"{option} is {path}; allowed: a name that ends in {ending}",
                )
                for option, path, ending in (("--trace", trace, ".parquet"), ("--film", film, ".mp4"))
            ),
        )
        from epuck_sim.cli.observers import LiveView, Watched
        from epuck_sim.cli.trials import run_trials, seeds_of, sweep_into, trial_of_sweep
        from epuck_sim.scenario.loader import find_scenario

        is_one = point is not None or trial is not None
        file = find_scenario(scenario)
        folder = out or (file.parent if file.parent == Path(scenario) and not is_one else None)
        is_watched = any(each is not None for each in (trace, record, film)) or live
        reject_first(
            (
                is_one and (point is None or trial is None or out is not None),
                "--point and --trial go together, and without --out",
            ),
            (
                folder is None and (workers is not None or dask is not None),
                "--workers and --dask need a run folder: --out FOLDER",
            ),
            (folder is None and share is not None, "--share needs a run folder of its own: --out FOLDER"),
            (
                folder is not None and is_watched,
                "a sweep keeps no traces, recordings and films; --point and --trial run one trial again, with them",
            ),
        )
        if folder is not None and take_over:
            from epuck_sim.runs.folder import take_over as take_over_lease

            if (holder := take_over_lease(folder)) is not None:
                typer.echo(f"{folder}: taken over from {holder}", err=True)
        view = LiveView(speed or 1.0, (port or WEB_PORT) if web else None) if live else None
        watched = Watched(trace, record, film, view, level or Level.FULL, tuple(memory or ()), relations)
        loaded = read_scenario(
            scenario, settings, axes, measures=measures, controller=controller, quick=quick, trusted=trust
        )
        given = {"seed": seed, "trials": trials}
        loaded = loaded.model_copy(update={key: value for key, value in given.items() if value is not None})
        if folder is not None:
            sweep_into(
                scenario,
                loaded,
                folder,
                workers=workers,
                dask=dask,
                share=share,
                interpret=interpret,
                as_json=as_json,
            )
        elif point is not None and trial is not None:
            chosen, seed_of_trial = trial_of_sweep(scenario, loaded, point, trial)
            run_trials(scenario, chosen, [seed_of_trial], watched, interpret=interpret, as_json=as_json)
        else:
            seeds = seeds_of(scenario, loaded)
            run_trials(scenario, loaded, seeds, watched, interpret=interpret, as_json=as_json)


@runs.command()
def status(
    folders: FoldersArgument,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON; of several folders, a list.")] = False,
) -> None:
    """Show how far the sweep in FOLDER is: trials stored, censored and failed, and the process at work on it.

    Of several folders, such as the shares of a sweep, a line each and their sum.
    """
    with exit_on_error():
        from epuck_sim.cli.status_tables import print_status, print_statuses
        from epuck_sim.runs.status import read_status

        if len(folders) == 1:
            print_status(read_status(folders[0]), as_json)
        else:
            print_statuses({str(folder): read_status(folder) for folder in folders}, as_json)


@runs.command()
def merge(
    folders: FoldersArgument,
    out: Annotated[Path, typer.Option(metavar="WHOLE", help="The run folder to make; it must be new or empty.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the status of WHOLE as JSON.")] = False,
) -> None:
    """Put shares of a sweep together, finished or not: every trial once, as if one machine had run them all.

    Folders of another scenario, another controller or other versions are refused. `run WHOLE` runs what is missing.
    """
    with exit_on_error():
        from epuck_sim.cli.status_tables import print_status
        from epuck_sim.runs.share import merge_folders
        from epuck_sim.runs.status import read_status

        merge_folders(folders, out)
        print_status(read_status(out), as_json)


@runs.command()
def verify(folder: FolderArgument) -> None:
    """Look at every file of FOLDER, and say whether it is whole; exit code 1 if one is not. Nothing in it is run."""
    with exit_on_error():
        from epuck_sim.runs.verify import verify as verdicts

        found = verdicts(folder)
        for each in found:
            typer.echo(f"{each.file}: {each.says}")
        if not all(each.is_whole for each in found):
            raise typer.Exit(1)
