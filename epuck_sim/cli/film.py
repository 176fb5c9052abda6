"""The commands of the camera above the arena: `film` a recorded trial, `track` the flashes in any film."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first

films = typer.Typer()


@films.command()
def film(
    recording: Annotated[
        Path, typer.Argument(metavar="RECORDING", help="FILE.rrd of a trial, made by `run --record`.")
    ],
    to: Annotated[Path, typer.Argument(metavar="FILE.mp4", help="The film: H.264, which any browser plays.")],
    overrides: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change the camera: overhead.light=lit"),
    ] = None,
) -> None:
    """Film a recorded trial with the webcam above the arena: lit rings in the dark, or everything in a lit room."""
    with exit_on_error():
        from epuck_sim.cli.progress import progress_bar
        from epuck_sim.overhead.render.film_trial import film_recording

        film_recording(recording, overrides or (), to, progress_bar("filming"))


@films.command()
def track(
    film: Annotated[
        str | None, typer.Argument(metavar="FILM", help="The file of a film, of any format, or its URL.")
    ] = None,
    camera: Annotated[
        int | None, typer.Option(min=0, help="Track a live camera instead, until the swarm is synchronised or Ctrl-C.")
    ] = None,
    arena: Annotated[
        str | None,
        typer.Option(
            "--arena-cm",
            metavar="SIDE|WIDTHxHEIGHT",
            help="Size of the floor; by default as the film describes it, or 60.",
        ),
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(
            "--period-s",
            min=0.1,
            max=86_400,
            help="Period of the oscillators; by default as the film describes it, or estimated.",
        ),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold-ms",
            min=1,
            max=86_400_000,
            help="Synchrony: standard deviation of the flashes within a period; by default about 130 for 5 s.",
        ),
    ] = None,
    order: Annotated[
        float | None,
        typer.Option(
            "--order-parameter",
            min=0.5,
            max=1,
            help="Derive the threshold from this order parameter, instead of --threshold-ms.",
        ),
    ] = None,
    robots: Annotated[
        int | None, typer.Option(min=1, help="Number of robots; track warns if it sees more or fewer.")
    ] = None,
    corners: Annotated[
        str | None,
        typer.Option(
            metavar="X,Y,X,Y,X,Y,X,Y", help="The floor's four corners, in any order, in pixels from the upper left."
        ),
    ] = None,
    height: Annotated[
        float | None,
        typer.Option(
            "--height-cm",
            min=10,
            max=100_000,
            help="Height of the camera above the floor; by default 110 for a side of 60.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    plot: Annotated[
        Path | None,
        typer.Option(metavar="FILE.png", help="Draw the histogram over time; its table is written beside it as .csv."),
    ] = None,
    rings: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write the position and size of every ring in every frame.")
    ] = None,
    annotate: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mp4", help="Write the film with the rings found and the histogram drawn."),
    ] = None,
) -> None:
    """Count the lit rings in FILM, frame by frame, and report when the swarm was synchronised (thesis 4.3.1)."""
    with exit_on_error():
        reject_first(
            ((film is None) == (camera is None), "give either a film or --camera NUMBER"),
            (threshold is not None and order is not None, "--threshold-ms and --order-parameter exclude each other"),
            (
                camera is not None and period is None,
                "--camera needs --period-s, because the period cannot be estimated while the camera films",
            ),
        )
        from epuck_sim.cli.parsing import check_outputs, parse_arena, parse_corners
        from epuck_sim.cli.progress import print_stderr, progress_bar
        from epuck_sim.cli.track_tables import print_track, print_track_json
        from epuck_sim.overhead.track.film_calibration import TrackOptions
        from epuck_sim.overhead.track.track_film import annotate_film, snapshot, track_camera, track_film

        options = TrackOptions(
            arena_cm=None if arena is None else parse_arena(arena),
            height_cm=height,
            corners_px=None if corners is None else parse_corners(corners),
            period_s=period,
            robots=robots,
            threshold_ms=threshold,
            order_parameter=order,
        )
        check_outputs(film, plot, rings, annotate)
        if camera is not None and period is not None:
            tracked = track_camera(camera, options, period, rings, annotate, progress_bar("tracking"))
        else:
            assert film is not None  # otherwise it was refused above
            tracked = track_film(film, options, rings, progress_bar("tracking"))
        for warning in tracked.warnings:
            print_stderr(f"warning: {warning}")
        (print_track_json if as_json else print_track)(tracked)
        if annotate is not None and camera is None:
            annotate_film(tracked, annotate, progress_bar("annotating"))
        if plot is not None:
            from epuck_sim.figures.film_tracking import save_track_figure

            save_track_figure(plot, tracked, snapshot(tracked) if camera is None else None)
