"""The parts of a page in Markdown."""

from collections.abc import Sequence
from typing import NamedTuple


class Code(NamedTuple):
    """Text as it is typed."""

    text: str


class Link(NamedTuple):
    """A word that leads to the heading of this name on the page."""

    text: str


Cell = str | Code | Link


def paragraph(*parts: Cell) -> str:
    """Return running text of these parts."""
    return "".join(map(_in_markdown, parts))


def table(headings: Sequence[str], rows: Sequence[Sequence[Cell]]) -> str:
    """Return a table."""
    lines = [headings, ["---"] * len(headings), *(map(_in_markdown, row) for row in rows)]
    return "\n".join(f"| {' | '.join(cell.replace('|', BAR) for cell in line)} |" for line in lines)


BAR = r"\|"
"""A bar that does not end a cell."""


def _in_markdown(cell: Cell) -> str:
    if isinstance(cell, Code):
        return f"`{cell.text}`"
    if isinstance(cell, Link):
        return f"[{cell.text}](#{cell.text.lower().replace(' ', '-')})"
    return cell.replace("*", r"\*").replace("_", r"\_").replace("<", r"\<")
