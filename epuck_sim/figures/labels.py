"""Names of axes of a sweep in figures and tables: the thesis's symbols for keys of a scenario, and units."""

import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from typing import Any

from epuck_sim.scenario.figure_axes import distinguishing_axes
from epuck_sim.scenario.scenario import Scenario

SYMBOLS = {
    "speed_cm_s": ("V", "cm/s"),
    "arena.width_cm": ("L", "cm"),
    "side_cm": ("L", "cm"),
    "dimensions": ("dimensions", ""),
    "count": ("N", ""),
    "period_s": ("τ", "s"),
    "jitter": ("\N{GREEK SMALL LETTER SIGMA}", ""),
    "curve": ("Ψ", ""),
    "early_slope": ("early slope", ""),
    "reorient_on": ("reorienting on", ""),
    "neighbourhood.kind": ("neighbourhood", ""),
    "walk.kind": ("walk", ""),
    "run_s": ("run", "s"),
    "persistence": ("g", ""),
    "exponent": ("μ", ""),
    "speed_distribution": ("speeds", ""),
    "speed_spread": ("spread", ""),
    "fast_share": ("fast share", ""),
    "fast_ratio": ("fast ratio", ""),
    "speed_per_run": ("speed per run", ""),
    "coupling": ("ε", ""),
    "refractory": ("D", ""),
    "neighbourhood.radius_cm": ("R", "cm"),
    "angle_deg": ("θ", "°"),
    "neighbourhood.k": ("K", ""),
    "central_pixels": ("pixels", ""),
}
"""Symbol in the thesis or the field, and unit, by the last two parts of a key, or by the last one."""

OTHER_GROUP = re.compile(r"robots\.[1-9][0-9]*(\..*)?")
"""What keys of a group of robots beside the first begin with; such a group is always named."""


def quantity_label(of: str | None) -> str:
    """Return the label of T_sync, or of the measure of this name.

    >>> quantity_label(None), quantity_label("near_walls")
    ('T_sync [cycles]', 'near_walls')
    """
    return "T_sync [cycles]" if of is None else of


def statistic_label(names: Iterable[str], of: str | None) -> str:
    r"""Return the label of statistics of T_sync, or of the measure of this name; each is named once.

    >>> statistic_label(["mean", "restricted mean", "mean"], None)
    'mean or restricted mean\nof T_sync [cycles]'
    """
    return f"{' or '.join(dict.fromkeys(names))}\nof {quantity_label(of)}"


def undetermined_label(of: str | None) -> str:
    """Return the label of points at which T_sync, or the measure of this name, is undetermined."""
    return f"undetermined: {'too many censored' if of is None else 'no trial has a value'}"


def key_name(key: str, among: Collection[str] = ()) -> str:
    """Return the thesis's symbol for a key, or the key itself.

    Args:
        key: A dotted key.
        among: Keys beside which it stands; where one of them has the same symbol, each says what it is of.

    >>> key_name("robots.0.parameters.speed_cm_s"), key_name("stop.metric")
    ('V', 'stop.metric')
    >>> key_name("robots.0.parameters.speed_cm_s", ["robots.1.parameters.speed_cm_s"])
    'V of robots.0'
    """
    symbol = _symbol(key)
    owner = _owner(key)
    namesakes = [other for other in among if other != key and _symbol(other) == symbol]
    if not namesakes and not OTHER_GROUP.fullmatch(owner):
        return symbol
    return key if any(_owner(other) == owner for other in namesakes) else f"{symbol} of {owner}"


def _symbol(key: str) -> str:
    return _symbol_and_unit(key)[0]


def _symbol_and_unit(key: str) -> tuple[str, str]:
    *_, owner, last = ["", *key.split(".")]
    return SYMBOLS.get(f"{owner}.{last}") or SYMBOLS.get(last) or (key, "")


def _owner(key: str) -> str:
    return key.rpartition(".")[0].removesuffix(".parameters")


def format_axis_values(values: Mapping[str, Any], among: Collection[str] = ()) -> str:
    """Return axis values as text, with symbols and units; `key_name` says what `among` is.

    >>> format_axis_values({"arena.width_cm": 60, "robots.0.count": 10, "neighbourhood.angle_deg": 90})
    'L = 60 cm, N = 10, θ = 90°'
    >>> format_axis_values({"agents.reorient_on": ["emitting", "receiving"], "neighbourhood.radius_cm": None})
    'reorienting on = emitting and receiving, R = none'
    >>> format_axis_values({"neighbourhood": {"kind": "range", "radius_cm": 25}})
    'neighbourhood = range, R = 25 cm'
    >>> format_axis_values({"arena.obstacles.0.width_cm": 2, "robots.0.signal": {"kind": "cone", "range_cm": 85}})
    'arena.obstacles.0.width_cm = 2, robots.0.signal = cone, range_cm = 85'
    """
    units = {key: unit_of(key) for key in values}
    spaced = {key: unit if unit == "°" else f" {unit}" for key, unit in units.items()}
    names = {key: key_name(key, (*values, *among)) for key in values}
    return ", ".join(f"{names[key]} = {_format_value(key, value, spaced[key])}" for key, value in values.items())


def distinguishing_labels(rows: Sequence[Mapping[str, Any]], among: Collection[str] = ()) -> list[str]:
    """Return a label for each row of axis values, with the values that distinguish it from the others.

    >>> distinguishing_labels([{"arena.width_cm": 60, "agents.count": 9}, {"arena.width_cm": 80, "agents.count": 9}])
    ['L = 60 cm', 'L = 80 cm']
    """
    return [format_axis_values(row, among) for row in distinguishing_axes(rows)]


def _format_value(key: str, value: Any, unit: str) -> str:
    if isinstance(value, Mapping):  # a whole section: its kind, and what goes with it
        details = format_axis_values({f"{key}.{name}": detail for name, detail in value.items() if name != "kind"})
        return ", ".join(filter(None, [str(value.get("kind", "")), details.replace(f"{key}.", "")]))
    if isinstance(value, list | tuple):
        return " and ".join(map(str, value)) or "nothing"
    return "none" if value is None else f"{value}{unit}".rstrip()


def axis_label(key: str, among: Collection[str] = ()) -> str:
    """Return the label of an axis of a figure: symbol and unit; `key_name` says what `among` is.

    >>> axis_label("arena.width_cm"), axis_label("robots.0.count")
    ('L [cm]', 'N')
    """
    unit, name = unit_of(key), key_name(key, among)
    return f"{name} [{unit}]" if unit else name


def axis_labels(keys: Collection[str]) -> list[str]:
    """Return the labels of axes that stand beside each other, as in a table.

    >>> axis_labels(["robots.0.count", "robots.1.count"])
    ['N of robots.0', 'N of robots.1']
    """
    return [axis_label(key, keys) for key in keys]


def unit_of(key: str) -> str:
    """Return the unit of a key's values; empty if there is none.

    >>> unit_of("arena.width_cm")
    'cm'
    """
    return _symbol_and_unit(key)[1]


def sweep_title(scenario: Scenario) -> str:
    """Return the title of the figures of a sweep: its description, or its name where it has none."""
    text = scenario.description or scenario.name
    return text[:1].upper() + text[1:] if scenario.description else text
