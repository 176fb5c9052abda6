"""Writes the page of a replication, with its figures."""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from epuck_sim.replication.claims import Claim, Claims
from epuck_sim.replication.contents import Contents, read_contents
from epuck_sim.replication.page import make_page
from epuck_sim.replication.picture import draw_claim
from epuck_sim.replication.sweeps import Version, sweep_folder
from epuck_sim.util.atomic_write import atomic_write

ALL, SOME = "replication", "chosen"
"""Stem of the page's name: of all claims, and of some, so that one does not overwrite the other."""

FIGURES = "figures"
"""Folder of its figures, beside it."""


class Written(NamedTuple):
    """A page that was written."""

    contents: Contents
    file: Path


def write_replication(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version) -> Written:
    """Write a page about the trials that are stored, FOLDER/replication.md, or chosen.md.

    Raises:
        EpuckSimError: A run folder is missing, or a file cannot be written.
    """
    contents = read_contents(claims, chosen, folder, version)
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    page = "\n\n".join(make_page(contents, _draw(chosen, folder, version))) + "\n"
    file = folder / f"{SOME if contents.chosen else ALL}.md"
    with atomic_write(file) as part:
        part.write_text(page, encoding="utf-8")
    return Written(contents, file)


def _draw(chosen: Sequence[Claim], folder: Path, version: Version) -> dict[str, str]:
    """Draw the figures of claims, and return their paths, relative to the page, by the claims' ids."""
    pictures = {}
    for claim in chosen:
        path = f"{FIGURES}/claim-{claim.id}.png"
        if claim.sweep and draw_claim(claim, sweep_folder(folder, claim.sweep, version), folder / path):
            pictures[claim.id] = path
    return pictures
