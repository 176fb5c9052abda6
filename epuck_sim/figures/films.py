"""The figures of a tracked film, like thesis Figs. 4.5 and 4.6, and of a film beside simulated trials."""

import math
from collections.abc import Sequence
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.patches import Circle
from matplotlib.ticker import MaxNLocator

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.display.table import csv_cell, csv_text
from epuck_sim.figures.saving import parse_target, save_figure
from epuck_sim.figures.style import add_shared_legend, make_logarithmic, typeset
from epuck_sim.overhead import ROUNDING
from epuck_sim.overhead.annotate import TrackedFrame
from epuck_sim.overhead.synchrony import MIN_COVERAGE, Evaluation, frame_ends
from epuck_sim.overhead.track import Track
from epuck_sim.util.messages import counted

if TYPE_CHECKING:  # or the figure of a film would wait for numba and pymunk
    from epuck_sim.overhead.compare import QuantityComparison

COLUMNS = ("time_s", "periods", "count", "spread_ms")
"""Columns of the table, a row per evaluation: time of the mode on the film's clock and in periods, rings, spread."""

ACROSS = 4  # snapshots in a row of the figure
SHOWN_PERIODS = 1.3  # periods of the past that a snapshot of the histogram shows
PANELS_ACROSS = 3  # panels in a row beside trials
BAR, MARK, LIMIT, SYNC, FOUND = "#d62728", "#1f4fd8", "0.35", "#5a0096", "#00e5ff"
TRIALS, FILM = "0.6", "#d62728"


def save_track_figure(png: Path, track: Track, snapshot: TrackedFrame | None = None) -> list[Path]:
    """Draw the figure of a tracked film as FILE.png, with a snapshot if there is one, and its evaluations as FILE.csv.

    EpuckSimError is raised if one of the files cannot be written.
    """
    rows = (
        [*map(csv_cell, (each.time_s, track.periods_at(each.time_s), each.rings, 1000 * each.spread_s))]
        for each in track.evaluations
    )
    return save_figure(parse_target(png), lambda: draw_track(track, snapshot), {".csv": csv_text(COLUMNS, rows)})


def draw_track(track: Track, snapshot: TrackedFrame | None = None) -> Figure:
    """Return the figure: snapshots of the histogram, then the counts and the spreads of the whole film.

    The first row of snapshots shows the first period; the second shows evaluations from the first one to synchrony; the
    third shows those around synchrony and after it.
    """
    figure = Figure(figsize=(15.5 if snapshot else 11, 10), dpi=120, layout="constrained")
    places = figure.add_gridspec(2, 2, width_ratios=(4, 10), height_ratios=(3, 2))
    if snapshot:
        panel, rings = figure.add_subfigure(places[0, 0]).subplots(), counted(len(snapshot.rings), "ring")
        panel.imshow(snapshot.frame.picture)
        for ring in snapshot.rings:
            panel.add_patch(Circle((ring.x_px, ring.y_px), ring.radius_px, fill=False, color=FOUND, linewidth=2))
        panel.set(xticks=[], yticks=[])
        panel.set_title(f"{track.periods_at(snapshot.frame.time_s):.1f} periods: {rings}", fontsize="medium")
    _draw_snapshots(figure.add_subfigure(places[0, 1 if snapshot else 0 :]), track)
    counts, detector = figure.add_subfigure(places[1, :]).subplots(2, 1, sharex=True)
    times = track.periods_at(track.times_s)
    _fill_counts(counts, times, track.counts, times[-1])
    counts.set(ylabel="lit rings", ylim=(0, 1.1 * _max_count(track)), xlim=(times[0], times[-1]))
    counts.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    _mark_synchrony(counts, track)
    _draw_spreads(detector, track)
    add_shared_legend(figure, [detector])
    return figure


