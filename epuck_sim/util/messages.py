"""Phrases that error messages share."""

import difflib
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from numbers import Integral
from typing import TypeVar

_Item = TypeVar("_Item")

ANOTHER_THREAD = "another thread is taking steps of this simulation; give each thread a copy.copy of it"
BY_OBSERVER = "an observer or a measure takes steps of the simulation, or resets it; allowed: looking, and commands"


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return the phrase for an unknown name, with the most similar known one if there is any.

    >>> did_you_mean("sped", ["speed", "count"])
    "unknown 'sped', did you mean 'speed'?"
    """
    nearest = nearest_name(name, known)
    return f"unknown {name!r}" + (f", did you mean {nearest!r}?" if nearest else "")


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the shortest known name that begins with the words of a name, else the most similar one, if any."""
    names = sorted(known, key=lambda each: (len(each), each))
    begun = [each for each in names if each.startswith(f"{name}_")]
    return next(iter(begun or difflib.get_close_matches(name, names, n=1, cutoff=0.55)), None)


def describe_error(error: BaseException) -> str:
    """Return the type and the message of an error, whatever a user's class makes of it, as text that can be stored."""
    try:
        text = str(error)
    except KeyboardInterrupt:
        raise
    except BaseException as another:
        text = f"its message cannot be shown: {type(another).__name__}"
    return f"{type(error).__name__}: {storable(text)}"


def storable(text: str) -> str:
    r"""Return a text in which surrogates, which neither files nor SQLite take, are written as escapes.

    >>> storable("no \ud800 text")
    'no \\ud800 text'
    """
    return text.encode("utf-8", "backslashreplace").decode("utf-8")


def comma_list(names: Iterable[str]) -> str:
    """Return the names separated by commas; "none" if there are no names."""
    return ", ".join(names) or "none"


def counted(number: int, what: str) -> str:
    """Return a number of things, in the plural unless it is one.

    >>> counted(1, "point"), counted(2, "point")
    ('1 point', '2 points')
    """
    return f"{number} {what}" + ("" if number == 1 else "s")


def whole(name: str, value: object, least: int = 1) -> int:
    """Return a whole number of Python or numpy as an int; raise ValueError if it is not whole or below `least`."""
    if not isinstance(value, (int, Integral)) or value < least:  # a plain int is found at once
        raise ValueError(f"{name} is {value!r}; allowed: whole numbers from {least}")
    return int(value)


def numbered(name: str, number: object, several: Sequence[_Item]) -> _Item:
    """Return the one of several with this number, from 0; raise ValueError if there is none."""
    if not isinstance(number, (int, Integral)) or not 0 <= int(number) < len(several):
        raise ValueError(f"{name} is {number!r}; allowed: {f'0 to {len(several) - 1}' if several else 'none'}")
    return several[int(number)]


def short_repr(value: object) -> str:
    """Return the repr of a value, cut to 60 characters."""
    return cut(repr(value), 60)


def short_yaml(value: object) -> str:
    """Return a value as `in_yaml` does, cut to 60 characters."""
    return cut(in_yaml(value), 60)


def in_yaml(value: object, *, is_inside: bool = False) -> str:
    """Return a value as a line of YAML; inside lists and mappings, words stand without quotes.

    >>> in_yaml([{"shape": "box", "is_low": True}, None, 0.5]), in_yaml("box")
    ('[{shape: box, is_low: true}, null, 0.5]', "'box'")
    """
    if isinstance(value, dict):
        return f"{{{', '.join(f'{key}: {in_yaml(each, is_inside=True)}' for key, each in value.items())}}}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(in_yaml(each, is_inside=True) for each in value)}]"
    if is_inside and isinstance(value, str) and value.isidentifier() and value not in ("null", "true", "false"):
        return value
    return str(value).lower() if isinstance(value, bool) else "null" if value is None else repr(value)


def cut(text: str, most: int) -> str:
    """Return a text, cut to so many characters."""
    return text if len(text) <= most else f"{text[: most - 3]}..."


def shortest_endings(keys: Iterable[str], separator: str = ".") -> dict[str, str]:
    """Return the shortest ending of each key, or path, that none of the others has, and that is more than a number.

    >>> shortest_endings(["robots.0.count", "robots.1.count", "arena.width_cm"])
    {'robots.0.count': '0.count', 'robots.1.count': '1.count', 'arena.width_cm': 'width_cm'}
    """
    parts = {key: key.split(separator) for key in keys}
    found = {key: [separator.join(own[-n:]) for n in range(1, len(own) + 1)] for key, own in parts.items()}
    uses = Counter(ending for own in found.values() for ending in own if not ending.isdigit())
    return {key: next((ending for ending in own if uses[ending] == 1), key) for key, own in found.items()}


def natural_order(name: str) -> list[tuple[str, int]]:
    """Return a key that sorts numbers in names by their values.

    >>> sorted(["fig-5-10", "fig-5-3", "thesis"], key=natural_order)
    ['fig-5-3', 'fig-5-10', 'thesis']
    """
    return [(text, int(digits or 0)) for text, digits in re.findall(r"(\D*)(\d*)", name)]
