"""The figure of a sweep: which form it has, and which options go with it."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from importlib import import_module
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.errors import EpuckSimError, StoreError
from epuck_sim.figures.forms.form import Choices, Form
from epuck_sim.figures.labels import FOLDER, format_axis_values, group_labels, short_files
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.axes import SIMULATED_AGAIN, check_labels, distinguishing_axes, is_tied_to, numeric_axes
from epuck_sim.scenario.keys import axis_key
from epuck_sim.scenario.loader import validate
from epuck_sim.scenario.scenario import Scenario
from epuck_sim.statistics.curves import has_series
from epuck_sim.statistics.statistic import check_units
from epuck_sim.util.messages import comma_list, short_repr

FORMS = {
    "curves": ("curves:Curves", ("x", "panels", "statistic", "scale", "points", "theory")),
    "map": ("maps:Maps", ("x", "y", "statistic", "scale")),
    "violins": ("violins:Violins", ("x", "censored_at_cycles", "scale", "points")),
    "series": ("curves:Series", ("scale",)),
    "perturbation": ("twins:Perturbation", ()),
    "course": ("twins:Courses", ()),
}
"""Module in `figures.forms` and class of each form, by its name, and the options that not all forms take."""

Results = Path | str | Sequence[Path | str] | Sequence[PointTrials]  # a run folder, several, or the points of one


def plot(
    results: Results,
    *,
    of: str | None = None,
    where: Sequence[str] | None = None,
    names: Sequence[str] = (),
    ax: Axes | Sequence[Axes] | None = None,
    **options: object,
) -> Figure:
    """Draw T_sync, or a measure, of a sweep, or of several in one figure.

    Args:
        results: A run folder, or what `read_points` returns of one, or several folders of one scenario.
        of: Name of a measure of the folders' trials; T_sync by default.
        where: Axes with the values that points must have, such as `count=5,10`; all points by default.
        names: Name of each of several folders in the figure; their own by default.
        ax: Axes to draw into, one for each panel. They get no legend, but all marks have labels, which `ax.legend()`
            shows, and titles only where there are several panels. By default there is a new figure with a legend.
        options: Keys of the section `figure` of scenarios, instead of the scenario's own: `form`, `x`, `y`, `panels`,
            `statistic`, `censored_at_cycles`, `title`, `labels`, `scale`, `points`, `theory`, `width_cm` and `font_pt`.

    Returns:
        The new figure, or that of `ax`.

    Raises:
        EpuckSimError: There is nothing to draw, or an option does not fit the form or the sweep.
    """
    form = read_form(results, options, of, names, where=where)
    if ax is None:
        return form.draw_figure()
    given: list[Axes] = [*np.ravel(np.array(ax, object))]
    if not all(isinstance(each, Axes) for each in given):
        raise EpuckSimError(f"ax is {short_repr(ax)}; allowed: Axes, or several")
    form.draw_on(given)
    figure = given[0].get_figure(root=True)
    assert figure is not None
    return figure


def read_form(
    results: Results,
    options: Mapping[str, object],
    of: str | None = None,
    names: Sequence[str] = (),
    prefix: str = "",
    where: Sequence[str] | None = None,
) -> Form:
    """Return the form that `plot` draws; options that are None are those of the scenario.

    In messages the names of options begin with `prefix`.
    """
    given_results = list(results) if isinstance(results, Iterable) and not isinstance(results, str) else [results]
    if not given_results:
        raise EpuckSimError("there is nothing to draw; give a run folder, or points of one")
    folders = [each for each in given_results if isinstance(each, Path | str)]
    points = [each for each in given_results if isinstance(each, PointTrials)]
    if len(given_results) not in (len(folders), len(points)):
        kinds = comma_list([*dict.fromkeys(type(each).__name__ for each in given_results)])
        raise EpuckSimError(f"results are of the type {kinds}; allowed: run folders, or points of one folder")
    if recording := next((each for each in folders if Path(each).suffix == ".rrd"), None):
        own = "its own: `plot FILE.rrd`, or in Python epuck_sim.figures.trial_page.draw_page(read_recording(FILE))"
        raise EpuckSimError(f"{recording}: is a recording, which gets a figure of {own}")
    if points and (names or where or of not in (None, points[0].of)):
        raise EpuckSimError("names, where and of are for run folders; for points, give read_points(folder, of=NAME)")
    where = [where] if isinstance(where, str) else where
    points = points or _read_folders(folders, of, where, names)
    folder = str(folders[0]) if folders else "the scenario"
    rows, scenario = [point.axes for point in points], points[0].scenario
    given: dict[str, Any] = {name: value for name, value in options.items() if value is not None}
    given |= {name: axis_key(given[name], rows, f"{prefix}{name}") for name in ("x", "y", "panels") if name in given}
    if isinstance(labels := given.get("labels"), Mapping):  # otherwise validation refuses it
        given["labels"] = {axis_key(key, rows, f"{prefix}label"): text for key, text in labels.items()}
    wanted = {**scenario.model_dump(mode="json"), "figure": {**scenario.figure.model_dump(mode="json"), **given}}
    section = validate(wanted, folder).figure
    name = section.form if "form" in given else _usual_form(points)
    _check_fit(points, name, given)
    origin = f"{prefix}label" if "labels" in given else f"{folder}: figure.labels"
    check_labels(section.labels, points[0].axes, (measure.name for measure in scenario.measures), origin)
    if not any(len(point.times) for point in points):
        raise StoreError(f"{folder}: holds no results yet")
    module, _, member = FORMS[name][0].partition(":")
    found: type[Form] = getattr(import_module(f"epuck_sim.figures.forms.{module}"), member)
    section = section.model_copy(update={"labels": {**group_labels(scenario), **section.labels}})
    form = found.read(points, Choices(section, given.keys(), folder, prefix))
    limits = [f"only points with {' and '.join(where)}"] if where else []
    form.ran, form.ties = _describe(points, folders), [*limits, *_tell_ties(points, section.labels)]
    return form


def _read_folders(
    folders: Sequence[Path | str], of: str | None, where: Sequence[str] | None, names: Sequence[str]
) -> list[PointTrials]:
    """Return the points of run folders; if there are several, the folder's name is an axis."""
    sweeps = [read_points(folder, of, where) for folder in folders]
    if len(folders) == 1 and not names:
        return sweeps[0]
    own = [Path(folder).resolve().name for folder in folders]
    names = names or (own if len(set(own)) == len(own) else [str(folder) for folder in folders])
    if not (all(names) and len(set(names)) == len(names) == len(folders) > 1):
        raise EpuckSimError(f"names need several folders, and a different name for each; given: {comma_list([*names])}")
    firsts = [sweep[0] for sweep in sweeps]
    kinds = [f"model {point.scenario.model} over {comma_list(sorted(point.axes))}" for point in firsts]
    for folder, kind in zip(folders, kinds, strict=True):
        if kind != kinds[0]:
            said = f"is of another scenario than {folders[0]}: {kind}, and not {kinds[0]}"
            raise EpuckSimError(f"{folder}: {said}; one figure shows folders of one scenario, or variants of it")
    check_units(firsts)
    named = zip(names, sweeps, strict=True)
    keys = {FOLDER: "", **firsts[0].axes}  # in the order of the first folder
    return [point._replace(axes={**keys, FOLDER: name, **point.axes}) for name, sweep in named for point in sweep]


