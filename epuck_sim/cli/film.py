"""The commands of the camera above the arena: `film` a recorded trial, `calibrate` a lens."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error

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
    lens: Annotated[
        Path | None, typer.Option(metavar="FILE.json", help="Film through this lens, written by `calibrate`.")
    ] = None,
) -> None:
    """Film a recorded trial with the webcam above the arena: lit rings in the dark, or everything in a lit room."""
    with exit_on_error():
        from epuck_sim.cli.progress import progress_bar
        from epuck_sim.overhead.filming import film_recording

        film_recording(recording, overrides or (), to, progress_bar("filming"), lens)


@films.command()
def calibrate(
    film: Annotated[str, typer.Argument(metavar="FILM", help="A film or numbered pictures of a board that is moved.")],
    to: Annotated[Path, typer.Argument(metavar="FILE.json", help="The lens, for `track --lens` and `film --lens`.")],
    board: Annotated[
        str, typer.Option(metavar="COLUMNSxROWS", help="Number of squares across and down the board.")
    ] = "9x6",
    charuco: Annotated[
        bool, typer.Option("--charuco", help="A ChArUco board (dictionary 5X5_100) instead of a checkerboard.")
    ] = False,
    fisheye: Annotated[bool, typer.Option("--fisheye", help="A fisheye lens, wider than about 120 degrees.")] = False,
) -> None:
    """Calibrate the lens of a camera from a film of a checkerboard or ChArUco board."""
    with exit_on_error():
        from epuck_sim.cli.parsing import parse_board
        from epuck_sim.cli.progress import progress_bar
        from epuck_sim.overhead.film import open_film
        from epuck_sim.overhead.lens import (
            APART_S,
            Board,
            calibrate_lens,
            check_lens_target,
            find_views,
            save_lens,
        )

        squares = Board("charuco" if charuco else "checkerboard", *parse_board(board))
        check_lens_target(to)
        with open_film(film) as reader:
            frames = progress_bar("calibrating")(reader.frames(), reader.duration_s)
            views = find_views(frames, squares, 0.0 if reader.is_pictures else APART_S)
            lens = calibrate_lens(film, views, (reader.width_px, reader.height_px), fisheye)
        save_lens(to, lens)
        typer.echo(f"{to}: focal length {lens.focal_px:.1f} px, from {lens.views} views, error {lens.error_px:.2f} px")
