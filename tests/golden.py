"""Golden values: outcomes of shipped scenarios that no change of names or structure may touch.

`python -m tests.golden` writes golden.json anew; do so in a commit that says why outcomes differ.
"""

import hashlib
import json
import platform
import tempfile
from collections.abc import Iterable
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from epuck_sim import (
    ParticleSimulation,
    Simulation,
    film_trial,
    load_scenario,
    read_points,
    read_recording,
    record,
    run_sweep,
    run_trial,
    summarize,
)
from epuck_sim.overhead.film.reader import open_film
from epuck_sim.sweep.executors import local_pool
from epuck_sim.trial.model import simulate
from epuck_sim.util.builtin import ARENAS, builtin_files

FILE = Path(__file__).with_suffix(".json")
ENGINES = ("numba", "numpy", "pymunk")
STEPS = 200
EVENTS = 2000
SWEEPS = {
    "robots": ["robots.0.parameters.speed_cm_s=1,5", "stop.max_cycles=30"],
    "agents": ["agents.speed_cm_s=0.1,10", "stop.max_cycles=200"],
}


def here() -> dict[str, str]:
    """Return the platform for which digests hold: last digits may differ on another."""
    engines = {name: version(name) for name in ENGINES}
    return {"machine": platform.machine(), "system": platform.system(), **engines}


def digest(arrays: Iterable[np.ndarray]) -> str:
    """Return a short name for the bits of arrays."""
    bits = hashlib.sha256()
    for array in arrays:
        bits.update(np.ascontiguousarray(array).tobytes())
    return bits.hexdigest()[:16]


def embodied(name: str, *, interpret: bool = False) -> dict[str, Any]:
    """Return the digest of all that robots sense, do and remember, and where they are after one second."""
    simulation, arrays = Simulation(name, seed=1, interpret=interpret), []
    for step in islice(simulation, STEPS):
        fields = (step.poses, step.infrared, step.distance_mm, step.camera, step.wheels_cm_s, step.ring_on)
        arrays += [array.copy() for array in (*fields, step.phase_ms, step.flash_seen, *step.memories)]
    early = islice(Simulation(name, seed=1), 11)
    *_, last = (step.poses.copy() for step in early)
    return {"digest": digest(arrays), "poses": last[:3].tolist()}


def particles(name: str) -> dict[str, Any]:
    """Return the digest of the first events of agents, and their phases after half a second."""
    simulation, arrays = ParticleSimulation(name, seed=1), []
    for event in islice(simulation, EVENTS):
        arrays += [np.array([event.time_s]), event.fired, event.received]
    arrays += [simulation.positions(), simulation.headings(), simulation.phases()]
    early = ParticleSimulation(name, seed=1)
    early.run_to(0.5)
    return {"digest": digest(arrays), "phases": early.phases()[:5].tolist()}


def scenario(name: str) -> dict[str, Any]:
    """Return the golden values of a shipped scenario."""
    return particles(name) if load_scenario(name).model == "particles" else embodied(name)


def outcomes(name: str, seeds: range) -> list[list[Any]]:
    """Return cycles, whether they are censored, and the order parameter of some trials."""
    found = load_scenario(name, ["stop.max_cycles=200"])
    results = [run_trial(simulate(found, seed)) for seed in seeds]
    return [[result.cycles, result.censored, result.order_parameter] for result in results]


def sweep(model: str, folder: Path) -> list[dict[str, Any]]:
    """Return the cycles of each trial of a small sweep, and the statistics of its points."""
    axis, limit = SWEEPS[model]
    found = load_scenario("thesis" if model == "robots" else "particles", [limit, "trials=6"], [axis])
    run_sweep(found, folder, lambda: local_pool(2))
    points = read_points(folder)
    statistics = [point._asdict() for point in summarize(points)]
    return [
        {"times": point.times.tolist(), "weibull_mean": row["weibull_mean"], "median": row["median"]}
        for point, row in zip(points, statistics, strict=True)
    ]


def pictures(folder: Path) -> dict[str, str]:
    """Return digests of a recording's contents and of a film's frames."""
    found = load_scenario("thesis", ["stop.max_cycles=2"])
    with record(folder / "t.rrd", found, 3) as recorder, film_trial(folder / "t.mp4", found, 3) as camera:
        run_trial(Simulation(found, 3), [recorder, camera])
    recorded = read_recording(folder / "t.rrd")
    arrays = [recorded.time_s, recorded.positions, recorded.headings, recorded.ring_on, recorded.phase_ms]
    with open_film(str(folder / "t.mp4")) as film:
        frames = [frame.picture for frame in film.frames()]
    return {"recording": digest(arrays), "film": digest(frames)}


def main() -> None:
    """Write the golden values of this platform."""
    with tempfile.TemporaryDirectory() as folder:
        golden = {
            "platform": here(),
            "scenarios": {name: scenario(name) for name in builtin_files(ARENAS)},
            "outcomes": {name: outcomes(name, range(6)) for name in ("thesis", "particles")},
            "sweeps": {model: sweep(model, Path(folder) / model) for model in SWEEPS},
            "pictures": pictures(Path(folder)),
        }
    FILE.write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
