"""The files of a figure: its pictures, and its numbers as CSV beside them."""

import io
import re
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from matplotlib import rc_context
from matplotlib.figure import Figure

from epuck_sim.display.table import AXIS_DIGITS, CSV_DIGITS, Row, csv_cell, csv_text
from epuck_sim.errors import EpuckSimError
from epuck_sim.util.atomic_write import atomic_write, check_target
from epuck_sim.util.messages import storable

CAPTION = ".txt"  # ending of the file with the caption

METADATA = {".png": ("Description", None), ".svg": ("Description", "Date"), ".pdf": ("Subject", "CreationDate")}
"""Keys of the caption, and of the date, in each format; none holds the date, so that equal figures are equal files."""

EDITABLE: Any = {"svg.fonttype": "none", "pdf.fonttype": 42, "svg.hashsalt": "epuck-sim", "savefig.dpi": "figure"}
"""Settings of matplotlib with which text stays text, and equal figures are equal files."""

SVG = "{http://www.w3.org/2000/svg}"  # namespace of the elements of SVG, which need none in HTML

FILE_TYPE = re.compile(r"\.[A-Za-z][A-Za-z0-9]{1,6}")
"""Endings that look like a file type: .jpg or .parquet, but neither .5 nor .b."""


class Target(NamedTuple):
    """Files of a figure."""

    stem: Path  # name of all its files without their endings
    formats: tuple[str, ...] = (".png", ".svg")  # endings of its pictures


def parse_target(path: Path) -> Target:
    """Return the files of a figure for `path`, which is a stem or the file of one picture.

    >>> parse_target(Path("fig.pdf")).formats, parse_target(Path("fig-0.5")).formats
    (('.pdf',), ('.png', '.svg'))
    """
    if path.suffix.lower() in METADATA:
        return Target(path.with_suffix(""), (path.suffix,))
    if FILE_TYPE.fullmatch(path.suffix):
        raise EpuckSimError(
            f"{path}: ends in {path.suffix!r}; allowed: .png, .svg or .pdf, for one picture of this type, or a name "
            "without a file type, for .png and .svg"
        )
    return Target(path)


def save_figure(
    target: Target, draw: Callable[[], Figure], tables: Mapping[str, str] | None = None, caption: str = ""
) -> list[Path]:
    """Write the pictures of a figure, and its tables and caption beside them, and return the files, pictures first.

    Tables are CSV, by the endings of their files. `draw` is called once all files are known to be writable; equal
    results give equal files. EpuckSimError is raised if a file cannot be written; then none is written, and older files
    stay.
    """
    caption = storable(caption)
    texts = {**(tables or {}), **({CAPTION: f"{caption}\n"} if caption else {})}
    endings = [*target.formats, *texts]
    files = check_files(target.stem, endings)
    figure = draw()
    with ExitStack() as whole:  # files get their names once all of them are written
        for file, ending in zip(files, endings, strict=True):
            part = whole.enter_context(atomic_write(file))
            if ending in texts:
                part.write_text(texts[ending], encoding="utf-8")
            else:
                key, date = METADATA[ending.lower()]
                metadata = {**({date: None} if date else {}), **({key: caption} if caption else {})}
                _render(figure, part, ending[1:].lower(), metadata)
    return files


def to_svg(figure: Figure, name: str) -> Element:
    """Return a figure as a part of a page; its ids begin with `name`, so that they are unique there."""
    drawn = io.StringIO()
    _render(figure, drawn, "svg", dict.fromkeys(("Creator", "Date", "Format", "Type")))
    root = ElementTree.fromstring(drawn.getvalue())
    for defs in root.findall(f"{SVG}defs"):
        for style in defs.findall(f"{SVG}style"):  # a style element would hold for the whole page
            root.set("style", str(style.text).removeprefix("*{").removesuffix("}"))
            defs.remove(style)
    for each in root.iter():
        each.tag = each.tag.removeprefix(SVG)
        for key, value in list(each.attrib.items()):
            del each.attrib[key]
            target = f"{name}-{value}" if key == "id" else value.replace("url(#", f"url(#{name}-")
            is_reference = key.endswith("href") and value.startswith("#")
            each.set(key.rpartition("}")[2], f"#{name}-{value[1:]}" if is_reference else target)
    return root


def check_files(stem: Path, endings: Iterable[str]) -> list[Path]:
    """Return the files with a stem and these endings; raise EpuckSimError if one of them cannot be written."""
    if stem.name in ("", ".."):
        raise EpuckSimError(f"{stem}: is not a file's name; give FOLDER/NAME, to which .png and so on are added")
    files = [stem.with_name(f"{stem.name}{ending}") for ending in endings]
    for file in files:
        check_target(file)
    return files


def _render(figure: Figure, target: Any, kind: str, metadata: Any) -> None:
    with warnings.catch_warnings(), rc_context(EDITABLE):
        warnings.filterwarnings("ignore", "Glyph .* missing")  # of a name in letters that the font lacks
        figure.savefig(target, format=kind, metadata=metadata)


def tabulate(groups: Iterable[tuple[Mapping[str, Any], Mapping[str, Iterable[Any]]]]) -> str:
    """Return groups as CSV; each has axis values, by key, and columns of equal length, by heading; axes are dotted."""
    every = list(groups)
    headings = (*every[0][0], *every[0][1])
    digits = [AXIS_DIGITS if "." in heading else CSV_DIGITS for heading in headings]
    rows = ([*axes.values(), *row] for axes, columns in every for row in zip(*columns.values(), strict=True))
    return csv_text(headings, (map(csv_cell, row, digits) for row in rows))


def tabulate_rows(rows: Sequence[Row]) -> str:
    """Return rows that all have the same cells as CSV."""
    return tabulate((row.axes, {name: [cell] for name, cell in row.record().items()}) for row in rows)
