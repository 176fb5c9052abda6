"""The axes of a sweep, and the section `figure`: over which of them a sweep is drawn."""

import json
import math
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from itertools import product
from typing import Annotated, Any, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field, model_validator

from epuck_sim.errors import EpuckSimError
from epuck_sim.measures.measure import T_SYNC_S
from epuck_sim.scenario.base import ConfigModel, Number, WholeNumber, check_range, ends_in, whole_key_of
from epuck_sim.util.messages import comma_list, did_you_mean, short_yaml

SPEED = ".speed_cm_s"  # ending of the keys of speeds, against which T_sync is drawn by default
LOG_RATIO = 10.0  # least ratio of the largest to the smallest value of an axis with a logarithmic scale
EVEN_RATIO = 5.0  # the same for values evenly spaced in the logarithm: room for two of the ticks 1, 2 and 5 of a decade
EVEN_VALUES, EVENNESS = 4, 0.05  # least number of such values, and how far off, relatively, each may be beside rounding
SIMULATED_AGAIN = ("perturbation", "course")  # forms of figures for which trials are simulated again, beside twins
MOST_NAMED = 20  # most values of an axis that a message names

Rows = Sequence[Mapping[str, Any]]  # axis values of each point of a sweep, by dotted key


class FigureSection(ConfigModel):
    """How `plot` draws a sweep, where the command does not say."""

    form: Literal["curves", "map", "violins", "series", "perturbation", "course"] = "curves"
    """How the sweep is drawn; `series` is for measures with a value for each cycle, and `perturbation` and `course` are
    for point agents."""
    x: str | None = None
    """Dotted key of the axis to draw against; the speed by default."""
    y: str | None = None
    """Dotted key of a map's vertical axis."""
    panels: str | None = None
    """Dotted key of the axis that has a panel for each of its values, for curves; one panel by default."""
    statistic: Literal["mean", "median", "weibull-mean"] = "mean"
    """Statistic of a point's trials in curves and maps."""
    censored_at_cycles: Annotated[WholeNumber, Field(ge=1)] | None = None
    """Limit, in cycles, at which the estimate drawn in violins treats trials as censored."""
    base_case: dict[str, Any] = Field(default_factory=dict)
    """Values of axes, by dotted key, of the base case, whose curve is dashed."""
    title: str = ""
    """Title; by default there is none, as a caption beside the figure says what was run."""
    labels: dict[str, str] = Field(default_factory=dict)
    """Labels of axes, by dotted key, and of `T_sync` or a measure, by name."""
    scale: Literal["linear", "log"] | None = None
    """Scale of T_sync or the measure; by default logarithmic for T_sync and for positive values that are far apart."""
    points: bool = False
    """Whether each trial is a dot, in curves and violins."""
    theory: bool = False
    """Whether the prediction of `predict` is drawn, dashed, under curves of T_sync against speed."""
    width_cm: Annotated[Number, Field(ge=5, le=100)] | None = None
    """Width; by default that of a column, or of a page for several panels."""
    font_pt: Annotated[Number, Field(ge=4, le=30)] = 8.0
    """Size of letters; those at ticks and in legends are a point smaller."""


def is_logarithmic(key: str, values: npt.ArrayLike) -> bool:
    """Return whether an axis with these values is logarithmic.

    It is if they are positive, and are speeds, far apart, or evenly spaced in the logarithm.

    >>> is_logarithmic("space.side_cm", [10, 100]), is_logarithmic("agents.count", [5, 40])
    (True, False)
    >>> is_logarithmic("agents.count", [2, 3, 4, 7, 10, 15]), is_logarithmic("agents.count", [5, 15, 25, 35])
    (True, False)
    """
    distinct = np.unique(np.asarray(values, float))
    low, high = distinct[0], distinct[-1]
    if low <= 0 or key.endswith(SPEED) or high >= LOG_RATIO * low:
        return bool(low > 0)
    even, rounding = np.geomspace(low, high, len(distinct)), 0 if (distinct % 1).any() else 0.5
    is_even = len(distinct) >= EVEN_VALUES and np.allclose(distinct, even, EVENNESS, rounding)
    return bool(is_even and high >= EVEN_RATIO * low)


def unknown_axis(key: str, axes: Collection[str]) -> str:
    """Return the phrase for a key that is no axis: it is the ending of one, which is for typing only, or unknown."""
    found = [axis for axis in axes if ends_in(axis, key)]
    return whole_key_of(key, found) if found else did_you_mean(key, axes)


