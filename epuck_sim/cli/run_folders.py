"""The commands `status` and `merge`: how far sweeps are, and shares of a sweep put together."""

from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error

run_folders = typer.Typer()

FoldersArgument = Annotated[
    list[Path], typer.Argument(metavar="FOLDER...", help="Run folders, as `run --out` makes them.")
]


@run_folders.command()
def status(
    folders: FoldersArgument,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON; of several folders, a list.")] = False,
) -> None:
    """Show how far the sweep in FOLDER is: trials stored, censored and failed, and the process at work on it.

    Of several folders, such as the shares of a sweep, a line each and their sum.
    """
    with exit_on_error():
        from epuck_sim.cli.status_tables import print_status, print_statuses
        from epuck_sim.runs.status import read_status

        if len(folders) == 1:
            print_status(read_status(folders[0]), as_json)
        else:
            print_statuses({str(folder): read_status(folder) for folder in folders}, as_json)


@run_folders.command()
def merge(
    folders: FoldersArgument,
    out: Annotated[Path, typer.Option(metavar="WHOLE", help="The run folder to make; it must be new or empty.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print the status of WHOLE as JSON.")] = False,
) -> None:
    """Put shares of a sweep together, finished or not: every trial once, as if one machine had run them all.

    Folders of another scenario, another controller or other versions are refused. `run WHOLE` runs what is missing.
    """
    with exit_on_error():
        from epuck_sim.cli.status_tables import print_status
        from epuck_sim.runs.share import merge_folders
        from epuck_sim.runs.status import read_status

        merge_folders(folders, out)
        print_status(read_status(out), as_json)
