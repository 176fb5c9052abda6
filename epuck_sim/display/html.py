"""HTML and SVG as trees of elements: whatever text they hold is escaped when they are written."""

from collections.abc import Iterable, Sequence
from xml.etree.ElementTree import Element, tostring

Node = Element | str
"""A part of a page: an element, or text."""


def element(tag: str, *children: Node, **attributes: object) -> Element:
    """Return an element; in the names of attributes, _ stands for -, and a last _ keeps them apart from Python's words.

    >>> to_html(element("p", "1 < 2, ", element("b", "surely"), "!", class_="note"))
    '<p class="note">1 &lt; 2, <b>surely</b>!</p>'
    """
    made = Element(tag, {name.rstrip("_").replace("_", "-"): str(value) for name, value in attributes.items()})
    for child in children:
        if isinstance(child, Element):
            made.append(child)
        elif len(made):
            made[-1].tail = (made[-1].tail or "") + child
        else:
            made.text = (made.text or "") + child
    return made


def table(headings: Sequence[str], rows: Iterable[Sequence[Node]], **attributes: object) -> Element:
    """Return a table with a row of headings; cells are text or elements."""
    head = element("tr", *(element("th", heading, scope="col") for heading in headings))
    body = (element("tr", *(element("td", cell) for cell in row)) for row in rows)
    return element("table", element("thead", head), element("tbody", *body), **attributes)


def facts(rows: Iterable[tuple[str, Node]]) -> Element:
    """Return a table of names and their values."""
    made = (element("tr", element("th", name, scope="row"), element("td", value)) for name, value in rows)
    return element("table", element("tbody", *made), class_="facts")


def details(summary: str, *children: Node) -> Element:
    """Return what is shown when its summary is clicked."""
    return element("details", element("summary", summary), *children)


def to_html(*nodes: Node) -> str:
    """Return elements as HTML."""
    root = element("div", *nodes)
    return tostring(root, encoding="unicode", method="html").removeprefix("<div>").removesuffix("</div>")
