"""The axes of a sweep: which keys of a scenario take which values together."""

import json
from collections.abc import Callable, Mapping
from itertools import product
from typing import Annotated, Any

from pydantic import Field, model_validator

from epuck_sim.scenario.base import ConfigModel


def canonical_text(axes: Mapping[str, Any]) -> str:
    """Return axis values as text which is the same for equal values, however they are written or ordered.

    >>> canonical_text({"b": 1, "a": [2.0]}) == canonical_text({"a": [2], "b": 1.0})
    True
    """
    all_numbers_as_floats = json.loads(json.dumps(axes), parse_int=float)
    return json.dumps(all_numbers_as_floats, sort_keys=True)


Values = Annotated[tuple[Any, ...], Field(min_length=1)]

MAX_POINTS = 100_000
"""Most points that a sweep may have."""

NO_AXES = ("sweep", "seed", "trials", "name", "description")
"""Keys of a scenario that cannot be an axis."""


class SweepAxes(ConfigModel):
    """The axes: every row of `points` is combined with every row of `zip` and every combination of `grid`.

    Keys are dotted, as in `--set`: `robots.0.parameters.speed_cm_s`.
    """

    points: Annotated[tuple[dict[str, Any], ...], Field(min_length=1)] | None = None
    """A list of rows, each a mapping with the same keys."""
    zip: dict[str, Values] = Field(default_factory=dict)
    """Keys whose values go together: the first of each, the second of each, and so on."""
    grid: dict[str, Values] = Field(default_factory=dict)
    """Keys whose values are combined in every way; the last key changes fastest."""

    @model_validator(mode="after")
    def _check_axes(self) -> "SweepAxes":
        listed = set(self.points[0]) if self.points else set()
        for number, row in enumerate(self.points or ()):
            if set(row) != listed:
                raise ValueError(f"points.{number} has the keys {sorted(row)}, points.0 has {sorted(listed)}")
        lengths = {key: len(values) for key, values in self.zip.items()}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{key} has {count}" for key, count in lengths.items())
            raise ValueError(f"zip: all keys need the same number of values, but {counts}")
        if len({key.casefold() for key in self.keys}) < len(set(self.keys)):
            raise ValueError("two axes differ only in capital letters; the table of results cannot hold both")
        repeated = (listed & set(self.zip)) | (listed & set(self.grid)) | (set(self.zip) & set(self.grid))
        if repeated:
            raise ValueError(f"{sorted(repeated)[0]} is in more than one of points, zip and grid")
        if not self.keys:
            raise ValueError("has no axis; give grid: {key: [value, ...]}, zip: {...} or points: [{...}, ...]")
        for key in self.keys:
            if key.partition(".")[0] in NO_AXES:
                raise ValueError(f"{key} cannot be an axis; allowed: a key on which trials depend, except the seed")
        if self.point_count > MAX_POINTS:
            raise ValueError(f"has {self.point_count} points; allowed: up to {MAX_POINTS}")
        return self

    @property
    def keys(self) -> list[str]:
        """The keys that change from point to point."""
        return [*(self.points[0] if self.points else ()), *self.zip, *self.grid]

    @property
    def point_count(self) -> int:
        """Number of points."""
        count = len(self.points or (None,)) * len(next(iter(self.zip.values()), (None,)))
        for values in self.grid.values():
            count *= len(values)
        return count

    def mapped(self, change: Callable[[str, Any], Any]) -> "SweepAxes":
        """Return the axes with `change(key, value)` instead of each value."""
        columns = {
            name: {key: tuple(change(key, value) for value in values) for key, values in getattr(self, name).items()}
            for name in ("zip", "grid")
        }
        points = self.points and tuple({key: change(key, value) for key, value in row.items()} for row in self.points)
        return self.model_copy(update={**columns, "points": points})

    def rows(self) -> list[dict[str, Any]]:
        """Return the values of each point by key, in the order of `keys`."""
        zipped = [dict(zip(self.zip, row, strict=True)) for row in zip(*self.zip.values(), strict=True)] or [{}]
        combined = [dict(zip(self.grid, row, strict=True)) for row in product(*self.grid.values())]
        listed = [{key: row[key] for key in self.points[0]} for row in self.points] if self.points else [{}]
        return [{**a, **b, **c} for a in listed for b in zipped for c in combined]
