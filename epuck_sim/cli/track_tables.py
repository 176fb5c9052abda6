"""What `epuck-sim track` is told, and what it prints."""

import json
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuck_sim.errors import FilmError
from epuck_sim.overhead.track.result import Track
from epuck_sim.util.atomic_write import check_target
from epuck_sim.util.provenance import versions

NUMBER = r"\s*([0-9]*\.?[0-9]+)\s*"


def parse_arena(text: str) -> tuple[float, float]:
    """Return width and height of a floor, given as SIDE or as WIDTHxHEIGHT in cm; raises FilmError.

    >>> parse_arena("60"), parse_arena("60x100")
    ((60.0, 60.0), (60.0, 100.0))
    """
    match = re.fullmatch(f"{NUMBER}(?:x{NUMBER})?", text)
    sides = [float(side) for side in match.groups() if side is not None] if match else []
    if not sides or not all(1 <= side <= 1e6 for side in sides):
        raise FilmError(f"--arena-cm is {text}; allowed: a side of 1 to 1000000 cm, such as 60, or two, such as 60x100")
    return sides[0], sides[-1]


def parse_corners(text: str) -> tuple[tuple[float, float], ...]:
    """Return the pixels of four corners, given as X,Y,X,Y,X,Y,X,Y; raises FilmError.

    >>> parse_corners("10,12, 470,11, 468,470, 12,469")
    ((10.0, 12.0), (470.0, 11.0), (468.0, 470.0), (12.0, 469.0))
    """
    numbers = re.fullmatch(",".join([NUMBER] * 8), text)
    if numbers is None:
        raise FilmError(f"--corners is {text}; allowed: four corners in pixels, such as 10,12,470,11,468,470,12,469")
    values = [float(value) for value in numbers.groups()]
    return tuple(zip(values[::2], values[1::2], strict=True))


def check_outputs(film: str | None, plot: Path | None, rings: Path | None, annotate: Path | None) -> None:
    """Refuse files that cannot be written or would replace one another, before a film is read, which takes a while.

    Raises FilmError for a name with another ending than its option's, and for one that is given twice or is the film's,
    and EpuckSimError as `check_target` does.
    """
    given = (("--plot", plot, ".png"), ("--rings", rings, ".csv"), ("--annotate", annotate, ".mp4"))
    owners = {} if film is None else {os.path.realpath(film): "the film"}
    for option, path, ending in given:
        if path is None:
            continue
        if path.suffix != ending:
            raise FilmError(f"{option} is {path}; allowed: a name that ends in {ending}")
        for target in (path, path.with_suffix(".csv")) if option == "--plot" else (path,):
            check_target(target)
            owner = owners.setdefault(os.path.realpath(target), option)
            if owner != option:
                raise FilmError(f"{option} is {path}; allowed: another name, for {target} is of {owner}")


def print_json(track: Track) -> None:
    """Print what a film tells as one JSON object on a line of stdout."""
    print(json.dumps({**track.summary(), "versions": versions()}), flush=True)


def print_table(track: Track) -> None:
    """Print what a film tells as a readable table on stdout."""
    table = Table(title=Text(track.film), title_justify="left", show_header=False)
    for name, value in _lines(track):
        table.add_row(name, value)
    Console(width=None if sys.stdout.isatty() else 120).print(table)


def _lines(track: Track) -> Iterator[tuple[str, str]]:
    yield "frames", f"{track.frames} at {track.fps:.4g} a second"
    yield "trial", f"from {track.start_s:.1f} s on, for {track.duration_s:.1f} s"
    yield "geometry from", track.calibration
    yield "period", f"{track.period_s:.4g} s{_how(track, 'period_s')}"
    yield "flash", f"{track.flash_ms:.0f} ms"
    yield "robots seen", f"{track.robots_seen} at once, {track.flashes_per_period:.1f} flashes a period"
    yield "threshold", f"{track.threshold_ms:.0f} ms{_how(track, 'threshold_ms')}"
    if track.t_sync_s is None:
        yield "T_sync", "never"
    else:
        yield "T_sync", f"{track.t_sync_cycles:.1f} cycles, {track.t_sync_s:.1f} s"
        yield "flashes until then", f"{track.t_sync_flashes:.1f} of each robot"


def _how(track: Track, name: str) -> str:
    return ", estimated" if name in track.estimated else ""
