"""The commands that read run folders: `export`, `summarize`, `plot` and `fit`."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.mistakes import readable_errors

results = typer.Typer()

FolderArgument = Annotated[Path, typer.Argument(metavar="FOLDER", help="A run folder, as `run --out` makes it.")]
JsonOption = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]


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
            typer.echo(f"{failed} trials failed and are left out; see: epuck-sim run {folder} --status", err=True)
