"""Words that messages share."""

import difflib
from collections.abc import Mapping


def did_you_mean(name: str, known: Mapping[str, object] | list[str]) -> str:
    """Return the words for an unknown `name`, with the nearest known one."""
    nearest = difflib.get_close_matches(name, list(known), n=1, cutoff=0.55)
    return f"unknown {name!r}" + (f", did you mean {nearest[0]!r}?" if nearest else "")


def comma_list(names: Mapping[str, object] | list[str]) -> str:
    """Return names as a readable list."""
    return ", ".join(names) or "none"


def short_repr(value: object) -> str:
    """Return a value as a message shows it, cut where it is long."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
