"""What the tests of results share: run folders, made without simulating, whose T_sync follow known laws."""

import csv
import math
import sqlite3
from collections.abc import Callable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from epuck_sim.errors import StoreError
from epuck_sim.runs.database import sign
from epuck_sim.runs.folder import DATABASE
from epuck_sim.runs.reader import PointTrials
from epuck_sim.runs.store import Outcome, Store
from epuck_sim.scenario.loader import Point, load_scenario, points
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.sweep.worker import Task, make_outcome
from epuck_sim.trial.result import TrialResult
from tests.cli.commands import contents
from tests.control.bench import with_step

SPEED, COUPLING, PERIOD = (f"robots.0.parameters.{name}" for name in ("speed_cm_s", "coupling", "period_s"))
WIDTH, HEIGHT, COUNT = "arena.width_cm", "arena.height_cm", "robots.0.count"
PIXELS, LIMIT, SECONDS = "robots.0.camera.central_pixels", "stop.max_cycles", "stop.max_time_s"

MANY_SPEEDS = [0.05, 0.08, 0.13, 0.2, 0.32, 0.5, 0.8, 1.3, 2.0, 3.2, 5.0, 8.0, 12.8]
SPEEDS = [0.2, 0.5, 1.0, 2.0, 5.0]

SHAPE = 1.35  # of the Weibull distributions that trials are drawn from

LOW, PEAK, STEEPNESS = -0.6, 0.3, 4.0


class Trials(NamedTuple):
    times: np.ndarray
    observed: np.ndarray


Law = Callable[[Point], Trials]


def sweep(grid: dict[str, Sequence] | None = None, trials: int = 120, name: str = "demo", **changes: Any) -> Scenario:
    """Return the scenario of a sweep; `changes` may be of any section."""
    axes = {"sweep": {"grid": {key: list(values) for key, values in grid.items()}}} if grid else {}
    return load_scenario({"name": name, "trials": trials, "stop": {"max_cycles": 5000}, **axes, **changes})


def bumpy_mean(speed: float, unit_cm_s: float = 1.0, unit_cycles: float = 90.0) -> float:
    """Return a mean T_sync with a minimum at 10 ^ LOW and a peak at 10 ^ PEAK, in units of speed and time."""
    x = math.log10(speed / unit_cm_s)
    return unit_cycles * math.exp(-STEEPNESS * (x**3 / 3 - (LOW + PEAK) / 2 * x**2 + LOW * PEAK * x))


def extremes(unit_cm_s: float = 1.0, unit_cycles: float = 90.0) -> dict[str, float]:
    """Return where `bumpy_mean` has its minimum and its peak."""
    v_m, v_p = unit_cm_s * 10**LOW, unit_cm_s * 10**PEAK
    times = [bumpy_mean(speed, unit_cm_s, unit_cycles) for speed in (v_m, v_p)]
    return {"v_m": v_m, "t_m": times[0], "v_p": v_p, "t_p": times[1]}


def falling_mean(speed: float) -> float:
    return 60 * speed**-0.5


def weibull(point: Point, mean: float, trials: int | None = None, shape: float = SHAPE) -> Trials:
    """Return the trials of a point, in whole cycles, as a Weibull distribution of this mean gives them."""
    limit = point.scenario.stop.max_cycles
    random = np.random.default_rng(point.seed(0))
    drawn = random.weibull(shape, point.scenario.trials if trials is None else trials)
    times = np.maximum(1, np.rint(drawn * mean / math.gamma(1 + 1 / shape)))
    return Trials(np.minimum(times, limit), times < limit)


def ended(times: Sequence[float], observed: Sequence[bool] | None = None) -> Trials:
    return Trials(np.array(times, float), np.array([True] * len(times) if observed is None else observed, bool))


def censored(point: Point, trials: int) -> Trials:
    return ended([point.scenario.stop.max_cycles] * trials, [False] * trials)


def bumpy(point: Point) -> Trials:
    return weibull(point, bumpy_mean(point.axes[SPEED]))


def falling(point: Point) -> Trials:
    return weibull(point, falling_mean(point.axes[SPEED]))


def in_memory(scenario: Scenario, law: Law) -> list[PointTrials]:
    """Return what `read_points` gives of a folder that `store` has filled."""
    return [of_point(point, law(point)) for point in points(scenario)]


def of_point(point: Point, trials: Trials) -> PointTrials:
    seeds = tuple(point.seed(trial) for trial in range(len(trials.times)))
    has_t_sync = point.scenario.stop.order_parameter is not None
    return PointTrials(*point[:4], *trials, seeds, has_t_sync=has_t_sync)


