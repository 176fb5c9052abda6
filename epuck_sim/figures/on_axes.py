"""The figures of a sweep as functions that take and return Axes of matplotlib.

Each draws what `read_points` returns, T_sync or the measure that it was asked for, into the Axes that it is given, with
labels for all marks, which `ax.legend()` shows. Without Axes it makes a figure of the width of a column, with the title
of the sweep and a legend; then `ax.figure.savefig("figure.pdf")` writes it.
"""

from collections.abc import Callable, Sequence

from matplotlib import rc_context
from matplotlib.axes import Axes

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.forms import courses as course_form
from epuck_sim.figures.forms import curves as curve_form
from epuck_sim.figures.forms import maps as map_form
from epuck_sim.figures.forms import perturbations as perturbation_form
from epuck_sim.figures.forms import series as series_form
from epuck_sim.figures.forms import violins as violin_form
from epuck_sim.figures.forms.fitness import check_deviates, check_has_values, check_statistic_of_map
from epuck_sim.figures.labels import axis_label, sweep_title
from epuck_sim.figures.style import COLUMN_CM, STYLE, count_trials, finish, make_figure
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.figure_axes import choose_axis, choose_second_axis
from epuck_sim.statistics.curves import read_curves
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.series import summarize_series
from epuck_sim.util.messages import comma_list


def curves(
    points: Sequence[PointTrials],
    x: str | None = None,
    *,
    statistic: Statistic | str = Statistic.MEAN,
    ax: Axes | None = None,
) -> Axes:
    """Draw T_sync, or a measure, against an axis, a curve for each combination of the others, with 95 % bands.

    Args:
        points: What `read_points` returns.
        x: Dotted key of the horizontal axis; by default the speed.
        statistic: What stands for the trials of a point: `mean`, `median` or `weibull-mean`.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        EpuckSimError: There is no such axis, no T_sync, or the measure is a series.
    """
    axis = choose_axis([point.axes for point in points], x, "x")
    found = read_curves(points, axis, Statistic(statistic))
    searches = curve_form.find_extrema(axis, found)
    labels = axis_label(axis, (axis, *found[0].axes)), curve_form.curves_label(found)
    return _draw(points, ax, labels, lambda axes: curve_form.plot_curves(axes, axis, found, searches))


def contour_map(
    points: Sequence[PointTrials],
    x: str | None = None,
    y: str | None = None,
    *,
    statistic: Statistic | str = Statistic.MEAN,
    ax: Axes | None = None,
) -> Axes:
    """Draw T_sync, or a measure, over two axes, with a colour bar.

    Args:
        points: What `read_points` returns, or those of its points whose other axes have one value.
        x: Dotted key of the horizontal axis; by default the speed.
        y: Dotted key of the vertical axis; by default the only other one.
        statistic: What stands for the trials of a point: `mean` or `median`.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        EpuckSimError: There are no such axes, several maps, or no trial with a value.
    """
    check_has_values(points, "map")
    chosen = Statistic(statistic)
    check_statistic_of_map(chosen)
    rows = [point.axes for point in points]
    horizontal = choose_axis(rows, x, "x")
    vertical = choose_second_axis(rows, horizontal, y, "y")
    maps = map_form.read_maps(points, horizontal, vertical, chosen)
    _check_one("map", [each.axes for each in maps])
    labels = axis_label(horizontal, (vertical,)), axis_label(vertical, (horizontal,))
    return _draw(points, ax, labels, lambda axes: map_form.plot_maps([axes], horizontal, vertical, maps))


