"""Which form a figure of `epuck-sim plot` has, and which options go with it."""

from collections.abc import Sequence

from epuck_sim.cli.errors import reject_first
from epuck_sim.cli.plot import FigureOptions, Form
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.series import has_series

SIMULATED_AGAIN = (Form.PERTURBATION, Form.COURSE)
"""Forms for which trials are simulated again."""


def usual_form(points: Sequence[PointTrials]) -> Form:
    """Return the form of a figure if no option gives one."""
    form = Form(points[0].scenario.figure.form)
    if any(map(has_series, points)):
        return Form.SERIES
    return Form.CURVES if points[0].of is not None and form in SIMULATED_AGAIN else form


def check_options(points: Sequence[PointTrials], options: FigureOptions) -> None:
    """Raise EpuckSimError for a form that does not fit the measure, or T_sync, and for options that do not fit it."""
    _check_form(points, options)
    form = options.form
    reject_first(
        (
            options.x is not None and form in (*SIMULATED_AGAIN, Form.SERIES),
            f"--x is for --form curves, map and violins, but this is {form}, over time",
        ),
        (options.y is not None and form != Form.MAP, f"--y is for --form map, but this is {form}"),
        (options.panels is not None and form != Form.CURVES, f"--panels is for --form curves, but this is {form}"),
        (
            options.censored_at is not None and form != Form.VIOLINS,
            f"--censored-at is for --form violins, but this is {form}",
        ),
        (
            options.statistic is not None and form not in (Form.CURVES, Form.MAP),
            f"--statistic is for --form curves and map, but this is {form}",
        ),
    )


def _check_form(points: Sequence[PointTrials], options: FigureOptions) -> None:
    of, form, is_series = options.of, options.form, any(map(has_series, points))
    reject_first(
        (of is None and form == Form.SERIES, "--form series is for measures: give --of NAME"),
        (
            of is not None and form in SIMULATED_AGAIN,
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
            of is not None and options.censored_at is not None,
            "--censored-at is for T_sync; measures are never censored",
        ),
    )
