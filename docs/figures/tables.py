"""The trials that figures of the docs show, in docs/trials/figures; docs/figures/sweeps.yaml has their sweeps.

`python -m docs.figures.tables FOLDER` puts them into run folders in FOLDER, from which `make figures` draws;
`python -m docs.figures.tables --run FOLDER` first runs those that are missing there, for hours, and writes the tables.
"""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

from docs.trials import COLUMNS, read_table, table_file, write_table
from epuck_sim import Scenario, load_scenario, points, read_points, run_sweep
from epuck_sim.runs.database import measures_in, reading
from epuck_sim.runs.store import Store
from epuck_sim.scenario.changes import TrialEvent
from epuck_sim.sweep.worker import Task, make_outcome
from epuck_sim.trial.result import TrialResult
from epuck_sim.util.yaml_io import read_yaml

SWEEPS = Path(__file__).with_name("sweeps.yaml")
TABLES = "figures"  # in docs/trials


def sweeps() -> dict[str, Scenario]:
    """Return the scenarios of all sweeps, by name."""
    found = {}
    for name, keys in read_yaml(SWEEPS).items():
        settings = [*keys.get("settings", ()), f"trials={keys['trials']}"]
        source, axes = keys.get("scenario", name), keys.get("axes", ())
        found[name] = load_scenario(source, settings, axes, quick=keys.get("quick", False))
    return found


def write(name: str, scenario: Scenario, folder: Path) -> None:
    """Write the table of a run folder."""
    with reading(folder) as connection:
        measures = measures_in(connection)
    stored = read_points(folder)
    columns: dict[str, list[Any]] = {
        measure: [value for point in read_points(folder, measure) for value in point.measured] for measure in measures
    }
    events = [[event._asdict() for event in trial] for point in stored for trial in point.events]
    if any(events):
        columns["events"] = events
    write_table(f"{TABLES}/{name}", stored, points(scenario), columns)


def restore(name: str, scenario: Scenario, folder: Path) -> None:
    """Put the trials of a table into a run folder, without what tables do not have: steps, computing time, versions."""
    swept, table = points(scenario), read_table(f"{TABLES}/{name}")
    further_columns = [*table.columns][len(COLUMNS) :]
    columns = {column: [*map(json.loads, table.columns[column])] for column in further_columns}
    outcomes = []
    for row, (number, cycles, observed) in enumerate(zip(table.points, table.times, table.observed, strict=True)):
        trial = row - int(np.searchsorted(table.points, number))
        further = {column: values[row] for column, values in columns.items()}
        events = tuple(TrialEvent(**event) for event in further.pop("events", ()))
        last = 0 if np.isnan(cycles) else int(cycles)
        task = Task(swept[number], trial, False)
        result = TrialResult(
            scenario=scenario.name,
            seed=task.point.seed(trial),
            t_sync_cycles=last if observed else None,
            censored=not observed if table.has_t_sync else None,
            cycles=last,
            order_parameter=None,
            steps=0,
            simulated_s=0.0,
            wall_s=0.0,
            measures=further,
            events=events,
        )
        ended = make_outcome(task, result, None)
        outcomes.append(ended._replace(provenance=(*ended.provenance[:-1], "docs/trials")))
    with Store(folder, scenario, swept) as store:
        store.add(outcomes)


def main(*arguments: str) -> None:
    """Fill run folders from tables; with `--run`, and where there is no table, run what is missing and write it."""
    folder = Path(arguments[-1])
    for name, scenario in sweeps().items():
        if "--run" in arguments or not table_file(f"{TABLES}/{name}").exists():
            run_sweep(scenario, folder / name)
            write(name, scenario, folder / name)
        else:
            restore(name, scenario, folder / name)
        print(name, flush=True)


if __name__ == "__main__":
    main(*sys.argv[1:])
