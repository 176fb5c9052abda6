"""The sweeps of claims: their scenarios, their trials, and what their full versions would cost."""

from collections.abc import Collection, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import NamedTuple, Protocol

import numpy as np

from epuck_sim.errors import EpuckSimError, ScenarioError
from epuck_sim.replication.claims import Check, Claim, Claims
from epuck_sim.replication.verdicts import Finding, chosen_points, run_check, taken
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.runs.status import read_status
from epuck_sim.scenario.keys import merge, without_quick
from epuck_sim.scenario.loader import find_scenario, from_keys
from epuck_sim.scenario.points import points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.scenario.yaml_io import read_yaml


class Version(StrEnum):
    """How many trials, and how long ones, claims are asked with."""

    QUICK = "quick"
    FULL = "full"


def sweep_scenario(claims: Claims, name: str, version: Version) -> Scenario:
    """Return the scenario of a sweep in one of its versions; raise ScenarioError if it cannot be run."""
    asked = claims.sweeps[name]
    given = without_quick(read_yaml(find_scenario(asked.scenario)))
    given.pop("figure", None)  # it is about axes that the sweep may no longer have
    if "points" in asked.keys.get("sweep", {}):
        given.pop("sweep", None)  # points are of this sweep's own axes
    changes = asked.quick or {} if version == Version.QUICK else asked.full
    own = {"name": f"{name}-{version}", "seed": claims.seed}
    try:
        return from_keys({**merge(merge(given, asked.keys), changes), **own}, "scenario")
    except ScenarioError as error:
        raise ScenarioError(f"sweep {name}: {error}") from error


def sweep_folder(folder: Path, name: str, version: Version) -> Path:
    """Return the run folder of a sweep: each version has its own."""
    return folder / "runs" / f"{name}-{version}"


def is_asked(claims: Claims, claim: Claim, version: Version) -> bool:
    """Return whether a version asks a claim: the quick one leaves out sweeps that take hours."""
    if not claim.checks:
        return False
    return claim.sweep is None or version == Version.FULL or claims.sweeps[claim.sweep].quick is not None


def needed_sweeps(claims: Claims, chosen: Sequence[Claim], version: Version) -> dict[str, Scenario]:
    """Return the scenarios of the sweeps that the chosen claims are asked of, by name.

    Raises:
        EpuckSimError: One of them cannot be run, or lacks a point that a claim names; then none is.
    """
    asked = [claim for claim in chosen if is_asked(claims, claim, version)]
    names = dict.fromkeys(claim.sweep for claim in asked if claim.sweep is not None)
    scenarios = {name: sweep_scenario(claims, name, version) for name in names}
    swept = {name: points(scenario) for name, scenario in scenarios.items()}
    for claim in asked:
        for check in claim.checks:
            if claim.sweep is None or check.test == "formula":
                continue
            try:
                chosen_points(check, swept[claim.sweep])
            except EpuckSimError as error:
                raise EpuckSimError(f"claim {claim.id}: {error}") from error
    return scenarios


class Effort(NamedTuple):
    """What the trials of a sweep have taken."""

    wall_s: float  # computing time of all trials together
    failed: int  # trials


class Trials(Protocol):
    """The trials of claims' sweeps, wherever they are stored."""

    @property
    def sweeps(self) -> Collection[str]:
        """Names of the sweeps."""
        ...

    def read(self, sweep: str, check: Check | None = None) -> list[PointTrials]:
        """Return the points of a sweep, with what a check takes of their measure."""
        ...

    def effort(self, sweep: str) -> Effort:
        """Return what the trials of a sweep have taken."""
        ...


class RunFolders:
    """Trials in run folders."""

    def __init__(self, folders: Mapping[str, Path]) -> None:
        """Take the run folder of each sweep."""
        self._folders = folders

    @property
    def sweeps(self) -> Collection[str]:
        """Names of the sweeps."""
        return self._folders.keys()

    def read(self, sweep: str, check: Check | None = None) -> list[PointTrials]:
        """Return the points of a sweep, with what a check takes of their measure.

        Raises:
            StoreError: The run folder is missing or damaged.
        """
        if check is None:
            return read_points(self._folders[sweep])
        return taken(check, read_points(self._folders[sweep], check.of))

    def effort(self, sweep: str) -> Effort:
        """Return what the trials of a sweep have taken."""
        status = read_status(self._folders[sweep])
        return Effort(status.wall_s, len(status.failed))


def check_claim(claim: Claim, trials: Trials) -> list[Finding]:
    """Run the checks of a claim on the trials that are stored; none if its sweep is not among those that are asked."""
    if claim.sweep not in (None, *trials.sweeps):
        return []
    asked = ((check, claim.sweep if check.test != "formula" else None) for check in claim.checks)
    return [run_check(check, trials.read(sweep, check) if sweep else []) for check, sweep in asked]


def estimate_cost(stored: Sequence[PointTrials], wall_s: float, full: Scenario) -> tuple[float, float]:
    """Return what the full version of a sweep costs, least and most s, if its trials are like those that are stored.

    It is the least if trials that are censored in the quick version, which took `wall_s` in all, end just then in the
    full one, the most if they take as long as it lets them.
    """
    cycles = np.concatenate([point.times for point in stored])
    ended = np.concatenate([point.observed & point.has_t_sync for point in stored])
    if not len(cycles):
        return (0.0, float("inf"))
    last = float(full.stop.max_cycles)
    # a trial without a T_sync goes on to the limit in any case
    goes_on = np.array([not point.has_t_sync for point in stored for _ in point.times])
    least, most = (np.where(still, last, cycles).mean() for still in (goes_on, ~ended))
    per_trial = wall_s / cycles.mean() / len(cycles) * len(points(full)) * full.trials
    return (float(least * per_trial), float(most * per_trial))
