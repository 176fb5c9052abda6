"""The commands that run and show trials, and tell how far sweeps are: `run`, `replay`, `status`, `merge`, `verify`."""

from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli import options
from epuck_sim.cli.errors import print_traceback, reject_first
from epuck_sim.cli.options import argument, more_output_option, option, output_option, scenario_option, sweeps_option
from epuck_sim.recording import Level

runs = typer.Typer()


@runs.command(cls=options.FoldedCommand)
def run(
    scenario: options.ScenarioArgument,
    settings: options.SetOption = None,
    axes: options.AxesOption = None,
    trials: options.TrialsOption = None,
    seed: Annotated[int | None, scenario_option("N", "Master seed; the scenario's own by default.", min=0)] = None,
    controller: options.ControllerOption = None,
    measures: options.MeasureOption = None,
    quick: options.QuickOption = False,
    out: Annotated[Path | None, output_option("FOLDER", "Run all points and trials into a run folder.")] = None,
    record: Annotated[Path | None, output_option("FILE.rrd", "Record for rerun's viewer, see `replay`.")] = None,
    film: Annotated[Path | None, output_option("FILE.mp4", "Film with the camera above the arena.")] = None,
    live: Annotated[bool, output_option("--live", "Show the trial while it runs.")] = False,
    as_json: options.JsonOption = False,
    trace: Annotated[Path | None, more_output_option("FILE.parquet", "Write a row per robot and step.")] = None,
    memory: Annotated[
        list[str] | None,
        more_output_option(
            "FIELD", "Add a field of the controllers' MEMORY to --trace, --record and --live; repeatable."
        ),
    ] = None,
    relations: Annotated[
        bool, more_output_option("--relations", "Add to --trace whom each robot sees lit, and whom it touches.")
    ] = False,
    level: Annotated[
        Level | None,
        more_output_option(
            "--record-level summary|poses|full", "How much is recorded, or shown live; full by default."
        ),
    ] = None,
    speed: Annotated[
        float | None,
        options.live_option("X", "Speed of --live, relative to real robots; 1 by default.", min=0.01, max=1000),
    ] = None,
    web: options.WebOption = False,
    port: options.PortOption = None,
    interpret: options.InterpretOption = False,
    traceback: Annotated[
        bool,
        options.controllers_option("--traceback", "With --interpret: print the traceback of a controller's error."),
    ] = False,
    workers: options.WorkersOption = None,
    dask: options.DaskOption = None,
    share: Annotated[
        str | None,
        sweeps_option("K/N", "Run only share K of N, into a folder of its own; `merge` puts shares together."),
    ] = None,
    until: Annotated[
        str | None,
        sweeps_option("10%", "Add trials until half of each interval's width is 10 % of T_sync; 3 means 3 cycles."),
    ] = None,
    contrast: Annotated[
        str | None,
        sweeps_option("KEY", "Apply --until to ratios, or differences in cycles, to the axis's first value."),
    ] = None,
    take_over: Annotated[
        bool,
        sweeps_option(
            "--take-over", "Take a run folder over from a process that is gone, on a file system without locks."
        ),
    ] = False,
    trust: options.TrustOption = False,
    point: options.PointOption = None,
    trial: options.TrialOption = None,
    help_all: options.HelpAllOption = False,  # noqa: ARG001
) -> None:
    """Simulate SCENARIO until the swarm is synchronised: some trials, or a sweep.

    Files of several trials are named FILE-0, FILE-1, ... A sweep needs --out FOLDER; as SCENARIO, that folder goes on.
    """
    has_rows = trace is not None or record is not None or live
    is_watched = has_rows or film is not None
    is_one = point is not None or trial is not None
    reject_first(
        (traceback and not interpret, "--traceback is for --interpret: compiled code has none"),
        (traceback and out is not None, "--traceback is for single trials: give --point and --trial, without --out"),
        (level is not None and record is None and not live, "--record-level is for --record and --live"),
        ((speed is not None or web) and not live, "--speed and --web are for --live"),
        (port is not None and not web, "--port is for --web"),
        (trace is None and relations, "--relations is for --trace"),
        (not has_rows and bool(memory), "--memory is for --trace, --record and --live"),
        (None not in (workers, dask), "--workers and --dask exclude each other"),
        (contrast is not None and until is None, "--contrast is for --until"),
        (None not in (until, share), "--until and --share exclude each other: --until needs all trials of a point"),
    )
    outputs = {"--trace": (trace, [".parquet"]), "--film": (film, [".mp4"])}
    options.check_outputs({}, outputs, dict.fromkeys(outputs, ()))  # endings only: paths depend on the number of trials
    from epuck_sim.cli.trials import Watched, chosen_trials, run_trials, sweep_into
    from epuck_sim.runs import folder as run_folder
    from epuck_sim.scenario.loader import find_scenario

    file = find_scenario(scenario)
    folder = out or (file.parent if file.parent == Path(scenario) and not is_one else None)
    is_none = folder is None
    one_again = "give --point and --trial to run one trial again with them"
    reject_first(
        (trial is not None and point is None, "--trial needs --point, of a sweep; for several trials, give --trials"),
        (is_one and (None in (point, trial) or out is not None), "give --point and --trial together, without --out"),
        (is_none and (workers or dask) is not None, "--workers and --dask need a run folder: --out FOLDER"),
        (is_none and until is not None, "--until is for sweeps: give --out FOLDER"),
        (is_none and share is not None, "--share needs a run folder of its own: --out FOLDER"),
        (not is_none and is_watched, f"a sweep keeps no traces, recordings or films; {one_again}"),
    )
    if folder is not None and take_over and (holder := run_folder.take_over(folder)) is not None:
        typer.echo(f"{folder}: taken over from {holder}", err=True)
    port_shown = (port or options.WEB_PORT) if web else None
    fields = tuple(memory or ())
    watched = Watched(trace, record, film, live, level or Level.FULL, fields, relations, speed or 1.0, port_shown)
    with print_traceback() if traceback else nullcontext():
        loaded = options.read_scenario(
            scenario, settings, axes, measures=measures, controller=controller, quick=quick, trusted=trust
        )
        given = {"seed": seed, "trials": trials}
        loaded = loaded.model_copy(update={key: value for key, value in given.items() if value is not None})
        if folder is not None:
            sweep_into(
                scenario, loaded, folder, workers, dask, share, until, contrast, interpret=interpret, as_json=as_json
            )
            return
        chosen, seeds = chosen_trials(scenario, loaded, point, trial)
        run_trials(scenario, chosen, seeds, watched, interpret=interpret, as_json=as_json)


