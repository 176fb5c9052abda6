"""The command `plot`: figures of run folders and of recorded trials."""

from collections.abc import Callable, Mapping, Sequence
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from epuck_sim.cli.errors import exit_on_error, reject_first
from epuck_sim.errors import StoreError
from epuck_sim.statistics.names import Statistic

if TYPE_CHECKING:  # or --help would wait for numpy
    from matplotlib.figure import Figure

    from epuck_sim.figures.csv_tables import Table
    from epuck_sim.runs.reader import PointTrials
    from epuck_sim.statistics.curve_extrema import ExtremaSearch
    from epuck_sim.statistics.curves import Curve

plots = typer.Typer()

STATISTIC = typer.Option(
    "--statistic",
    help="What stands for the trials of a point: their mean (restricted to the limit of cycles where trials are "
    "censored), by default; their median; or the mean of the nearest Weibull distribution (Appendix A).",
)


class Form(StrEnum):
    """A way to draw a sweep."""

    CURVES = "curves"
    MAP = "map"
    VIOLINS = "violins"
    SERIES = "series"
    PERTURBATION = "perturbation"
    COURSE = "course"


class FigureOptions(NamedTuple):
    """Options of `plot` about the figure of a sweep; for one that is None, the scenario's section `figure` decides."""

    form: Form | None
    x: str | None
    y: str | None
    panels: str | None
    censored_at: int | None
    statistic: Statistic | None
    of: str | None


class Sketch(NamedTuple):
    """A figure to be drawn and saved."""

    default_stem: Path
    """Stem of its files if `--to` is not given."""
    draw: "Callable[[], Figure]"
    tables: "Mapping[str, Table]"
    """Its numbers, by the endings of their files."""
    note: str = ""
    """What the figure does not show, and why; or nothing."""


@plots.command()
def plot(
    results: Annotated[
        Path, typer.Argument(metavar="FOLDER|FILE.rrd", help="A run folder, or the recording of a trial.")
    ],
    to: Annotated[
        Path | None,
        typer.Option(
            metavar="STEM|FILE",
            help="Write STEM.png, STEM.svg and so on, or one picture, FILE.png, FILE.svg or FILE.pdf, with its numbers "
            "as CSV beside it. By default STEM is FOLDER/T_sync, FOLDER/NAME_OF_MEASURE, FOLDER/FORM, or the "
            "recording's name.",
        ),
    ] = None,
    form: Annotated[
        Form | None, typer.Option(help="How to draw a sweep; by default as the scenario says, or else curves.")
    ] = None,
    x: Annotated[
        str | None, typer.Option(metavar="KEY", help="Horizontal axis of a sweep's figure; by default the speed.")
    ] = None,
    y: Annotated[str | None, typer.Option(metavar="KEY", help="Vertical axis of a map.")] = None,
    panels: Annotated[
        str | None, typer.Option(metavar="KEY", help="Axis of curves that has a panel for each of its values.")
    ] = None,
    censored_at: Annotated[
        int | None,
        typer.Option(metavar="CYCLES", min=1, help="For violins: estimate the mean as if trials were censored there."),
    ] = None,
    statistic: Annotated[Statistic | None, STATISTIC] = None,
    of: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Draw a measure of the folder's trials instead of T_sync; one that is a series against the cycles.",
        ),
    ] = None,
) -> None:
    """Draw a sweep's T_sync as curves, a map or violins, or the course of its trials over time; or a recorded trial."""
    with exit_on_error():
        from epuck_sim.figures.saving import Target, parse_target, save_figure

        target = parse_target(to) if to else None
        options = FigureOptions(form, x, y, panels, censored_at, statistic, of)
        sketch = _sketch_sweep(results, options) if results.is_dir() else _sketch_trial(results, options)
        for file in save_figure(target or Target(sketch.default_stem), sketch.draw, sketch.tables):
            typer.echo(file)
        if sketch.note:
            typer.echo(sketch.note, err=True)


def _sketch_trial(recording: Path, options: FigureOptions) -> Sketch:
    from epuck_sim.figures.trial_page import check_drawable, draw_page
    from epuck_sim.recording.reader import read_recording

    names = ("--form", "--x", "--y", "--panels", "--censored-at", "--statistic", "--of")
    reject_first(
        *(
            (value is not None, f"{name} is for run folders; {recording} is none")
            for name, value in zip(names, options, strict=True)
        )
    )
    recorded = read_recording(recording)
    check_drawable(recorded, str(recording))
    return Sketch(recording.with_suffix(""), lambda: draw_page(recorded), {})


