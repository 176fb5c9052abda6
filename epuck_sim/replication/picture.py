"""A small figure for a claim: the curves on which its checks look at points."""

from pathlib import Path

from matplotlib import rc_context

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures import plot
from epuck_sim.figures.style import style
from epuck_sim.replication.checks import FormulaCheck
from epuck_sim.replication.claims import Claim
from epuck_sim.replication.evaluation import points_at
from epuck_sim.runs.reader import read_points
from epuck_sim.scenario.figure_axes import choose_axis
from epuck_sim.scenario.scenario import FigureSection
from epuck_sim.util.atomic_write import atomic_write

DOTS_PER_INCH = 120
"""Enough for a screen: a page has a figure for each claim."""

MIN_VALUES = 3
"""Fewest values of an axis that are drawn as a curve."""


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
