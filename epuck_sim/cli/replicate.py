"""The command `replicate`: claims of the thesis, each with a verdict."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epuck_sim.cli.errors import print_stderr, reject_first
from epuck_sim.cli.options import DaskOption, WorkersOption
from epuck_sim.util.messages import counted

if TYPE_CHECKING:  # or --help would wait for numba
    from epuck_sim.display.table import Table
    from epuck_sim.replication.claims import Claim
    from epuck_sim.scenario.scenario import Scenario
    from epuck_sim.sweep.executors import OpenPool

replications = typer.Typer()


@replications.command()
def replicate(
    claims: Annotated[
        list[str] | None, typer.Argument(metavar="CLAIM...", help="Claims, such as R36; all by default.")
    ] = None,
    out: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder of the page and its run folders.")] = Path(
        "replication"
    ),
    file: Annotated[
        Path | None,
        typer.Option("--claims", metavar="FILE.yaml", help="Ask the claims of this file instead of the thesis's."),
    ] = None,
    only_list: Annotated[bool, typer.Option("--list", help="Print the claims, and run nothing.")] = False,
    until_decided: Annotated[
        bool,
        typer.Option("--until-decided", help="Add trials where claims are undecided, the cheapest first."),
    ] = False,
    cpu_hours: Annotated[
        float | None, typer.Option(min=0, metavar="H", help="Limit of the computing time that --until-decided adds.")
    ] = None,
    workers: WorkersOption = None,
    dask: DaskOption = None,
) -> None:
    """Test claims of the thesis: run the trials that are missing, and write a page with a verdict on each claim."""
    reject_first(
        (workers is not None and dask is not None, "--workers and --dask exclude each other"),
        (cpu_hours is not None and not until_decided, "--cpu-hours is a limit of --until-decided, which is not given"),
    )
    from epuck_sim.cli.tables import terminal_width
    from epuck_sim.replication.claims import SHIPPED, read_claims

    known = read_claims(file or SHIPPED)
    chosen = known.choose(tuple(claims or ()))
    if only_list:
        for claim in chosen:
            typer.echo(f"{claim.id:4} {claim.section:12} {claim.claim}{'' if claim.checks else ' (no trials)'}")
        return
    from epuck_sim.replication.page import read_contents, write_replication
    from epuck_sim.replication.sweeps import LOOKS, Trials, needed_sweeps, sweep_folder
    from epuck_sim.sweep.cluster import DaskCluster
    from epuck_sim.sweep.executors import local_pool

    open_pool = partial(local_pool, workers) if dask is None else DaskCluster(dask).open
    budget_s = (math.inf if cpu_hours is None else 3600 * cpu_hours) if until_decided else None
    needed = needed_sweeps(known, chosen)
    folders = {name: sweep_folder(out, name) for name in needed}
    failed, undecided = _run_claims(chosen, needed, folders, open_pool, budget_s)
    trials = Trials(folders)
    contents = read_contents(known, chosen, needed, trials, out, file, LOOKS if until_decided else 1)
    page = write_replication(contents, trials, out)
    for answer in contents.answers:
        typer.echo(f"{answer.claim.id:4} {answer.verdict:12} {answer.claim.claim}")
    if undecided is not None:
        typer.echo(undecided.to_text(terminal_width()))
    typer.echo(page)
    if failed:
        typer.echo(f"{counted(failed, 'trial')} failed; give the command again to retry them", err=True)
        raise typer.Exit(1)


def _run_claims(
    chosen: "Sequence[Claim]",
    needed: "dict[str, Scenario]",
    folders: dict[str, Path],
    open_pool: "OpenPool",
    budget_s: float | None,
) -> "tuple[int, Table | None]":
    """Run the trials that are missing, and more within a budget, and show how far they are.

    Returns:
        How many trials have failed, and a table of what is undecided within the budget.
    """
    from epuck_sim.cli.progress import SweepProgressBar
    from epuck_sim.replication.sweeps import Decider, begun
    from epuck_sim.sweep.run import run_sweep

    failed = dict.fromkeys(needed, 0)

    def run(name: str, scenario: "Scenario") -> None:
        with SweepProgressBar() as bar:
            failed[name] = run_sweep(scenario, folders[name], open_pool, bar).failed

    for name, scenario in needed.items():
        print_stderr(f"{name}:")
        run(name, begun(scenario, folders[name]))
    if budget_s is not None:
        decider = Decider(chosen, needed, folders)
        for line in decider.run(run, budget_s):
            print_stderr(line)
        return sum(failed.values()), decider.table()
    return sum(failed.values()), None
