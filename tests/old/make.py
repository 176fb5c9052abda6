"""Files as the present version writes them, for versions to come: `python -m tests.old.make` before a version's end.

They are written once, into a folder with the version's name, with the values that they hold in values.json; later
versions open them for ever (see tests/test_old_versions.py), and nobody makes those of an old version anew.
"""

import json
import platform
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq

import epuck_sim
from epuck_sim import Simulation, load_scenario, read_points, run_sweep, run_trial
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import calibrate_lens, find_views, read_lens, save_lens
from epuck_sim.overhead.film import open_film
from epuck_sim.overhead.track import track_film
from epuck_sim.runs.compatibility import Share
from epuck_sim.runs.reader import read_status
from epuck_sim.trial.model import simulate
from tests.golden import digest
from tests.overhead.cameras import charuco, film_of, lens_matrix
from tests.sweep.pool_here import pool_here

HERE = Path(__file__).parent
RUN, SHARES, RECORDINGS = "run", ("share-1", "share-2"), ("robots.rrd", "agents.rrd")
FILM, LENS, TRACE = "film.mp4", "lens.json", "trace.parquet"
LENS_SIZE = (640, 480)

ROBOTS = {
    "name": "robots",
    "robots": [{"count": 3, "parameters": {"period_s": 2, "speed_cm_s": 3}}, {"count": 1, "controller": "constant"}],
    "faults": [{"kind": "ring_dead", "robots": [1], "at_s": 3, "until_s": 5}],
    "schedule": [{"at_s": 4, "set": {"robots.0.parameters.coupling": 0.3}}],
    "measures": ["near_walls", "largest_cluster"],
    "stop": {"max_cycles": 5},
    "seed": 7,
}
AGENTS = {"name": "agents", "model": "particles", "agents": {"count": 6, "speed_cm_s": 20}, "trials": 5}
AGENTS |= {"measures": ["largest_cluster"], "stop": {"max_cycles": 30}}
QUICK = {"period_s": 2, "speed_cm_s": 2, "coupling": 0.5}
FILMED = {
    "name": "filmed",
    "robots": [{"count": 3, "parameters": QUICK, "signal": {"kind": "cone"}}],
    "stop": {"max_cycles": 8, "further_cycles": 8},
    "overhead": {"width_px": 200, "height_px": 200, "noise_levels": 0},
}


def make(folder: Path) -> None:
    """Write one file of each kind into a folder."""
    folder.mkdir()
    run_sweep(load_scenario(ROBOTS, ["trials=3"], ["robots.0.count=2,3"]), folder / RUN, pool_here)
    agents = load_scenario(AGENTS, axes=["neighbourhood.k=1,2"])
    for number, name in enumerate(SHARES, start=1):
        run_sweep(agents, folder / name, pool_here, share=Share(number, len(SHARES)))
    for given, name in zip((ROBOTS, AGENTS), RECORDINGS, strict=True):
        scenario = load_scenario(given)
        with epuck_sim.record(folder / name, scenario, 5) as recorder:
            run_trial(simulate(scenario, 5), [recorder])
    filmed = load_scenario(FILMED)
    with epuck_sim.film_trial(folder / FILM, filmed, 5) as camera:
        run_trial(Simulation(filmed, 5), [camera])
    robots = load_scenario(ROBOTS)
    with epuck_sim.Trace(folder / TRACE, robots, 5, memory=["rotation_time"], relations=True) as trace:
        run_trial(Simulation(robots, 5), [trace])
    frames = film_of(charuco(9, 6), lens_matrix(420.0), np.array([-0.1, 0, 0, 0]))
    save_lens(folder / LENS, calibrate_lens("film", find_views(frames, (9, 6), is_charuco=True), LENS_SIZE, False))


def run_values(path: Path) -> dict[str, Any]:
    points, status = read_points(path, of="largest_cluster"), read_status(path)
    return {
        "points": [
            [point.axes, list(map(int, point.seeds)), point.times.tolist(), point.observed.tolist(), point.events]
            for point in points
        ],
        "largest_cluster": [point.measured for point in points],
        "medians": [row.record()["median"] for row in epuck_sim.summarize(read_points(path))],
        "status": [status.trials, status.stored, status.censored, len(status.failed), status.share],
        "made_by": [made.made_by["epuck_sim"] for made in status.versions],
    }


def recording_values(path: Path) -> dict[str, Any]:
    held = epuck_sim.read_recording(path)
    names = ("time_s", "positions", "headings", "ring_on", "phase_ms")
    arrays = {**{name: getattr(held, name) for name in names}, "flashes": held.flash_s}
    return {
        "scenario": [held.scenario.name, held.scenario.population, held.seed, held.cycles, held.synchronised],
        "made_by": held.versions["epuck_sim"],
        "shapes": {name: array.shape for name, array in arrays.items()},
        "digests": {name: digest([array]) for name, array in arrays.items()},
        "events": held.events,
    }


def film_values(path: Path) -> dict[str, Any]:
    """Return what a film holds, and what is found in it."""
    with open_film(str(path)) as opened:
        frames, description = list(opened.frames()), opened.description
    tracked = track_film(str(path), TrackOptions(), None, lambda read, _: read).summary()
    return {
        "description": description,
        "frames": [len(frames), frames[0].picture.shape, frames[-1].time_s],
        "colours": np.mean([frame.picture.mean(axis=(0, 1)) for frame in frames], axis=0).tolist(),
        "tracked": {name: value for name, value in tracked.items() if name != "film"},
    }


def trace_values(path: Path) -> dict[str, Any]:
    table = pq.read_table(path)
    metadata = {name.decode(): text.decode() for name, text in table.schema.metadata.items()}
    columns = {name: str(table[name].type) for name in table.column_names}
    numbers = [name for name, kind in columns.items() if kind in {"double", "int32"}]
    return {
        "columns": columns,
        "rows": table.num_rows,
        "digest": digest(table[name].to_numpy() for name in numbers),
        "scenario": digest([np.array(metadata["scenario"])]),
        "seed": metadata["seed"],
        "made_by": json.loads(metadata["versions"])["epuck_sim"],
    }


READERS: dict[str, Callable[[Path], dict[str, Any]]] = {  # the reader of each file
    **dict.fromkeys((RUN, *SHARES), run_values),
    **dict.fromkeys(RECORDINGS, recording_values),
    FILM: film_values,
    LENS: lambda path: read_lens(path, LENS_SIZE)._asdict(),
    TRACE: trace_values,
}


def values(folder: Path, name: str) -> dict[str, Any]:
    """Return what a file holds, as JSON keeps it."""
    return json.loads(json.dumps(READERS[name](folder / name)))


def main() -> None:
    """Write the files of this version, and what they hold."""
    platform.node = lambda: "lab"
    folder = HERE / epuck_sim.__version__
    make(folder)
    held = {name: values(folder, name) for name in READERS}
    (folder / "values.json").write_text(json.dumps(held, indent=1) + "\n")


if __name__ == "__main__":
    main()
