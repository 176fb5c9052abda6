"""Curves of T_sync, or of a measure, against speed or another axis: a line for each combination of the others.

Predictions of theory, dashed, lie under curves of T_sync against speed.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray
from epuck_sim.display.table import Row
from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import MIN_TRIALS, UNDETERMINED, Estimate
from epuck_sim.figures import style
from epuck_sim.figures.forms.form import Choices, Form, draw_trials, end_scale, joined, named_axis, names_of
from epuck_sim.figures.labels import format_axis_values, short_files, statistic_label, undetermined_label
from epuck_sim.figures.saving import tabulate, tabulate_rows
from epuck_sim.measures.measure import SERIES_COLUMNS, T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import SPEED, check_panels, distinguishing_axes, is_logarithmic
from epuck_sim.statistics import Statistic, curves as curve_statistics
from epuck_sim.statistics.curves import Curve, PointSeries, group_by_other_axes, read_curves, summarize_series
from epuck_sim.statistics.extrema import MIN_SPEEDS, PLACES, ExtremaSearch, Place, search_extrema

if TYPE_CHECKING:  # or figures would wait for the models
    from epuck_sim.theory.predict import Prediction

POINT_COLUMNS = ("trials", "censored", "statistic", "estimate", "low", "high")
"""Columns after the axes in a table of curves: number of trials, share of censored ones, what is estimated, cycles."""

MAX_CURVES = 500  # largest number of curves of a figure; more are neither told apart nor quickly drawn

MAX_EXTRAPOLATION = 100
"""Largest Weibull mean that is shown, as a multiple of the limit of trials; larger ones are extrapolated too far."""

EXTREMUM: Any = {"markersize": 7, "markeredgecolor": "black"}  # looks of the minimum and the peak

NOT_A_SPEED = ExtremaSearch({}, None, "the axis is no speed")

PREDICTED_AXES = ("agents.speed_cm_s", "robots.0.parameters.speed_cm_s")  # axes over which there are predictions
MOST_PREDICTED = 12  # largest number of curves that are predicted: each takes about a second
SPEEDS = 60  # number of speeds at which a curve is predicted

DASHES: dict[str, Any] = {"linestyle": (0, (5, 2)), "linewidth": 0.7, "zorder": 1.5}
"""Looks of predictions, which lie under the results of trials."""

PLACE: dict[str, Any] = {"markerfacecolor": "white", "markersize": 5, "linewidth": 0.7}  # of predicted V_m and V_p
EDGE = 0.04  # length of the marks of the limits at the edges of a panel, as a share of its width

CELLS = ("regime", "probability", "v_m", "v_p", "t_frozen", "frozen_share", "t_fast")  # cells of predictions' table

CAPTION = (
    "dashed is T_sync as predict computes it from who hears whom, without a trial: curves, at the left edge for "
    "standing swarms, at the right for the fastest"
)
HOLLOW = "; hollow triangles are V_m (down) and V_p (up), with their standard deviations, at the top without T_sync"


class Predicted(NamedTuple):
    """Prediction of a curve."""

    speeds: FloatArray  # (S,) cm/s, ascending
    times: FloatArray  # (S,) T_sync, cycles
    at_any: "Prediction"  # what holds at all of these speeds

    @property
    def places(self) -> list[tuple[Estimate, str]]:
        """V_m and V_p where they are within the speeds, and their markers."""
        places = ((self.at_any.v_m_cm_s, "v"), (self.at_any.v_p_cm_s, "^"))
        return [each for each in places if self.speeds[0] <= each[0].value <= self.speeds[-1]]


def predict_curves(axis: str, curves: Sequence[Curve]) -> list[Predicted]:
    """Return predictions of curves of T_sync; raise EpuckSimError if the axis or a swarm cannot be predicted."""
    from epuck_sim.theory.predict import predictor  # noqa: PLC0415 few figures need the models

    if curves[0].of is not None or axis not in PREDICTED_AXES:
        this = f"{curves[0].of or 'this'} is against {axis}"
        raise EpuckSimError(f"predictions are of T_sync in cycles against {' or '.join(PREDICTED_AXES)}, but {this}")
    if len(curves) > MOST_PREDICTED:
        raise EpuckSimError(f"predictions are of up to {MOST_PREDICTED} curves, but these are {len(curves)}")
    curve_statistics.check_speed_alone(curves)
    found = []
    for curve in curves:
        moving = curve.x[curve.x > 0]
        speeds = np.geomspace(moving.min(), moving.max(), SPEEDS) if len(moving) else np.zeros(1)
        at = [*map(predictor(curve.scenario), speeds.tolist())]
        found.append(Predicted(speeds, np.array([each.t_sync.value for each in at]), at[0]))
    return found


@dataclass(kw_only=True)
class Curves(Form):
    """Curves with their 95 % bands.

    The scale is logarithmic for T_sync, and for measures that are positive and far apart. Points are hollow where
    trials are censored, at a grey line; a cross on the upper edge is undetermined; triangles are the local minimum and
    the peak, where found; the base case is dashed.
    """

    name = "curves"

    axis: str  # dotted key of the horizontal axis
    curves: Sequence[Curve]
    names: Sequence[str] = ()  # values of the axis if they are no numbers; points are then at 0, 1 and so on
    split_by: str | None = None  # dotted key of the axis that has a panel for each of its values; None for one panel
    predicted: Sequence[Predicted] = ()  # prediction of each curve; empty if there is none
    unpredicted: str = ""  # why there is none, though the scenario asks for it
    placed: Sequence[tuple[str, str, style.Look]] = field(init=False)
    """Title of the panel, label and look of each curve; curves with one label, in several panels, look alike."""

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        rows = [point.axes for point in points]
        axis, points, names = named_axis(points, choices)
        split_by, origin = choices.axis("panels", taken=axis)
        if (count := len(group_by_other_axes(points, axis))) > MAX_CURVES:
            said = f"there would be {count} curves, one for each combination of the other axes"
            raise EpuckSimError(f"{said}; allowed: up to {MAX_CURVES}; draw against another --x, or --form map")
        curves = read_curves(points, axis, Statistic(choices.section.statistic))
        check_panels(rows, axis, split_by, origin)
        found: dict[str, Any] = {"axis": axis, "curves": curves, "names": names, "split_by": split_by}
        try:
            found["predicted"] = predict_curves(axis, curves) if choices.section.theory else ()
        except EpuckSimError as error:
            if "theory" in choices.given:
                raise EpuckSimError(f"{choices.prefix}theory: {error}") from error
            found["unpredicted"] = str(error)
        return cls.made(points, choices, **found)

    def __post_init__(self) -> None:
        rows, names = [curve.axes for curve in self.curves], names_of(self.curves)
        keys = (self.axis, *rows[0])
        x, _ = self.labels = self.label_of(self.axis, keys), statistic_label(names, self.quantity)
        trials = style.count_trials(joined(self.curves, "trials").tolist())
        self.shows = f"{' or '.join(names).capitalize()} of {self.quantity} against {x}, with 95 % intervals; {trials}"
        heads = short_files([{self.split_by: row[self.split_by]} if self.split_by else {} for row in rows])
        titles = [format_axis_values(head, keys, self.settings.labels) for head in heads]
        self.titles = list(dict.fromkeys(titles))
        told = short_files(distinguishing_axes(rows))
        own = [{key: value for key, value in row.items() if key != self.split_by} for row in told]
        labels = [format_axis_values(row, (self.axis, *told[0]), self.settings.labels) for row in own]
        places = {label: number for number, label in enumerate(dict.fromkeys(labels))}
        looks = style.choose_looks(len(places))
        self.placed = [(title, label, looks[places[label]]) for title, label in zip(titles, labels, strict=True)]

    @cached_property
    def searches(self) -> Sequence[ExtremaSearch]:
        """Minimum and peak of each curve of T_sync against speed; none of others."""
        if self.of not in T_SYNC or not self.axis.endswith(SPEED):
            return [NOT_A_SPEED] * len(self.curves)
        return [search_extrema(curve) for curve in self.curves]

    def panels_of(self, panels: Sequence[Axes]) -> list[Axes]:
        """Return the panel of each curve."""
        return [panels[self.titles.index(title)] for title, _, _ in self.placed]

    @property
    def tables(self) -> Mapping[str, str]:
        """The points of the curves; of T_sync against speed minima and peaks, or a reason; and predictions."""
        rows: dict[str, list[Row]] = {"-regimes.csv": [], "-theory.csv": []}
        for curve, search in zip(self.curves, self.searches, strict=True):
            places = {name.lower(): search.places[name].estimate if search.places else UNDETERMINED for name in PLACES}
            if search is not NOT_A_SPEED:
                row = Row(curve.axes, {**places, "p_value": search.p_value, "reason": search.reason})
                rows["-regimes.csv"].append(row)
        for curve, predicted in zip(self.curves, self.predicted, strict=False):
            rows["-theory.csv"].append(Row(curve.axes, {name: predicted.at_any.cells[name] for name in CELLS}))
        points = {".csv": curves_table(self.axis, self.curves, self.names)}
        return points | {ending: tabulate_rows(each) for ending, each in rows.items() if each}

    @property
    def notes(self) -> Sequence[str]:
        """Reasons why there are no bands, marks or predictions, and what predictions leave out."""
        searched = zip(self.curves, self.searches, strict=True)
        many = (search.reason for curve, search in searched if len(curve.x) >= MIN_SPEEDS)  # few are plain to see
        reasons = [each for each in dict.fromkeys(many) if each not in ("", NOT_A_SPEED.reason)]
        notes = [f"no minimum and peak are looked for: {reason}" for reason in reasons]
        if any((curve.trials < MIN_TRIALS).any() for curve in self.curves):
            notes.insert(0, f"no bands where a point has fewer than {MIN_TRIALS} trials")
        if self.unpredicted:
            notes.append(f"no prediction: {self.unpredicted}")
        if self.predicted:
            notes.append(f"{CAPTION}{HOLLOW * any(each.places for each in self.predicted)}")
        left_out = dict.fromkeys(note.removesuffix(".") for each in self.predicted for note in each.at_any.notes)
        return [*notes, *left_out]

    def draw(self, panels: Sequence[Axes]) -> None:
        self._draw_predictions(panels)
        x = joined(self.curves, "x")
        is_log = style.has_log_scale(self.of, joined(self.curves, "values"), self.settings.scale)
        top, beyond = self._ends(is_log)
        for panel in panels:
            style.make_logarithmic(panel, *["y"] * is_log, *["x"] * is_logarithmic(self.axis, x))
            style.mark_wholes(panel.xaxis, x)
            style.set_names(panel, self.names)
        looks = {label: look for _, label, look in self.placed}
        for label, look in looks.items():
            if label:
                shown: Any = {"label": style.typeset(label), "linestyle": "none" if self.names else "-"}
                panels[0].plot([], [], marker=look.marker, color=look.colour, **shown)
        each = zip(self.curves, self.placed, strict=True)
        crossed = [*dict.fromkeys(label for curve, (_, label, _) in each if np.isnan(curve.values).any())]
        drawn = zip(self.panels_of(panels), self.curves, self.searches, self.placed, strict=True)
        for panel, curve, search, (_, label, look) in drawn:
            number, is_log_x = [*looks].index(label), panel.get_xscale() == "log"
            places = style.shifted(curve.x, number, len(looks), is_log_x) if self.names else curve.x
            self._draw_curve(panel, curve._replace(x=places), search.places, look, beyond)
            if label in crossed and not self.names:
                places = style.shifted(curve.x, crossed.index(label), len(crossed), is_log_x)
            style.draw_crosses(panel, places[np.isnan(curve.values)], look.colour)
            if self.settings.points:
                draw_trials(panel, curve, look.colour, number, len(looks))
        self._label_marks(panels[0])
        end_scale(panels, self.curves, top)

    def _draw_predictions(self, panels: Sequence[Axes]) -> None:
        for panel, each, (*_, look) in zip(self.panels_of(panels), self.predicted, self.placed, strict=False):
            speeds, times, at_any = each
            looks: Any = {"color": look.colour, **DASHES}
            panel.plot(speeds, times, **looks)
            for limit, edge in ((at_any.t_sync_frozen, (0, EDGE)), (at_any.t_sync_fast, (1 - EDGE, 1))):
                panel.plot(edge, (limit.value,) * 2, transform=panel.get_yaxis_transform(), **looks)
            for place, marker in each.places:
                ends = np.clip((place.low, place.value, place.high), speeds[0], speeds[-1])
                time = np.interp(np.log(place.value), np.log(speeds), times)
                top: Any = {"transform": panel.get_xaxis_transform(), "clip_on": False, "in_layout": False}
                height, at = (1, top) if math.isnan(time) else (time, {})
                panel.plot(ends, (height,) * 3, marker=marker, markevery=[1], color=look.colour, **PLACE, **at)

    def _ends(self, is_log: bool) -> tuple[float, float]:
        """Return the highest end of the scale, and the upper end of bands that have no known end."""
        dots = [each.values for curve in self.curves for each in curve.measured if self.settings.points]
        values = np.concatenate([joined(self.curves, "values"), *dots, *(each.times for each in self.predicted)])
        known = values[np.isfinite(values)]
        if self.of not in T_SYNC:
            ends = joined(self.curves, "intervals")[:, 1]
            return math.inf, float(np.concatenate([known, ends[np.isfinite(ends)]]).max(initial=-math.inf))
        limits = (each.limit for curve in self.curves for each in curve.measured)
        longest = MAX_EXTRAPOLATION * max(limits, default=math.inf)
        return (3 if is_log else 1.5) * min(float(known.max(initial=1.0 if len(known) else math.inf)), longest), 1e12

    def _draw_curve(self, panel: Axes, curve: Curve, found: Mapping[str, Place], look: style.Look, end: float) -> None:
        """Draw a line, with a gap where it is undetermined, in its band; over names only points and bars."""
        known = ~np.isnan(curve.values)
        low, high = np.where(known[:, None], np.nan_to_num(curve.intervals, nan=np.nan, posinf=end), np.nan).T
        if self.names:
            panel.vlines(curve.x, low, high, look.colour, linewidth=1)
        else:
            style.draw_intervals(panel, curve.x, low, high, look.colour)
            panel.plot(curve.x, curve.values, "--" if is_base_case(curve) else "-", color=look.colour)
        for censored, face in ((False, look.colour), (True, "white")):
            chosen = known & ((curve.censored > 0) == censored)
            panel.plot(curve.x[chosen], curve.values[chosen], look.marker, color=look.colour, markerfacecolor=face)
        for v, t, marker in (("V_m", "T_m", "v"), ("V_p", "T_p", "^")) if found else ():
            speed, time = found[v].estimate.value, found[t].estimate.value
            panel.plot(speed, time, marker, color=look.colour, zorder=4, **EXTREMUM)

    def _label_marks(self, panel: Axes) -> None:
        is_known = ~np.isnan(joined(self.curves, "values"))
        if np.isfinite(joined(self.curves, "intervals")[is_known, 0]).any():
            marks: Any = {"color": style.GREY, "label": "95 % interval"}
            panel.vlines([], [], [], **marks) if self.names else panel.fill_between([], [], alpha=style.BAND, **marks)
        if any(map(is_base_case, self.curves)):
            panel.plot([], [], "--", color=style.GREY, label="base case")
        if (joined(self.curves, "censored")[is_known] > 0).any():
            label = "restricted mean: some censored" if self.settings.statistic == "mean" else "some trials censored"
            panel.plot([], [], "o", color=style.GREY, markerfacecolor="white", label=label)
        if not is_known.all():
            panel.plot([], [], "x", color=style.GREY, label=undetermined_label(self.of))
        if any(search.places for search in self.searches):
            for marker, label in (("v", "local minimum V_m"), ("^", "peak V_p")):
                panel.plot([], [], marker, color=style.GREY, label=style.typeset(label), **EXTREMUM)
        if self.predicted:
            panel.plot([], [], color=style.GREY, label="predicted", **DASHES)
        if any(each.places for each in self.predicted):
            panel.plot([], [], "^", color=style.GREY, label=style.typeset("predicted V_m and V_p"), **PLACE)


def curves_table(axis: str, curves: Sequence[Curve], values: Sequence[str] = ()) -> str:
    """Return CSV with a row for each point of curves over `axis`, whose `values` may be names, after other axes."""
    xs = [np.array(values)[c.x.astype(int)] if values else c.x for c in curves]
    columns = [(c.trials, c.censored, c.names, c.values, *c.intervals.T) for c in curves]
    each = zip(curves, xs, columns, strict=True)
    return tabulate((c.axes, {axis: x, **c.tied, **dict(zip(POINT_COLUMNS, row, strict=True))}) for c, x, row in each)


def is_base_case(curve: Curve) -> bool:
    """Return whether a curve has the axis values that its scenario calls the base case."""
    base = curve.scenario.figure.base_case
    return bool(base) and all(key in curve.axes and curve.axes[key] == value for key, value in base.items())


MAX_LINES = 20  # largest number of lines; more of them are hard to distinguish


@dataclass(kw_only=True)
class Series(Form):
    """A line for each point: the mean at each cycle in its 95 % band, dashed where some trials have ended before."""

    name = "series"

    points: Sequence[PointSeries]

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        return cls.made(points, choices, points=summarize_series(points))

    def __post_init__(self) -> None:
        if len(self.points) > MAX_LINES:
            said = f"there would be {len(self.points)} lines, one for each point; allowed: up to {MAX_LINES}"
            raise EpuckSimError(f"{said}; epuck-sim summarize prints all")
        trials = style.count_trials([int(point.statistics.trials[0]) for point in self.points])
        over = self.points[0].statistics.over
        self.labels = f"{over} of 5 s" if all(point.is_timed for point in self.points) else over, self.quantity
        self.shows = f"{self.of}: means over the {over}s of the trials that reach them, with 95 % intervals; {trials}"

    @property
    def tables(self) -> Mapping[str, str]:
        """A row for each cycle of each point."""
        rows = []
        for _, axes, s, *_ in self.points:
            columns = s.trials, s.known, *s.mean.T, *s.median.T
            rows.append((axes, {s.over: s.cycles, **dict(zip(SERIES_COLUMNS, columns, strict=True))}))
        return {".csv": tabulate(rows)}

    @property
    def notes(self) -> Sequence[str]:
        few = any((point.statistics.known < MIN_TRIALS).any() for point in self.points)
        return [f"no bands where fewer than {MIN_TRIALS} trials have a value"] * few

    def draw(self, panels: Sequence[Axes]) -> None:
        (panel,) = panels
        labels, looks = self.labels_of([point.axes for point in self.points]), style.choose_looks(len(self.points))
        has_bands = has_ended = False
        for place, (point, label, look) in enumerate(zip(self.points, labels, looks, strict=True)):
            series = point.statistics
            mean, low, high = series.mean.T
            complete = int(np.count_nonzero(series.trials == series.trials[0]))
            style.draw_intervals(panel, series.cycles, low, high, look.colour)
            style.draw_course(panel, series.cycles[:complete], mean[:complete], place, look, style.typeset(label))
            if complete < len(mean):
                style.draw_course(panel, series.cycles[complete - 1 :], mean[complete - 1 :], place, look, "", "--")
            has_bands |= bool(np.isfinite(low).any())
            has_ended |= complete < len(mean)
        means = np.concatenate([point.statistics.mean[:, 0] for point in self.points])
        if self.settings.scale == "log" and style.has_log_scale(self.of, means, "log"):
            style.make_logarithmic(panel, "y")
        panel.xaxis.set_major_locator(MaxNLocator(integer=True))
        if has_bands:
            panel.fill_between([], [], color=style.GREY, alpha=style.BAND, linewidth=0, label="95 % interval")
        if has_ended:
            panel.plot([], [], "--", color=style.GREY, label="some trials have ended")