def choose_axis(rows: Rows, requested: str | None = None, origin: str = "--x", *, by_name: bool = False) -> str:
    """Choose the axis to draw against: the requested one, or a speed, or the one with the most distinct numbers.

    A speed with a single value is chosen only where every axis has a single value. `origin` is the option or key that
    requests an axis. With `by_name`, its values need not be numbers.
    """
    numbers = numeric_axes(rows)
    if by_name and (requested is not None or not numbers):
        numbers = {key: {repr(row[key]) for row in rows} for key in rows[0]}
    if requested is not None:
        if requested not in numbers:
            said = f"{requested} is not numeric" if requested in rows[0] else unknown_axis(requested, numbers)
            raise EpuckSimError(f"{origin}: {said}; axes{'' if by_name else ' with numbers'}: {comma_list(numbers)}")
        return requested
    if not numbers:
        names = "; for names: plot --form violins" if rows[0] else "; sweeps have one: run --sweep KEY=A,B"
        raise EpuckSimError(f"there is no axis with numbers{names}")
    return max(numbers, key=lambda key: (len(numbers[key]) > 1, key.endswith(SPEED), len(numbers[key])))


def choose_second_axis(rows: Rows, x: str, requested: str | None = None, origin: str = "--y") -> str:
    """Choose the vertical axis of a map, beside `x`: the requested one, or the only other one whose numbers differ."""
    others = _untied(numeric_axes(rows), rows, x)
    choice = f"give --y one of {comma_list(others)}" if others else "there is no other axis whose numbers differ"
    if requested is not None:
        if choose_axis(rows, requested, origin) == x or is_tied_to(requested, x, rows):
            raise EpuckSimError(f"{origin}: {requested} varies together with {x}, the horizontal axis; {choice}")
        return requested
    if len(others) != 1:
        raise EpuckSimError(f"a map needs a second axis, beside {x}: {choice}")
    return others[0]


def check_panels(rows: Rows, x: str, panels: str | None, origin: str = "--panels") -> None:
    """Raise EpuckSimError if `panels` is given, and no axis beside `x`; `origin` is its name in messages."""
    others = other_axes(rows, x)
    if panels is not None and panels not in others:
        said = f"{panels} is the horizontal axis" if panels == x else unknown_axis(panels, others)
        raise EpuckSimError(f"{origin}: {said}; other axes: {comma_list(others)}")


def check_figure_axes(figure: FigureSection, rows: Rows) -> None:
    """Check that all keys that a scenario's section `figure` names are axes of its sweep, and that a map has two."""
    is_map = figure.form == "map" and bool(rows[0])  # without a sweep, none is drawn
    if figure.x is None and figure.y is None and figure.panels is None and not (figure.base_case or is_map):
        return
    x = choose_axis(rows, figure.x, "figure.x", by_name=figure.form != "map")
    if figure.y is not None or (is_map and not _untied(numeric_axes(rows), rows, x)):
        choose_second_axis(rows, x, figure.y, "figure.y")
    check_panels(rows, x, figure.panels, "figure.panels")
    for key, value in figure.base_case.items():
        check_panels(rows, x, key, "figure.base_case")
        if all(row[key] != value for row in rows):
            values = comma_list([short_yaml(each) for each in {repr(row[key]): row[key] for row in rows}.values()])
            raise EpuckSimError(f"figure.base_case: {key} is {short_yaml(value)}; allowed: {values}")


def check_labels(labels: Collection[str], axes: Collection[str], measures: Iterable[str], origin: str) -> None:
    """Raise EpuckSimError for a label whose key is not an axis, T_sync, t_sync_s or the name of a measure."""
    known = [*axes, "T_sync", T_SYNC_S, *measures]
    for key in labels:
        if key not in known:
            raise EpuckSimError(f"{origin}: {unknown_axis(key, known)}; allowed: {comma_list(known)}")


def other_axes(rows: Rows, *axes: str) -> list[str]:
    """Return the axes that are neither among `axes` nor tied one-to-one to one of them."""
    return [key for key in rows[0] if not any(key == axis or is_tied_to(key, axis, rows) for axis in axes)]


def group_rows(rows: Rows, *axes: str) -> list[tuple[dict[str, Any], list[int]]]:
    """Return groups of points that differ in `axes` alone, in the order of the sweep: other axes' values, and places.

    An axis that is tied one-to-one to one of `axes` is not among the others.
    """
    others = other_axes(rows, *axes)
    groups: dict[str, list[int]] = {}
    for place, row in enumerate(rows):
        groups.setdefault(canonical_text({key: row[key] for key in others}), []).append(place)
    return [({key: rows[places[0]][key] for key in others}, places) for places in groups.values()]


