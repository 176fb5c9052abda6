"""HTML and SVG as trees of elements: whatever text they hold is escaped when they are written."""

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from xml.etree.ElementTree import Element, tostring

from epuck_sim.errors import EpuckSimError
from epuck_sim.util.atomic_write import atomic_write, check_target

Node = Element | str  # A part of a page: an element, or text


def element(tag: str, *children: Node, **attributes: object) -> Element:
    """Return an element; in the names of attributes, _ stands for -, and a last _ keeps them apart from Python's words.

    Values that are floats have five significant digits.

    >>> to_html(element("p", "1 < 2, ", element("b", "surely"), "!", class_="note"))
    '<p class="note">1 &lt; 2, <b>surely</b>!</p>'
    """
    given = {name: f"{value:.5g}" if isinstance(value, float) else str(value) for name, value in attributes.items()}
    made = Element(tag, {name.rstrip("_").replace("_", "-"): value for name, value in given.items()})
    for child in children:
        if isinstance(child, Element):
            made.append(child)
        elif len(made):
            made[-1].tail = (made[-1].tail or "") + child
        else:
            made.text = (made.text or "") + child
    return made


def table(headings: Sequence[str], rows: Iterable[Sequence[Node]], **attributes: object) -> Element:
    """Return a table with a row of headings, in a box that scrolls, by keys, too; cells are text or elements."""
    head = element("tr", *(element("th", heading, scope="col") for heading in headings))
    body = (element("tr", *(element("td", cell) for cell in row)) for row in rows)
    made = element("table", element("thead", head), element("tbody", *body), **attributes)
    return element("div", made, class_="scroll", tabindex=0)


def facts(rows: Iterable[tuple[str, Node]]) -> Element:
    """Return a table of names and their values."""
    made = (element("tr", element("th", name, scope="row"), element("td", value)) for name, value in rows)
    return element("table", element("tbody", *made), class_="facts")


def details(summary: str, *children: Node) -> Element:
    """Return a part of a page that is shown when its summary is clicked."""
    return element("details", element("summary", summary), *children)


def to_html(*nodes: Node) -> str:
    """Return elements as HTML."""
    root = element("div", *nodes)
    return tostring(root, encoding="unicode", method="html").removeprefix("<div>").removesuffix("</div>")


def in_words(seconds: float) -> str:
    """Return a time as text for people.

    >>> in_words(42), in_words(200), in_words(20000)
    ('42 s', '3 min', '5.6 h')
    """
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"


STYLE = """
:root { color-scheme: light dark; --paper: #ffffff; --ink: #1c2126; --faint: #5b646d; --rule: #d5dadf; --box: #f3f5f7 }
@media (prefers-color-scheme: dark) {
  :root { --paper: #14171c; --ink: #e6e9ec; --faint: #a3adb7; --rule: #3a424b; --box: #1e232a }
}
* { box-sizing: border-box }
body { margin: 0 auto; padding: 1rem clamp(.75rem, 3vw, 2.5rem) 4rem; max-width: 84rem; background: var(--paper);
  color: var(--ink); font: 16px/1.5 system-ui, sans-serif }
h1, h2, h3 { line-height: 1.2; overflow-wrap: anywhere } h2 { margin-top: 2.5rem; border-top: 1px solid var(--rule);
  padding-top: 1.2rem }
p { max-width: 48rem; overflow-wrap: anywhere } .note { color: var(--faint) }
nav a { margin-right: 1rem } a { color: inherit }
.scroll { overflow: auto; max-height: 34rem; border: 1px solid var(--rule); border-radius: 6px }
table { border-collapse: collapse; font-variant-numeric: tabular-nums }
th, td { padding: .25rem .75rem; text-align: right; vertical-align: top; white-space: nowrap }
thead th { position: sticky; top: 0; background: var(--box) } tbody tr:nth-child(even) { background: var(--box) }
.facts { table-layout: fixed; width: 100%; max-width: 56rem } .facts th { width: 38%; color: var(--faint) }
.facts th, .facts td, .left th, .left td { text-align: left } .facts th { font-weight: 400 }
.facts th, .facts td { white-space: normal; overflow-wrap: anywhere } .left td { white-space: pre-wrap }
pre, code { font: .875em/1.45 ui-monospace, monospace } code { overflow-wrap: anywhere }
pre { background: var(--box); border-radius: 6px; padding: .75rem 1rem; overflow: auto; max-height: 34rem }
summary { cursor: pointer; margin: .75rem 0 }
figure { margin: 1.5rem 0 } figcaption { color: var(--faint); max-width: 48rem }
figure > svg { display: block; width: 100%; max-width: 40rem; height: auto; background: #ffffff; border-radius: 6px }
"""
"""Style of the page."""

POLICY = "default-src 'none'; img-src data:; style-src 'unsafe-inline'"
"""Content policy of a page: it loads and runs nothing, whatever names and messages of others it contains."""


def write_html(path: Path | str, make: Callable[[], str]) -> None:
    """Make a page and write it, once its file is known to be writable; raise EpuckSimError if it is not."""
    target = Path(path)
    if target.suffix not in (".html", ".htm"):
        raise EpuckSimError(f"{target}: unknown format {target.suffix!r}; allowed: .html")
    check_target(target)
    page = make()
    with atomic_write(target) as part:
        part.write_text(page, encoding="utf-8", errors="backslashreplace")


def make_document(title: str, body: str) -> str:
    """Return a page with this title; the body is HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"{to_html(element('title', title))}<style>{STYLE}</style></head>\n<body><main>\n{body}</main></body></html>\n"
    )
