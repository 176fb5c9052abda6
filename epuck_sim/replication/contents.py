"""What the page of a replication shows, read from the run folders, and what the full version would cost."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from epuck_sim.replication.checks import FormulaCheck
from epuck_sim.replication.claims import Claim, Claims
from epuck_sim.replication.evaluation import Finding, run_check
from epuck_sim.replication.sweeps import Version, is_asked, sweep_folder, sweep_scenario
from epuck_sim.replication.verdicts import Answer, answer
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.runs.status import Status, read_status
from epuck_sim.scenario.points import points
from epuck_sim.scenario.scenario import Scenario


class Cost(NamedTuple):
    """Computing time in s."""

    least: float
    """If trials that are censored in the quick version end just then in the full one."""
    most: float
    """If they take as long as the full one lets them."""


class Asked(NamedTuple):
    """A sweep that was asked."""

    status: Status
    limit: int
    """Limit of cycles."""
    full: Cost | None
    """What its full version would cost; None if this is it."""


class Contents(NamedTuple):
    """Everything on the page."""

    version: Version
    folder: Path
    """Folder of the replication, as it was given."""
    chosen: tuple[str, ...]
    """Ids of the claims that were chosen; none if these are all."""
    answers: list[Answer]
    sweeps: dict[str, Asked]
    """The sweeps that were asked."""
    claims: Claims
    """The file of claims."""

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
    asked = {claim.id: claim for claim in chosen if is_asked(claims, claim, version)}
    folders = {each.sweep: sweep_folder(folder, each.sweep, version) for each in asked.values() if each.sweep}
    findings = [(claim, check_claim(claim, folders) if claim.id in asked else []) for claim in chosen]
    return Contents(
        version,
        folder,
        () if len(chosen) == len(claims.claims) else tuple(claim.id for claim in chosen),
        answer(findings),
        {name: _read_sweep(each, sweep_scenario(claims, name, Version.FULL)) for name, each in folders.items()},
        claims,
    )


def check_claim(claim: Claim, folders: dict[str, Path]) -> list[Finding]:
    """Run the checks of a claim on the trials that are stored."""
    return [
        run_check(check, [])
        if isinstance(check, FormulaCheck) or claim.sweep is None
        else run_check(check, read_points(folders[claim.sweep], check.of))
        for check in claim.checks
    ]


def _read_sweep(folder: Path, full: Scenario) -> Asked:
    stored, status = read_points(folder), read_status(folder)
    cost = None if stored[0].scenario.name == full.name else estimate_cost(stored, status.wall_s, full)
    return Asked(status, stored[0].scenario.stop.max_cycles, cost)


def estimate_cost(stored: Sequence[PointTrials], wall_s: float, full: Scenario) -> Cost:
    """Return what the full version of a sweep costs, if its trials are like those that are stored.

    Args:
        stored: The points of the quick version.
        wall_s: Time of all its trials.
        full: Scenario of the full version.
    """
    cycles = np.concatenate([point.times for point in stored])
    ended = np.concatenate([point.observed & point.has_t_sync for point in stored])
    if not len(cycles):
        return Cost(0.0, float("inf"))
    last = float(full.stop.max_cycles)
    # a trial without a T_sync goes on to the limit in any case
    goes_on = np.array([not point.has_t_sync for point in stored for _ in point.times])
    least, most = (np.where(still, last, cycles).mean() for still in (goes_on, ~ended))
    per_trial = wall_s / cycles.mean() / len(cycles) * len(points(full)) * full.trials
    return Cost(float(least * per_trial), float(most * per_trial))
