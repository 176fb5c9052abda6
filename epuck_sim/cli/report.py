"""The command `report`: one page about a run folder."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error
from epuck_sim.cli.results import FolderArgument

reports = typer.Typer()


@reports.command()
def report(
    folder: FolderArgument,
    to: Annotated[Path, typer.Option(metavar="PAGE.html", help="The page, which is complete in itself.")],
) -> None:
    """Write a page about a sweep: what was run, tables, figures, failed trials, commands."""
    with exit_on_error():
        from epuck_sim.report.page import write_report

        write_report(folder, to)
        typer.echo(to)
