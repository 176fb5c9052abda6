"""The command `plot`: figures of run folders and of recorded trials."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer

from epuck_sim.cli.errors import exit_on_error
from epuck_sim.errors import EpuckSimError
from epuck_sim.statistics.names import Statistic

plots = typer.Typer()

STATISTIC = typer.Option(
    "--statistic",
    help="What stands for the trials of a point: their mean (restricted to the limit of cycles where trials are "
    "censored), by default; their median; or the mean of the nearest Weibull distribution (Appendix A).",
)


class Form(StrEnum):
    """A way to draw a sweep."""

    CURVES = "curves"
    MAP = "map"
    VIOLINS = "violins"
    SERIES = "series"
    PERTURBATION = "perturbation"
    COURSE = "course"


@plots.command()
def plot(
    results: Annotated[
        Path, typer.Argument(metavar="FOLDER|FILE.rrd", help="A run folder, or the recording of a trial.")
    ],
    to: Annotated[
        Path | None,
        typer.Option(
            metavar="STEM|FILE",
            help="Write STEM.png, STEM.svg and so on, or one picture, FILE.png, FILE.svg or FILE.pdf, with its numbers "
            "as CSV beside it. By default STEM is FOLDER/T_sync, FOLDER/NAME_OF_MEASURE, FOLDER/FORM, or the "
            "recording's name.",
        ),
    ] = None,
    form: Annotated[
        Form | None, typer.Option(help="How to draw a sweep; by default as the scenario says, or else curves.")
    ] = None,
    x: Annotated[
        str | None, typer.Option(metavar="KEY", help="Horizontal axis of a sweep's figure; by default the speed.")
    ] = None,
    y: Annotated[str | None, typer.Option(metavar="KEY", help="Vertical axis of a map.")] = None,
    panels: Annotated[
        str | None, typer.Option(metavar="KEY", help="Axis of curves that has a panel for each of its values.")
    ] = None,
    censored_at: Annotated[
        int | None,
        typer.Option(metavar="CYCLES", min=1, help="For violins: estimate the mean as if trials were censored there."),
    ] = None,
    statistic: Annotated[Statistic | None, STATISTIC] = None,
    of: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Draw a measure of the folder's trials instead of T_sync; one that is a series against the cycles.",
        ),
    ] = None,
    width_cm: Annotated[
        float | None,
        typer.Option(
            metavar="CM",
            min=5,
            max=100,
            help="Width of a sweep's figure: 8.5 cm, that of a column, or 17.5 cm, that of a page, for several panels.",
        ),
    ] = None,
) -> None:
    """Draw T_sync or a measure of a sweep, as curves, a map or violins; its trials over time; or a recorded trial."""
    with exit_on_error():
        from epuck_sim.figures.saving import parse_target

        target = parse_target(to) if to else None
        options = {
            "form": form,
            "x": x,
            "y": y,
            "panels": panels,
            "censored_at_cycles": censored_at,
            "statistic": statistic,
            "width_cm": width_cm,
        }
        if results.is_dir():
            _plot_sweep(results, of, options, target)
        else:
            _plot_trial(results, {**options, "of": of}, target)


def _plot_sweep(folder: Path, of: str | None, options: dict[str, Any], target: Any) -> None:
    from epuck_sim.figures.labels import sweep_title
    from epuck_sim.figures.saving import Target, save_figure
    from epuck_sim.figures.sweep_figure import SIMULATED_AGAIN, read_form
    from epuck_sim.runs.reader import read_points

    points = read_points(folder, of)
    form = read_form(points, options, str(folder), "--")
    stem = folder / (form.name if form.name in SIMULATED_AGAIN else of or "T_sync")
    title = sweep_title(points[0].scenario)
    _save(save_figure(target or Target(stem), lambda: form.draw_figure(title), form.tables))
    for note in form.notes:
        typer.echo(f"note: {note}", err=True)


def _plot_trial(recording: Path, options: dict[str, Any], target: Any) -> None:
    from epuck_sim.figures.saving import Target, save_figure
    from epuck_sim.figures.trial_page import check_drawable, draw_page
    from epuck_sim.recording.reader import read_recording

    for name, value in options.items():
        if value is not None:
            flag = name.removesuffix("_cycles").replace("_", "-")
            raise EpuckSimError(f"--{flag} is for run folders; {recording} is none")
    recorded = read_recording(recording)
    check_drawable(recorded, str(recording))
    _save(save_figure(target or Target(recording.with_suffix("")), lambda: draw_page(recorded)))


def _save(files: list[Path]) -> None:
    for file in files:
        typer.echo(file)
