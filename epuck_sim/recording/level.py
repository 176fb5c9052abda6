"""How much of a trial a recording holds."""

from enum import StrEnum


class Level(StrEnum):
    """Each level holds what the one before holds, and more."""

    SUMMARY = "summary"
    """Flashes and the order parameter."""
    POSES = "poses"
    """Also the arena, the robots or agents with their rings or flashes and their headings, and the phases."""
    FULL = "full"
    """Also fields of view and who sees whom, camera rows, infrared distances, wheel speeds and contacts.

    Of point-like agents, which have none of these: also cones or ranges, and who hears whom.
    """
