"""The command `replicate`: claims of the thesis, each with a verdict."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first

replications = typer.Typer()


@replications.command()
def replicate(
    claims: Annotated[
        list[str] | None, typer.Argument(metavar="CLAIM...", help="Claims, such as R36; all by default.")
    ] = None,
    full: Annotated[
        bool,
        typer.Option("--full/--quick", help="Ask with many and long trials, or within half an hour; quick by default."),
    ] = False,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of the page and its run folders.")] = Path(
        "replication"
    ),
    file: Annotated[
        Path | None,
        typer.Option("--claims", metavar="FILE.yaml", help="Ask the claims of this file instead of the thesis's."),
    ] = None,
    only_list: Annotated[bool, typer.Option("--list", help="Print the claims, and run nothing.")] = False,
    workers: Annotated[int | None, typer.Option(min=1, help="Worker processes; all cores by default.")] = None,
    dask: Annotated[str | None, typer.Option(metavar="ADDRESS", help="Run on this Dask scheduler's workers.")] = None,
) -> None:
    """Test claims of the thesis: run the trials that are missing, and write a page with a verdict on each claim."""
    with exit_on_error():
        reject_first((workers is not None and dask is not None, "--workers and --dask exclude each other"))
        from epuck_sim.replication.claims import SHIPPED, read_claims

        known = read_claims(file or SHIPPED)
        chosen = known.choose(tuple(claims or ()))
        if only_list:
            for claim in chosen:
                typer.echo(f"{claim.id:4} {claim.section:12} {claim.claim}{' (not asked)' if claim.not_asked else ''}")
            return
        from epuck_sim.cli.replication import run_claims, write_answers
        from epuck_sim.replication.sweeps import Version
        from epuck_sim.sweep.cluster import DaskCluster
        from epuck_sim.sweep.executors import local_pool

        open_pool = partial(local_pool, workers) if dask is None else DaskCluster(dask).open
        version = Version.FULL if full else Version.QUICK
        failed = run_claims(known, chosen, out, version, open_pool)
        write_answers(known, chosen, out, version)
        if failed:
            typer.echo(f"{failed} trials failed; give the command again to retry them", err=True)
            raise typer.Exit(1)
