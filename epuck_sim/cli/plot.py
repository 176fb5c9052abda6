"""The command `plot`: figures of run folders and of recorded trials."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from epuck_sim.cli.errors import exit_on_error
from epuck_sim.errors import EpuckSimError
from epuck_sim.statistics.names import Statistic

if TYPE_CHECKING:  # or --help would wait for matplotlib
    from epuck_sim.figures.saving import Target

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
        list[Path],
        typer.Argument(
            metavar="FOLDER...|FILE.rrd", help="A run folder, or several of one scenario, or the recording of a trial."
        ),
    ],
    names: Annotated[
        str | None,
        typer.Option(metavar="NAME,...", help="Names of several folders in the figure; by default, their own."),
    ] = None,
    to: Annotated[
        Path | None,
        typer.Option(
            metavar="STEM|FILE",
            help="Write STEM.png, STEM.svg and so on, or one picture, FILE.png, FILE.svg or FILE.pdf, with its caption "
            "and its numbers as CSV beside it. By default STEM is FOLDER/T_sync, FOLDER/NAME_OF_MEASURE, FOLDER/FORM, "
            "or the recording's name.",
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
    title: Annotated[str | None, typer.Option(metavar="TEXT", help="Title; by default there is none.")] = None,
    label: Annotated[
        list[str] | None,
        typer.Option(metavar="KEY=TEXT", help="Label of an axis, or of T_sync or a measure; may be repeated."),
    ] = None,
    log: Annotated[
        bool | None,
        typer.Option("--log/--linear", help="Scale of T_sync or the measure.", show_default="log for T_sync"),
    ] = None,
    points: Annotated[bool, typer.Option("--points", help="Draw each trial as a dot, in curves and violins.")] = False,
    font_pt: Annotated[
        float | None, typer.Option(metavar="PT", min=4, max=30, help="Size of letters; 8 points by default.")
    ] = None,
) -> None:
    """Draw T_sync or a measure of sweeps, as curves, a map or violins; their trials over time; or a recorded trial.

    A caption is written beside the figure, and its numbers. A scenario's section figure has the same options.
    """
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
            "title": title,
            "labels": _parse_labels(label) if label else None,
            "scale": None if log is None else "log" if log else "linear",
            "points": points or None,
            "width_cm": width_cm,
            "font_pt": font_pt,
        }
        named = [name.strip() for name in names.split(",")] if names else []
        if len(results) > 1 or results[0].is_dir():
            _plot_sweeps(results, of, named, options, target)
        else:
            _plot_trial(results[0], {**options, "of": of, "names": names}, target)


def _parse_labels(labels: list[str]) -> dict[str, str]:
    parts = [label.partition("=") for label in labels]
    for label, (_, equals, _) in zip(labels, parts, strict=True):
        if not equals:
            raise EpuckSimError(f"--label is {label!r}; allowed: KEY=TEXT")
    return {key: text for key, _, text in parts}


def _plot_sweeps(
    folders: list[Path], of: str | None, names: list[str], options: dict[str, Any], target: "Target | None"
) -> None:
    from epuck_sim.figures.saving import Target, save_figure
    from epuck_sim.figures.sweep_figure import SIMULATED_AGAIN, read_form

    form = read_form(folders, options, of, names, "--")
    stem = form.name if form.name in SIMULATED_AGAIN else of or "T_sync"
    others = "".join(f"-with-{folder.resolve().name}" for folder in folders[1:])
    _save(save_figure(target or Target(folders[0] / f"{stem}{others}"), form.draw_figure, form.tables, form.caption))
    for note in form.notes:
        typer.echo(f"note: {note}", err=True)


def _plot_trial(recording: Path, options: dict[str, Any], target: "Target | None") -> None:
    from epuck_sim.figures.saving import Target, save_figure
    from epuck_sim.figures.sweep_figure import flag
    from epuck_sim.figures.trial_page import check_drawable, draw_page
    from epuck_sim.recording.reader import read_recording

    for name, value in options.items():
        if value is not None:
            raise EpuckSimError(f"{flag(name, value)} is for run folders; {recording} is none")
    recorded = read_recording(recording)
    check_drawable(recorded, str(recording))
    _save(save_figure(target or Target(recording.with_suffix("")), lambda: draw_page(recorded)))


def _save(files: list[Path]) -> None:
    for file in files:
        typer.echo(file)
