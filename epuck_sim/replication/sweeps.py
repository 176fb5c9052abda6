"""The sweeps of claims: their scenarios and their trials, which are added until each claim is decided.

A sweep is looked at when it has the trials of its scenario, and whenever it has half as many more, `LOOKS` times at
most. Each p-value is corrected for these looks (`looks_p_value`), and all together by Holm's method. So the level of a
page holds whatever the reason to add trials, or to stop.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from scipy.stats import norm

from epuck_sim.display.html import in_words
from epuck_sim.display.table import Row, Table
from epuck_sim.estimate import LEVEL
from epuck_sim.replication import verdicts
from epuck_sim.replication.claims import Check, Claim, Claims
from epuck_sim.runs.compatibility import read_stored_points
from epuck_sim.runs.database import reading
from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.reader import PointTrials, read_points, read_status
from epuck_sim.scenario.base import refused_at
from epuck_sim.scenario.keys import merge, without_quick
from epuck_sim.scenario.loader import from_keys, points, read_keys
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.sequential import look_boundary, relative_sizes


def sweep_scenario(claims: Claims, name: str) -> Scenario:
    """Return the scenario of a sweep; raise EpuckSimError if it cannot be run, or brings code that is not trusted."""
    asked = claims.sweeps[name]
    own = asked.keys.get("sweep")
    with refused_at(f"sweep {name}"):
        given, _, folder = read_keys(asked.scenario)
        given = without_quick(given)
        given.pop("figure", None)  # it is about axes that the sweep may no longer have
        if isinstance(own, Mapping) and "points" in own:
            given.pop("sweep", None)  # points are of this sweep's own axes
        return from_keys({**merge({**given, "seed": claims.seed}, asked.keys), "name": name}, "scenario", folder)


def sweep_folder(folder: Path, name: str) -> Path:
    """Return the run folder of a sweep."""
    return folder / "runs" / name


def needed_sweeps(claims: Claims, chosen: Sequence[Claim]) -> dict[str, Scenario]:
    """Return the scenarios of the sweeps on which the chosen claims are tested, by name.

    EpuckSimError is raised if a sweep cannot be run, or lacks an axis, a value or a measure that a claim names.
    """
    names = dict.fromkeys(claim.sweep for claim in chosen if claim.checks and claim.sweep is not None)
    scenarios = {name: sweep_scenario(claims, name) for name in names}
    swept = {name: points(scenario) for name, scenario in scenarios.items()}
    for claim in chosen:
        with refused_at(f"claim {claim.id}"):
            for check in claim.checks:
                if claim.sweep is not None and check.test != "formula":
                    verdicts.chosen_points(check, swept[claim.sweep])
    return scenarios


@dataclass
class Trials:
    """The trials of claims' sweeps, in run folders."""

    folders: Mapping[str, Path]  # run folder of each sweep

    def read(self, sweep: str, check: Check | None = None) -> list[PointTrials]:
        """Return the points of a sweep, with the values that a check takes; raise StoreError as `read_points` does."""
        points = read_points(self.folders[sweep], check.of if check else None)
        return verdicts.taken(check, points) if check else points

    def effort(self, sweep: str) -> tuple[float, int]:
        """Return the computing time of a sweep's trials together, s, and the number of those that failed."""
        status = read_status(self.folders[sweep])
        return status.wall_s, len(status.failed)


def check_claim(claim: Claim, trials: Trials) -> list[verdicts.Finding]:
    """Run the checks of a claim on the trials that are stored."""
    found = []
    with refused_at(f"claim {claim.id}"):
        for check in claim.checks:
            sweep = None if check.test == "formula" else claim.sweep
            found.append(verdicts.run_check(check, trials.read(sweep, check) if sweep else []))
    return found


LOOKS = 8  # largest number of looks at a sweep, at the last of which it has 17 times as many trials as at the first

HOUR_S = 3600.0


def trials_at_looks(first: int) -> list[int]:
    """Return the numbers of trials per point at which a sweep is looked at; the first is that of its scenario."""
    return [math.ceil(first * size) for size in relative_sizes(LOOKS)]


def begun(scenario: Scenario, folder: Path) -> Scenario:
    """Return a sweep with the trials of the last look that was begun in its run folder; unchanged if there is none."""
    if not (folder / DATABASE).exists():
        return scenario
    with reading(folder) as connection:
        planned = max(point.trials for point in read_stored_points(connection))
    return scenario.model_copy(update={"trials": max(scenario.trials, planned)})


class NextLook(NamedTuple):
    """The next look at the claims of a sweep."""

    sweep: str
    scenario: Scenario  # with the trials of this look
    cost_s: float  # computing time of the trials that are missing, if they take as long as those that are stored
    claims: dict[str, float]
    """Computing time until each undecided claim is decided, if its effects stay as they are; inf for never."""


