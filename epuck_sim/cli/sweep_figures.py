"""What `epuck-sim plot` draws of a run folder: its options, and the section `figure` of its scenario, as a figure."""

from collections.abc import Sequence
from pathlib import Path

from epuck_sim.cli.figure_options import SIMULATED_AGAIN, check_options, usual_form
from epuck_sim.cli.plot import FigureOptions, Form, Sketch
from epuck_sim.errors import StoreError
from epuck_sim.figures.forms.curves import NOT_A_SPEED, NOT_T_SYNC, curves_tables, draw_curves, find_extrema
from epuck_sim.figures.forms.fitness import check_has_values, check_statistic_of_map
from epuck_sim.figures.forms.maps import draw_maps, maps_table, read_maps
from epuck_sim.figures.forms.series import draw_series, series_table
from epuck_sim.figures.forms.violins import draw_violins, read_violins, violins_table
from epuck_sim.figures.labels import sweep_title
from epuck_sim.runs.reader import PointTrials, read_points
from epuck_sim.scenario.figure_axes import check_panels, choose_axis, choose_second_axis
from epuck_sim.statistics.curve_extrema import ExtremaSearch
from epuck_sim.statistics.curves import Curve, read_curves
from epuck_sim.statistics.estimate import MIN_TRIALS
from epuck_sim.statistics.extrema import MIN_SPEEDS
from epuck_sim.statistics.names import Statistic
from epuck_sim.statistics.series import summarize_series


def sketch_sweep(folder: Path, options: FigureOptions) -> Sketch:
    """Return the figure of a run folder."""
    points = read_points(folder, options.of)
    form = options.form or usual_form(points)
    check_options(points, options._replace(form=form))
    if not any(len(point.times) for point in points):
        raise StoreError(f"{folder}: holds no results yet")
    title, width_cm = sweep_title(points[0].scenario), options.width_cm
    if form == Form.SERIES:
        return _sketch_series(folder, title, points, width_cm)
    if form in SIMULATED_AGAIN:
        return _sketch_simulated(folder / form, form, title, points, width_cm)
    return _sketch_values(folder, title, points, options._replace(form=form))


def _sketch_values(folder: Path, title: str, points: Sequence[PointTrials], options: FigureOptions) -> Sketch:
    """Return the figure of T_sync, or of a measure with one value for each trial."""
    stem, figure, width_cm = folder / (options.of or "T_sync"), points[0].scenario.figure, options.width_cm
    rows, statistic = [point.axes for point in points], options.statistic or Statistic.MEAN
    x = choose_axis(rows, *_option_or_key(options.x, "--x", figure.x, f"{folder}: figure.x"))
    if options.form != Form.CURVES:
        check_has_values(points, str(options.form))
    if options.form == Form.MAP:
        check_statistic_of_map(statistic)
        key = None if figure.y == x else figure.y  # --x may have taken it
        y = choose_second_axis(rows, x, *_option_or_key(options.y, "--y", key, f"{folder}: figure.y"))
        maps = read_maps(points, x, y, statistic)
        return Sketch(stem, lambda: draw_maps(title, x, y, maps, width_cm), {".csv": maps_table(x, maps)})
    if options.form == Form.VIOLINS:
        limit = options.censored_at or (figure.censored_at_cycles if options.of is None else None)
        violins = read_violins(points, x, limit)
        table = violins_table(x, violins)
        return Sketch(stem, lambda: draw_violins(title, x, violins, limit, width_cm), {".csv": table})
    key = None if figure.panels == x else figure.panels
    panels, origin = _option_or_key(options.panels, "--panels", key, f"{folder}: figure.panels")
    curves = read_curves(points, x, statistic)
    check_panels(rows, x, panels, origin)
    extrema = find_extrema(x, curves)
    tables = curves_tables(x, curves, extrema)
    note = _note(curves, extrema)
    return Sketch(stem, lambda: draw_curves(title, x, curves, extrema, panels, width_cm), tables, note)


def _note(curves: Sequence[Curve], searches: Sequence[ExtremaSearch]) -> str:
    """Return why there are no bands or marks, where there cannot be any."""
    # that there are few speeds is plain to see
    many = (search.reason for curve, search in zip(curves, searches, strict=True) if len(curve.x) >= MIN_SPEEDS)
    reasons = [reason for reason in dict.fromkeys(many) if reason not in ("", NOT_A_SPEED.reason, NOT_T_SYNC.reason)]
    notes = [f"no minimum and peak are looked for: {reason}" for reason in reasons]
    if any((curve.trials < MIN_TRIALS).any() for curve in curves):
        notes.insert(0, f"no bands where a point has fewer than {MIN_TRIALS} trials")
    return "\n".join(f"note: {note}" for note in notes)


def _sketch_simulated(
    stem: Path, form: Form, title: str, points: Sequence[PointTrials], width_cm: float | None
) -> Sketch:
    from epuck_sim.figures.forms.courses import courses_table, draw_courses, read_courses
    from epuck_sim.figures.forms.perturbations import draw_perturbations, perturbations_table, read_perturbations

    if form == Form.COURSE:
        courses = read_courses(points)
        return Sketch(stem, lambda: draw_courses(title, courses, width_cm), {".csv": courses_table(courses)})
    found = read_perturbations(points)
    return Sketch(stem, lambda: draw_perturbations(title, found, width_cm), {".csv": perturbations_table(found)})


def _sketch_series(folder: Path, title: str, points: Sequence[PointTrials], width_cm: float | None) -> Sketch:
    of, found = str(points[0].of), summarize_series(points)
    few = any((point.statistics.known < MIN_TRIALS).any() for point in found)
    note = f"note: no bands where fewer than {MIN_TRIALS} trials have a value" if few else ""
    return Sketch(folder / of, lambda: draw_series(title, of, found, width_cm), {".csv": series_table(found)}, note)


def _option_or_key(option: str | None, name: str, value: str | None, key: str) -> tuple[str | None, str]:
    """Return the option, or else the value of the scenario's key, and the name of the one that counts."""
    return (value, key) if option is None else (option, name)