def _draw_snapshots(page: SubFigure, track: Track) -> None:
    """Draw histograms of moments, the present at the right; long lines mark a period, a short one its midpoint."""
    grid, period_s, top = page.subplots(3, ACROSS, sharex=True, sharey=True), track.period_s, _max_count(track)
    letters = iter(ascii_lowercase)
    for panels, moments in zip(grid, choose_moments(track), strict=True):
        for panel, (now_s, evaluation) in zip(panels, moments, strict=False):
            oldest_s = max(now_s - SHOWN_PERIODS * period_s, track.start_s)
            shown = slice(*np.searchsorted(track.times_s, (oldest_s, now_s)))
            _fill_counts(panel, track.times_s[shown] - now_s, track.counts[shown], 0.0)
            panel.vlines([-period_s, 0], 0, 1.2 * top, color=MARK, linewidth=1.6)
            panel.vlines(-period_s / 2, 1.05 * top, 1.2 * top, color=MARK, linewidth=1.6)
            panel.tick_params(labelsize="small")
            if evaluation is not None:
                is_first = _is_first_synchrony(track, evaluation)
                looks: dict[str, Any] = {"color": SYNC, "weight": "bold"} if is_first else {}
                looks |= {"ha": "center", "va": "bottom", "fontsize": "small"}
                panel.text(-period_s / 2, 1.24 * top, f"{1000 * evaluation.spread_s:.0f} ms", **looks)
            title = f"({next(letters)}) {round(track.periods_at(now_s), 2):g} periods"
            panel.set_title(title, fontsize="small", loc="left", pad=3)
        for unused in panels[len(moments) :]:
            unused.set_axis_off()
    grid[0, 0].set(xlim=(-SHOWN_PERIODS * period_s, 0.03 * period_s), ylim=(0, 1.45 * top))
    grid[0, 0].yaxis.set_major_locator(MaxNLocator(4, integer=True))
    page.supxlabel("time from now (s)", fontsize="small")
    page.supylabel("lit rings", fontsize="small")


def _max_count(track: Track) -> int:
    return int(track.counts.max(initial=1))


def _fill_counts(panel: Axes, times: FloatArray, counts: IntArray, end: float) -> None:
    """Draw each count for the time its frame stands for; nothing where frames are missing."""
    if len(times) < 2:
        return
    edges = np.column_stack([times, frame_ends(times, end)]).ravel()
    heights = np.column_stack([counts, np.zeros_like(counts)]).ravel()[:-1]
    panel.stairs(heights, edges, fill=True, facecolor=BAR, edgecolor=BAR, linewidth=0.4)


def _draw_spreads(panel: Axes, track: Track) -> None:
    """Draw a dot for each evaluation; an empty one if too much of its period was not seen."""
    modes = track.periods_at(np.array([each.time_s for each in track.evaluations]))
    spreads_ms = 1000 * np.array([each.spread_s for each in track.evaluations])
    is_seen = np.array([each.coverage >= MIN_COVERAGE for each in track.evaluations], bool)
    panel.plot(modes, spreads_ms, color="0.75", linewidth=0.8, zorder=1)
    panel.plot(modes[is_seen], spreads_ms[is_seen], "ko", markersize=4)
    if not is_seen.all():
        label = "frames are missing"
        panel.plot(modes[~is_seen], spreads_ms[~is_seen], "ko", markerfacecolor="white", markersize=4, label=label)
    limit_ms = track.threshold_ms
    panel.axhline(limit_ms, color=LIMIT, linestyle="--", linewidth=1, label=f"threshold: {limit_ms:.0f} ms")
    _mark_synchrony(panel, track)
    panel.set(xlabel=f"periods of {track.period_s:.4g} s", ylabel="spread (ms)")
    make_logarithmic(panel, "y")


def _mark_synchrony(panel: Axes, track: Track) -> None:
    line: dict[str, Any] = {"color": SYNC, "linewidth": 1.2, "zorder": 0.5}
    if track.t_sync_periods is not None:
        label = f"T_sync: {track.t_sync_cycles} cycles, {track.t_sync_s:.1f} s"
        panel.axvline(track.t_sync_periods, **line, label=label)
    if track.histogram_periods is not None:
        label = f"by the histogram: {track.histogram_periods:.1f} periods"
        panel.axvline(track.histogram_periods, **line, linestyle=":", label=label)