def _sketch_sweep(folder: Path, options: FigureOptions) -> Sketch:
    from epuck_sim.cli.measure_plots import check_measure, sketch_series, usual_form
    from epuck_sim.runs.reader import read_points, read_status

    points = read_points(folder, options.of)
    form = options.form or usual_form(points)
    check_measure(points, form, options.censored_at)
    over_time = form in (Form.PERTURBATION, Form.COURSE)
    reject_first(
        (
            options.x is not None and (over_time or form == Form.SERIES),
            f"--x is for figures of T_sync, but this is {form}, over time",
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
    if not any(len(point.times) for point in points):
        raise StoreError(f"{folder}: holds no results yet")
    title = read_status(folder).scenario
    if form == Form.SERIES:
        return Sketch(folder / str(options.of), *sketch_series(title, points))
    if over_time:
        return _sketch_over_time(folder / form, title, form, points)
    return _sketch_t_sync(folder, title, points, options._replace(form=form))


def _sketch_t_sync(folder: Path, title: str, points: "Sequence[PointTrials]", options: FigureOptions) -> Sketch:
    from epuck_sim.figures.curves import curves_tables, draw_curves, find_extrema
    from epuck_sim.figures.maps import draw_maps, maps_table, read_maps
    from epuck_sim.figures.violins import draw_violins, read_violins, violins_table
    from epuck_sim.scenario.figure_axes import check_panels, choose_axis, choose_second_axis
    from epuck_sim.statistics.curves import read_curves

    stem, figure = folder / (options.of or "T_sync"), points[0].scenario.figure
    rows, statistic = [point.axes for point in points], options.statistic or Statistic.MEAN
    x = choose_axis(rows, *_option_or_key(options.x, "--x", figure.x, f"{folder}: figure.x"))
    if options.form == Form.MAP:
        key = None if figure.y == x else figure.y  # --x may have taken it
        y = choose_second_axis(rows, x, *_option_or_key(options.y, "--y", key, f"{folder}: figure.y"))
        maps = read_maps(points, x, y, statistic)
        return Sketch(stem, lambda: draw_maps(title, x, y, maps), {".csv": maps_table(x, maps)})
    if options.form == Form.VIOLINS:
        limit = options.censored_at or (figure.censored_at_cycles if options.of is None else None)
        violins = read_violins(points, x, limit)
        return Sketch(stem, lambda: draw_violins(title, x, violins, limit), {".csv": violins_table(x, violins)})
    key = None if figure.panels == x else figure.panels
    panels, origin = _option_or_key(options.panels, "--panels", key, f"{folder}: figure.panels")
    curves = read_curves(points, x, statistic)
    check_panels(rows, x, panels, origin)
    extrema = find_extrema(x, curves)
    tables = curves_tables(x, curves, extrema)
    return Sketch(stem, lambda: draw_curves(title, x, curves, extrema, panels), tables, _note(curves, extrema))


def _note(curves: "Sequence[Curve]", searches: "Sequence[ExtremaSearch]") -> str:
    """Return why there are no bands or marks, where there cannot be any."""
    from epuck_sim.figures.curves import NOT_A_SPEED, NOT_T_SYNC
    from epuck_sim.statistics.estimate import MIN_TRIALS
    from epuck_sim.statistics.extrema import MIN_SPEEDS

    # that there are few speeds is plain to see
    many = (search.reason for curve, search in zip(curves, searches, strict=True) if len(curve.x) >= MIN_SPEEDS)
    reasons = [reason for reason in dict.fromkeys(many) if reason not in ("", NOT_A_SPEED.reason, NOT_T_SYNC.reason)]
    notes = [f"no minimum and peak are looked for: {reason}" for reason in reasons]
    if any((curve.trials < MIN_TRIALS).any() for curve in curves):
        notes.insert(0, f"no bands where a point has fewer than {MIN_TRIALS} trials")
    return "\n".join(f"note: {note}" for note in notes)


def _sketch_over_time(stem: Path, title: str, form: Form, points: "Sequence[PointTrials]") -> Sketch:
    from epuck_sim.figures.courses import courses_table, draw_courses, read_courses
    from epuck_sim.figures.perturbations import draw_perturbations, perturbations_table, read_perturbations

    if form == Form.COURSE:
        courses = read_courses(points)
        return Sketch(stem, lambda: draw_courses(title, courses), {".csv": courses_table(courses)})
    perturbations = read_perturbations(points)
    return Sketch(stem, lambda: draw_perturbations(title, perturbations), {".csv": perturbations_table(perturbations)})


def _option_or_key(option: str | None, name: str, value: str | None, key: str) -> tuple[str | None, str]:
    """Return the option, or else the value of the scenario's key, and the name of the one that counts."""
    return (value, key) if option is None else (option, name)
