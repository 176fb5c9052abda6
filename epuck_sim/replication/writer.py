"""Writes the page of a replication, as Markdown and as HTML, with its figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from epuck_sim.display.page import make_document
from epuck_sim.replication.claims import Claim, Claims
from epuck_sim.replication.contents import Contents, read_contents
from epuck_sim.replication.document import to_body, to_markdown
from epuck_sim.replication.page import TITLE, make_page
from epuck_sim.replication.picture import draw_claim
from epuck_sim.replication.sweeps import Version, sweep_folder
from epuck_sim.util.atomic_write import atomic_write

ALL, SOME = "replication", "chosen"
"""Stem of the page's files: of all claims, and of some, so that one does not overwrite the other."""

FIGURES = "figures"
"""Folder of its figures, beside it."""


class Written(NamedTuple):
    """A page that was written."""

    contents: Contents
    files: list[Path]


def write_replication(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version) -> Written:
    """Write a page about the trials that are stored, FOLDER/replication.md and .html, or chosen.md and .html.

    Raises:
        EpuckSimError: A run folder is missing, or a file cannot be written.
    """
    contents = read_contents(claims, chosen, folder, version)
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    blocks = list(make_page(contents, _draw(chosen, folder, version)))
    stem = SOME if contents.chosen else ALL
    texts = {".md": to_markdown(blocks), ".html": make_document(TITLE, to_body(blocks, folder))}
    files = [folder / f"{stem}{suffix}" for suffix in texts]
    for file, text in zip(files, texts.values(), strict=True):
        with atomic_write(file) as part:
            part.write_text(text, encoding="utf-8")
    return Written(contents, files)


def _draw(chosen: Sequence[Claim], folder: Path, version: Version) -> dict[str, str]:
    """Draw the figures of claims, and return their paths, relative to the page, by the claims' ids."""
    pictures = {}
    for claim in chosen:
        path = f"{FIGURES}/claim-{claim.id}.png"
        if claim.sweep and draw_claim(claim, sweep_folder(folder, claim.sweep, version), folder / path):
            pictures[claim.id] = path
    return pictures