def texts_of_values(rows: Rows, key: str, values: Sequence[Any], origin: str) -> list[str]:
    """Return values of an axis as `canonical_text`; raise EpuckSimError for another key, or a value that no point has.

    In messages the values are called `origin`.
    """
    if key not in rows[0]:
        raise EpuckSimError(f"{origin}: {did_you_mean(key, rows[0])}; axes: {comma_list(rows[0])}")
    if not values:
        raise EpuckSimError(f"{origin}: {key} is given no value")
    texts = [canonical_text({key: value}) for value in values]
    known = {canonical_text({key: row[key]}): row[key] for row in rows}
    for value, text in zip(values, texts, strict=True):
        if text not in known:
            named = comma_list([*map(short_yaml, known.values())][:MOST_NAMED])
            more = f" and {len(known) - MOST_NAMED} more" if len(known) > MOST_NAMED else ""
            raise EpuckSimError(f"{origin}: {key} is never {short_yaml(value)}; its values: {named}{more}")
    return texts


def numeric_axes(rows: Rows) -> dict[str, set[Any]]:
    """Return the distinct values of each axis that has only numbers."""
    columns = {key: [row[key] for row in rows] for key in rows[0]}
    return {key: set(values) for key, values in columns.items() if {*map(type, values)} <= {int, float}}


def is_tied_to(key: str, axis: str, rows: Rows) -> bool:
    """Return whether the values of `axis` and `key` correspond one-to-one, as in a zip."""
    pairs = {(repr(row[axis]), repr(row[key])) for row in rows}
    return len(pairs) == len({x for x, _ in pairs}) == len({value for _, value in pairs}) > 1


def distinguishing_axes(rows: Rows) -> list[dict[str, Any]]:
    """Keep only the axis values that distinguish each row, and drop axes that are tied one-to-one to another.

    >>> distinguishing_axes([{"width": 4, "height": 4, "tau": 5}, {"width": 6, "height": 6, "tau": 5}])
    [{'width': 4}, {'width': 6}]
    """
    kept = _untied(rows[0], rows)
    return [{key: row[key] for key in kept} for row in rows]


def _untied(keys: Iterable[str], rows: Rows, *before: str) -> list[str]:
    """Return the axes with several values that are not tied one-to-one to an earlier one, or to one of `before`."""
    kept: list[str] = []
    for key in keys:
        differs = len({repr(row[key]) for row in rows}) > 1
        if differs and not any(key == axis or is_tied_to(key, axis, rows) for axis in (*before, *kept)):
            kept.append(key)
    return kept


def canonical_text(axes: Mapping[str, Any]) -> str:
    """Return axis values as text which is the same for equal values, however they are written or ordered.

    >>> canonical_text({"b": 1, "a": [2.0]}) == canonical_text({"a": [2], "b": 1.0})
    True
    """
    return json.dumps(json.loads(json.dumps(axes), parse_int=float), sort_keys=True)


Values = Annotated[tuple[Any, ...], Field(min_length=1)]

MAX_POINTS = 100_000  # most points that a sweep may have

RANGE = re.compile(r"\s*[-+.]*\d[-+.\deE]*(:([-+.\deE]+|\w*))+\s*")
"""A range of values, FROM:TO:NUMBER, and :lin or :log, or what was meant as one."""

COUNTS = ("count", "k", "central_pixels")  # last words of keys whose values in a range are whole

_RANGES = (
    f"FROM:TO:NUMBER, as in 0.05:12.8:20: FROM below TO, 2 to {MAX_POINTS} values; and :lin, or :log with FROM above 0"
)

NO_AXES = ("sweep", "seed", "trials", "trial_timeout_s", "name", "description", "figure", "overhead")
"""Keys of a scenario that cannot be an axis."""


def with_ranges(key: str, values: Any) -> Any:
    """Return the values of an axis, with each range replaced by its values.

    The values of a range are evenly spaced, on the scale that figures would use unless the range names one. They have
    six digits, and are whole for `COUNTS`; the ends stay as they are given.

    >>> with_ranges("agents.speed_cm_s", "0.1:10:3"), with_ranges("agents.count", [2, "1:10:4"])
    ([0.1, 1.0, 10.0], [2, 1, 2, 5, 10])
    """
    if isinstance(values, str) and RANGE.fullmatch(values):
        values = [values]
    if not isinstance(values, list | tuple):
        return values
    found: list[Any] = []
    for value in values:
        found.extend(_values_of_range(key, value) if isinstance(value, str) and RANGE.fullmatch(value) else [value])
    return found


