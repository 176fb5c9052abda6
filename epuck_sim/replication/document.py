"""A page as a list of blocks, which are written as Markdown or as HTML."""

import base64
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from epuck_sim.display.html import Node, element, table, to_html


class Code(NamedTuple):
    """Text as it is typed."""

    text: str


class Link(NamedTuple):
    """A word that leads to the heading of this name on the page."""

    text: str


Cell = str | Code | Link


class Heading(NamedTuple):
    """A heading; level 1 is the page's title."""

    level: int
    text: str


class Paragraph(NamedTuple):
    """Running text."""

    parts: tuple[Cell, ...]


class Rows(NamedTuple):
    """A table."""

    headings: Sequence[str]
    rows: Sequence[Sequence[Cell]]


class Picture(NamedTuple):
    """A PNG file beside the page."""

    path: str
    """Relative to the page."""
    caption: str


Block = Heading | Paragraph | Rows | Picture


def paragraph(*parts: Cell) -> Paragraph:
    """Return a paragraph of these parts."""
    return Paragraph(parts)


def to_markdown(blocks: Iterable[Block]) -> str:
    """Return blocks as Markdown."""
    return "\n\n".join(map(_block_in_markdown, blocks)) + "\n"


def _block_in_markdown(block: Block) -> str:
    if isinstance(block, Heading):
        return f"{'#' * block.level} {block.text}"
    if isinstance(block, Paragraph):
        return "".join(map(_in_markdown, block.parts))
    if isinstance(block, Picture):
        return f"![{block.caption}]({block.path})"
    lines = [block.headings, ["---"] * len(block.headings), *(map(_in_markdown, row) for row in block.rows)]
    return "\n".join(f"| {' | '.join(cell.replace('|', BAR) for cell in line)} |" for line in lines)


BAR = r"\|"
"""A bar that does not end a cell."""


def _in_markdown(cell: Cell) -> str:
    if isinstance(cell, Code):
        return f"`{cell.text}`"
    if isinstance(cell, Link):
        return f"[{cell.text}](#{_anchor(cell.text)})"
    return cell.replace("*", r"\*").replace("_", r"\_").replace("<", r"\<")


def _anchor(text: str) -> str:
    return text.lower().replace(" ", "-")


def to_body(blocks: Iterable[Block], folder: Path) -> str:
    """Return blocks as HTML; pictures are read from the folder, and become parts of it."""
    nodes = {Heading: _heading, Paragraph: _paragraph, Rows: _rows, Picture: _picture_in(folder)}
    return to_html(*(nodes[type(block)](block) for block in blocks))  # type: ignore[operator]


def _heading(block: Heading) -> Node:
    return element(f"h{block.level}", block.text, id=_anchor(block.text))


def _paragraph(block: Paragraph) -> Node:
    return element("p", *map(_node, block.parts))


def _rows(block: Rows) -> Node:
    made = table(block.headings, ([_node(cell) for cell in row] for row in block.rows), class_="left")
    return element("div", made, class_="scroll")


def _picture_in(folder: Path) -> Callable[[Picture], Node]:
    def show(block: Picture) -> Node:
        data = base64.b64encode((folder / block.path).read_bytes()).decode()
        image = element("img", src=f"data:image/png;base64,{data}", alt=block.caption)
        return element("figure", image, element("figcaption", block.caption))

    return show


def _node(cell: Cell) -> Node:
    if isinstance(cell, Code):
        return element("code", cell.text)
    return element("a", cell.text, href=f"#{_anchor(cell.text)}") if isinstance(cell, Link) else cell