def choose_moments(track: Track) -> list[list[tuple[float, Evaluation | None]]]:
    """Return three rows of up to `ACROSS` moments, in order of time, each with the evaluation made at that moment.

    An evaluation is made half a period after its mode, when the mode is at the midpoint.
    """
    quarters = [track.start_s + track.period_s * (quarter + 1) / ACROSS for quarter in range(ACROSS)]
    made = [(each.time_s + track.period_s / 2, each) for each in track.evaluations]
    sync = next((index for index, (_, each) in enumerate(made) if _is_first_synchrony(track, each)), None)
    split = max(0, len(made) - ACROSS if sync is None else sync - 1)
    evenly = [made[round(place)] for place in np.linspace(0, split - 1, min(ACROSS, split))]
    around_sync = [*made[split : split + ACROSS - 1], *made[split + ACROSS - 1 :][-1:]]
    return [[(now_s, None) for now_s in quarters], [*evenly], [*around_sync]]


def _is_first_synchrony(track: Track, evaluation: Evaluation) -> bool:
    return track.histogram_s is not None and abs(evaluation.time_s - (track.start_s + track.histogram_s)) < 1e-6


def save_comparison_figure(path: Path, rows: "Sequence[QuantityComparison]") -> list[Path]:
    """Draw a film beside trials, and write a table of all values; raise EpuckSimError if a file cannot be written.

    The table has a row for each quantity and trial, and one, whose trial is `film`, for the film. Its column `status`
    says why there is no value: it is `beyond` the film's end, or `unknown`.
    """
    cells: list[list[Any]] = []
    for row in rows:
        for trial, value in [("film", row.film), *enumerate(row.trials.tolist())]:
            status = "unknown" if math.isnan(value) else "beyond" if math.isinf(value) else "known"
            cells.append([row.name, row.unit, trial, csv_cell(value), status])
    table = csv_text(("quantity", "unit", "trial", "value", "status"), cells)
    return save_figure(parse_target(path), lambda: draw_comparison(rows), {".csv": table})


def draw_comparison(rows: "Sequence[QuantityComparison]") -> Figure:
    """Return the figure: a histogram of the trials for each quantity that is known, and a line where the film is."""
    rows = [row for row in rows if not math.isnan(row.percentile) and np.isfinite(row.trials).any()]
    down = max(math.ceil(len(rows) / PANELS_ACROSS), 1)
    figure = Figure(figsize=(3.6 * PANELS_ACROSS, 2.3 * down), dpi=300, layout="constrained")
    panels = figure.subplots(down, PANELS_ACROSS, squeeze=False).ravel()
    for panel, row in zip(panels, rows, strict=False):
        values = row.trials[np.isfinite(row.trials)]
        spread = float(np.ptp(np.append(values, row.film if math.isfinite(row.film) else values[0])))
        edges = 12 if spread > ROUNDING * abs(values).max() else [values[0] - 0.5, values[0] + 0.5]
        panel.hist(values, edges, color=TRIALS, edgecolor=TRIALS)  # edges show bars that are narrow
        notes = [f"{counted(row.beyond, 'trial')} beyond the film's end"] * (row.beyond > 0)
        if math.isfinite(row.film):
            panel.axvline(row.film, color=FILM, linewidth=2)
        else:
            notes.append("film: beyond its end")
        notes.append(f"film at {row.percentile:.0f} %")
        panel.set_title("\n".join(notes), fontsize="small", loc="left")
        panel.set(xlabel=typeset(f"{row.name} ({row.unit})"), ylabel="trials")
        panel.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    for panel in panels[len(rows) :]:
        panel.set_axis_off()
    return figure
