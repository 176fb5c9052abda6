"""The sweeps of claims: their scenarios and their trials."""

from collections.abc import Mapping, Sequence
from pathlib import Path

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


def sweep_scenario(claims: Claims, name: str) -> Scenario:
    """Return the scenario of a sweep; raise ScenarioError if it cannot be run."""
    asked = claims.sweeps[name]
    given = without_quick(read_yaml(find_scenario(asked.scenario)))
    given.pop("figure", None)  # it is about axes that the sweep may no longer have
    if "points" in asked.keys.get("sweep", {}):
        given.pop("sweep", None)  # points are of this sweep's own axes
    try:
        return from_keys({**merge(given, asked.keys), "name": name, "seed": claims.seed}, "scenario")
    except ScenarioError as error:
        raise ScenarioError(f"sweep {name}: {error}") from error


def sweep_folder(folder: Path, name: str) -> Path:
    """Return the run folder of a sweep."""
    return folder / "runs" / name


def needed_sweeps(claims: Claims, chosen: Sequence[Claim]) -> dict[str, Scenario]:
    """Return the scenarios of the sweeps that the chosen claims are asked of, by name.

    Raises:
        EpuckSimError: One of them cannot be run, or lacks what a claim names; then none is.
    """
    names = dict.fromkeys(claim.sweep for claim in chosen if claim.checks and claim.sweep is not None)
    scenarios = {name: sweep_scenario(claims, name) for name in names}
    swept = {name: points(scenario) for name, scenario in scenarios.items()}
    for claim in chosen:
        for check in claim.checks:
            if claim.sweep is None or check.test == "formula":
                continue
            try:
                chosen_points(check, swept[claim.sweep])
            except EpuckSimError as error:
                raise EpuckSimError(f"claim {claim.id}: {error}") from error
    return scenarios


class Trials:
    """The trials of claims' sweeps, in run folders."""

    def __init__(self, folders: Mapping[str, Path]) -> None:
        """Take the run folder of each sweep."""
        self.folders = folders

    def read(self, sweep: str, check: Check | None = None) -> list[PointTrials]:
        """Return the points of a sweep, with what a check takes of their measure.

        Raises:
            StoreError: The run folder is missing or damaged.
        """
        if check is None:
            return read_points(self.folders[sweep])
        return taken(check, read_points(self.folders[sweep], check.of))

    def effort(self, sweep: str) -> tuple[float, int]:
        """Return the computing time of a sweep's trials together, s, and the number of those that failed."""
        status = read_status(self.folders[sweep])
        return status.wall_s, len(status.failed)


def check_claim(claim: Claim, trials: Trials) -> list[Finding]:
    """Run the checks of a claim on the trials that are stored."""
    asked = ((check, claim.sweep if check.test != "formula" else None) for check in claim.checks)
    return [run_check(check, trials.read(sweep, check) if sweep else []) for check, sweep in asked]
