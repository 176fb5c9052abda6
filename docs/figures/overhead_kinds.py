"""Makes docs/figures/overhead_kinds.csv: the tracker on kinds of films by a renderer that it was not tuned on.

Each film shows ten robots that flash at random times and, from the fourth of seven periods on, together. It is tracked
twice: told corners, height, period and number of robots, where positions are compared with the true ones; and told
nothing but the size of the arena and the camera's height. With a number as its argument it films that many films of
each kind instead of 20; 20 take an hour or more on an idle core.
"""

import csv
import sys
import tempfile
from pathlib import Path

import numpy as np

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film.writer import film_file
from epuck_sim.overhead.track.film_calibration import TrackOptions
from epuck_sim.overhead.track.track_film import track_film
from tests.overhead.score import Score, compare
from tests.overhead.track.films import passed, read_rings
from tests.overhead.webcam import KINDS, shoot, swarm

FILMS = 20
CYCLES, TOGETHER_FROM, PERIOD_S = 7, 3, 2.0
TRUE_PERIODS = TOGETHER_FROM + 0.5 + 0.075 / 2
WITHIN_PERIODS = 0.25
HEADER = [
    *("kind", "films", "rings", "found_percent", "right_percent", "rms_mm", "worst_mm"),
    *("told_right", "told_refused", "told_wrong", "alone_right", "alone_refused", "alone_wrong"),
]


def verdict(film: Path, options: TrackOptions, rings: Path | None) -> int:
    """Return 0 if T_sync is right, 1 if the tracker says that it cannot tell, 2 if it is wrong."""
    try:
        track = track_film(str(film), options, rings, passed)
    except FilmError:
        return 1
    if track.t_sync_periods is None:
        return 1 if track.confidence == "none" else 2
    true_s = TRUE_PERIODS * PERIOD_S
    return 0 if abs(track.t_sync_s - true_s) <= WITHIN_PERIODS * PERIOD_S else 2


def examine(kind: str, seed: int, folder: Path) -> tuple[Score, int, int]:
    """Return how well the rings of a film are found, and the verdicts about its T_sync."""
    camera = KINDS[kind]
    robots = swarm(10, CYCLES, TOGETHER_FROM, seed, period_s=PERIOD_S)
    film, table = folder / "film.mp4", folder / "rings.csv"
    truth = []
    with film_file(film, *camera.size_px, {}) as writer:
        for frame, lit_cm in shoot(camera, robots, frames_per_s=12.0):
            writer.write(frame)
            truth.append((frame.time_s, lit_cm))
    alone = TrackOptions(robots.arena_cm, camera.above_cm)
    corners = tuple((float(x), float(y)) for x, y in camera.floor_px(robots.arena_cm))
    table.unlink(missing_ok=True)
    told = verdict(film, alone._replace(corners_px=corners, period_s=PERIOD_S, robots=10), table)
    rows = read_rings(table) if table.exists() else []
    score = Score()
    for time_s, lit_cm in truth:
        reported = [(row["x_cm"], row["y_cm"]) for row in rows if abs(row["time_s"] - time_s) < 2e-3]
        score += compare(np.array(reported).reshape(-1, 2), lit_cm, np.empty((0, 2)))
    return score, told, verdict(film, alone, None)


def main(films: int) -> None:
    """Write the table, a row as soon as its kind is done."""
    with Path(__file__).with_name("overhead_kinds.csv").open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(HEADER)
        for kind in KINDS:
            total, told, alone = Score(), [0, 0, 0], [0, 0, 0]
            with tempfile.TemporaryDirectory() as folder:
                for seed in range(films):
                    score, *verdicts = examine(kind, seed, Path(folder))
                    total += score
                    told[verdicts[0]] += 1
                    alone[verdicts[1]] += 1
            shares = f"{100 * total.recall:.1f}", f"{100 * total.precision:.1f}"
            errors = f"{10 * total.rms_cm:.2f}", f"{10 * total.worst_cm:.1f}"
            row = [kind, films, total.found + total.missed, *shares, *errors, *told, *alone]
            writer.writerow(row)
            file.flush()
            print(*row, sep=", ", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else FILMS)
