"""Writes the page of a replication, its tables, and a figure for each claim: the curves that its tests look at."""

from collections.abc import Mapping, Sequence
from pathlib import Path

from matplotlib import rc_context

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import plot
from epuck_sim.figures.style import style
from epuck_sim.replication.checks import FormulaCheck
from epuck_sim.replication.claims import Claim, Claims
from epuck_sim.replication.contents import Contents, read_contents
from epuck_sim.replication.evaluation import points_at
from epuck_sim.replication.page import make_page
from epuck_sim.replication.sweeps import Version, is_asked, sweep_folder
from epuck_sim.replication.tables import check_table, claim_table, sweep_table
from epuck_sim.replication.verdicts import Answer
from epuck_sim.runs.reader import read_points
from epuck_sim.scenario.axes import FigureSection, choose_axis
from epuck_sim.util.atomic_write import atomic_write

ALL, SOME = "replication", "chosen"
"""Stem of the page's name: of all claims, and of some, so that one does not overwrite the other."""

FIGURES = "figures"
"""Folder of its figures, beside it."""

DOTS_PER_INCH = 120
"""Enough for a screen: a page has a figure for each claim."""

MIN_VALUES = 3
"""Fewest values of an axis that are drawn as a curve."""


Written = tuple[list[Answer], Path]


def write_replication(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version) -> Written:
    """Write a page about the trials that are stored, FOLDER/replication.md, or chosen.md, and tables beside it.

    Returns:
        The answers, and the page.

    Raises:
        EpuckSimError: A run folder is missing, or a file cannot be written.
    """
    contents = read_contents(claims, chosen, folder, version)
    (folder / FIGURES).mkdir(parents=True, exist_ok=True)
    return contents.answers, write_contents(contents, _draw(claims, chosen, folder, version))


def write_contents(contents: Contents, pictures: Mapping[str, str]) -> Path:
    """Write the page and its tables, and return the page.

    Args:
        contents: What they show.
        pictures: Path of each claim's figure, relative to the page, by the claim's id.
    """
    stem = SOME if contents.chosen else ALL
    made = {"claims": claim_table(contents), "tests": check_table(contents), "sweeps": sweep_table(contents)}
    files = {name: f"{stem}.csv" if name == "claims" else f"{stem}-{name}.csv" for name in made}
    texts = {files[name]: table.to_csv() for name, table in made.items() if table.rows}
    links = {name: file for name, file in files.items() if file in texts}
    texts[f"{stem}.md"] = "\n\n".join(make_page(contents, pictures, links)) + "\n"
    for name, text in texts.items():
        with atomic_write(contents.folder / name) as part:
            part.write_text(text, encoding="utf-8")
    for name in set(files.values()) - set(texts):  # of claims that were chosen before
        (contents.folder / name).unlink(missing_ok=True)
    return contents.folder / f"{stem}.md"


def _draw(claims: Claims, chosen: Sequence[Claim], folder: Path, version: Version) -> dict[str, str]:
    pictures = {}
    for claim in chosen:
        if claim.sweep is None or not is_asked(claims, claim, version):
            continue
        path = f"{FIGURES}/claim-{claim.id}.png"
        if draw_claim(claim, sweep_folder(folder, claim.sweep, version), folder / path):
            pictures[claim.id] = path
    return pictures


def draw_claim(claim: Claim, folder: Path, path: Path) -> bool:
    """Draw the points of a claim's first test against its axis; those that the other tests share, too.

    Args:
        claim: The claim.
        folder: The run folder of its sweep.
        path: The PNG file to write.

    Returns:
        Whether there is a curve to draw.
    """
    drawn = [check for check in claim.checks if not isinstance(check, FormulaCheck) and check.take is None]
    if not drawn:
        return False
    of = drawn[0].of
    alike = [check for check in drawn if check.of == of]
    stored = read_points(folder, of)
    numbers = {point.number for check in alike for point in points_at(check.where, stored)}
    # one panel, whatever the figure of the sweep has
    plain = {"figure": FigureSection(base_case=stored[0].scenario.figure.base_case)}
    shown = [
        point._replace(scenario=point.scenario.model_copy(update=plain)) for point in stored if point.number in numbers
    ]
    try:
        axis = choose_axis([point.axes for point in shown])
        if len({point.axes[axis] for point in shown}) < MIN_VALUES:
            return False
        figure = plot(shown, form="curves", x=axis)
    except EpuckSimError:  # no axis has numbers
        return False
    with rc_context(style()), atomic_write(path) as part:
        figure.savefig(part, format="png", dpi=DOTS_PER_INCH)
    return True
