"""The commands that read run folders: `export`, `summarize`, `plot` and `fit`."""

from collections.abc import Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.errors import StoreError

if TYPE_CHECKING:  # or --help would wait for numpy
    from epuck_sim.runs.reader import PointTrials

results = typer.Typer()

FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="A run folder, as `run --out` makes it.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@results.command("export")
def export_results(
    folder: FolderArgument,
    to: Annotated[Path, typer.Option(metavar="FILE", help="A .parquet or .csv file; a row for each trial.")],
) -> None:
    """Write the results of a sweep as one table."""
    with exit_on_error():
        from epuck_sim.runs.export import export

        failed = export(folder, to)
        if failed:
            typer.echo(f"{failed} trials failed and are left out; see: epuck-sim status {folder}", err=True)


@results.command()
def summarize(folder: FolderArgument, as_json: JsonOption = False) -> None:
    """Print the statistics of T_sync at each point of a sweep, censored trials taken into account."""
    with exit_on_error():
        from epuck_sim.cli.tables import print_summary
        from epuck_sim.runs.reader import read_points
        from epuck_sim.statistics.summary import summarize as statistics

        print_summary(str(folder), statistics(read_points(folder)), as_json)


class Form(StrEnum):
    """How a sweep can be drawn."""

    CURVES = "curves"
    MAP = "map"
    VIOLINS = "violins"
    PERTURBATION = "perturbation"
    COURSE = "course"


class Wanted(NamedTuple):
    """What the command says of the figure of a sweep; where it is None, the scenario's section `figure` counts."""

    form: Form | None
    x: str | None
    y: str | None
    panels: str | None
    censored_at: int | None


@results.command()
def plot(
    results: Annotated[
        Path, typer.Argument(metavar="FOLDER|FILE.rrd", help="A run folder, or the recording of a trial.")
    ],
    to: Annotated[
        Path | None,
        typer.Option(metavar="STEM", help="Write STEM.png and so on; by default FOLDER/T_sync, FOLDER/FORM, or FILE."),
    ] = None,
    form: Annotated[Form | None, typer.Option(help="By default what the scenario says, or else curves.")] = None,
    x: Annotated[
        str | None, typer.Option(metavar="KEY", help="The axis to draw a sweep against; the speed by default.")
    ] = None,
    y: Annotated[str | None, typer.Option(metavar="KEY", help="Of a map, the axis that goes up.")] = None,
    panels: Annotated[
        str | None, typer.Option(metavar="KEY", help="Of curves, the axis with a panel for each of its values.")
    ] = None,
    censored_at: Annotated[
        int | None,
        typer.Option(metavar="CYCLES", min=1, help="Of violins: estimate the mean as if trials were censored there."),
    ] = None,
) -> None:
    """Draw a sweep's T_sync as curves, a map or violins, or what its trials do over time; or a recorded trial."""
    with exit_on_error():
        wanted = Wanted(form, x, y, panels, censored_at)
        for file in _plot_sweep(results, to, wanted) if results.is_dir() else _plot_trial(results, to, wanted):
            typer.echo(file)


def _plot_trial(recording: Path, to: Path | None, wanted: Wanted) -> list[Path]:
    from epuck_sim.figures.trial_page import save_page
    from epuck_sim.recording.reader import read_recording

    options = zip(("--form", "--x", "--y", "--panels", "--censored-at"), wanted, strict=True)
    reject_first(*((value is not None, f"{name} is for run folders; {recording} is none") for name, value in options))
    return save_page(read_recording(recording), str(recording), to or recording.with_suffix(""))


def _plot_sweep(folder: Path, to: Path | None, wanted: Wanted) -> list[Path]:
    from epuck_sim.figures.curves import save_figure
    from epuck_sim.figures.maps import read_maps, save_maps
    from epuck_sim.figures.violins import read_violins, save_violins
    from epuck_sim.runs.reader import read_points, read_status
    from epuck_sim.statistics.curves import choose_axis, choose_second_axis, read_curves

    points = read_points(folder)
    figure = points[0].scenario.figure
    form = wanted.form or Form(figure.form)
    over_time = form in (Form.PERTURBATION, Form.COURSE)
    reject_first(
        (wanted.x is not None and over_time, f"--x is for figures of T_sync, but this is {form}, over time"),
        (wanted.y is not None and form != Form.MAP, f"--y is for --form map, but this is {form}"),
        (wanted.panels is not None and form != Form.CURVES, f"--panels is for --form curves, but this is {form}"),
        (
            wanted.censored_at is not None and form != Form.VIOLINS,
            f"--censored-at is for --form violins, but this is {form}",
        ),
    )
    if not any(len(point.times) for point in points):
        raise StoreError(f"{folder}: holds no results yet")
    stem, title = to or folder / (form if over_time else "T_sync"), read_status(folder).scenario
    if over_time:
        return _plot_over_time(stem, title, form, points)
    x = choose_axis(points, *_said(wanted.x, "--x", figure.x, f"{folder}: figure.x"))
    if form == Form.MAP:
        own = None if figure.y == x else figure.y  # which --x may have taken
        y = choose_second_axis(points, x, *_said(wanted.y, "--y", own, f"{folder}: figure.y"))
        return save_maps(stem, title, x, y, read_maps(points, x, y))
    if form == Form.VIOLINS:
        limit = wanted.censored_at or figure.censored_at_cycles
        return save_violins(stem, title, x, read_violins(points, x, limit), limit)
    own = None if figure.panels == x else figure.panels
    panels, origin = _said(wanted.panels, "--panels", own, f"{folder}: figure.panels")
    return save_figure(stem, title, x, read_curves(points, x), panels, origin)


def _plot_over_time(stem: Path, title: str, form: Form, points: "Sequence[PointTrials]") -> list[Path]:
    from epuck_sim.figures.courses import read_courses, save_courses
    from epuck_sim.figures.perturbations import read_perturbations, save_perturbations

    if form == Form.COURSE:
        return save_courses(stem, title, read_courses(points))
    return save_perturbations(stem, title, read_perturbations(points))


def _said(wanted: str | None, option: str, default: str | None, key: str) -> tuple[str | None, str]:
    """Return what counts, and what messages call it: an option of the command, or a key of the scenario."""
    return (default, key) if wanted is None else (wanted, option)


@results.command()
def fit(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Run folders of sweeps over speed.")],
    as_json: JsonOption = False,
) -> None:
    """Print where T_sync has its local minimum and peak against speed, and the laws by which they scale."""
    with exit_on_error():
        from epuck_sim.cli.fit_tables import print_fit
        from epuck_sim.statistics.scaling_fit import fit_curves, fit_laws

        curves = [curve for folder in folders for curve in fit_curves(folder)]
        print_fit(curves, fit_laws(curves), as_json)
