"""The thesis's names for keys of a scenario."""

from collections.abc import Mapping
from typing import Any

SYMBOLS = {
    "speed_cm_s": ("V", "cm/s"),
    "width_cm": ("L", "cm"),
    "count": ("N", ""),
    "period_s": ("τ", "s"),
    "coupling": ("ε", ""),
    "central_pixels": ("pixels", ""),
}
"""The thesis's symbols, and units, by the last part of a key."""


def key_name(key: str) -> str:
    """Return the thesis's symbol for a key, or the key itself.

    >>> key_name("robots.0.parameters.speed_cm_s"), key_name("stop.metric")
    ('V', 'stop.metric')
    """
    return SYMBOLS.get(key.rpartition(".")[2], (key, ""))[0]


def values_told(values: Mapping[str, Any]) -> str:
    """Return axis values in words.

    >>> values_told({"arena.width_cm": 60, "robots.0.count": 10})
    'L = 60 cm, N = 10'
    """
    return ", ".join(f"{key_name(key)} = {value} {unit_of(key)}".rstrip() for key, value in values.items())


def unit_of(key: str) -> str:
    """Return the unit of a key's values, or nothing.

    >>> unit_of("arena.width_cm")
    'cm'
    """
    return SYMBOLS.get(key.rpartition(".")[2], ("", ""))[1]
