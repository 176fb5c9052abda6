"""Measures commands on run folders of many trials: `python -m tests.benchmarks.big_folders FOLDER TRIALS...`.

The folders are made without simulating: their rows are as a sweep of ten speeds would have left them.
"""

import os
import random
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from epuck_sim import Point, Scenario, points
from epuck_sim.runs.compatibility import stored_point
from epuck_sim.runs.database import RESULT, new_database, sign
from epuck_sim.runs.folder import DATABASE
from epuck_sim.scenario.loader import RUN_SCENARIO, load_scenario, write_scenario
from epuck_sim.util.provenance import PROVENANCE, host, versions

SPEED = "robots.0.parameters.speed_cm_s"

COMMANDS = {
    "status": ("status",),
    "summarize": ("summarize", "--json"),
    "resume with nothing to do": ("run", "--workers", "1"),
}


def scenario_of(trials: int) -> Scenario:
    return load_scenario("thesis", [f"trials={trials // 10}"], [f"{SPEED}={','.join(map(str, range(1, 11)))}"])


def fill(folder: Path, trials: int) -> None:
    """Make a run folder in which all trials are stored."""
    scenario = scenario_of(trials)
    found = points(scenario)
    folder.mkdir(parents=True)
    (folder / RUN_SCENARIO).write_text(write_scenario(scenario))
    columns = ", ".join([f'point, trial, "{SPEED}", seed', *RESULT, *PROVENANCE])
    with new_database(folder / DATABASE, [SPEED], [stored_point(point) for point in found]) as connection:
        values = ", ".join("?" * (4 + len(RESULT) + len(PROVENANCE)))
        connection.executemany(f"INSERT INTO trials ({columns}) VALUES ({values})", rows(found))
        sign(connection, "trials", ((point.key, trial) for point in found for trial in range(point.scenario.trials)))


def rows(found: tuple[Point, ...]) -> Iterator[tuple]:
    made, generator = {**versions(), "host": host()}, random.Random(1)
    for point in sorted(found, key=lambda point: point.key):
        for trial in range(point.scenario.trials):
            cycles = 1 + int(generator.expovariate(1 / 60))
            result = (cycles, 0, 0.95 + 0.05 * generator.random(), 5.0 * cycles, 0.001 * cycles, 50 * cycles, cycles)
            seed = generator.getrandbits(53)
            yield point.key, trial, point.axes[SPEED], seed, *result, *(made[name] for name in PROVENANCE)


def measure(*arguments: str) -> tuple[float, float, float]:
    """Return seconds on the wall and of CPU, and the peak of memory in MB, of a command."""
    began = time.perf_counter()
    with subprocess.Popen([sys.executable, "-m", "epuck_sim", *arguments], stdout=subprocess.DEVNULL) as process:
        _, code, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(code)
    assert process.returncode == 0, arguments
    return time.perf_counter() - began, used.ru_utime + used.ru_stime, used.ru_maxrss / 1024


def main() -> None:
    for trials in map(int, sys.argv[2:]):
        folder = Path(sys.argv[1]) / str(trials)
        if not folder.exists():
            fill(folder, trials)
        size = (folder / DATABASE).stat().st_size
        print(f"{trials:,} trials: {size / trials:.0f} bytes each", flush=True)
        for name, (command, *options) in COMMANDS.items():
            wall, cpu, memory = measure(command, f"{folder}/", *options)
            print(f"  {name}: {wall:.1f} s, {cpu:.1f} CPU s, {memory:.0f} MB", flush=True)


if __name__ == "__main__":
    main()