def violins(
    points: Sequence[PointTrials], x: str | None = None, *, censored_at: int | None = None, ax: Axes | None = None
) -> Axes:
    """Draw the distribution of T_sync against an axis of the sweep, and its Weibull mean (Fig. A.1), or of a measure.

    Args:
        points: What `read_points` returns, or those of its points whose other axes have one value.
        x: Dotted key of the horizontal axis; by default the speed.
        censored_at: Cycle at which the Weibull mean takes trials to be censored; by default, where they are.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        EpuckSimError: There is no such axis, there are several groups, or no trial with a value.
    """
    check_has_values(points, "violins")
    axis = choose_axis([point.axes for point in points], x, "x")
    groups = violin_form.read_violins(points, axis, censored_at)
    _check_one("group of violins", [each.axes for each in groups])
    labels = axis_label(axis), violin_form.violins_label(groups)
    return _draw(points, ax, labels, lambda axes: violin_form.plot_violins([axes], axis, groups, censored_at))


def series(points: Sequence[PointTrials], *, ax: Axes | None = None) -> Axes:
    """Draw a measure that has a value for each cycle: means over the cycles, a line for each point.

    Args:
        points: What `read_points` returns, asked for the measure.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        EpuckSimError: The measure is no series, or there are too many points.
    """
    found, labels = summarize_series(points), series_form.series_labels(str(points[0].of))
    return _draw(points, ax, labels, lambda axes: series_form.plot_series(axes, found))


def order_parameters(points: Sequence[PointTrials], *, ax: Axes | None = None) -> Axes:
    """Simulate the trials of point-like agents again, and draw their mean order parameter over time.

    Args:
        points: What `read_points` returns.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        ScenarioError: The model is another than particles.
    """
    courses = course_form.read_courses(points)
    return _draw(points, ax, course_form.ORDER_LABELS, lambda axes: course_form.plot_order_parameters(axes, courses))


def deviations(points: Sequence[PointTrials], *, ax: Axes | None = None) -> Axes:
    """Simulate the trials of point-like agents again, and draw their mean deviation from an undisturbed twin over time.

    Args:
        points: What `read_points` returns.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        ScenarioError: The model is another than particles.
        EpuckSimError: Nothing can deviate.
    """
    check_deviates(points)
    courses = course_form.read_courses(points)
    return _draw(points, ax, course_form.DEVIATION_LABELS, lambda axes: course_form.plot_deviations(axes, courses))


def perturbation(point: PointTrials, *, ax: Axes | None = None) -> Axes:
    """Simulate the first trial of a point again, and draw every agent's deviation from an undisturbed twin (Fig. 5.8).

    Args:
        point: One of the points that `read_points` returns.
        ax: Axes to draw into; those of a new figure by default.

    Returns:
        The Axes.

    Raises:
        ScenarioError: The model is another than particles.
        EpuckSimError: Nothing can deviate.
    """
    found = perturbation_form.read_perturbations([point])
    labels = perturbation_form.LABELS
    return _draw([point], ax, labels, lambda axes: perturbation_form.plot_perturbations([axes], found))


def _check_one(name: str, rows: Sequence[dict[str, object]]) -> None:
    """Raise EpuckSimError if there are several maps or groups, with these values of the other axes."""
    if len(rows) > 1:
        keys = [key for key in rows[0] if len({repr(row[key]) for row in rows}) > 1]
        raise EpuckSimError(
            f"there would be {len(rows)} panels, but Axes hold one {name}: choose points with one value of "
            f"{comma_list(keys)}"
        )


def _draw(
    points: Sequence[PointTrials], ax: Axes | None, labels: tuple[str, str], plot: Callable[[Axes], None]
) -> Axes:
    """Draw into given Axes, or into those of a new figure with a title and a legend; and label them."""
    if ax is not None:
        plot(ax)
        ax.set(xlabel=labels[0], ylabel=labels[1])
        return ax
    with rc_context(STYLE):
        trials = [len(point.times) for point in points if len(point.times)]
        figure = make_figure(f"{sweep_title(points[0].scenario)}\n{count_trials(trials)}", COLUMN_CM)
        made: Axes = figure.subplots()
        plot(made)
        made.set(xlabel=labels[0], ylabel=labels[1])
        finish(figure, [made])
    return made
