"""The commands that read run folders: `export`, `summarize`, `plot` and `fit`."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.mistakes import readable_errors

results = typer.Typer()

FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="A run folder, as `run --out` makes it.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print JSON.")]


@results.command("export")
def export_results(
    folder: FolderArgument,
    to: Annotated[Path, typer.Option(metavar="FILE", help="A .parquet or .csv file; a row for each trial.")],
) -> None:
    """Write the results of a sweep as one table."""
    with readable_errors():
        from epuck_sim.export import export

        failed = export(folder, to)
        if failed:
            typer.echo(f"{failed} trials failed and are left out; see: epuck-sim run {folder}/ --status", err=True)


@results.command()
def summarize(folder: FolderArgument, as_json: JsonOption = False) -> None:
    """Print the statistics of T_sync at each point of a sweep, censored trials taken into account."""
    with readable_errors():
        from epuck_sim.results import read_points
        from epuck_sim.summary import summarize as statistics
        from epuck_sim.sweep_report import print_summary

        print_summary(str(folder), statistics(read_points(folder)), as_json)


@results.command()
def plot(
    results: Annotated[
        Path, typer.Argument(metavar="FOLDER|FILE.rrd", help="A run folder, or the recording of a trial.")
    ],
    to: Annotated[
        Path | None,
        typer.Option(metavar="STEM", help="Write STEM.png, .svg and so on; by default FOLDER/T_sync, or FILE."),
    ] = None,
    x: Annotated[
        str | None, typer.Option(metavar="KEY", help="The axis to draw a sweep against; the speed by default.")
    ] = None,
) -> None:
    """Draw T_sync against speed, a line for each value of the other axes, and write its numbers; or draw a trial."""
    with readable_errors():
        for file in _plot_sweep(results, to, x) if results.is_dir() else _plot_trial(results, to, x):
            typer.echo(file)


def _plot_trial(recording: Path, to: Path | None, x: str | None) -> list[Path]:
    from epuck_sim.recording.page import save_page
    from epuck_sim.recording.reader import read_recording

    if x is not None:
        raise EpuckSimError("--x is for run folders")
    return save_page(read_recording(recording), str(recording), to or recording.with_suffix(""))


def _plot_sweep(folder: Path, to: Path | None, x: str | None) -> list[Path]:
    from epuck_sim.curves import choose_axis, read_curves
    from epuck_sim.figures import save_figure
    from epuck_sim.results import read_points, read_status

    points = read_points(folder)
    axis = choose_axis(points, x)
    curves = read_curves(points, axis)
    if not curves:
        raise StoreError(f"{folder}: holds no results yet")
    return save_figure(to or folder / "T_sync", read_status(folder).scenario, axis, curves)


@results.command()
def fit(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Run folders of sweeps over speed.")],
    as_json: JsonOption = False,
) -> None:
    """Print where T_sync has its local minimum and peak against speed, and the laws by which they scale."""
    with readable_errors():
        from epuck_sim.fit_report import print_fit
        from epuck_sim.fitting import fit_curves, fit_laws

        curves = [curve for folder in folders for curve in fit_curves(folder)]
        print_fit(curves, fit_laws(curves), as_json)