def _describe(points: Sequence[PointTrials], folders: Sequence[Path | str]) -> str:
    places = [f", run folder {Path(folder).resolve().name}" for folder in folders] or [""]
    scenarios: dict[str | None, Scenario] = {}
    for point in points:
        scenarios.setdefault(point.axes.get(FOLDER), point.scenario)
    lines = []
    for (name, scenario), place in zip(scenarios.items(), places, strict=True):
        title = f"{scenario.description[:1].upper()}{scenario.description[1:]}" or scenario.name
        head = f"{name}: " if name else ""
        lines.append(f"{head}{title} (scenario {scenario.name}, seed {scenario.seed}{place}).")
    return "\n".join(lines)


def _tell_ties(points: Sequence[PointTrials], labels: Mapping[str, str]) -> Iterator[str]:
    """Yield a sentence on each axis that is tied to an earlier one, as in a zip, of which a figure shows but one."""
    rows = short_files([point.axes for point in points])
    kept = distinguishing_axes(rows)[0]
    for key, other in product(rows[0], kept):
        if key not in kept and is_tied_to(key, other, rows):
            pairs = (format_axis_values({other: row[other], key: row[key]}, row, labels) for row in rows)
            yield f"together vary {'; '.join(dict.fromkeys(pairs))}"


def _usual_form(points: Sequence[PointTrials]) -> str:
    form = points[0].scenario.figure.form
    if any(map(has_series, points)):
        return "series"
    form = "curves" if form in (SIMULATED_AGAIN if points[0].of is not None else ["series"]) else form
    rows = [point.axes for point in points]
    return "violins" if form == "curves" and rows[0] and not numeric_axes(rows) else form


def _check_fit(points: Sequence[PointTrials], form: str, given: Mapping[str, object]) -> None:
    """Raise EpuckSimError if a form does not fit the measure, or T_sync, or if options do not fit the form."""
    of, is_series = points[0].of, any(map(has_series, points))
    mistakes: dict[str, object] = {
        "--form series is for measures: give --of NAME": of is None and form == "series",
        f"--of is for --form curves, map, violins and series, but this is {form}": of and form in SIMULATED_AGAIN,
        f"--form series: {of} is no series, but one value for each trial; allowed: curves, map or violins": (
            form == "series" and not is_series
        ),
        f"--form {form}: {of} is a series, with several values a trial; allowed: series": (
            is_series and form != "series"
        ),
        f"--censored-at is for T_sync in cycles, but this is {of}": of and "censored_at_cycles" in given,
    }
    for option, value in given.items():
        takers = [each for each, (_, takes) in FORMS.items() if option in takes]
        others = " and ".join(filter(None, [", ".join(takers[:-1]), *takers[-1:]]))
        mistakes[f"{flag(option, value)} is for --form {others}, but this is {form}"] = form not in (takers or [form])
    for message, is_made in mistakes.items():
        if is_made:
            raise EpuckSimError(message)


def flag(option: str, value: object) -> str:
    """Return the name of an option with a value on the command line.

    >>> flag("censored_at_cycles", 5), flag("scale", "log")
    ('--censored-at', '--log')
    """
    return f"--{value}" if option == "scale" else f"--{option.removesuffix('_cycles').replace('_', '-')}"
