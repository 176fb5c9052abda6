"""Phrases that error messages share."""

import difflib
import re
from collections.abc import Iterable, Mapping


def did_you_mean(name: str, known: Mapping[str, object] | list[str]) -> str:
    """Return the phrase for an unknown name, with the most similar known one if there is any.

    >>> did_you_mean("sped", ["speed", "count"])
    "unknown 'sped', did you mean 'speed'?"
    """
    nearest = nearest_name(name, known)
    return f"unknown {name!r}" + (f", did you mean {nearest!r}?" if nearest else "")


def nearest_name(name: str, known: Iterable[str]) -> str | None:
    """Return the known name that is most similar to a name; None if none is similar."""
    nearest = difflib.get_close_matches(name, list(known), n=1, cutoff=0.55)
    return nearest[0] if nearest else None


def comma_list(names: Mapping[str, object] | list[str]) -> str:
    """Return the names separated by commas; "none" if there are no names."""
    return ", ".join(names) or "none"


def short_repr(value: object) -> str:
    """Return the repr of a value, cut to 60 characters."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."


def natural_order(name: str) -> list[tuple[str, int]]:
    """Return a key that sorts numbers in names by their values.

    >>> sorted(["fig-5-10", "fig-5-3", "thesis"], key=natural_order)
    ['fig-5-3', 'fig-5-10', 'thesis']
    """
    return [(text, int(digits or 0)) for text, digits in re.findall(r"(\D*)(\d*)", name)]
