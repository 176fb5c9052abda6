"""Recordings of trials for rerun's viewer: written while a trial runs, read back, shown."""

from enum import StrEnum

GREY = (150, 150, 150)
WHITE = (255, 255, 255)
LIT = (220, 40, 30)
NIGHT = (13, 16, 17)  # background of pictures, whatever the viewer's theme


class Level(StrEnum):
    """How much of a trial a recording holds: each level includes the one before."""

    SUMMARY = "summary"
    """Flashes and the order parameter."""
    POSES = "poses"
    """Also the arena, poses, rings and phases of robots or agents."""
    FULL = "full"
    """Also fields of view, which robots see which, camera rows, infrared distances, wheel speeds and contacts.

    Point-like agents have none of these; instead, cones or ranges, and which agents receive whose pulses.
    """
