"""Names of axes of a sweep in figures and tables: the thesis's symbols for keys of a scenario, and units."""

from collections.abc import Mapping, Sequence
from typing import Any

from epuck_sim.scenario.figure_axes import distinguishing_axes

SYMBOLS = {
    "speed_cm_s": ("V", "cm/s"),
    "width_cm": ("L", "cm"),
    "side_cm": ("L", "cm"),
    "dimensions": ("dimensions", ""),
    "count": ("N", ""),
    "period_s": ("τ", "s"),
    "jitter": ("\N{GREEK SMALL LETTER SIGMA}", ""),
    "curve": ("Ψ", ""),
    "early_slope": ("early slope", ""),
    "reorient_on": ("reorienting on", ""),
    "kind": ("neighbourhood", ""),
    "speed_distribution": ("speeds", ""),
    "speed_spread": ("spread", ""),
    "coupling": ("ε", ""),
    "refractory": ("D", ""),
    "radius_cm": ("R", "cm"),
    "angle_deg": ("θ", "°"),
    "k": ("K", ""),
    "central_pixels": ("pixels", ""),
}
"""Symbol in the thesis, and unit, by the last part of a key."""


def quantity_label(of: str | None) -> str:
    """Return the label of T_sync, or of the measure of this name.

    >>> quantity_label(None), quantity_label("near_walls")
    ('T_sync [cycles]', 'near_walls')
    """
    return "T_sync [cycles]" if of is None else of


def key_name(key: str) -> str:
    """Return the thesis's symbol for a key, or the key itself.

    >>> key_name("robots.0.parameters.speed_cm_s"), key_name("stop.metric")
    ('V', 'stop.metric')
    """
    return SYMBOLS.get(key.rpartition(".")[2], (key, ""))[0]


def format_axis_values(values: Mapping[str, Any]) -> str:
    """Return axis values as text, with symbols and units.

    >>> format_axis_values({"arena.width_cm": 60, "robots.0.count": 10, "neighbourhood.angle_deg": 90})
    'L = 60 cm, N = 10, θ = 90°'
    >>> format_axis_values({"agents.reorient_on": ["emitting", "receiving"], "neighbourhood.radius_cm": None})
    'reorienting on = emitting and receiving, R = none'
    >>> format_axis_values({"neighbourhood": {"kind": "range", "radius_cm": 25}})
    'neighbourhood = range, R = 25 cm'
    """
    units = {key: unit_of(key) for key in values}
    spaced = {key: unit if unit == "°" else f" {unit}" for key, unit in units.items()}
    return ", ".join(f"{key_name(key)} = {_format_value(value, spaced[key])}" for key, value in values.items())


def distinguishing_labels(rows: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return a label for each row of axis values, with the values that distinguish it from the others.

    >>> distinguishing_labels([{"arena.width_cm": 60, "agents.count": 9}, {"arena.width_cm": 80, "agents.count": 9}])
    ['L = 60 cm', 'L = 80 cm']
    """
    return [format_axis_values(row) for row in distinguishing_axes(rows)]


def _format_value(value: Any, unit: str) -> str:
    if isinstance(value, Mapping):  # a whole section: its kind, and what goes with it
        details = {key: detail for key, detail in value.items() if key != "kind"}
        return ", ".join(filter(None, [str(value.get("kind", "")), format_axis_values(details)]))
    if isinstance(value, list | tuple):
        return " and ".join(map(str, value)) or "nothing"
    return "none" if value is None else f"{value}{unit}".rstrip()


def axis_label(key: str) -> str:
    """Return the label of an axis of a figure: symbol and unit.

    >>> axis_label("arena.width_cm"), axis_label("robots.0.count")
    ('L [cm]', 'N')
    """
    unit = unit_of(key)
    return f"{key_name(key)} [{unit}]" if unit else key_name(key)


def unit_of(key: str) -> str:
    """Return the unit of a key's values; empty if there is none.

    >>> unit_of("arena.width_cm")
    'cm'
    """
    return SYMBOLS.get(key.rpartition(".")[2], ("", ""))[1]
