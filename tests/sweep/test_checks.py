"""Claims about pilots: each point is timed once, in random order, until time is up."""

import pytest

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.loader import load_scenario
from epuck_sim.scenario.points import Point, points
from epuck_sim.sweep import checks
from epuck_sim.sweep.checks import time_trials
from tests.control.bench import with_step


def made(*settings: str, speeds: str = "1,2,4,8"):
    return points(load_scenario("pair", settings, [f"robots.0.parameters.speed_cm_s={speeds}"]))


def test_every_point_is_timed_once_if_there_is_time_and_no_trial_is_cut() -> None:
    timed = time_trials(made("stop.max_cycles=2"), 60)
    assert sorted(each.point for each in timed) == [0, 1, 2, 3]
    assert [each.point for each in timed] != [0, 1, 2, 3]
    assert not any(each.is_cut for each in timed)
    assert all(each.wall_s > 0 for each in timed)


@pytest.mark.parametrize(
    ("scenario", "coupling"), [("thesis", "robots.0.parameters.coupling=1e-6"), ("particles", "response.coupling=1e-6")]
)
def test_a_trial_that_takes_longer_is_cut(scenario: str, coupling: str) -> None:
    found = points(load_scenario(scenario, [coupling, "stop.max_cycles=1000000000"]))
    (timed,) = time_trials(found, 0.1)  # the trial itself would take years
    assert timed.is_cut
    assert timed.wall_s >= 0.1


def test_what_compiling_takes_is_not_counted_and_each_trial_may_take_what_is_left(monkeypatch) -> None:
    now, budgets = [0.0], []

    def time_trial(point: Point, budget_s: float) -> checks.TimedTrial:
        budgets.append(budget_s)
        now[0] += 2
        return checks.TimedTrial(point.number, 2, False)

    monkeypatch.setattr(checks.time, "perf_counter", lambda: now[0])
    monkeypatch.setattr(checks, "_time_trial", time_trial)
    assert len(time_trials(made(), 5)) == 3
    assert budgets == [0, 5, 3, 1]


def test_a_trial_that_fails_is_reported(tmp_path) -> None:
    (tmp_path / "bad.py").write_text(with_step("1 / 0"))
    scenario = load_scenario("pair", [f"robots=[{{controller: {tmp_path}/bad.py, count: 2}}]"])
    with pytest.raises(ScenarioError, match="point 0: a trial fails"):
        time_trials(points(scenario), 1)