def outcome(point: Point, trial: int, error: str | None = None, **changes) -> Outcome:
    """Return how a trial might have ended: failed, or with a result in which some fields are as `changes` says."""
    number, task = 1000 * point.number + trial, Task(point, trial, False)
    ends = {"t_sync_cycles": number, "censored": False, "cycles": number, "order_parameter": 0.96 + number / 1e6}
    lasts = {"steps": 50 * number, "simulated_s": 5.0 * number, "wall_s": 0.001 * number}
    result = TrialResult(scenario=point.scenario.name, seed=point.seed(trial), **ends, **lasts)._replace(**changes)
    return make_outcome(task, None if error else result, error)


def store(folder: Path, scenario: Scenario, law: Law, failed: int = 0) -> Path:
    """Make a run folder, of which the first `failed` trials that are left at point 0 have failed."""
    found = points(scenario)
    with Store(folder, scenario, found) as opened:
        for point in found:
            (times, observed), ended = law(point), []
            for trial, (time, is_observed) in enumerate(zip(times.astype(int).tolist(), observed, strict=True)):
                lasts = {"cycles": time, "steps": 50 * time, "simulated_s": 5.0 * time, "wall_s": 0.001}
                ends = {"t_sync_cycles": time if is_observed else None, "censored": not is_observed}
                order = 0.97 if is_observed else 0.5
                ended.append(outcome(point, trial, order_parameter=order, **lasts, **ends))
            failures = range(len(times), len(times) + failed) if point.number == 0 else ()
            opened.add([*ended, *(outcome(point, trial, error=f"gone {trial}") for trial in failures)])
    return folder


def store_measured(folder: Path, scenario: Scenario, law: Callable[[Point], Sequence[Any]]) -> Path:
    """Make a run folder of a scenario with one measure, of which the law gives the value in each trial of a point."""
    (section,) = scenario.measures
    without = {"t_sync_cycles": None, "censored": None, "order_parameter": None, "cycles": 9}
    values = [(point.number, *each) for point in points(scenario) for each in enumerate(law(point))]
    trials = ((number, trial, {"measures": {section.name: value}, **without}) for number, trial, value in values)
    put(folder, *trials, scenario=scenario)
    return folder


def rows(file: Path) -> list[dict[str, str]]:
    with file.open(newline="", encoding="utf-8") as text:
        return list(csv.DictReader(text))


def six_digits(number: float) -> str:
    """Return a number as the tables of figures have it; nothing for what is not finite."""
    return f"{number:.6g}" if math.isfinite(number) else ""


def edit(folder: Path, statement: str, *values: Any) -> None:
    """Change a database with the right checksums, as if its trials had ended otherwise."""
    with closing(sqlite3.connect(folder / DATABASE)) as connection, connection:
        connection.execute(statement, values)
        for table in ("points", "trials"):
            sign(connection, table)


FILES = {".lock", DATABASE, "scenario.yaml", "SHA256SUMS"}  # names of the files in a run folder without users' files

MINE = with_step("actuators.left_cm_s = parameters.pace", PARAMETERS='{"pace": 2.0, "loud": True}')


def scenario_of(sweep: dict | None, **changes) -> Scenario:
    return load_scenario({"name": "demo", "trials": 3, "sweep": sweep, **changes})


DEMO = scenario_of({"grid": {COUNT: [2, 3], SPEED: [1, 0.5]}})


def fill(folder: Path, scenario: Scenario = DEMO, **changes) -> tuple[Point, ...]:
    """Have every trial of a sweep stored in the folder; return its points."""
    every = [(point.number, trial, changes) for point in points(scenario) for trial in range(scenario.trials)]
    return put(folder, *every, scenario=scenario)


def put(folder: Path, *trials: tuple[Any, ...], scenario: Scenario = DEMO) -> tuple[Point, ...]:
    """Store trials, each given by its point's number, its own, and changes of its outcome; return the points."""
    found = points(scenario)
    with Store(folder, scenario, found) as store:
        store.add([outcome(found[point], trial, **dict(*changes)) for point, trial, *changes in trials])
    return found


def stored(folder: Path) -> list[dict]:
    """Return every row of the trials, in order of point and trial, of a database that is whole."""
    with closing(sqlite3.connect(folder / DATABASE)) as connection:
        connection.row_factory = sqlite3.Row
        assert connection.execute("PRAGMA integrity_check").fetchall()[0][0] == "ok"
        assert connection.execute("PRAGMA foreign_key_check").fetchall() == []
        query = "SELECT number, trials.* FROM trials JOIN points ON point = key ORDER BY number, trial"
        rows = [dict(row) for row in connection.execute(query)]
        assert len(rows) == connection.execute("SELECT count(*) FROM trials").fetchone()[0]
    return rows


def refusal(folder: Path, scenario: Scenario) -> str:
    """Return the message of the StoreError with which the folder is refused, nothing in it being touched."""
    before = contents(folder)
    with pytest.raises(StoreError) as caught, Store(folder, scenario, points(scenario)):
        pass
    assert before.items() <= contents(folder).items()
    assert str(caught.value).startswith(f"{folder}: ")
    return str(caught.value)
