"""What a shell may complete: names of scenarios, controllers and measures, shipped and from installed packages."""

from collections.abc import Iterable


def complete_scenario(incomplete: str) -> list[str]:
    """Return the scenarios and sweeps whose names begin in this way."""
    from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files

    return _beginning([*builtin_files(ARENAS), *builtin_files(SWEEPS)], "epuck_sim.scenarios", incomplete)


def complete_controller(incomplete: str) -> list[str]:
    """Return the controllers whose names begin in this way."""
    from epuck_sim.util.builtin import CONTROLLERS, builtin_files

    return _beginning(builtin_files(CONTROLLERS), "epuck_sim.controllers", incomplete)


def complete_measure(incomplete: str) -> list[str]:
    """Return the measures whose names begin in this way."""
    from epuck_sim.measures.shipped import SHIPPED

    return _beginning(SHIPPED, "epuck_sim.measures", incomplete)


def _beginning(shipped: Iterable[str], group: str, incomplete: str) -> list[str]:
    """Return names that begin in this way, of what is shipped and of a group of entry points."""
    from importlib.metadata import entry_points

    names = dict.fromkeys([*shipped, *entry_points(group=group).names])
    return [name for name in names if name.startswith(incomplete)]
