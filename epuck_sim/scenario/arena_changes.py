"""Arenas that change during a trial of robots, by entries of its schedule."""

from collections.abc import Mapping
from typing import Any

from epuck_sim.errors import ScenarioError
from epuck_sim.scenario.arena import ArenaSection
from epuck_sim.scenario.embodied import EmbodiedScenario
from epuck_sim.scenario.validation import validate

STAYING = {"movables", "floor", "lamps"}
"""Keys of the arena that stay as they are where walls and obstacles change."""


def check_arenas(scenario: EmbodiedScenario, origin: str) -> None:
    """Check the arenas that entries of a schedule make.

    All entries that change the arena set the same keys, so that each makes an arena that is known beforehand, whatever
    entries come before it.

    Args:
        scenario: The scenario.
        origin: Begins every error message.

    Raises:
        ScenarioError: An arena is not allowed, too small for the robots, or depends on the order of entries; or its
            floor has a picture, which is stretched between walls that move.
    """
    first: tuple[int, set[str]] | None = None
    for number, entry in enumerate(scenario.schedule):
        values = entry.arena_values()
        if not values:
            continue
        first = first or (number, set(values))
        if set(values) != first[1]:
            raise ScenarioError(
                f"{origin}.{number}.set: sets {_listed(values)}, and {origin}.{first[0]}.set sets {_listed(first[1])}; "
                "give all entries that change the arena the same keys of it"
            )
        if scenario.arena.floor.picture is not None and values.keys() - {"obstacles"}:
            raise ScenarioError(
                f"{origin}.{number}.set: sets {_listed(values)}, and arena.floor.picture is stretched between the "
                "walls; give patches instead, or set arena.obstacles alone"
            )
        given = {
            "arena": {**scenario.arena.model_dump(exclude=STAYING), **values},
            "robot": scenario.robot.model_dump(),
            "robots": [{"count": scenario.robot_count, "signal": {"kind": "cone"}}],  # which all robots have
        }
        validate(given, f"{origin}.{number}.set")


def _listed(names: Mapping[str, Any] | set[str]) -> str:
    return ", ".join(f"arena.{name}" for name in sorted(names))


def arena_after(scenario: EmbodiedScenario, entry: int) -> ArenaSection:
    """Return the arena after an entry of the schedule; its movables are given where they begin."""
    given = {**scenario.arena.model_dump(exclude=STAYING), **scenario.schedule[entry].arena_values()}
    stays = {key: getattr(scenario.arena, key) for key in STAYING}
    return ArenaSection.model_validate(given).model_copy(update=stays)


def largest_cm(scenario: EmbodiedScenario) -> tuple[float, float]:
    """Return the largest width and height, cm, that the arena has in a trial."""
    sections = [scenario.arena, *(arena_after(scenario, entry) for entry in arena_entries(scenario))]
    return max(section.width_cm for section in sections), max(section.height_cm for section in sections)


def arena_entries(scenario: EmbodiedScenario) -> list[int]:
    """Return the numbers of the entries that change the arena."""
    return [number for number, entry in enumerate(scenario.schedule) if entry.arena_values()]
