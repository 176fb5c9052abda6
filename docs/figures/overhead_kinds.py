"""Makes docs/figures/overhead_kinds.csv: the tracker on kinds of films by a renderer that it was not tuned on.

Each film shows ten robots that flash at random times and, from the fourth of seven periods on, together. It is tracked
twice: told corners, height, period and number of robots, where positions are compared with the true ones; and told
nothing but the size of the arena and the camera's height. OpenCV's HoughCircles, told the radius of the rings, is the
yardstick. With a number as its argument it makes that many films of each kind instead of 20; names of kinds after it
choose these. Films are made in turn, one of each kind and then the next of each, and each goes to overhead_films.csv at
once: those that are there are not made again, and the table is of all of them. To repeat films, delete their rows.
"""

import csv
import sys
import tempfile
from functools import reduce
from operator import add
from pathlib import Path
from typing import NamedTuple

import cv2
import numpy as np

from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import csv_text
from epuck_sim.errors import FilmError
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.camera import Picture
from epuck_sim.overhead.film import film_file
from epuck_sim.overhead.track import track_film
from tests.overhead.films import Score, compare, passed, read_rings, score_rows
from tests.overhead.webcam import KINDS, LED_CIRCLE_CM, LED_HEIGHT_CM, shoot, swarm

BRIGHT = 60  # level of a pixel's brightest colour from which it is bright

EDGE, VOTES = 100, 20
"""Upper threshold of Canny's edges, and number of votes of a circle: with fewer, good films show false ones."""

FILMS = 20
NOWHERE = np.empty((0, 2))
SCALE = 0.6  # size of the pictures, relative to those of the kinds, which are 480 pixels high: most are 288 x 288

CYCLES, TOGETHER_FROM, PERIOD_S = 7, 3, 2.0
TRUE_PERIODS = TOGETHER_FROM + 0.5 + 0.075 / 2
WITHIN_PERIODS = 0.25
FILMS_CSV, KINDS_CSV = (Path(__file__).with_name(f"overhead_{what}.csv") for what in ("films", "kinds"))
HEADER = (
    "kind films rings found_percent right_percent worst_found_percent rms_mm worst_mm t_sync_error_periods "
    "told_right told_refused told_wrong alone_right alone_refused alone_wrong "
    "hough_found_percent hough_right_percent hough_rms_mm"
)


def hough_rings(picture: Picture, radius_px: float) -> FloatArray:
    """Return (n, 2) px: columns and rows of the middles of circles of about this radius in a picture."""
    bright = np.where(picture.max(axis=2) >= BRIGHT, 255, 0).astype(np.uint8)
    if not bright.any():
        return NOWHERE
    found = cv2.HoughCircles(
        cv2.GaussianBlur(bright, (5, 5), 1.0),
        cv2.HOUGH_GRADIENT,
        dp=1.5,
        minDist=1.8 * radius_px,
        param1=EDGE,
        param2=VOTES,
        minRadius=round(0.8 * radius_px),
        maxRadius=round(1.35 * radius_px),
    )
    return NOWHERE if found is None else np.asarray(found, float).reshape(-1, 3)[:, :2]


class Examined(NamedTuple):
    """How well a film was tracked."""

    kind: str
    seed: int
    told: int  # verdict about T_sync: 0 if it is right, 1 if the tracker says that it cannot tell, 2 if it is wrong
    alone: int
    error_periods: float  # error of T_sync where the tracker is told all, in periods; NaN if there is none
    rings: Score
    hough: Score

    def row(self) -> list[object]:
        """Return a row of overhead_films.csv."""
        return [*self[:4], f"{self.error_periods:.4f}", *_rounded(self.rings), *_rounded(self.hough)]


def _rounded(score: Score) -> list[object]:
    return [*score[:3], f"{score.worst_cm:.4f}", f"{score.squares_cm2:.5f}"]


def examined_of(row: list[str]) -> Examined:
    """Return the film of a row of overhead_films.csv."""
    counts = len(Score._fields)
    rings, hough = (Score(*map(int, part[:3]), *map(float, part[3:])) for part in (row[5 : 5 + counts], row[-counts:]))
    seed, told, alone = map(int, row[1:4])
    return Examined(row[0], seed, told, alone, float(row[4]), rings, hough)


