"""Makes docs/figures/overhead_confidence.csv: how often `track` is right where it is sure, in films that cameras spoil.

Each film shows eight robots that flash at random and, from the fourth of six cycles on, together; or two groups that
stay apart. An effect of `tests/overhead/webcam.py` spoils it. `track` is told the floor and its corners, and nothing
else. A number as argument is that of films of each effect and strength, 2 by default. Films that the table has are not
made again: to repeat them, delete their rows.
"""

import csv
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

from epuck_sim.display.table import csv_text
from epuck_sim.errors import FilmError
from epuck_sim.overhead.calibration import TrackOptions
from epuck_sim.overhead.track import track_film
from tests.overhead.films import passed, save
from tests.overhead.webcam import EFFECTS, GOOD, SCALE, Effect, film, is_right

TABLE = Path(__file__).with_name("overhead_confidence.csv")
COLUMNS = ("effect", "strength", "seed", "t_sync_cycles", "confidence", "is_right")
FLOOR_CM = (60.0, 60.0)


def cases(films: int) -> Iterator[tuple[str, float, int, Effect, int]]:
    """Yield effect, strength, seed, the effect itself, and the number of groups."""
    for seed in range(1, films + 1):
        for name, (make, strengths) in EFFECTS.items():
            for strength in strengths:
                yield name, strength, seed, make(strength), 1
        for groups in (2, 3):
            yield "groups apart", groups, seed, iter, groups


def examine(effect: Effect, seed: int, groups: int) -> tuple[str, str, bool]:
    """Return T_sync in cycles, the confidence, and whether the answer is right."""
    corners = tuple((float(x), float(y)) for x, y in GOOD.scaled(SCALE).floor_px(FLOOR_CM))
    frames = list(film(effect, seed, groups=groups))
    bar_px = (frames[0].picture.shape[1] - GOOD.scaled(SCALE).size_px[0]) / 2
    corners = tuple((x + bar_px, y) for x, y in corners)
    with tempfile.TemporaryDirectory() as folder:
        path = save(Path(folder) / "film.mp4", frames)
        try:
            track = track_film(path, TrackOptions(FLOOR_CM, 110.0, corners), None, passed)
        except FilmError:
            return "", "refused", False
    return (
        "" if track.t_sync_cycles is None else f"{track.t_sync_cycles:.2f}",
        track.confidence,
        is_right(track.t_sync_cycles, groups),
    )


def main() -> None:
    """Examine the films that the table lacks, and print the shares."""
    rows = list(csv.reader(TABLE.read_text().splitlines()))[1:] if TABLE.exists() else []
    done = {tuple(row[:3]) for row in rows}
    for name, strength, seed, effect, groups in cases(int(sys.argv[1]) if len(sys.argv) > 1 else 2):
        key = (name, str(strength), str(seed))
        if key in done:
            continue
        rows.append([*key, *map(str, examine(effect, seed, groups))])
        TABLE.write_text(csv_text(COLUMNS, rows))
    for confidence in ("high", "low", "none", "refused"):
        right = [row[5] == "True" for row in rows if row[4] == confidence]
        print(f"{confidence}: {sum(right)} of {len(right)} films right")
    for row in rows:
        if row[4:] == ["high", "False"]:
            print("sure and wrong:", *row)


if __name__ == "__main__":
    main()
