"""Records as a page finds its way about them: where each field stands, and what kind of number it is."""

from typing import Any

import numpy as np

Fields = dict[str, tuple[int, str]]


def fields_of(dtype: np.dtype[Any], prefix: str = "", first: int = 0) -> Fields:
    """Return offset and kind of each number of a record by its dotted name, of an array by the name of all.

    >>> fields_of(np.dtype([("a", "?"), ("b", [("c", "f8"), ("d", "u8", 2)])], align=True))
    {'a': (0, '?'), 'b.c': (8, 'f8'), 'b.d': (16, 'u8')}
    """
    found: Fields = {}
    for name, field in (dtype.fields or {}).items():
        kind, offset = field[0], field[1]
        if kind.base.fields:
            found |= fields_of(kind.base, f"{prefix}{name}.", first + offset)
        else:
            found[prefix + name] = first + offset, "?" if kind.base == np.bool_ else kind.base.str[1:]
    return found
