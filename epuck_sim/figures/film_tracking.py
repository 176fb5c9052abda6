"""The figure of a tracked film, after thesis Figs. 4.5 and 4.6: the evolving histogram, and its spread over time."""

from collections.abc import Iterator
from pathlib import Path
from string import ascii_lowercase
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.errors import FilmError
from epuck_sim.figures.csv_tables import rounded, save_table
from epuck_sim.figures.style import add_shared_legend, make_logarithmic
from epuck_sim.overhead.track.history import ACROSS, History, Snapshot, choose_moments
from epuck_sim.overhead.track.spread import LEAST_SEEN, Evaluation, frame_ends
from epuck_sim.util.atomic_write import atomic_write, check_target

COLUMNS = ("time_s", "cycles", "count", "spread_ms")
"""Of the table, a row for each evaluation: time of the mode, on the film's clock and in periods since the start."""

SHOWN_PERIODS = 1.3
"""A snapshot shows the histogram so far back."""

BAR, MARK, LIMIT, SYNC, FOUND = "#d62728", "#1f4fd8", "0.35", "#1a9641", "#39ff14"


def save_track_figure(png: Path, history: History, snapshot: Snapshot | None = None) -> list[Path]:
    """Draw FILE.png and write `COLUMNS` into FILE.csv beside it; return both. Nothing in them tells when.

    Raises FilmError for another ending, and EpuckSimError where one of the two cannot be written.
    """
    if png.suffix != ".png":
        raise FilmError(f"{png}: ends in {png.suffix!r}; allowed: .png, for the figure; its numbers go into .csv")
    files = [png, png.with_suffix(".csv")]
    for file in files:
        check_target(file)
    figure = draw_track(history, snapshot)
    with atomic_write(png) as part:
        figure.savefig(part, format="png", dpi=120)
    save_table(files[1], COLUMNS, _rows(history))
    return files


def _rows(history: History) -> Iterator[list[Any]]:
    for each in history.evaluations:
        values = (each.time_s, history.cycles(each.time_s), each.rings, 1000 * each.spread_s)
        yield [*map(rounded, values)]


def draw_track(history: History, snapshot: Snapshot | None = None) -> Figure:
    """Return the figure: snapshots of the histogram, then the counts and the spreads of the whole film.

    The first row of snapshots shows the first period, the second evaluations from the first one to synchrony, the third
    those around and after it.
    """
    figure = Figure(figsize=(15.5 if snapshot else 11, 10), layout="constrained")
    places = figure.add_gridspec(2, 2, width_ratios=(4, 10), height_ratios=(3, 2))
    if snapshot:
        _draw_picture(figure.add_subfigure(places[0, 0]), history, snapshot)
    _draw_snapshots(figure.add_subfigure(places[0, 1 if snapshot else 0 :]), history)
    counts, spreads = figure.add_subfigure(places[1, :]).subplots(2, 1, sharex=True)
    _draw_counts(counts, history)
    _draw_spreads(spreads, history)
    add_shared_legend(figure, [spreads])
    return figure


def _draw_picture(page: SubFigure, history: History, snapshot: Snapshot) -> None:
    panel = page.subplots()
    panel.imshow(snapshot.picture)
    for column, row, radius in snapshot.rings_px:
        panel.add_patch(Circle((column, row), radius, fill=False, color=FOUND, linewidth=2))
    panel.set(xticks=[], yticks=[])
    rings = len(snapshot.rings_px)
    cycles = history.cycles(snapshot.time_s)
    panel.set_title(f"{cycles:.1f} cycles: {rings} {'ring' if rings == 1 else 'rings'}", fontsize="medium")


