"""The commands that print what run folders hold: `export`, `summarize`, `fit` and `compare`."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.cli.plot import STATISTIC
from epuck_sim.statistics.names import Statistic

results = typer.Typer()

FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="A run folder, as `run --out` makes it.")]
OfOption = Annotated[
    str | None, typer.Option("--of", metavar="NAME", help="A measure of the folder's trials; T_sync by default.")
]
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
def summarize(
    folder: FolderArgument,
    of: OfOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print the statistics of T_sync, or of a measure, at each point of a sweep; censored trials count as such.

    Of a measure that is a series, these are the statistics at each cycle; the table shows some of the cycles.
    """
    with exit_on_error():
        from epuck_sim.cli.series_tables import print_series
        from epuck_sim.cli.tables import print_summary
        from epuck_sim.runs.reader import read_points
        from epuck_sim.statistics.series import has_series, summarize_series
        from epuck_sim.statistics.summary import summarize as statistics

        points = read_points(folder, of)
        if any(map(has_series, points)):
            print_series(f"{folder}: {of}", summarize_series(points), as_json)
        else:
            print_summary(str(folder), of, statistics(points), as_json)


@results.command()
def fit(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Run folders of sweeps over speed.")],
    statistic: Annotated[Statistic, STATISTIC] = Statistic.MEAN,
    of: OfOption = None,
    x: Annotated[str | None, typer.Option("--x", metavar="KEY", help="Axis of --of; by default the speed.")] = None,
    as_json: JsonOption = False,
) -> None:
    """Print the local minimum and the peak of T_sync against speed, and the laws by which they scale.

    Of a measure, print its minimum and its peak along an axis.
    """
    with exit_on_error():
        reject_first((x is not None and of is None, "--x is for measures, --of NAME; T_sync is fitted against speed"))
        if of is not None:
            from epuck_sim.cli.measure_fit_tables import print_measure_fit
            from epuck_sim.statistics.measure_fit import fit_measure

            print_measure_fit([fit for folder in folders for fit in fit_measure(folder, of, x, statistic)], as_json)
            return
        from epuck_sim.cli.fit_tables import print_fit
        from epuck_sim.statistics.scaling_fit import fit_curves, fit_laws

        curves = [curve for folder in folders for curve in fit_curves(folder, statistic)]
        print_fit(curves, fit_laws(curves), as_json)


@results.command()
def compare(
    folder: FolderArgument,
    other: Annotated[
        Path | None, typer.Argument(metavar="OTHER", help="A run folder with the same axes, to compare it with.")
    ] = None,
    axis: Annotated[
        str | None,
        typer.Option(metavar="KEY=A,B", help="Compare two values of an axis instead: robots.0.count=5,10"),
    ] = None,
    of: OfOption = None,
    as_json: JsonOption = False,
) -> None:
    """Print how T_sync, or a measure, differs between two run folders or two values of an axis."""
    with exit_on_error():
        from epuck_sim.cli.comparison_tables import print_comparison
        from epuck_sim.runs.reader import read_points
        from epuck_sim.scenario.overrides import parse_axis
        from epuck_sim.statistics.comparison import compare as compare_matches
        from epuck_sim.statistics.comparison import match_folders, match_values

        reject_first(((other is None) == (axis is None), "give a second run folder, or --axis KEY=A,B, and not both"))
        points = read_points(folder, of)
        if axis is not None:
            key, values = parse_axis(axis, "--axis")
            found = match_values(points, key, values)
            names = [f"{key} = {value}" for value in values]
        else:
            assert other is not None
            found = match_folders(points, read_points(other, of))
            names = [str(folder), str(other)]
        print_comparison(names, compare_matches(*found), as_json)
