"""The thesis's names for keys of a scenario."""

from collections.abc import Mapping
from typing import Any

SYMBOLS = {
    "speed_cm_s": ("V", "cm/s"),
    "width_cm": ("L", "cm"),
    "side_cm": ("L", "cm"),
    "dimensions": ("dimensions", ""),
    "count": ("N", ""),
    "period_s": ("τ", "s"),
    "jitter": ("\N{GREEK SMALL LETTER SIGMA}", ""),
    "curve": ("Ψ", ""),
    "reorient_on": ("reorienting on", ""),
    "speed_distribution": ("speeds", ""),
    "speed_spread": ("spread", ""),
    "coupling": ("ε", ""),
    "refractory": ("D", ""),
    "radius_cm": ("R", "cm"),
    "angle_deg": ("θ", "°"),
    "k": ("K", ""),
    "central_pixels": ("pixels", ""),
}
"""The thesis's symbols, and units, by the last part of a key."""


def key_name(key: str) -> str:
    """Return the thesis's symbol for a key, or the key itself.

    >>> key_name("robots.0.parameters.speed_cm_s"), key_name("stop.metric")
    ('V', 'stop.metric')
    """
    return SYMBOLS.get(key.rpartition(".")[2], (key, ""))[0]


def format_axis_values(values: Mapping[str, Any]) -> str:
    """Return axis values in words.

    >>> values_told({"arena.width_cm": 60, "robots.0.count": 10, "neighbourhood.angle_deg": 90})
    'L = 60 cm, N = 10, θ = 90°'
    >>> values_told({"agents.reorient_on": ["emitting", "receiving"], "neighbourhood.radius_cm": None})
    'reorienting on = emitting and receiving, R = none'
    """
    units = {key: unit_of(key) for key in values}
    spaced = {key: unit if unit == "°" else f" {unit}" for key, unit in units.items()}
    return ", ".join(f"{key_name(key)} = {_format_value(value, spaced[key])}" for key, value in values.items())


def _format_value(value: Any, unit: str) -> str:
    if isinstance(value, list | tuple):
        return " and ".join(map(str, value)) or "nothing"
    return "none" if value is None else f"{value}{unit}".rstrip()


def axis_label(key: str) -> str:
    """Return what stands beside an axis of a figure.

    >>> axis_label("arena.width_cm"), axis_label("robots.0.count")
    ('L [cm]', 'N')
    """
    unit = unit_of(key)
    return f"{key_name(key)} [{unit}]" if unit else key_name(key)


def unit_of(key: str) -> str:
    """Return the unit of a key's values, or nothing.

    >>> unit_of("arena.width_cm")
    'cm'
    """
    return SYMBOLS.get(key.rpartition(".")[2], ("", ""))[1]