class Decider:
    """Adds trials to sweeps, one look after the other, as long as claims on them are undecided."""

    def __init__(self, chosen: Sequence[Claim], scenarios: dict[str, Scenario], folders: dict[str, Path]) -> None:
        self._scenarios, self._trials = scenarios, Trials(folders)
        self._findings = {claim.id: (claim, check_claim(claim, self._trials)) for claim in chosen}

    def answers(self) -> list[verdicts.Answer]:
        """Return the answers after the last looks."""
        return verdicts.judge_claims([*self._findings.values()], LOOKS)

    def run(self, add: Callable[[str, Scenario], None], budget_s: float) -> Iterator[str]:
        """Add trials until all is decided, or no look is left whose cost is within a budget of computing time.

        `add` runs the missing trials of a sweep. Yields a message before each look, with its cost, and another after
        it, with its verdicts.
        """
        spent_s = 0.0
        while looks := [look for look in self.next_looks() if look.cost_s <= budget_s - spent_s]:
            look = looks[0]
            yield f"{look.sweep}: {look.scenario.trials} trials a point, about {in_words(look.cost_s)} of computing"
            before_s, _ = self._trials.effort(look.sweep)
            add(look.sweep, look.scenario)
            spent_s += self._trials.effort(look.sweep)[0] - before_s
            for name, (claim, _) in self._findings.items():
                if claim.sweep == look.sweep:
                    self._findings[name] = claim, check_claim(claim, self._trials)
            found = (each for each in self.answers() if each.claim.id in look.claims)
            yield ", ".join(f"{each.claim.id} {each.verdict}" for each in found)

    def next_looks(self) -> list[NextLook]:
        """Return the next look at each sweep that has undecided claims, unless it has had all its looks.

        The number of trials that decides a claim follows from its effects: deviations from a threshold, in standard
        errors, grow with the root of the number of trials. Claims whose points scatter too much get no further looks.
        """
        answers = [each for each in self.answers() if each.verdict == verdicts.Verdict.UNDECIDED]
        tests = sum(judged.verdict == verdicts.Verdict.UNDECIDED for each in answers for judged in each.checks)
        found = []
        for name, scenario in self._scenarios.items():
            asked = [each for each in answers if each.claim.sweep == name and not _needs_points(each)]
            folder = self._trials.folders[name]
            status, now = read_status(folder), begun(scenario, folder).trials
            left = [trials for trials in trials_at_looks(scenario.trials) if trials > now]
            if not left or not asked:
                continue
            trial_s = status.wall_s / max(status.stored, 1) * status.points  # one more trial of each point
            costs = {}
            for each in asked:
                needed = now * _growth_needed(each.checks, tests)
                costs[each.claim.id] = trial_s * (next((size for size in left if size >= needed), math.inf) - now)
            next_scenario = scenario.model_copy(update={"trials": left[0]})
            found.append(NextLook(name, next_scenario, (left[0] - now) * trial_s, costs))
        return sorted(found, key=lambda look: (min(look.claims.values()), look.cost_s))

    def table(self) -> Table:
        """Return the undecided claims, and the time that would decide them."""
        rows, near = [], []
        for look in self.next_looks():
            for claim, cost_s in look.claims.items():
                until = in_words(cost_s) if math.isfinite(cost_s) else f"more than {LOOKS} looks"
                cells = {"trials": look.scenario.trials, "next_look": in_words(look.cost_s), "until": until}
                rows.append(Row({"claim": claim}, {"sweep": look.sweep, **cells}))
                if cost_s <= HOUR_S:
                    near.append(claim)
        title = "Undecided claims: computing time of the next look, and of all until a verdict if effects stay"
        headings = {"trials": "trials at the next look", "next_look": "its time", "until": "until decided"}
        notes = []
        if near:
            notes.append(f"An hour of computing would decide each of {', '.join(near)}.")
        if scattered := ", ".join(each.claim.id for each in self.answers() if _needs_points(each)):
            far = "not more trials: points scatter by far more than their errors"
            notes.append(f"More points would decide {scattered}, {far}.")
        return Table(title if rows else "No undecided claim may be looked at again", rows, notes, headings)


def _needs_points(answer: verdicts.Answer) -> bool:
    """Return whether the points of all undecided tests scatter by far more than their errors."""
    undecided = [judged for judged in answer.checks if judged.verdict == verdicts.Verdict.UNDECIDED]
    return bool(undecided) and all(judged.effect.is_scattered for judged in undecided)


def _growth_needed(checks: Sequence[verdicts.Finding], tests: int) -> float:
    """Return the growth of trials that decides a claim if effects stay: all its checks for it, or one against."""
    boundary = look_boundary(relative_sizes(LOOKS), 1 - (1 - LEVEL) / tests)
    shown, refuted = 1.0, math.inf
    for judged in checks:
        for_it, against = verdicts.p_values(judged.check, judged.effect)
        deviation = float(norm.isf(judged.p_value / 2))
        growth = (boundary / deviation) ** 2 if deviation > 0 else math.inf
        if for_it < against:
            shown = max(shown, growth)
        else:
            shown, refuted = math.inf, min(refuted, growth)
    return max(1.0, min(shown, refuted))
