"""A table of estimates, and its forms for people and programs: a terminal, HTML, notebooks, JSON and CSV.

Cells are estimates, numbers, shares, texts, or None where there is nothing to show.
"""

import csv
import io
import json
import math
import textwrap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from numbers import Integral
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

from epuck_sim.display.html import element, table as html_table, to_html
from epuck_sim.estimate import UNDETERMINED, Estimate, significant
from epuck_sim.util.messages import in_yaml, shortest_endings

CSV_DIGITS, AXIS_DIGITS = 6, 15  # significant digits in CSV of numbers, and of values of axes, which tell rows apart
GAP = 2  # number of blanks between the columns of a terminal
UNBROKEN = 5  # longest heading whose words stay on one line, such as "B / A"
MOST_TIED = 6  # largest number of values of an axis that are named above a table
POINT = "point"  # column with the number of a point, the first to be left out where a table is too wide


class Share(float):
    """A share, which is shown to people in per cent."""


class AtMost(float):
    """A number that is an upper bound, and is shown as one."""


class Row(NamedTuple):
    """A row of a table."""

    axes: Mapping[str, Any]  # what the row is of: values of axes, by dotted key
    cells: Mapping[str, Any]  # its cells, by names as programs know them; all rows of a table have the same

    def record(self) -> dict[str, Any]:
        """Return the cells as JSON and CSV hold them: an estimate as three, with `_low` and `_high`, None for NaN."""
        found: dict[str, Any] = {}
        for name, cell in self.cells.items():
            ends = cell.ends if isinstance(cell, Estimate) else (cell,)
            found |= zip((name, f"{name}_low", f"{name}_high"), map(plain, ends), strict=False)
        return found


class Table(NamedTuple):
    """Rows with the same cells, and a title and notes on them."""

    title: str
    rows: Sequence[Row]
    notes: Sequence[str] = ()
    headings: Mapping[str, str] = {}
    """Headings of cells that are not their names with blanks for underscores; empty for cells of JSON and CSV alone."""

    def records(self) -> list[dict[str, Any]]:
        """Return the rows as JSON holds them; where one has an estimate, all have three columns for it."""
        estimated = {name for row in self.rows for name, cell in row.cells.items() if isinstance(cell, Estimate)}

        def whole(name: str, cell: Any) -> Any:
            return cell if name not in estimated or isinstance(cell, Estimate) else UNDETERMINED._replace(value=cell)

        rows = (row._replace(cells={name: whole(name, cell) for name, cell in row.cells.items()}) for row in self.rows)
        return [{"axes": dict(row.axes), **row.record()} for row in rows]

    def to_csv(self) -> str:
        """Return the rows as CSV, with the axes first."""
        records = self.records()
        axes = [{key: csv_cell(value, AXIS_DIGITS) for key, value in each.pop("axes").items()} for each in records]
        rows = (
            [*map(head.get, axes[0]), *(csv_cell(each.get(name)) for name in records[0])]
            for head, each in zip(axes, records, strict=True)
        )
        return csv_text((*axes[0], *records[0]) if records else (), rows)

    def to_html(self) -> Element:
        """Return the table and its notes."""
        columns = _columns(self)
        rows = zip(*(column.texts for column in columns), strict=True)
        made = html_table([column.heading for column in columns], rows)
        return element("div", made, *[element("p", " ".join(self.notes), class_="note")] * bool(self.notes))

    def _repr_html_(self) -> str:
        return to_html(element("p", self.title), self.to_html())

    def to_text(self, width: int | None = None) -> str:
        """Return the table as a terminal shows it: no number is broken, whatever the terminal's width.

        Columns with one value, or tied one-to-one to another axis, are named above the table. If the rest is too wide,
        it comes in parts below each other, each with the columns that tell the rows apart.
        """
        columns = _columns(self)
        kept, said = _without_told(columns) if len(self.rows) > 1 else (columns, [])
        parts, more = _parts(kept, width) if self.rows else ([], [])
        heads = [line for part in (self.title, "; ".join([*said, *more])) for line in part.splitlines() if line]
        blocks = [_wrap(heads, width), *map(_lines, parts), _wrap(self.notes, width)]
        text = "\n\n".join("\n".join(block) for block in blocks[1:-1] if block)
        return "\n".join(filter(None, ["\n".join(blocks[0]), text, "\n".join(blocks[-1])]))


