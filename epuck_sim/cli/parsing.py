"""Parses and checks command-line options that are more than a word or a number."""

import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import get_args

from epuck_sim.errors import FilmError
from epuck_sim.scenario.overhead import TagDictionary
from epuck_sim.util.atomic_write import check_target

NUMBER = r"\s*(-?[0-9]*\.?[0-9]+)\s*"


def parse_arena(text: str) -> tuple[float, float]:
    """Return width and height, in cm, of a floor given as SIDE or WIDTHxHEIGHT; raises FilmError for anything else.

    >>> parse_arena("60"), parse_arena("60x100")
    ((60.0, 60.0), (60.0, 100.0))
    """
    match = re.fullmatch(f"{NUMBER}(?:x{NUMBER})?", text)
    sides = [float(side) for side in match.groups() if side is not None] if match else []
    if not sides or not all(1 <= side <= 1e6 for side in sides):
        raise FilmError(f"--arena-cm is {text}; allowed: a side of 1 to 1000000 cm, such as 60, or two, such as 60x100")
    return sides[0], sides[-1]


def parse_corners(text: str) -> tuple[tuple[float, float], ...]:
    """Return the pixels of four corners given as X,Y,X,Y,X,Y,X,Y; raises FilmError for anything else.

    >>> parse_corners("10,12, 470,11, 468,470, 12,469")
    ((10.0, 12.0), (470.0, 11.0), (468.0, 470.0), (12.0, 469.0))
    """
    numbers = re.fullmatch(",".join([NUMBER] * 8), text)
    if numbers is None:
        raise FilmError(f"--corners is {text}; allowed: four corners in pixels, such as 10,12,470,11,468,470,12,469")
    values = [float(value) for value in numbers.groups()]
    return tuple(zip(values[::2], values[1::2], strict=True))


def parse_board(text: str) -> tuple[int, int]:
    """Return the squares across and down a board given as COLUMNSxROWS; raises FilmError for anything else.

    >>> parse_board("9x6")
    (9, 6)
    """
    match = re.fullmatch(r"([0-9]+)x([0-9]+)", text)
    squares = tuple(map(int, match.groups())) if match else ()
    if len(squares) != 2 or not all(4 <= number <= 40 for number in squares):
        raise FilmError(f"--board is {text}; allowed: squares across and down, each 4 to 40, such as 9x6")
    return squares[0], squares[1]


def parse_tags(text: str) -> tuple[str, frozenset[int] | None]:
    """Return a dictionary of tags, and the numbers of those that there are; raises FilmError for anything else.

    >>> parse_tags("4X4_50")
    ('4X4_50', None)
    >>> parse_tags("5X5_100:0-2,7")
    ('5X5_100', frozenset({0, 1, 2, 7}))
    """
    match = re.fullmatch(r"([4-7]X[4-7]_[0-9]+)(?::([0-9]+(?:-[0-9]+)?(?:,[0-9]+(?:-[0-9]+)?)*))?", text)
    names = get_args(TagDictionary)
    if match is None or match[1] not in names:
        raise FilmError(
            f"--tags is {text}; allowed: a dictionary, {', '.join(names)}, and numbers if you want: 4X4_50:0-9,12"
        )
    name, given = match.groups()
    count = int(name.partition("_")[2])
    spans = [[int(end) for end in span.split("-")] for span in (given or "").split(",") if span]
    if any(span[0] > span[-1] or span[-1] >= count for span in spans):
        raise FilmError(f"--tags is {text}; allowed: numbers from 0 to {count - 1}, and ranges that rise, as in 0-9")
    numbers = frozenset(number for span in spans for number in range(span[0], span[-1] + 1))
    return name, numbers or None


def check_outputs(
    film: str | None,
    plot: Path | None,
    rings: Path | None,
    tables: Mapping[str, Path | None],
    films: Mapping[str, Path | None],
) -> None:
    """Check before a film is read, which takes a while, that the outputs of `track` can be written.

    Args:
        film: The film to track; None for a camera.
        plot: The figure; its table is written beside it.
        rings: The table of rings.
        tables: Other tables by their options, as CSV or Parquet.
        films: Films by their options.

    Raises:
        FilmError: A name has the wrong ending, is given twice, or is the film's.
        EpuckSimError: A file cannot be written (see `check_target`).
    """
    others = [
        *((option, path, (".csv", ".parquet")) for option, path in tables.items()),
        *((option, path, (".mp4",)) for option, path in films.items()),
    ]
    given = (("--plot", plot, (".png",)), ("--rings", rings, (".csv",)), *others)
    owners = {} if film is None else {os.path.realpath(film): "the film"}
    for option, path, endings in given:
        if path is None:
            continue
        if path.suffix not in endings:
            raise FilmError(f"{option} is {path}; allowed: a name that ends in {' or '.join(endings)}")
        for target in (path, path.with_suffix(".csv")) if option == "--plot" else (path,):
            check_target(target)
            owner = owners.setdefault(os.path.realpath(target), option)
            if owner != option:
                raise FilmError(f"{option} is {path}; allowed: another name, because {target} belongs to {owner}")
