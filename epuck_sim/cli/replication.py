"""What `epuck-sim replicate` does and prints."""

from collections.abc import Sequence
from pathlib import Path

import typer

from epuck_sim.cli.progress import SweepProgressBar, print_stderr
from epuck_sim.errors import EpuckSimError
from epuck_sim.replication.claims import Claim, Claims
from epuck_sim.replication.sweeps import Version, needed_sweeps, sweep_folder
from epuck_sim.replication.writer import write_replication
from epuck_sim.sweep.executors import OpenPool
from epuck_sim.sweep.run import run_sweep


def run_claims(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version, open_pool: OpenPool) -> int:
    """Run the trials that are missing, show how far they are, and return how many have failed."""
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


def write_answers(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version) -> None:
    """Write the page, and print a line for each claim and the page's name."""
    written = write_replication(claims, chosen, folder, version)
    for answer in written.contents.answers:
        typer.echo(f"{answer.claim.id:4} {answer.verdict:12} {answer.claim.claim}")
    typer.echo(written.file)
