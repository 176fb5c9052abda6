"""Interface of the forms of figures: a form is one object that reads and checks, draws, and tabulates."""

from abc import ABC, abstractmethod
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuck_sim.errors import EpuckSimError
from epuck_sim.figures.labels import axis_label, format_axis_values, format_value, short_files
from epuck_sim.figures.style import GREY, PLAIN, finish, format_tick, make_panels, shifted, style, typeset
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.runs.reader import PointTrials
from epuck_sim.scenario.axes import FigureSection, choose_axis, distinguishing_axes, numeric_axes
from epuck_sim.statistics.curves import Curve
from epuck_sim.statistics.statistic import measure, measure_unit, quantity
from epuck_sim.util.messages import counted

MAX_DOTS = 1000  # largest number of trials at a point that an SVG holds as dots; more of them are a picture in it


@dataclass(frozen=True)
class Choices:
    """Choices of a figure, by its scenario and by options."""

    section: FigureSection
    """The scenario's section `figure`, with the options that are given in place of its own values."""
    given: Collection[str] = ()  # keys of the section that are given as options
    folder: str = ""  # the run folder, as messages name it
    prefix: str = ""  # what the names of options begin with in messages: `--` on the command line

    def axis(self, name: str, taken: str | None = None) -> tuple[str | None, str]:
        """Return the axis that a key of the section names, if not `taken`, and the name of the choice in messages."""
        key = getattr(self.section, name)
        if name in self.given:
            return key, f"{self.prefix}{name}"
        return None if key == taken else key, f"{self.folder}: figure.{name}"


@dataclass(kw_only=True)
class Form(ABC):
    """A way to draw a sweep, with what it shows; its texts are made with it, in `__post_init__`."""

    name: ClassVar[str]  # its name for `--form`
    shape: ClassVar[float] = 0.72  # height of a panel over its width

    of: str | None = None  # name of the measure; None for T_sync
    unit: str = ""
    ran: str = ""  # what was run, as text for captions
    ties: Sequence[str] = ()  # which axes vary together, likewise
    settings: FigureSection = field(default_factory=FigureSection)

    titles: Sequence[str] = field(init=False, default=("",))  # of the panels, from left to right and from above
    labels: Sequence[str] = field(init=False)
    """Labels of the horizontal and of the vertical axis; with several vertical ones, panels are stacked."""
    shows: str = field(init=False)  # description for captions: its statistic, and the numbers of trials

    @classmethod
    @abstractmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        """Return the form of these points; raise EpuckSimError if it does not fit the sweep, or would be blank."""

    @classmethod
    def made(cls, points: Sequence[PointTrials], choices: Choices, /, **found: Any) -> Self:
        """Return the form of what `read` has found, with the measure of the points and the settings of the choices."""
        return cls(of=points[0].of, unit=measure_unit(points[0]), settings=choices.section, **found)

    @property
    @abstractmethod
    def tables(self) -> Mapping[str, str]:
        """Its numbers as CSV, by the endings of their files."""

    @property
    def notes(self) -> Sequence[str]:
        """Sentences on parts that it does not show, and why."""
        return []

    @property
    def caption(self) -> str:
        """Caption: what was run, what is shown of it and what is not, line by line."""
        notes = [f"{note[:1].upper()}{note[1:]}." for note in (*self.ties, *self.notes)]
        return "\n".join(filter(None, [self.ran, f"{self.shows}.", *notes]))

    @abstractmethod
    def draw(self, panels: Sequence[Axes]) -> None:
        """Draw into as many Axes as it has titles; every mark has a label, which a legend shows."""

    def draw_figure(self) -> Figure:
        """Return a figure with a legend; raise EpuckSimError if there are more panels than a figure holds."""
        with rc_context(style(self.settings.font_pt)):
            figure, panels = make_panels(self.settings.title, self.titles, self.labels, self.settings.width_cm)
            self.draw(panels)
            finish(figure, panels, self.shape)
        return figure

    def draw_on(self, panels: Sequence[Axes]) -> None:
        """Draw into given Axes, and label them; raise EpuckSimError if they are not as many as the form has panels."""
        if len(panels) != len(self.titles):
            said = f"the figure has {counted(len(self.titles), 'panel')}, but ax is {len(panels)} Axes"
            raise EpuckSimError(f"{said}: give as many, or points with one value of the other axes")
        self.draw(panels)
        heights = [self.labels[1]] * len(panels) if len(self.labels) == 2 else self.labels[1:]
        for panel, title, height in zip(panels, self.titles, heights, strict=True):
            panel.set(xlabel=typeset(self.labels[0]), ylabel=typeset(height))
            if title:
                panel.set_title(typeset(title))

    @property
    def quantity(self) -> str:
        """Label of T_sync or of the measure."""
        return self.settings.labels.get(self.of or "T_sync") or quantity(self.of, self.unit)

    def label_of(self, key: str, among: Collection[str]) -> str:
        """Return the label of an axis of the figure, which names its section if others share its symbol."""
        return axis_label(key, among, self.settings.labels)

    def labels_of(self, rows: Sequence[Mapping[str, Any]], among: Collection[str] = ()) -> list[str]:
        """Return a label for each row of axis values, with what distinguishes it from the others."""
        return [format_axis_values(row, among, self.settings.labels) for row in short_files(distinguishing_axes(rows))]