@runs.command()
def replay(
    source: Annotated[Path, argument("RECORDING", "A recording FILE.rrd, or a run folder with --point and --trial.")],
    point: options.PointOption = None,
    trial: options.TrialOption = None,
    record: Annotated[
        Path | None,
        option("FILE.rrd", "Where to record it; by default to FOLDER-point-K-trial-J.rrd in the current folder."),
    ] = None,
    interpret: options.InterpretOption = False,
    trust: options.TrustOption = False,
    web: options.WebOption = False,
    port: options.PortOption = None,
    screenshot: Annotated[Path | None, option("FILE.png", "Draw what the viewer shows; this needs no display.")] = None,
    at: Annotated[
        float | None, option("SECONDS", "Moment that is drawn, in simulated time; the end by default.", min=0)
    ] = None,
) -> None:
    """Open a recording in rerun's viewer. Sweeps keep none: a trial of a run folder is simulated again."""
    again = point is not None and trial is not None
    reject_first(
        (web and screenshot is not None, "--web and --screenshot exclude each other"),
        (port is not None and not web, "--port is for --web"),
        (at is not None and screenshot is None, "--at is for --screenshot"),
        (screenshot is not None and screenshot.suffix != ".png", "--screenshot: a picture's name must end in .png"),
        (not source.exists(), f"{source}: there is no such file or run folder"),
        (source.is_dir() and not again, f"{source}: is a folder; of a run folder, give --point and --trial, from 0"),
        (
            source.is_dir() != again or (point is None) != (trial is None),
            "give --point and --trial together, with a run folder",
        ),
        ((record is not None or interpret) and not again, "--record and --interpret are for a run folder's trial"),
    )
    from epuck_sim.recording.reader import last_moment_s
    from epuck_sim.recording.viewer import NO_DISPLAY, draw_screenshot, has_display, serve, show
    from epuck_sim.util.atomic_write import check_target
    from epuck_sim.util.machine import check_port

    if web:
        check_port(port or options.WEB_PORT)
    if screenshot is not None:
        check_target(screenshot)
    file = source
    if point is not None and trial is not None:
        from epuck_sim.cli.trials import record_again

        file = record or Path(f"{source.resolve().name}-point-{point}-trial-{trial}.rrd")
        record_again(source, point, trial, file, interpret=interpret, trusted=trust)
    end_s = last_moment_s(file)
    if screenshot is not None:
        reject_first(
            (end_s < 0, f"{file}: holds no moment of a trial that could be drawn"),
            (at is not None and at > end_s, f"--at is {at or 0:.9g}; allowed: 0 to {end_s:.9g}, where {file} ends"),
        )
        draw_screenshot(file, end_s if at is None else at, screenshot)
    elif web:
        serve(file, port or options.WEB_PORT, announce)
    elif again and not has_display():
        typer.echo(NO_DISPLAY, err=True)
    else:
        show(file)


def announce(address: str) -> None:
    """Print where a recording is served, and how to end that."""
    typer.echo("open this address in a browser on this machine:", err=True)
    typer.echo(address)
    typer.echo("press Ctrl-C to end", err=True)


@runs.command()
def status(folders: options.FoldersArgument, as_json: options.JsonOption = False) -> None:
    """Show how far the sweep in FOLDER is: trials stored, censored and failed, and the process at work on it.

    For several folders print a line for each, and the sum of those of one sweep, such as its shares; as JSON, a list.
    """
    from epuck_sim.cli.tables import print_status, print_statuses
    from epuck_sim.runs.reader import read_status

    if len(folders) == 1:
        print_status(read_status(folders[0]), as_json)
    else:
        print_statuses({str(folder): read_status(folder) for folder in folders}, as_json)


@runs.command()
def merge(
    folders: options.FoldersArgument,
    out: Annotated[Path, option("WHOLE", "The run folder to make; it must be new or empty.")],
    as_json: options.JsonOption = False,
) -> None:
    """Put shares of a sweep together, finished or not: every trial once, as if one machine had run them all.

    Folders of another scenario, another controller or other versions are refused. `run WHOLE` runs what is missing.
    """
    from epuck_sim.cli.tables import print_status
    from epuck_sim.runs.compatibility import merge_folders
    from epuck_sim.runs.reader import read_status

    merge_folders(folders, out)
    print_status(read_status(out), as_json)


@runs.command()
def verify(folder: options.FolderArgument) -> None:
    """Check whether every file of FOLDER is whole; exit code 1 if one is not. No code in FOLDER is run."""
    from epuck_sim.runs.reader import verify as verdicts

    found = verdicts(folder)
    for each in found:
        typer.echo(f"{each.file}: {each.says}")
    if not all(each.is_whole for each in found):
        raise typer.Exit(1)
