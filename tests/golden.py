"""Golden values: outcomes of shipped scenarios, and of cases, that no change of names or structure may touch.

`python -m tests.golden` writes golden.json anew; do so in a commit that says why outcomes differ. The cases are a
table, golden_cases.yaml: between them, they have each key of a scenario on which outcomes depend. Of each, golden.json
holds the digest of what happens in a simulation, and how two short trials end.
"""

import hashlib
import json
import pickle
import platform
import tempfile
from collections.abc import Callable, Iterable, Iterator
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import yaml

import epuck_sim
from epuck_sim import EmbodiedScenario, ParticleScenario, ParticleSimulation, Simulation, Step, load_scenario, run_trial
from epuck_sim.overhead.film import open_film
from epuck_sim.trial.model import simulate
from epuck_sim.util.builtin import ARENAS, builtin_files

FILE = Path(__file__).with_suffix(".json")
ROOT = FILE.parent.parent
CASES: dict[str, dict[str, Any]] = yaml.load(FILE.with_name("golden_cases.yaml").read_text(), yaml.CSafeLoader)
Felt = Callable[[Step], Iterator[np.ndarray]]
STEPS = 200
SWEEPS = {
    "robots": ["robots.0.parameters.speed_cm_s=1,5", "stop.max_cycles=30"],
    "agents": ["agents.speed_cm_s=0.1,10", "stop.max_cycles=200"],
}


def here() -> dict[str, str]:
    """Return the platform for which digests hold: last digits may differ on another."""
    engines = {name: version(name) for name in ("numba", "numpy", "pymunk")}
    return {"machine": platform.machine(), "system": platform.system(), **engines}


def digest(arrays: Iterable[np.ndarray]) -> str:
    """Return a short name for the bits of arrays."""
    bits = hashlib.sha256()
    for array in arrays:
        bits.update(np.ascontiguousarray(array).tobytes())
    return bits.hexdigest()[:16]


def case(kind: str, name: str) -> EmbodiedScenario | ParticleScenario:
    """Return the scenario of a case of a kind, `robots` or `agents`."""
    changes = dict(CASES[kind][name])
    base = changes.pop("base")
    limit = {"stop.max_time_s": 20} if kind == "robots" else {"stop.max_cycles": 40}
    texts = {key: json.dumps(value).replace('"tests/', f'"{ROOT}/tests/') for key, value in (changes | limit).items()}
    return load_scenario(base, [f"{key}={text}" for key, text in texts.items()])


def felt(step: Step) -> Iterator[np.ndarray]:
    """Yield copies of all that robots sense, do and remember in a step, and of who sees and touches whom."""
    yield from (step.poses.copy(), step.infrared.copy(), step.distance_mm.copy(), step.camera.copy())
    yield from (step.wheels_cm_s.copy(), step.ring_on.copy(), step.ring_commands.copy(), step.movables.copy())
    yield from (step.present.copy(), step.phase_ms, step.flash_seen, step.sightings, step.contacts)
    for memory in step.memories:
        for name in memory.dtype.names or ():
            yield memory[name].copy()


def felt_of_shipped(step: Step) -> Iterator[np.ndarray]:
    """Yield the same of robots of a shipped scenario, as golden.json has it: without presence, sights and contacts."""
    fields = (step.poses, step.infrared, step.distance_mm, step.camera, step.wheels_cm_s, step.ring_on)
    yield from (array.copy() for array in (*fields, step.phase_ms, step.flash_seen, *step.memories))


def happened(simulation: ParticleSimulation, *, is_case: bool) -> Iterator[np.ndarray]:
    """Yield what happens to agents in many events, and how they are after them."""
    for event in islice(simulation, 1000 if is_case else 2000):
        yield from (np.array([event.time_s]), event.fired, event.received)
    yield from (simulation.positions(), simulation.headings(), simulation.phases())
    if is_case:
        yield simulation.periods_s
        if simulation.scenario.neighbourhood.kind != "random":
            yield simulation.neighbour_links()


def endings(scenario: EmbodiedScenario | ParticleScenario) -> list[list[Any]]:
    """Return how some trials end: cycles, whether they are censored, order parameter, measures and events in short."""
    results = [run_trial(simulate(scenario, seed)) for seed in range(2)]
    further = [json.dumps([dict(result.measures), list(map(list, result.events))]) for result in results]
    return [
        [result.cycles, result.censored, result.order_parameter, digest([np.array(text)])]
        for result, text in zip(results, further, strict=True)
    ]