class _Column(NamedTuple):
    heading: str
    cells: list[Any]
    texts: list[str]
    is_axis: bool

    @property
    def least(self) -> int:
        """Width of the widest cell, and of the longest word of the heading, or of all of a short one."""
        return max(map(len, (*self.texts, *self.heading.split(), self.heading[:UNBROKEN])))


def cell_text(cell: Any) -> str:
    """Return the text of a cell for people; what is below 0.05, as a p-value may be, never seems to reach it.

    >>> [cell_text(each) for each in (Estimate(44.2, 28.9, 66.8), Share(0.9996), 2**53, AtMost(0.00123456), None, True)]
    ['44 [29, 67]', '99.96 %', '9007199254740992', '<= 0.00123', '-', 'yes']
    >>> cell_text(0.04951), cell_text(0.049951), cell_text(0.0499996), cell_text(0.05)
    ('0.0495', '0.04995', '0.0499996', '0.05')
    """
    if cell is None or isinstance(cell, bool):
        return {None: "-", True: "yes", False: "no"}[cell]
    if isinstance(cell, Share):
        decimals = -math.floor(math.log10(100 * (1 - cell))) if 0.99 < cell < 1 else 0  # nearly all is not all
        return "-" if math.isnan(cell) else f"{100 * cell:.{decimals}f} %" if cell > 0.99 else f"{100 * cell:.2g} %"
    if isinstance(cell, AtMost):
        return f"<= {cell_text(float(cell))}"
    if isinstance(cell, list | tuple) and not isinstance(cell, Estimate):
        return f"{len(cell)} values"
    if isinstance(cell, float) and significant(cell) == "0.05":
        return next(text for digits in range(3, 18) if (text := f"{cell:.{digits}g}") != "0.05" or cell >= 0.05)
    return significant(cell) if isinstance(cell, float) else str(cell).replace("\n", r"\n")


