"""Names of axes of a sweep in figures and tables: the thesis's symbols for keys of a scenario, and units."""

import re
from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import Any

from epuck_sim.measures.measure import T_SYNC
from epuck_sim.scenario.scenario import Scenario

SYMBOLS = {
    "speed_cm_s": ("V", "cm/s"),
    "arena.width_cm": ("L", "cm"),
    "side_cm": ("L", "cm"),
    "agents.count": ("N", ""),
    "robots.0.count": ("N", ""),
    "period_s": ("τ", "s"),
    "jitter": ("\N{GREEK SMALL LETTER SIGMA}", ""),
    "curve": ("Ψ", ""),
    "reorient_on": ("reorienting on", ""),
    "neighbourhood.kind": ("neighbourhood", ""),
    "walk.kind": ("walk", ""),
    "persistence": ("g", ""),
    "exponent": ("μ", ""),
    "speed_distribution": ("speeds", ""),
    "speed_spread": ("spread", ""),
    "coupling": ("ε", ""),
    "refractory": ("D", ""),
    "neighbourhood.radius_cm": ("R", "cm"),
    "angle_deg": ("θ", "°"),
    "neighbourhood.k": ("K", ""),
    "central_pixels": ("pixels", ""),
    "delay_ms": ("Δ", "ms"),
}
"""Symbol in the thesis or the field, and unit, by a key, its last two parts, or the last one."""

UNITS = {"cm_s": "cm/s", "cm": "cm", "ms": "ms", "s": "s", "deg": "°", "rad": "rad", "px": "px", "kg": "kg"}
"""Units by the endings of keys."""

UNIT_ENDING = re.compile(rf"(.+)_({'|'.join(UNITS)})")

FILE = re.compile(r"(?:.*/)?([^/]+)\.(?:py|c)(?::(\w+))?")
"""A user's file as the value of a key, and the name of an object in it."""

FOLDER = "folder"  # axis of points of several run folders, whose values are the folders' names

OTHER_GROUP = re.compile(r"robots\.[1-9][0-9]*(\..*)?")
"""Beginning of keys of a group of robots beside the first, which is always named."""

KINDS = ("kind", "shape")  # keys of a section that say what it is

NO_LABELS: Mapping[str, str] = MappingProxyType({})


def group_labels(scenario: Scenario) -> dict[str, str]:
    """Return labels of a scenario's keys that are not N: the count of the first of several groups of robots."""
    return {"robots.0.count": "count of robots.0"} if len(scenario.controllers) > 1 else {}


def statistic_label(names: Iterable[str], label: str) -> str:
    """Return the label for statistics of a quantity with this label; means, restricted or not, are not named.

    >>> statistic_label(["mean", "restricted mean"], "T_sync (cycles)"), statistic_label(["median"], "way")
    ('T_sync (cycles)', 'median of way')
    """
    others = [name for name in dict.fromkeys(names) if name not in ("mean", "restricted mean")]
    return f"{' or '.join(others)} of {label}" if others else label


def undetermined_label(of: str | None) -> str:
    """Return the label of points at which T_sync, or the measure of this name, is undetermined."""
    return f"undetermined: {'too many censored' if of in T_SYNC else 'no trial has a value'}"


def key_name(key: str, among: Collection[str] = (), own: Mapping[str, str] = NO_LABELS) -> str:
    """Return the thesis's symbol for a dotted key, or the last part of the key.

    If one of the keys `among` has the same symbol, the key's section is named, too. Labels in `own` are a user's; a
    unit in brackets at their end is left out.

    >>> key_name("robots.0.parameters.speed_cm_s"), key_name("stop.max_time_s")
    ('V', 'max time')
    >>> key_name("robots.0.parameters.speed_cm_s", ["robots.1.parameters.speed_cm_s"])
    'V of robots.0'
    """
    if key in own:
        return re.sub(r" \([^()]*\)$", "", own[key])
    symbol, owner = _symbol_and_unit(key)[0], _owner(key)
    namesakes = [other for other in among if other != key and _symbol_and_unit(other)[0] == symbol]
    if not namesakes and not OTHER_GROUP.fullmatch(owner):
        return symbol
    return key if any(_owner(other) == owner for other in namesakes) else f"{symbol} of {owner}"


