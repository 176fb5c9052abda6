"""Series of a measure over the cycles: at each point of a sweep, the mean of the trials that reach a cycle."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from epuck_sim.errors import EpuckSimError
from epuck_sim.estimate import MIN_TRIALS
from epuck_sim.figures import style
from epuck_sim.figures.forms.form import Choices, Form
from epuck_sim.figures.saving import Table, tabulate
from epuck_sim.runs.reader import PointTrials
from epuck_sim.statistics.series import PointSeries, summarize_series

COLUMNS = ("cycle", "trials", "known", "mean", "low", "high", "median", "median_low", "median_high")
"""Columns after the axes in the table: number of trials that reach the cycle, and of those with a value there."""

MAX_LINES = 20  # largest number of lines; more of them are hard to distinguish


@dataclass(kw_only=True)
class Series(Form):
    """The mean over the cycles at each point, in its 95 % band; dashed where some trials have ended before."""

    name = "series"
    takes = ("scale",)

    points: Sequence[PointSeries]

    @classmethod
    def read(cls, points: Sequence[PointTrials], choices: Choices) -> Self:
        return cls(points=summarize_series(points))

    def __post_init__(self) -> None:
        if len(self.points) > MAX_LINES:
            raise EpuckSimError(
                f"there would be {len(self.points)} lines, one for each point; allowed: up to {MAX_LINES}; epuck-sim "
                "summarize prints all"
            )

    @property
    def labels(self) -> Sequence[str]:
        return "cycle", self.quantity

    @property
    def shows(self) -> str:
        trials = style.count_trials([int(point.statistics.trials[0]) for point in self.points])
        return f"{self.of}: means over the cycles of the trials that reach them, with 95 % intervals; {trials}"

    @property
    def tables(self) -> Mapping[str, Table]:
        """A row for each cycle of each point."""
        columns = [(s.cycles, s.trials, s.known, *s.mean.T, *s.median.T) for _, s in self.points]
        each = zip(self.points, columns, strict=True)
        return {".csv": tabulate((point.axes, dict(zip(COLUMNS, found, strict=True))) for point, found in each)}

    @property
    def notes(self) -> Sequence[str]:
        few = any((point.statistics.known < MIN_TRIALS).any() for point in self.points)
        return [f"no bands where fewer than {MIN_TRIALS} trials have a value"] * few

    def draw(self, panels: Sequence[Axes]) -> None:
        (panel,) = panels
        labels, looks = self.labels_of([point.axes for point in self.points]), style.choose_looks(len(self.points))
        has_bands = has_ended = False
        for place, ((_, series), label, look) in enumerate(zip(self.points, labels, looks, strict=True)):
            mean, low, high = series.mean.T
            complete = int(np.count_nonzero(series.trials == series.trials[0]))
            style.draw_intervals(panel, series.cycles, low, high, look.colour)
            style.draw_course(panel, series.cycles[:complete], mean[:complete], place, look, style.typeset(label))
            if complete < len(mean):
                panel.plot(series.cycles[complete - 1 :], mean[complete - 1 :], "--", color=look.colour)
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