def verdict(film: Path, options: TrackOptions, rings: Path | None) -> tuple[int, float]:
    """Return the verdict about T_sync, and its error in periods."""
    try:
        track = track_film(str(film), options, rings, passed)
    except FilmError:
        return 1, np.nan
    if track.histogram_s is None:
        return 1 if track.confidence == "none" else 2, np.nan
    error_periods = track.histogram_s / PERIOD_S - TRUE_PERIODS
    return 0 if abs(error_periods) <= WITHIN_PERIODS else 2, error_periods


def examine(kind: str, seed: int, folder: Path) -> Examined:
    """Return how well the rings of a film are found, and the verdicts about its T_sync."""
    camera = KINDS[kind].scaled(SCALE)
    px_per_cm = camera.focal_px / (camera.above_cm - LED_HEIGHT_CM)
    robots = swarm(10, CYCLES, TOGETHER_FROM, seed, period_s=PERIOD_S)
    film, table = folder / "film.mp4", folder / "rings.csv"
    width_px, height_px = camera.size_px
    truth, hough = [], Score()
    with film_file(film, width_px, height_px, {}) as writer:
        for frame, lit_cm in shoot(camera, robots, frames_per_s=12.0):
            writer.write(frame)
            truth.append((frame.time_s, lit_cm, NOWHERE))
            crests_cm = np.column_stack([lit_cm, np.full(len(lit_cm), LED_HEIGHT_CM)])
            at_px = camera.project(crests_cm, robots.arena_cm) if len(lit_cm) else NOWHERE
            circles = hough_rings(frame.picture, LED_CIRCLE_CM * px_per_cm)
            hough += compare(circles / px_per_cm, at_px / px_per_cm, NOWHERE)
    alone = TrackOptions(robots.arena_cm, camera.above_cm)
    corners = tuple((float(x), float(y)) for x, y in camera.floor_px(robots.arena_cm))
    table.unlink(missing_ok=True)
    told, error_periods = verdict(film, alone._replace(corners_px=corners, period_s=PERIOD_S, robots=10), table)
    score = score_rows(read_rings(table) if table.exists() else [], truth)
    return Examined(kind, seed, told, verdict(film, alone, None)[0], error_periods, score, hough)


def row_of(kind: str, films: list[Examined]) -> list[object]:
    """Return the row of a kind."""
    total, hough = (reduce(add, scores) for scores in zip(*((film.rings, film.hough) for film in films), strict=True))
    errors = np.abs([film.error_periods for film in films])
    verdicts = [[film[place] for film in films].count(which) for place in (2, 3) for which in range(3)]
    return [
        *(kind, len(films), total.found + total.missed, f"{100 * total.recall:.1f}", f"{100 * total.precision:.1f}"),
        f"{100 * min(film.rings.recall for film in films):.1f}",
        *(f"{10 * total.rms_cm:.2f}", f"{10 * total.worst_cm:.1f}"),
        "" if np.isnan(errors).all() else f"{np.nanmax(errors):.3f}",
        *verdicts,
        *(f"{100 * hough.recall:.1f}", f"{100 * hough.precision:.1f}", f"{10 * hough.rms_cm:.2f}"),
    ]


def films_made() -> list[Examined]:
    """Return the films of overhead_films.csv."""
    if not FILMS_CSV.exists():
        return []
    with FILMS_CSV.open(newline="") as file:
        return [examined_of(row) for row in list(csv.reader(file))[1:]]


def main(films: int, kinds: list[str]) -> None:
    """Make the films that are not yet made, and write both tables after each."""
    scores = [f"{whose}_{field}" for whose in ("tracker", "hough") for field in Score._fields]
    made = films_made()
    for seed in range(films):
        for kind in kinds:
            if any((film.kind, film.seed) == (kind, seed) for film in made):
                continue
            with tempfile.TemporaryDirectory() as folder:
                made.append(examine(kind, seed, Path(folder)))
            print(*made[-1].row(), sep=", ", flush=True)
            FILMS_CSV.write_text(csv_text([*Examined._fields[:5], *scores], (film.row() for film in made)))
            of_kinds = {name: [film for film in made if film.kind == name] for name in KINDS}
            KINDS_CSV.write_text(csv_text(HEADER.split(), (row_of(name, its) for name, its in of_kinds.items() if its)))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else FILMS, sys.argv[2:] or list(KINDS))
