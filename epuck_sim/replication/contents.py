"""What the page of a replication shows, read from the run folders."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from epuck_sim.replication.checks import FormulaCheck
from epuck_sim.replication.claims import Claim, Claims
from epuck_sim.replication.cost import Cost, estimate_cost
from epuck_sim.replication.evaluation import Finding, run_check
from epuck_sim.replication.sweeps import Version, sweep_folder, sweep_scenario
from epuck_sim.replication.verdicts import Answer, answer
from epuck_sim.runs.reader import read_points
from epuck_sim.runs.status import Status, read_status


class Contents(NamedTuple):
    """Everything on the page."""

    version: Version
    folder: Path
    """Folder of the replication, as it was given."""
    chosen: tuple[str, ...]
    """Ids of the claims that were chosen; none if these are all."""
    answers: list[Answer]
    sweeps: dict[str, Status]
    """How far each sweep is that was asked."""
    limits: dict[str, int]
    """Limit of cycles of each."""
    costs: dict[str, Cost]
    """What the full version of each would cost; empty if this is the full version."""
    notes: tuple[str, ...]
    """What the thesis contradicts itself in, misprints, and takes for findings."""

    @property
    def checks(self) -> int:
        """Number of checks that are corrected together."""
        judged = (each for answer in self.answers for each in answer.checks)
        return sum(not isinstance(each.tested.check, FormulaCheck) for each in judged)


def read_contents(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version) -> Contents:
    """Test the chosen claims on the trials that are stored.

    Raises:
        StoreError: A run folder is missing or damaged.
    """
    asked = [(claim, check_claim(claim, folder, version)) for claim in chosen]
    names = dict.fromkeys(claim.sweep for claim in chosen if claim.sweep is not None)
    folders = {name: sweep_folder(folder, name, version) for name in names}
    return Contents(
        version,
        folder,
        () if len(chosen) == len(claims.claims) else tuple(claim.id for claim in chosen),
        answer(asked),
        {name: read_status(each) for name, each in folders.items()},
        {name: read_points(each)[0].scenario.stop.max_cycles for name, each in folders.items()},
        {} if version == Version.FULL else {name: _cost(claims, name, folders[name]) for name in names},
        claims.notes,
    )


def _cost(claims: Claims, name: str, folder: Path) -> Cost:
    return estimate_cost(read_points(folder), read_status(folder).wall_s, sweep_scenario(claims, name, Version.FULL))


def check_claim(claim: Claim, folder: Path, version: Version) -> list[Finding]:
    """Run the checks of a claim on the trials that are stored."""
    found = []
    for check in claim.checks:
        if isinstance(check, FormulaCheck) or claim.sweep is None:
            found.append(run_check(check, []))
        else:
            found.append(run_check(check, read_points(sweep_folder(folder, claim.sweep, version), check.of)))
    return found