def named_axis(points: Sequence[PointTrials], choices: Choices) -> tuple[str, Sequence[PointTrials], list[str]]:
    """Return the horizontal axis; points, with 0, 1 and so on in place of names that are its values; and the names."""
    rows = [point.axes for point in points]
    axis = choose_axis(rows, *choices.axis("x"), by_name=True)
    if axis in numeric_axes(rows):
        return axis, points, []
    for point in points:
        measure(point)  # what it refuses it names by the values of axes
    texts = [format_value(axis, row[axis]) for row in short_files([{axis: row[axis]} for row in rows])]
    names = list(dict.fromkeys(texts))
    each = zip(points, texts, strict=True)
    return axis, [point._replace(axes={**point.axes, axis: names.index(text)}) for point, text in each], names


def names_of(curves: Sequence[Curve]) -> list[str]:
    """Return the names of the statistics of curves, each once."""
    return list(dict.fromkeys(name for curve in curves for name in curve.names))


def joined(curves: Sequence[Any], name: str) -> Any:
    """Return the arrays with this name of all curves, or maps, joined into one."""
    return np.concatenate([getattr(curve, name) for curve in curves])


def end_scale(panels: Sequence[Axes], curves: Sequence[Curve], top: float) -> None:
    """Let vertical scales end at the top or below, with a line at the cycle at which all censored trials are."""
    limits = {each.horizon for curve in curves for each in curve.measured if each.censored}
    for panel in panels:
        if len(limits) == 1 and min(limits) <= top:
            shown = format_tick(min(limits), plain=min(limits) < PLAIN[1])
            label = f"limit: {shown} {curves[0].measured[0].unit}"
            panel.axhline(min(limits), color=GREY, linestyle=":", label=label)
        panel.set_ylim(top=min(panel.get_ylim()[1], top))


def draw_trials(panel: Axes, curve: Curve, colour: str, number: int = 0, count: int = 1) -> None:
    """Draw each trial of one of `count` curves as a dot; those of censored trials are hollow, and lie side by side."""
    looks: Any = {"color": colour, "markeredgewidth": 0.4, "markersize": 1.6, "alpha": 0.4, "zorder": 1.9}
    for place, measured in enumerate(curve.measured):
        for observed, face, label in ((True, colour, "a trial"), (False, "none", "a censored trial")):
            values = measured.values[measured.observed == observed]
            if len(values):
                row = (np.arange(len(values)) - (len(values) - 1) / 2) / len(measured.values) * (not observed)
                x = shifted(curve.x, number + row[:, None], count, panel.get_xscale() == "log")[:, place]
                dots = x, values, "o"
                panel.plot(*dots, markerfacecolor=face, rasterized=len(values) > MAX_DOTS, label=label, **looks)


def check_has_values(points: Sequence[PointTrials], form: str) -> None:
    """Raise EpuckSimError if all trials are censored, or without a value, so that a map or violins would be blank."""
    if any(measure(point).observed.any() for point in points):
        return
    of = points[0].of
    if of not in T_SYNC:
        raise EpuckSimError(f"no trial has a value of {of}, so --form {form} would be blank")
    instead = "raise stop.max_cycles, or draw --form curves, which marks where trials are censored"
    raise EpuckSimError(f"all trials are censored, so --form {form} would be blank; {instead}")
