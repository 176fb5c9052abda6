"""The command `track`: the flashes in any film of a swarm, and when it was synchronised."""

import math
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.cli.film_options import (
    DECISION,
    FILM,
    ArenaOption,
    CornersOption,
    HeightOption,
    LensOption,
    PeriodOption,
    RobotsOption,
    TagsOption,
    scene_options,
)
from epuck_sim.cli.replay import WEB_PORT

tracking = typer.Typer()

LIVE, OUTPUT = "Live camera", "Output"
"""Further headings of options, in the help."""


@tracking.command()
def track(
    film: Annotated[
        str | None, typer.Argument(metavar="FILM", help="The file of a film, of any format, or its URL.")
    ] = None,
    camera: Annotated[
        int | None,
        typer.Option(
            min=0, help="Track a live camera instead, until the swarm is synchronised or Ctrl-C.", rich_help_panel=FILM
        ),
    ] = None,
    web: Annotated[
        bool,
        typer.Option(
            "--web", help="Show what --camera sees, with rings and histogram, in a browser.", rich_help_panel=LIVE
        ),
    ] = False,
    port: Annotated[
        int | None,
        typer.Option(min=1, max=65535, help=f"Port of --web; {WEB_PORT} by default.", rich_help_panel=LIVE),
    ] = None,
    record: Annotated[
        Path | None,
        typer.Option(metavar="FILE.mp4", help="Write what --camera sees, to track it again.", rich_help_panel=LIVE),
    ] = None,
    start: Annotated[
        float,
        typer.Option(
            "--start-s", min=0, help="Leave out what is before this time on the film's clock.", rich_help_panel=FILM
        ),
    ] = 0.0,
    end: Annotated[
        float | None,
        typer.Option(
            "--end-s", min=0, help="Leave out what is after this time on the film's clock.", rich_help_panel=FILM
        ),
    ] = None,
    fps: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=10_000, help="Frames per second, instead of the film's time stamps.", rich_help_panel=FILM
        ),
    ] = None,
    arena: ArenaOption = None,
    height: HeightOption = None,
    corners: CornersOption = None,
    lens: LensOption = None,
    tags: TagsOption = None,
    period: PeriodOption = None,
    robots: RobotsOption = None,
    threshold: Annotated[
        float | None,
        typer.Option(
            "--threshold-ms",
            min=1,
            max=86_400_000,
            help="Synchrony: standard deviation of the flashes within a period; by default about 130 for 5 s.",
            rich_help_panel=DECISION,
        ),
    ] = None,
    order: Annotated[
        float | None,
        typer.Option(
            "--order-parameter",
            min=0.5,
            max=1,
            help="Derive the threshold from this order parameter, instead of --threshold-ms.",
            rich_help_panel=DECISION,
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.", rich_help_panel=OUTPUT)] = False,
    plot: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.png",
            help="Draw the histogram over time; its table is written beside it as .csv.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    rings: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv", help="Write the position and size of every ring in every frame.", rich_help_panel=OUTPUT
        ),
    ] = None,
    flashes: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv|.parquet",
            help="Write when, how long and where each flash was, and whose it is.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    trace: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.parquet|.csv",
            help="Write a row for each robot and frame, with columns that `run --trace` writes, too.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    pairs: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.csv|.parquet",
            help="Write how often each two robots flash together.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
    annotate: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE.mp4",
            help="Write the film with the rings found and the histogram drawn.",
            rich_help_panel=OUTPUT,
        ),
    ] = None,
) -> None:
    """Count the lit rings in FILM, frame by frame, and report when the swarm was synchronised (thesis 4.3.1)."""
    with exit_on_error():
        reject_first(
            ((film is None) == (camera is None), "give either a film or --camera NUMBER"),
            (threshold is not None and order is not None, "--threshold-ms and --order-parameter exclude each other"),
            (end is not None and end <= start, "--end-s is not after --start-s"),
            (
                camera is not None and any((start, end, fps, tags)),
                "--camera excludes --start-s, --end-s, --fps, --tags",
            ),
            (camera is None and (web or record is not None), "--web and --record are for --camera"),
            (port is not None and not web, "--port is for --web"),
            (
                camera is not None and period is None,
                "--camera needs --period-s, because the period cannot be estimated while the camera films",
            ),
        )
        from epuck_sim.cli.parsing import check_outputs
        from epuck_sim.cli.progress import print_stderr, progress_bar
        from epuck_sim.cli.track_tables import print_track, print_track_json
        from epuck_sim.overhead.live import Watching, track_camera
        from epuck_sim.overhead.robots import find_robots, save_robots
        from epuck_sim.overhead.track import annotate_film, snapshot, track_film
        from epuck_sim.util.ports import check_port

        options = scene_options(arena, height, corners, period, robots, tags)._replace(
            threshold_ms=threshold,
            order_parameter=order,
            start_s=start,
            end_s=math.inf if end is None else end,
            fps=fps,
        )
        tables = {"--flashes": flashes, "--trace": trace, "--pairs": pairs}
        check_outputs(film, plot, rings, tables, {"--annotate": annotate, "--record": record})
        if web:
            check_port(port or WEB_PORT)
        if camera is not None and period is not None:
            watching = Watching(record, rings, annotate, (port or WEB_PORT) if web else None)
            tracked = track_camera(camera, options, watching, progress_bar("tracking"), print_stderr, lens)
        else:
            assert film is not None  # otherwise it was refused above
            tracked = track_film(film, options, rings, progress_bar("tracking"), lens)
        robots_found = None
        if tags is not None or any(tables.values()):
            robots_found = find_robots(tracked)
        objections = tracked.reasons if tracked.confidence == "none" else ()
        for warning in (*objections, *tracked.warnings, *(robots_found.warnings if robots_found else ())):
            print_stderr(f"warning: {warning}")
        (print_track_json if as_json else print_track)(tracked, robots_found)
        if robots_found is not None:
            save_robots(tracked, robots_found, flashes, trace, pairs)
        if annotate is not None and camera is None:
            annotate_film(tracked, annotate, progress_bar("annotating"))
        if plot is not None:
            from epuck_sim.figures.film_tracking import save_track_figure

            save_track_figure(plot, tracked, snapshot(tracked) if camera is None else None)
