"""The command `replay`: look at a recording, or at a trial of a sweep, which is simulated again."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.cli.options import (
    WEB_PORT,
    InterpretOption,
    PointOption,
    PortOption,
    TrialOption,
    TrustOption,
    WebOption,
)

replays = typer.Typer()


@replays.command()
def replay(
    source: Annotated[
        Path,
        typer.Argument(metavar="RECORDING", help="A recording FILE.rrd, or a run folder with --point and --trial."),
    ],
    point: PointOption = None,
    trial: TrialOption = None,
    record: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.rrd",
            help="Where to record it; by default to FOLDER-point-K-trial-J.rrd in the current folder.",
        ),
    ] = None,
    interpret: InterpretOption = False,
    trust: TrustOption = False,
    web: WebOption = False,
    port: PortOption = None,
    screenshot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw what the viewer shows; this needs no display.")
    ] = None,
    at: Annotated[
        float | None,
        typer.Option(metavar="SECONDS", min=0, help="Moment that is drawn, in simulated time; the end by default."),
    ] = None,
) -> None:
    """Open a recording in rerun's viewer. Sweeps keep none: a trial of a run folder is simulated again."""
    with exit_on_error():
        again = point is not None and trial is not None
        reject_first(
            (web and screenshot is not None, "--web and --screenshot exclude each other"),
            (port is not None and not web, "--port is for --web"),
            (at is not None and screenshot is None, "--at is for --screenshot"),
            (screenshot is not None and screenshot.suffix != ".png", "--screenshot: a picture's name must end in .png"),
            (not source.exists(), f"{source}: there is no such file or run folder"),
            (
                source.is_dir() != again or (point is None) != (trial is None),
                "--point and --trial go together, and with a run folder",
            ),
            ((record is not None or interpret) and not again, "--record and --interpret are for a run folder's trial"),
        )
        from epuck_sim.recording.reader import last_moment_s
        from epuck_sim.recording.viewer import NO_DISPLAY, draw_screenshot, has_display, serve, show
        from epuck_sim.util.atomic_write import check_target
        from epuck_sim.util.ports import check_port

        if web:
            check_port(port or WEB_PORT)
        if screenshot is not None:
            check_target(screenshot)
        file = source
        if point is not None and trial is not None:
            from epuck_sim.cli.trials import record_again

            file = record or Path(f"{source.resolve().name}-point-{point}-trial-{trial}.rrd")
            record_again(source, point, trial, file, interpret=interpret, trusted=trust)
            typer.echo(file)
        end_s = last_moment_s(file)
        if screenshot is not None:
            reject_first(
                (at is not None and at > end_s, f"--at is {at or 0:.9g}; allowed: 0 to {end_s:.9g}, where {file} ends")
            )
            draw_screenshot(file, end_s if at is None else at, screenshot)
        elif web:
            serve(file, port or WEB_PORT, announce)
        elif again and not has_display():
            typer.echo(NO_DISPLAY, err=True)
        else:
            show(file)


def announce(address: str) -> None:
    """Print where a recording is served, and how to end that."""
    typer.echo("open this address in a browser on this machine:", err=True)
    typer.echo(address)
    typer.echo("press Ctrl-C to end", err=True)
