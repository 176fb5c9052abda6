"""The frame of an HTML page that is complete in itself, and fits readers' themes."""

from pathlib import Path

from epuck_sim.display.html import element, to_html
from epuck_sim.errors import EpuckSimError

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
"""What a page may load, and run: nothing, whatever names and messages of others stand in it."""


SUFFIXES = (".html", ".htm")
"""Endings of a page's name."""


def check_suffix(path: Path) -> None:
    """Raise EpuckSimError if a file's name is not that of a page."""
    if path.suffix not in SUFFIXES:
        raise EpuckSimError(f"{path}: unknown format {path.suffix!r}; allowed: .html")


def make_document(title: str, body: str) -> str:
    """Return a page with this title; the body is HTML."""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">'
        f"{to_html(element('title', title))}<style>{STYLE}</style></head>\n<body>\n{body}</body></html>\n"
    )