def _symbol_and_unit(key: str) -> tuple[str, str]:
    *_, owner, last = ["", *key.split(".")]
    found = SYMBOLS.get(key) or SYMBOLS.get(f"{owner}.{last}") or SYMBOLS.get(last)
    if found:
        return found
    name, unit = ends.groups() if (ends := UNIT_ENDING.fullmatch(last)) else (last, "")
    return name.replace("_", " "), UNITS.get(unit, "")


def _owner(key: str) -> str:
    return key.rpartition(".")[0].removesuffix(".parameters")


def format_axis_values(
    values: Mapping[str, Any], among: Collection[str] = (), own: Mapping[str, str] = NO_LABELS
) -> str:
    """Return axis values as text, with symbols and units; `key_name` says what `among` and `own` are.

    >>> format_axis_values({"arena.width_cm": 60, "robots.0.count": 10, "neighbourhood.angle_deg": 90})
    'L = 60 cm, N = 10, θ = 90°'
    >>> format_axis_values({"agents.reorient_on": ["emitting", "receiving"], "neighbourhood.radius_cm": None})
    'reorienting on = emitting and receiving, R = none'
    >>> format_axis_values({"neighbourhood": {"kind": "range", "radius_cm": 25}})
    'neighbourhood = range, R = 25 cm'
    >>> format_axis_values({"low": True, "arena.walls": "low", "robots.0.signal": {"kind": "cone", "range_cm": 85}})
    'low = true, walls = low, signal = cone, range = 85 cm'
    >>> format_axis_values({"arena.obstacles": [{"shape": "circle", "x_cm": 5, "y_cm": 9, "radius_cm": 2}]})
    'obstacles = circle, x = 5 cm, y = 9 cm, radius = 2 cm'
    >>> format_axis_values({"folder": "mine", "robots.0.count": 10})
    'mine, N = 10'
    """
    keys = (*values, *among)
    texts = {key: format_value(key, value) for key, value in values.items()}
    return ", ".join(text if key == FOLDER else f"{key_name(key, keys, own)} = {text}" for key, text in texts.items())


def short_files(rows: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return rows of axis values with users' files by their names alone, where these tell them apart.

    >>> short_files([{"curve": "/me/kura.py:sine"}, {"curve": "a/b.py"}, {"curve": "c/b.py"}])
    [{'curve': 'sine'}, {'curve': 'a/b.py'}, {'curve': 'c/b.py'}]
    """
    texts = {value for row in rows for value in row.values() if isinstance(value, str)}
    names = {text: file[2] or file[1] if (file := FILE.fullmatch(text)) else text for text in texts}
    uses = Counter(names.values())
    short = {text: name for text, name in names.items() if uses[name] == 1}
    return [
        {key: short.get(value, value) if isinstance(value, str) else value for key, value in row.items()}
        for row in rows
    ]


def format_value(key: str, value: Any) -> str:
    """Return a value of an axis as text, with its unit."""
    unit = _symbol_and_unit(key)[1]
    if isinstance(value, Mapping):  # a whole section: its kind, and what goes with it
        kinds = [str(value[name]) for name in KINDS if name in value]
        details = {f"{key}.{name}": detail for name, detail in value.items() if name not in KINDS}
        return ", ".join(filter(None, [*kinds, format_axis_values(details)]))
    if isinstance(value, list | tuple):
        return " and ".join(format_value(key, each) for each in value) or "nothing"
    if isinstance(value, bool):
        return str(value).lower()
    return "none" if value is None else f"{value}{unit}" if unit in ("", "°") else f"{value} {unit}"


def axis_label(key: str, among: Collection[str] = (), own: Mapping[str, str] = NO_LABELS) -> str:
    """Return the label of an axis of a figure: symbol and unit; `key_name` says what `among` and `own` are.

    >>> axis_label("arena.width_cm"), axis_label("robots.0.count"), axis_label("robots.0.signal.range_cm")
    ('L (cm)', 'N', 'range (cm)')
    """
    unit, name = _symbol_and_unit(key)[1], key_name(key, among, own)
    return own.get(key) or (f"{name} ({unit})" if unit else name)
