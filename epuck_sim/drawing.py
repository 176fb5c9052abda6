"""Figures on paper and on the screen: every figure is written twice, as PNG and as SVG."""

import warnings
from pathlib import Path

from matplotlib import rc_context
from matplotlib.figure import Figure

from epuck_sim.errors import EpuckSimError
from epuck_sim.files import check_target, written_whole


def check_stem(stem: Path, *endings: str) -> list[Path]:
    """Return STEM with each of the endings; raises EpuckSimError where one of these files cannot be written."""
    if stem.name in ("", ".."):
        raise EpuckSimError(f"{stem}: is no file's name; give FOLDER/NAME, to which .png and so on are added")
    files = [stem.with_name(f"{stem.name}{ending}") for ending in endings]
    for file in files:
        check_target(file)
    return files


def save_drawing(figure: Figure, png: Path, svg: Path) -> None:
    """Write a figure into two files; nothing in them tells when: the same results give the same files."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")  # of a name in letters that the font lacks
        with written_whole(png) as part:
            figure.savefig(part, format="png", dpi=120)
        with written_whole(svg) as part, rc_context({"svg.hashsalt": "epuck-sim"}):
            figure.savefig(part, format="svg", metadata={"Date": None})
