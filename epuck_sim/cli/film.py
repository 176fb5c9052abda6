"""The commands of the camera above the arena: `film` a recorded trial, `track` the flashes in any film."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first

films = typer.Typer()


@films.command()
def film(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="A trial's FILE.rrd, of `run --record`.")],
    to: Annotated[Path, typer.Argument(metavar="FILE.mp4", help="The film: H.264, which any browser plays.")],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Change the camera: overhead.light=lit"),
    ] = None,
) -> None:
    """Film a recorded trial as the webcam above the arena saw it: lit rings in the dark, or all in the light."""
    with exit_on_error():
        from epuck_sim.cli.progress import progress_bar
        from epuck_sim.overhead.render.film_trial import film_recording

        film_recording(recording, settings or (), to, progress_bar("filming"))


@films.command()
def track(
    film: Annotated[str | None, typer.Argument(metavar="FILM", help="A film's file, of any kind, or its URL.")] = None,
    camera: Annotated[
        int | None, typer.Option(min=0, help="Instead of a film, a camera: until the swarm is synchronised, or Ctrl-C.")
    ] = None,
    arena: Annotated[
        str | None,
        typer.Option(
            "--arena-cm", metavar="SIDE|WIDTHxHEIGHT", help="Of the floor; by default what the film says, or 60."
        ),
    ] = None,
    period: Annotated[
        float | None,
        typer.Option(
            "--period-s", min=0.1, max=86_400, help="Of the oscillators; by default what the film says, or estimated."
        ),
    ] = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold-ms",
            min=1,
            max=86_400_000,
            help="Standard deviation of the flashes in a period that is synchrony; about 130 of 5 s by default.",
        ),
    ] = None,
    order: Annotated[
        float | None,
        typer.Option(
            "--order-parameter",
            min=0.5,
            max=1,
            help="Instead of --threshold-ms: that of flashes with this order parameter.",
        ),
    ] = None,
    robots: Annotated[
        int | None, typer.Option(min=1, help="How many there are; you are told if more or fewer are seen.")
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
            "--height-cm", min=10, max=100_000, help="Of the camera above the floor; 110 for a side of 60 by default."
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE.png", help="Draw the histogram over time; its numbers beside it, .csv.")
    ] = None,
    rings: Annotated[
        Path | None, typer.Option(metavar="FILE.csv", help="Write every ring in every frame: where, and how large.")
    ] = None,
    annotate: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mp4", help="Write the film with the rings found and the histogram."),
    ] = None,
) -> None:
    """Count lit rings in FILM, frame by frame, and tell when the swarm was synchronised (thesis 4.3.1)."""
    with exit_on_error():
        reject_first(
            ((film is None) == (camera is None), "give either a film or --camera NUMBER"),
            (threshold is not None and order is not None, "--threshold-ms and --order-parameter exclude each other"),
            (
                camera is not None and period is None,
                "--camera needs --period-s: while it runs, the film that would tell the period is not there yet",
            ),
        )
        from epuck_sim.cli.parsing import check_outputs, parse_arena, parse_corners
        from epuck_sim.cli.progress import print_stderr, progress_bar
        from epuck_sim.cli.track_tables import print_track, print_track_json
        from epuck_sim.overhead.track.result import Known
        from epuck_sim.overhead.track.track_film import annotate_film, snapshot, track_camera, track_film

        known = Known(
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
            found = track_camera(camera, known, period, rings, annotate, progress_bar("tracking"))
        else:
            assert film is not None  # or it was refused
            found = track_film(film, known, rings, progress_bar("tracking"))
        for warning in found.warnings:
            print_stderr(f"warning: {warning}")
        (print_track_json if as_json else print_track)(found)
        if annotate is not None and camera is None:
            annotate_film(found, annotate, progress_bar("annotating"))
        if plot is not None:
            from epuck_sim.figures.film_tracking import save_track_figure

            save_track_figure(plot, found.history(), snapshot(found) if camera is None else None)
