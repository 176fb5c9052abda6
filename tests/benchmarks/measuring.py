"""What benchmarks share: swarms, CPU time of pieces of work, memory, and tables."""

import time
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from epuck_sim import EmbodiedScenario, load_scenario
from epuck_sim.arrays import FloatArray

Work = Callable[[], object]


def swarm_of(robots: int, side_cm: float, *settings: str) -> EmbodiedScenario:
    size = [f"robots.0.count={robots}", f"arena.width_cm={side_cm}", f"arena.height_cm={side_cm}"]
    return load_scenario("thesis", [*size, *settings])


def cpu_s(work: Work) -> float:
    """Return the CPU time of a piece of work, of all threads."""
    began = time.process_time()
    work()
    return time.process_time() - began


def resident_kb() -> int:
    """Return how much memory this process takes."""
    (line,) = (line for line in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in line)
    return int(line.split()[1])


def take_turns(works: Mapping[str, Work], rounds: int) -> dict[str, FloatArray]:
    """Return the CPU time of this thread, (rounds,) us, for each call of each work; a first one compiles."""
    spent_us: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(1 + rounds):
        for name, work in works.items():
            began = time.thread_time()
            work()
            spent_us[name].append((time.thread_time() - began) * 1e6)
    return {name: np.array(found[1:]) for name, found in spent_us.items()}


def written(cell: object) -> str:
    """Return a number with three digits or with all before the point, and anything else as it is."""
    if not isinstance(cell, float):
        return str(cell)
    return f"{cell:,.0f}" if abs(cell) >= 1000 else f"{cell:.3g}"


def print_table(columns: tuple[str, ...], rows: list[tuple[object, ...]]) -> None:
    cells = [[written(cell) for cell in row] for row in (columns, *rows)]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    print()
    for row in cells:
        print("  ".join(cell.rjust(width) for cell, width in zip(row, widths, strict=True)), flush=True)
