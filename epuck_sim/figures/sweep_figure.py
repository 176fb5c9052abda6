"""The figure of a sweep: which form it has, and which options go with it."""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.figures.forms.form import Choices, Form
from epuck_sim.figures.labels import sweep_title
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.validation import validate
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.series import has_series

FORMS = {
    "curves": "curves:Curves",
    "map": "maps:Maps",
    "violins": "violins:Violins",
    "series": "series:Series",
    "perturbation": "twins:Perturbation",
    "course": "twins:Courses",
}
"""Module in `figures.forms` and class of each form, by its name."""

SIMULATED_AGAIN = ("perturbation", "course")
"""Forms for which trials are simulated again."""


def plot(
    results: Path | str | Sequence[PointTrials],
    *,
    of: str | None = None,
    form: str | None = None,
    x: str | None = None,
    y: str | None = None,
    panels: str | None = None,
    statistic: Statistic | str | None = None,
    censored_at_cycles: int | None = None,
    width_cm: float | None = None,
    ax: Axes | Sequence[Axes] | None = None,
) -> Figure:
    """Draw T_sync, or a measure, of a sweep.

    What is not given is as the section `figure` of the scenario says.

    Args:
        results: A run folder, or what `read_points` returns of one.
        of: Name of a measure of the folder's trials; T_sync by default.
        form: `curves`, `map`, `violins`, `series`, or, of point agents, `perturbation` or `course`.
        x: Dotted key of the horizontal axis; by default the speed.
        y: Dotted key of the vertical axis of a map.
        panels: Dotted key of the axis of curves that has a panel for each of its values.
        statistic: What stands for the trials of a point: `mean`, `median` or `weibull-mean`.
        censored_at_cycles: Cycle at which the Weibull mean beside violins takes trials to be censored.
        width_cm: Width of a new figure; by default that of a column, or of a page for several panels.
        ax: Axes to draw into, one for each panel. They get neither title nor legend, but all marks have labels, which
            `ax.legend()` shows. By default there is a new figure with both.

    Returns:
        The new figure, or that of `ax`.

    Raises:
        EpuckSimError: There is nothing to draw, or an option does not fit the form or the sweep.
    """
    points = read_points(results, of) if isinstance(results, Path | str) else results
    options = {
        "form": form,
        "x": x,
        "y": y,
        "panels": panels,
        "statistic": statistic,
        "censored_at_cycles": censored_at_cycles,
        "width_cm": width_cm,
    }
    drawn = read_form(points, options, str(results) if isinstance(results, Path | str) else "the scenario")
    if ax is None:
        return drawn.draw_figure(sweep_title(points[0].scenario))
    given = [ax] if isinstance(ax, Axes) else list(ax)
    drawn.draw_on(given)
    figure = given[0].get_figure(root=True)
    assert figure is not None
    return figure


def read_form(points: Sequence[PointTrials], options: Mapping[str, Any], folder: str, prefix: str = "") -> Form:
    """Return what is to be drawn of points of a sweep.

    Args:
        points: The points.
        options: Options of the figure, by the names of the keys of the section `figure`; None where it decides.
        folder: What messages call the run folder.
        prefix: What the names of options begin with in messages.

    Raises:
        EpuckSimError: There is nothing to draw, or an option does not fit the form or the sweep.
    """
    given = {name: value for name, value in options.items() if value is not None}
    scenario = points[0].scenario
    wanted = {**scenario.model_dump(mode="json"), "figure": {**scenario.figure.model_dump(mode="json"), **given}}
    choices = Choices(validate(wanted, folder).figure, given.keys(), folder, prefix)
    name = choices.section.form if "form" in given else _usual_form(points)
    _check_fit(points, name, given)
    form = _find(name)
    for option in given:
        takers = [each for each in FORMS if option in _find(each).takes]
        if takers and name not in takers:
            flag = option.removesuffix("_cycles").replace("_", "-")
            others = " and ".join(filter(None, [", ".join(takers[:-1]), takers[-1]]))
            raise EpuckSimError(f"--{flag} is for --form {others}, but this is {name}")
    if not any(len(point.times) for point in points):
        raise StoreError(f"{folder}: holds no results yet")
    return form.read(points, choices)


def _find(name: str) -> type[Form]:
    module, _, member = FORMS[name].partition(":")
    found: type[Form] = getattr(import_module(f"epuck_sim.figures.forms.{module}"), member)
    return found


def _usual_form(points: Sequence[PointTrials]) -> str:
    """Return the form of a figure if no option gives one."""
    form = points[0].scenario.figure.form
    if any(map(has_series, points)):
        return "series"
    return "curves" if form in (SIMULATED_AGAIN if points[0].of is not None else ["series"]) else form


def _check_fit(points: Sequence[PointTrials], form: str, given: Mapping[str, Any]) -> None:
    """Raise EpuckSimError for a form that does not fit the measure, or T_sync."""
    of, is_series = points[0].of, any(map(has_series, points))
    mistakes = {
        "--form series is for measures: give --of NAME": of is None and form == "series",
        f"--of is for --form curves, map, violins and series, but this is {form}": of and form in SIMULATED_AGAIN,
        f"--form series: {of} is no series, but one value for each trial; allowed: curves, map or violins": (
            form == "series" and not is_series
        ),
        f"--form {form}: {of} is a series, with a value for each cycle; allowed: series": (
            is_series and form != "series"
        ),
        "--censored-at is for T_sync; measures are never censored": of and "censored_at_cycles" in given,
    }
    for message, is_made in mistakes.items():
        if is_made:
            raise EpuckSimError(message)
