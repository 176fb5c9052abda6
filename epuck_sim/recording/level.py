"""How much of a trial a recording holds."""

from enum import StrEnum


class Level(StrEnum):
    """Each level holds what the one before holds, and more."""

    SUMMARY = "summary"
    """Flashes and the order parameter."""
    POSES = "poses"
    """Also the arena, the robots with their rings and headings, and the phases."""
    FULL = "full"
    """Also fields of view and who sees whom, camera rows, infrared distances, wheel speeds and contacts."""