def leaves(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the values in nested mappings, and in lists of mappings, with their dotted keys.

    >>> [*leaves({"a": {"b": 1}, "c": [{"d": 2}], "e": [3]})]
    [('a.b', 1), ('c.0.d', 2), ('e', [3])]
    """
    inner: Mapping[Any, Any] = {}
    if isinstance(value, Mapping):
        inner = value
    elif isinstance(value, Sequence) and all(isinstance(each, Mapping) for each in value):
        inner = dict(enumerate(value))
    if not inner:
        yield key, value
    for name, part in inner.items():
        yield from leaves(part, f"{key}.{name}" if key else str(name))


def plain(value: Any) -> Any:
    """Return a result as JSON can hold it: named tuples as objects, estimates as value, low and high, null for NaN."""
    if isinstance(value, Estimate):
        return dict(zip(("value", "low", "high"), map(plain, value.ends), strict=True))
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if hasattr(value, "_asdict"):
        return plain(value._asdict())
    if isinstance(value, Mapping):
        return {key: plain(each) for key, each in value.items()}
    return [plain(each) for each in value] if isinstance(value, list | tuple) else value


def csv_text(columns: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    """Return a table as CSV."""
    written = io.StringIO()
    csv.writer(written, lineterminator="\n").writerows([columns, *rows])
    return written.getvalue()


def csv_cell(value: Any, digits: int = CSV_DIGITS) -> Any:
    """Return a number with the digits of CSV, empty text if it is not finite; text as it is; anything else as JSON.

    >>> csv_cell(1234.56789), csv_cell(1234567), csv_cell(float("nan")), csv_cell("mean"), csv_cell({"k": True})
    ('1234.57', 1234567, '', 'mean', '{"k": true}')
    """
    if isinstance(value, bool | list | dict):
        return json.dumps(value)
    if value is None or isinstance(value, str | Integral):
        return value
    same = float(f"{value:.{max(digits, 13)}g}")  # sums differ in their last digits from one machine to another
    return f"{same:.{digits}g}" if math.isfinite(value) else ""


def _columns(table: Table) -> list[_Column]:
    if not table.rows:
        return []
    first = table.rows[0]
    every = {name: table.headings.get(name, name.replace("_", " ")) for name in first.cells}
    headings = {name: heading for name, heading in every.items() if heading}
    short = shortest_endings([*first.axes, *headings.values()])
    axes, cells = [], []
    for key in first.axes:
        values = [row.axes[key] for row in table.rows]
        endings = shortest_endings([value for value in values if isinstance(value, str)], "/")
        # values of axes with all of their digits, which tell points apart
        texts = [endings[value].replace("\n", r"\n") if isinstance(value, str) else in_yaml(value) for value in values]
        axes.append(_Column(short[key], values, texts, True))
    for name, heading in headings.items():
        values = [row.cells[name] for row in table.rows]
        cells.append(_Column(heading, values, list(map(cell_text, values)), False))
    return sorted([*axes, *cells], key=lambda column: column.heading != POINT)  # others keep their order


def _without_told(columns: list[_Column]) -> tuple[list[_Column], list[str]]:
    """Return the columns that do not follow from others, and texts on those left out."""
    kept: list[_Column] = []
    said: list[str] = []
    patterns: dict[tuple[int, ...], _Column] = {}
    for column in columns:
        texts, first = column.texts, dict[str, int]()
        pattern = tuple(first.setdefault(text, len(first)) for text in texts)
        if len(first) == 1 and (texts[0] == "-" or not isinstance(column.cells[0], Estimate)):
            said.append(f"{column.heading} {'= ' * column.is_axis}{texts[0]}")
        elif column.is_axis and pattern in patterns:
            values = list(dict.fromkeys(texts))
            given = f" {', '.join(values)}" if len(values) <= MOST_TIED else ""
            said.append(f"{column.heading}{given} with {patterns[pattern].heading}")
        else:
            kept.append(column)
            if column.is_axis:
                patterns[pattern] = column
    return kept or columns, said if kept else []


def _width(columns: Sequence[_Column]) -> int:
    return sum(column.least for column in columns) + GAP * (len(columns) - 1)


def _parts(columns: list[_Column], width: int | None) -> tuple[list[list[_Column]], list[str]]:
    """Return columns in parts that fit a width, each with those that tell rows apart, and texts on what is left out.

    Axes, or else the first column, tell rows apart, with points unless these only count up; if too wide, a number does.
    """
    if width is None or _width(columns) <= width:
        return [columns], []
    first, rows, said = columns[0], range(1, 1 + len(columns[0].cells)), list[str]()
    keys = [column for column in columns if column.is_axis or column.heading == POINT] or [first]
    if _width([column for column in keys if column.heading != POINT]) > width / 2:
        keys = [first if first.heading == POINT else _Column("row", [*rows], [*map(str, rows)], False)]
    elif first.heading == POINT and len(rows) > 1 and first.cells == [first.cells[0] + row - 1 for row in rows]:
        keys, columns = keys[1:], columns[1:]
        said = [f"points {first.texts[0]} to {first.texts[-1]}, in order"]
    parts: list[list[_Column]] = [[]]
    for column in (each for each in columns if each not in keys):
        if parts[-1] and _width([*keys, *parts[-1], column]) > width:
            parts.append([])
        parts[-1].append(column)
    return [[*keys, *part] for part in parts], said


def _lines(columns: Sequence[_Column]) -> list[str]:
    """Return the lines of a heading, whose words are below each other if cells are narrow, a rule, and the rows."""
    widths = [column.least for column in columns]
    headings = [textwrap.wrap(column.heading, width) for column, width in zip(columns, widths, strict=True)]
    height = max(map(len, headings))
    above = [[""] * (height - len(lines)) + lines for lines in headings]
    rule = ["-" * width for width in widths]
    rows = [*zip(*above, strict=True), rule, *zip(*(column.texts for column in columns), strict=True)]
    are_texts = (all(isinstance(cell, str) for cell in column.cells) for column in columns)
    align: list[Callable[[str, int], str]] = [str.ljust if is_text else str.rjust for is_text in are_texts]
    gap = " " * GAP
    return [
        gap.join(put(cell, width) for put, cell, width in zip(align, row, widths, strict=True)).rstrip() for row in rows
    ]


def _wrap(lines: Iterable[str], width: int | None) -> list[str]:
    if width is None:
        return list(lines)
    return [part for line in lines for part in textwrap.wrap(line, width, break_long_words=False) or [""]]