def _values_of_range(key: str, text: str) -> list[Any]:
    refusal = f"{key} is {text}; allowed: {_RANGES}"
    try:
        low, high, count, *scale = text.strip().split(":")
        first, last, number = float(low), float(high), int(count)
    except ValueError as error:
        if key.startswith(("measures.", "arena.floor.picture")):  # where any text may stand
            return [text]
        raise ValueError(refusal) from error
    is_even = scale in ([], ["lin"]) or (scale == ["log"] and first > 0)
    if not (0 < last - first < math.inf and 2 <= number <= MAX_POINTS and is_even):
        raise ValueError(refusal)
    is_log = is_logarithmic(key, (first, last)) if not scale else scale == ["log"]
    inner = (np.geomspace if is_log else np.linspace)(first, last, number)[1:-1]
    if key.rpartition(".")[2] in COUNTS:
        inner = np.round(inner)
    if not is_log:
        inner[np.abs(inner) < 1e-9 * (last - first)] = 0  # 0 but for rounding
    values = [first, *(float(f"{value:.6g}") for value in inner), last]
    if (different := len({*values})) < number:
        allowed = "fewer, or with :lin" if is_log else "fewer"
        raise ValueError(f"{key} is {text}; rounded, only {different} values differ; allowed: {allowed}")
    is_whole = {*"eE."}.isdisjoint(low + high) and all(value == int(value) for value in values)
    return [int(value) for value in values] if is_whole else values


class SweepAxes(ConfigModel):
    """The axes: every row of `points` is combined with every row of `zip` and every combination of `grid`.

    Keys are dotted, as in `--set`: `robots.0.parameters.speed_cm_s`.
    """

    points: Annotated[tuple[dict[str, Any], ...], Field(min_length=1)] | None = None
    """A list of rows, each a mapping with the same keys."""
    zip: dict[str, Values] = Field(default_factory=dict)
    """Keys whose values go together: the first of each, the second of each, and so on."""
    grid: dict[str, Values] = Field(default_factory=dict)
    """Keys whose values are combined in every way; the last key changes fastest. A range, `0.05:12.8:20`, stands for 20
    values from the first number to the second."""

    @model_validator(mode="before")
    @classmethod
    def _read_ranges(cls, given: Any) -> Any:
        if not isinstance(given, dict):
            return given
        columns = {name: given[name] for name in ("zip", "grid") if isinstance(given.get(name), dict)}
        read = {name: {key: with_ranges(key, values) for key, values in each.items()} for name, each in columns.items()}
        return {**given, **read}

    def _check_together(self) -> None:
        points = self.points or ()
        for number, row in enumerate(points):
            first = points[0].keys()
            if row.keys() != first:
                raise ValueError(f"points.{number} has the keys {sorted(row)}, points.0 has {sorted(first)}")
        lengths = {key: len(values) for key, values in self.zip.items()}
        if len(set(lengths.values())) > 1:
            counts = ", ".join(f"{key} has {count}" for key, count in lengths.items())
            raise ValueError(f"zip: all keys need the same number of values, but {counts}")
        counts_of_keys = Counter(self.keys)
        if not counts_of_keys:
            raise ValueError("has no axis; give grid: {key: [value, ...]}, zip: {...} or points: [{...}, ...]")
        for key, count in counts_of_keys.items():
            if count > 1:
                raise ValueError(f"{key} is in more than one of points, zip and grid")
            if key.partition(".")[0] in NO_AXES:
                raise ValueError(f"{key} cannot be an axis; allowed: a key on which trials depend, except the seed")
        if len({key.casefold() for key in self.keys}) < len(self.keys):
            raise ValueError("two axes differ only in capital letters; the table of results cannot hold both")
        check_range("the number of points", self.point_count, 1, MAX_POINTS)

    @property
    def keys(self) -> list[str]:
        """The keys that change from point to point."""
        return [*(self.points[0] if self.points else ()), *self.zip, *self.grid]

    @property
    def point_count(self) -> int:
        """Number of points."""
        first_zipped = next(iter(self.zip.values()), (None,))
        return math.prod(map(len, (self.points or (None,), first_zipped, *self.grid.values())))

    def with_values(self, change: Callable[[str, Any], Any]) -> "SweepAxes":
        """Return the axes with `change(key, value)` instead of each value."""
        columns = {
            name: {key: tuple(change(key, value) for value in values) for key, values in column.items()}
            for name, column in (("zip", self.zip), ("grid", self.grid))
        }
        points = self.points and tuple({key: change(key, value) for key, value in row.items()} for row in self.points)
        return self.model_copy(update={**columns, "points": points})

    def rows(self) -> list[dict[str, Any]]:
        """Return the values of each point by key, in the order of `keys`."""
        zipped = [dict(zip(self.zip, row, strict=True)) for row in zip(*self.zip.values(), strict=True)] or [{}]
        combined = [dict(zip(self.grid, row, strict=True)) for row in product(*self.grid.values())]
        listed = [{key: row[key] for key in self.points[0]} for row in self.points] if self.points else [{}]
        return [{**a, **b, **c} for a in listed for b in zipped for c in combined]
