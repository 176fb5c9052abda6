"""What the tests of sweeps share: a sweep of short trials, and a run folder's table without what may differ."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from subprocess import Popen
from types import MappingProxyType
from typing import Any

from epuck_sim.runs.database import reading
from epuck_sim.runs.folder import DATABASE
from epuck_sim.sweep.run import SweepProgress
from tests.processes import COMMAND, start


def short_sweep(folder: Path, trials: int = 30) -> Path:
    """Write a sweep of 8 points whose trials take some milliseconds; some of them are censored."""
    path = folder / "short.yaml"
    path.write_text(
        f"""
arena: {{width_cm: 40, height_cm: 40}}
robots: [{{count: 3, controller: firefly}}]
stop: {{max_cycles: 12}}
trials: {trials}
sweep:
  zip: {{robots.0.parameters.coupling: [0.1, 0.3], robots.0.parameters.period_s: [5, 2.5]}}
  grid: {{robots.0.parameters.speed_cm_s: [1, 4, 8, 12]}}
"""
    )
    return path


def agents_sweep(measures: Sequence[Any], trials: int = 3, **sections: Any) -> dict[str, Any]:
    """Return the keys of a sweep of point agents over two sizes of the swarm, with measures."""
    given = {"name": "demo", "model": "particles", "trials": trials, "stop": {"max_cycles": 6}}
    return {**given, "measures": [*measures], "sweep": {"grid": {"agents.count": [5, 8]}}, **sections}


def table(folder: Path) -> list[tuple]:
    """Return every trial's row, without wall time and host, and check that the database is intact."""
    with reading(folder) as connection:
        assert connection.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
        names = [row[1] for row in connection.execute("PRAGMA table_info(trials)")]
        columns = ", ".join(f'"{name}"' for name in names if name not in ("wall_s", "host", "checksum"))
        return connection.execute(f"SELECT {columns} FROM trials ORDER BY point, trial").fetchall()


def errors(folder: Path) -> dict[tuple[str, int], str]:
    """Return the error of each trial that failed, by its point and number."""
    with reading(folder) as connection:
        rows = connection.execute("SELECT point, trial, error FROM trials WHERE error IS NOT NULL")
        return {(point, trial): error for point, trial, error in rows}


def stored(folder: Path) -> int:
    """Return how many trials a run folder holds; 0 while there is none."""
    if not (folder / DATABASE).exists():
        return 0
    with reading(folder) as connection:
        return connection.execute("SELECT count(*) FROM trials").fetchone()[0]


def begin(*arguments: str | Path, folder: Path, mark: str = "", env: Mapping[str, str] = MappingProxyType({})) -> Popen:
    """Start a run in `folder`, with `env` added to the environment; `mark` is in that of all its processes."""
    return start([*COMMAND, "run", *arguments], mark, cwd=folder, env=env)


class Stopped(Exception):  # noqa: N818 no error
    """A run is stopped."""


def stopper(after: int) -> Callable[[SweepProgress], None]:
    """Return an observer that stops a run after so many trials, or those that were stored together with them."""

    def stop(progress: SweepProgress) -> None:
        if progress.ended >= after:
            raise Stopped

    return stop