def robots(scenario: EmbodiedScenario | str, felt: Felt, first: int | None = None) -> dict[str, Any]:
    """Return the digest of what robots sense and do, and where some are after first steps: a second, and one more."""
    simulation, other = (Simulation(scenario, seed=1) for _ in range(2))
    arrays = [array for step in islice(simulation, STEPS) for array in felt(step)]
    early = other.advance(first or round(1 / simulation.step_s) + 1)
    return {"digest": digest(arrays), "poses": early.poses[early.present][:3].tolist()}


def commanded(*, stop_at: int | None = None) -> dict[str, str]:
    """Return the digest of robots that are driven from outside, whose parameters change, and others.

    Args:
        stop_at: Step after which a simulation goes on as a copy of its own, made by pickle; None for none.
    """
    robots = [{"count": 3, "controller": "external"}, {"count": 2, "controller": "external_ring"}, {"count": 3}]
    simulation, arrays = Simulation({"robots": robots}, seed=1), []
    for number in range(STEPS // 2):
        step = next(simulation)
        arrays += felt(step)
        if number % 7 == 3:
            speed = 12.0 * np.cos(np.arange(3) + number)
            simulation.command(speed, speed[::-1] - 2, np.arange(5) % 3 == number % 3)
        if number == 30:
            simulation.set_parameters(2, speed_cm_s=3.0, coupling=0.5)
        if number == stop_at:
            simulation = pickle.loads(pickle.dumps(simulation))
    return {"digest": digest(arrays)}


def agents(scenario: ParticleScenario | str, *, is_case: bool) -> dict[str, Any]:
    """Return the digest of what happens to agents, and some of their phases after half a second."""
    simulation, early = (ParticleSimulation(scenario, seed=1) for _ in range(2))
    early.run_to(0.5)
    return {"digest": digest(happened(simulation, is_case=is_case)), "phases": early.phases()[:5].tolist()}


def case_values(kind: str, name: str) -> dict[str, Any]:
    given = case(kind, name)
    values = robots(given, felt) if kind == "robots" else agents(given, is_case=True)
    return {**values, "trials": endings(given)}


def scenario(name: str) -> dict[str, Any]:
    is_of_agents = load_scenario(name).model == "particles"
    return agents(name, is_case=False) if is_of_agents else robots(name, felt_of_shipped, 11)


def outcomes(name: str, seeds: range) -> list[list[Any]]:
    """Return cycles, whether they are censored, and the order parameter of some trials."""
    found = load_scenario(name, ["stop.max_cycles=200"])
    results = [run_trial(simulate(found, seed)) for seed in seeds]
    return [[result.cycles, result.censored, result.order_parameter] for result in results]


def sweep(model: str, folder: Path) -> list[dict[str, Any]]:
    """Return the cycles of each trial of a small sweep, and the statistics of its points."""
    axis, limit = SWEEPS[model]
    found = load_scenario("thesis" if model == "robots" else "particles", [limit, "trials=6"], [axis])
    epuck_sim.run_sweep(found, folder, workers=2)
    points = epuck_sim.read_points(folder)
    statistics = [point.record() for point in epuck_sim.summarize(points)]
    return [
        {"times": point.times.tolist(), "weibull_mean": row["weibull_mean"], "median": row["median"]}
        for point, row in zip(points, statistics, strict=True)
    ]


def pictures(folder: Path) -> dict[str, str]:
    """Return digests of a recording's contents and of a film's frames."""
    found = load_scenario("thesis", ["stop.max_cycles=2"])
    recording, film = epuck_sim.record(folder / "t.rrd", found, 3), epuck_sim.film_trial(folder / "t.mp4", found, 3)
    with recording as recorder, film as camera:
        run_trial(Simulation(found, 3), [recorder, camera])
    recorded = epuck_sim.read_recording(folder / "t.rrd")
    # but for the headings: numpy's arctan2 differs among processors in the last digit
    arrays = [recorded.time_s, recorded.positions, recorded.ring_on, recorded.phase_ms]
    with open_film(str(folder / "t.mp4")) as opened:
        frames = [frame.picture for frame in opened.frames()]
    return {"recording": digest(arrays), "film": digest(frames)}


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        golden = {
            "platform": here(),
            "scenarios": {name: scenario(name) for name in builtin_files(ARENAS)},
            "outcomes": {name: outcomes(name, range(6)) for name in ("thesis", "particles")},
            "sweeps": {model: sweep(model, Path(folder) / model) for model in SWEEPS},
            "pictures": pictures(Path(folder)),
            "commanded": commanded(),
            "cases": {kind: {name: case_values(kind, name) for name in names} for kind, names in CASES.items()},
        }
    FILE.write_text(json.dumps(golden, indent=1) + "\n")


if __name__ == "__main__":
    main()
