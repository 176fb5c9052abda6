"""The command `plot`: figures of run folders and of recorded trials."""

from collections.abc import Callable, Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.statistics.names import Statistic

if TYPE_CHECKING:  # or --help would wait for numpy
    from matplotlib.figure import Figure

    from epuck_sim.figures.csv_tables import Table

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


class FigureOptions(NamedTuple):
    """Options of `plot` about the figure of a sweep; for one that is None, the scenario's section `figure` decides."""

    form: Form | None
    x: str | None
    y: str | None
    panels: str | None
    censored_at: int | None
    statistic: Statistic | None
    of: str | None
    width_cm: float | None


class Sketch(NamedTuple):
    """A figure to be drawn and saved."""

    default_stem: Path
    """Stem of its files if `--to` is not given."""
    draw: "Callable[[], Figure]"
    tables: "Mapping[str, Table]"
    """Its numbers, by the endings of their files."""
    note: str = ""
    """What the figure does not show, and why; or nothing."""


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
        from epuck_sim.figures.saving import Target, parse_target, save_figure

        target = parse_target(to) if to else None
        options = FigureOptions(form, x, y, panels, censored_at, statistic, of, width_cm)
        sketch = _sketch_sweep(results, options) if results.is_dir() else _sketch_trial(results, options)
        for file in save_figure(target or Target(sketch.default_stem), sketch.draw, sketch.tables):
            typer.echo(file)
        if sketch.note:
            typer.echo(sketch.note, err=True)


def _sketch_sweep(folder: Path, options: FigureOptions) -> Sketch:
    from epuck_sim.cli.sweep_figures import sketch_sweep

    return sketch_sweep(folder, options)


def _sketch_trial(recording: Path, options: FigureOptions) -> Sketch:
    from epuck_sim.figures.trial_page import check_drawable, draw_page
    from epuck_sim.recording.reader import read_recording

    names = ("--form", "--x", "--y", "--panels", "--censored-at", "--statistic", "--of", "--width-cm")
    reject_first(
        *(
            (value is not None, f"{name} is for run folders; {recording} is none")
            for name, value in zip(names, options, strict=True)
        )
    )
    recorded = read_recording(recording)
    check_drawable(recorded, str(recording))
    return Sketch(recording.with_suffix(""), lambda: draw_page(recorded), {})
