"""What `epuck-sim plot --of` draws of a measure: which form, and series over the cycles."""

from collections.abc import Callable, Mapping, Sequence

from matplotlib.figure import Figure

from epuck_sim.cli.errors import reject_first
from epuck_sim.cli.plot import Form
from epuck_sim.figures.csv_tables import Table
from epuck_sim.figures.series import MAX_LINES, draw_series, series_table
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.estimate import MIN_TRIALS
from epuck_sim.statistics.series import has_series, summarize_series

OVER_TIME = (Form.PERTURBATION, Form.COURSE)
"""Forms for which trials are simulated again."""


def usual_form(points: Sequence[PointTrials]) -> Form:
    """Return the form of a figure if no option gives one."""
    form = Form(points[0].scenario.figure.form)
    if any(map(has_series, points)):
        return Form.SERIES
    return Form.CURVES if points[0].of is not None and form in OVER_TIME else form


def check_measure(points: Sequence[PointTrials], form: Form, censored_at: int | None) -> None:
    """Raise EpuckSimError for a form that does not fit the measure, or T_sync, that is to be drawn."""
    of, is_series = points[0].of, any(map(has_series, points))
    reject_first(
        (of is None and form == Form.SERIES, "--form series is for measures: give --of NAME"),
        (
            of is not None and form in OVER_TIME,
            f"--of is for --form curves, map, violins and series, but this is {form}",
        ),
        (
            form == Form.SERIES and not is_series,
            f"--form series: {of} is no series, but one value for each trial; allowed: curves, map or violins",
        ),
        (
            is_series and form != Form.SERIES,
            f"--form {form}: {of} is a series, with a value for each cycle; allowed: series",
        ),
        (
            of is not None and censored_at is not None,
            "--censored-at is for T_sync; measures are never censored",
        ),
    )


def sketch_series(title: str, points: Sequence[PointTrials]) -> tuple[Callable[[], Figure], Mapping[str, Table], str]:
    """Return what draws a series, its numbers, and what the figure does not show."""
    of, found = str(points[0].of), summarize_series(points)
    reject_first(
        (
            len(found) > MAX_LINES,
            f"there would be {len(found)} lines, one for each point; allowed: up to {MAX_LINES}; all are printed by "
            f"epuck-sim summarize --of {of}",
        )
    )
    few = any((point.statistics.known < MIN_TRIALS).any() for point in found)
    note = f"note: no bands where fewer than {MIN_TRIALS} trials have a value" if few else ""
    return lambda: draw_series(title, of, found), {".csv": series_table(found)}, note