def _draw_snapshots(page: SubFigure, history: History) -> None:
    """Draw a row of panels for each row of moments; places without one stay empty."""
    grid = page.subplots(3, ACROSS, sharex=True, sharey=True)
    letters = iter(ascii_lowercase)
    for panels, moments in zip(grid, choose_moments(history), strict=True):
        for panel, (now_s, evaluation) in zip(panels, moments, strict=False):
            _draw_snapshot(panel, history, now_s, evaluation)
            words = f"({next(letters)}) {round(history.cycles(now_s), 2):g} cycles"
            panel.set_title(words, fontsize="small", loc="left", pad=3)
        for unused in panels[len(moments) :]:
            unused.set_axis_off()
    grid[0, 0].set(xlim=(-SHOWN_PERIODS * history.period_s, 0.03 * history.period_s), ylim=(0, 1.45 * _most(history)))
    grid[0, 0].yaxis.set_major_locator(MaxNLocator(4, integer=True))
    page.supxlabel("time from now [s]", fontsize="small")
    page.supylabel("lit rings", fontsize="small")


def _draw_snapshot(panel: Axes, history: History, now_s: float, evaluation: Evaluation | None) -> None:
    """Draw what the histogram is, with now at the right; long lines mark a period, a short one its midpoint."""
    period_s = history.period_s
    oldest_s = max(now_s - SHOWN_PERIODS * period_s, history.start_s)
    first, end = np.searchsorted(history.times_s, (oldest_s, now_s))
    _fill_counts(panel, history.times_s[first:end] - now_s, history.counts[first:end], 0.0)
    top = _most(history)
    panel.vlines([-period_s, 0], 0, 1.2 * top, color=MARK, linewidth=1.6)
    panel.vlines(-period_s / 2, 1.05 * top, 1.2 * top, color=MARK, linewidth=1.6)
    panel.tick_params(labelsize="small")
    if evaluation is not None:
        style: dict[str, Any] = {"color": SYNC, "weight": "bold"} if history.begins_synchrony(evaluation) else {}
        words = f"{1000 * evaluation.spread_s:.0f} ms"
        panel.text(-period_s / 2, 1.24 * top, words, ha="center", va="bottom", fontsize="small", **style)


def _most(history: History) -> int:
    return int(history.counts.max(initial=1))


def _fill_counts(panel: Axes, times: FloatArray, counts: IntArray, end: float) -> None:
    """Draw each count for as long as its frame stands: nothing where frames are missing."""
    if len(times) < 2:
        return
    edges = np.column_stack([times, frame_ends(times, end)]).ravel()
    heights = np.column_stack([counts, np.zeros_like(counts)]).ravel()[:-1]
    panel.stairs(heights, edges, fill=True, facecolor=BAR, edgecolor=BAR, linewidth=0.4)


def _draw_counts(panel: Axes, history: History) -> None:
    times = history.cycles(history.times_s)
    _fill_counts(panel, times, history.counts, times[-1])
    panel.set(ylabel="lit rings", ylim=(0, 1.1 * _most(history)), xlim=(times[0], times[-1]))
    panel.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    _mark_synchrony(panel, history)


def _draw_spreads(panel: Axes, history: History) -> None:
    """Draw a dot for each evaluation, an empty one where too much of the period was not seen."""
    modes = history.cycles(np.array([each.time_s for each in history.evaluations]))
    spreads_ms = 1000 * np.array([each.spread_s for each in history.evaluations])
    is_seen = np.array([each.seen >= LEAST_SEEN for each in history.evaluations], bool)
    panel.plot(modes, spreads_ms, color="0.75", linewidth=0.8, zorder=1)
    panel.plot(modes[is_seen], spreads_ms[is_seen], "ko", markersize=4)
    if not is_seen.all():
        label = "frames are missing"
        panel.plot(modes[~is_seen], spreads_ms[~is_seen], "ko", markerfacecolor="white", markersize=4, label=label)
    limit_ms = 1000 * history.threshold_s
    panel.axhline(limit_ms, color=LIMIT, linestyle="--", linewidth=1, label=f"threshold: {limit_ms:.0f} ms")
    _mark_synchrony(panel, history)
    panel.set(xlabel=f"cycles of {history.period_s:.4g} s", ylabel="spread [ms]")
    make_logarithmic(panel, "y")


def _mark_synchrony(panel: Axes, history: History) -> None:
    if history.t_sync_s is not None:
        cycles = history.cycles(history.t_sync_s)
        panel.axvline(cycles, color=SYNC, linewidth=1.2, zorder=0.5, label=f"T_sync: {cycles:.1f} cycles")
