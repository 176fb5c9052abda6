"""What a shell may complete: names of shipped scenarios, controllers and measures."""

from collections.abc import Iterable


def complete_scenario(incomplete: str) -> list[str]:
    """Return the shipped scenarios and sweeps whose names begin in this way."""
    from epuck_sim.util.builtin import ARENAS, SWEEPS, builtin_files

    return _beginning([*builtin_files(ARENAS), *builtin_files(SWEEPS)], incomplete)


def complete_controller(incomplete: str) -> list[str]:
    """Return the shipped controllers whose names begin in this way."""
    from epuck_sim.util.builtin import CONTROLLERS, builtin_files

    return _beginning(builtin_files(CONTROLLERS), incomplete)


def complete_measure(incomplete: str) -> list[str]:
    """Return the shipped measures whose names begin in this way."""
    from epuck_sim.measures.shipped import SHIPPED

    return _beginning(SHIPPED, incomplete)


def _beginning(names: Iterable[str], incomplete: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
