"""Options by which commands know the scene of a film."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from epuck_sim.cli.parsing import parse_arena, parse_corners, parse_tags

if TYPE_CHECKING:
    from epuck_sim.overhead.calibration import TrackOptions

FILM, GEOMETRY, DECISION = "Film", "Geometry", "Decision"
"""Headings of options, in the help."""


def arena_option(otherwise: str) -> Any:
    """Return the option of the floor's size, whose help says what it is if the film does not describe it."""
    return typer.Option(
        "--arena-cm",
        metavar="SIDE|WIDTHxHEIGHT",
        help=f"Size of the floor; by default as the film describes it, or {otherwise}.",
        rich_help_panel=GEOMETRY,
    )


ArenaOption = Annotated[str | None, arena_option("60")]
HeightOption = Annotated[
    float | None,
    typer.Option(
        "--height-cm",
        min=10,
        max=100_000,
        help="Height of the camera above the floor; by default 110 for a side of 60.",
        rich_help_panel=GEOMETRY,
    ),
]
CornersOption = Annotated[
    str | None,
    typer.Option(
        metavar="X,Y,X,Y,X,Y,X,Y",
        help="The floor's four corners, in any order, in pixels from the upper left.",
        rich_help_panel=GEOMETRY,
    ),
]
LensOption = Annotated[
    Path | None,
    typer.Option(metavar="FILE.json", help="The lens of the camera, written by `calibrate`.", rich_help_panel=GEOMETRY),
]
TagsOption = Annotated[
    str | None,
    typer.Option(
        metavar="DICTIONARY[:NUMBERS]",
        help="Tell robots apart by the ArUco tags on top of them: 4X4_50, or 4X4_50:0-9 if no others are there.",
        rich_help_panel=FILM,
    ),
]
PeriodOption = Annotated[
    float | None,
    typer.Option(
        "--period-s",
        min=0.1,
        max=86_400,
        help="Period of the oscillators; by default as the film describes it, or estimated.",
        rich_help_panel=DECISION,
    ),
]
RobotsOption = Annotated[
    int | None,
    typer.Option(
        min=1,
        help="Number of robots; no T_sync is given if the flashes do not add up to it.",
        rich_help_panel=DECISION,
    ),
]


def scene_options(
    arena: str | None,
    height_cm: float | None,
    corners: str | None,
    period_s: float | None,
    robots: int | None,
    tags: str | None,
) -> "TrackOptions":
    """Return what is known of the scene; raises FilmError for an arena, corners or tags that cannot be read."""
    from epuck_sim.overhead.calibration import TrackOptions

    dictionary, numbers = (None, None) if tags is None else parse_tags(tags)
    return TrackOptions(
        arena_cm=None if arena is None else parse_arena(arena),
        height_cm=height_cm,
        corners_px=None if corners is None else parse_corners(corners),
        period_s=period_s,
        robots=robots,
        tags=dictionary,
        tag_numbers=numbers,
    )
