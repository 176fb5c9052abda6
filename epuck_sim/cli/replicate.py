"""The command `replicate`: claims of the thesis, each with a verdict."""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epuck_sim.cli.errors import print_stderr, reject_first
from epuck_sim.cli.options import DaskOption, WorkersOption
from epuck_sim.errors import EpuckSimError
from epuck_sim.util.messages import counted

if TYPE_CHECKING:  # or --help would wait for numba
    from epuck_sim.replication.claims import Claim, Claims
    from epuck_sim.replication.sweeps import Version
    from epuck_sim.sweep.executors import OpenPool

replications = typer.Typer()


@replications.command()
def replicate(
    claims: Annotated[
        list[str] | None, typer.Argument(metavar="CLAIM...", help="Claims, such as R36; all by default.")
    ] = None,
    full: Annotated[
        bool,
        typer.Option(
            "--full/--quick", help="Ask with many and long trials, or within an hour or so; quick by default."
        ),
    ] = False,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of the page and its run folders.")] = Path(
        "replication"
    ),
    file: Annotated[
        Path | None,
        typer.Option("--claims", metavar="FILE.yaml", help="Ask the claims of this file instead of the thesis's."),
    ] = None,
    only_list: Annotated[bool, typer.Option("--list", help="Print the claims, and run nothing.")] = False,
    workers: WorkersOption = None,
    dask: DaskOption = None,
) -> None:
    """Test claims of the thesis: run the trials that are missing, and write a page with a verdict on each claim."""
    reject_first((workers is not None and dask is not None, "--workers and --dask exclude each other"))
    from epuck_sim.replication.claims import SHIPPED, read_claims

    known = read_claims(file or SHIPPED)
    chosen = known.choose(tuple(claims or ()))
    if only_list:
        for claim in chosen:
            typer.echo(f"{claim.id:4} {claim.section:12} {claim.claim}{'' if claim.checks else ' (no trials)'}")
        return
    from epuck_sim.replication.page import write_replication
    from epuck_sim.replication.sweeps import Version
    from epuck_sim.sweep.cluster import DaskCluster
    from epuck_sim.sweep.executors import local_pool

    open_pool = partial(local_pool, workers) if dask is None else DaskCluster(dask).open
    version = Version.FULL if full else Version.QUICK
    failed = _run_claims(known, chosen, out, version, open_pool)
    answers, file = write_replication(known, chosen, out, version)
    for answer in answers:
        typer.echo(f"{answer.claim.id:4} {answer.verdict:12} {answer.claim.claim}")
    typer.echo(file)
    if failed:
        typer.echo(f"{counted(failed, 'trial')} failed; give the command again to retry them", err=True)
        raise typer.Exit(1)


def _run_claims(
    claims: "Claims", chosen: "Sequence[Claim]", folder: Path, version: "Version", open_pool: "OpenPool"
) -> int:
    """Run the trials that are missing, show how far they are, and return how many have failed."""
    from epuck_sim.cli.progress import SweepProgressBar
    from epuck_sim.replication.sweeps import needed_sweeps, sweep_folder
    from epuck_sim.sweep.run import run_sweep

    needed = needed_sweeps(claims, chosen, version)
    try:
        (folder / "runs").mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise EpuckSimError(f"{folder}: cannot be made: {error.strerror}") from error
    failed = 0
    for name, scenario in needed.items():
        print_stderr(f"{name}:")
        with SweepProgressBar() as bar:
            failed += run_sweep(scenario, sweep_folder(folder, name, version), open_pool, bar).failed
    return failed
