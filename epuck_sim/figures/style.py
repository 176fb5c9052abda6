"""The style that figures have in common: sizes, panels, titles and legends, colours and markers of lines."""

import math
import re
import textwrap
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from matplotlib import rcParams
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.cm import ScalarMappable
from matplotlib.colorbar import Colorbar
from matplotlib.figure import Figure
from matplotlib.ticker import AutoLocator, LogLocator, MaxNLocator, NullFormatter

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.measures.measure import T_SYNC
from epuck_sim.scenario.axes import is_logarithmic
from epuck_sim.util.messages import counted

COLUMN_CM, PAGE_CM = 8.5, 17.5
"""Widths, cm, of a column, for a figure with one panel, and of a page of two columns, for one with several."""

MIN_PANEL_CM = 4.0  # smallest width of a panel, cm; narrower ones have no room for their numbers
MAX_PANELS = 64  # largest number of panels of a figure; one with more is neither legible nor quickly drawn
LETTERS_PER_CM = 52.0  # number of letters of one point on a centimetre
MIN_LETTERS = 15  # smallest width of a panel in letters; numbers and labels cover narrower ones
BAND = 0.15  # opacity of bands
BAR, BAR_ASPECT = 0.05, 25  # width of a colour bar as a share of the figure's, and its height over its width
GREY = "0.35"  # colour of legend marks that stand for many curves

COLOURS = ("#002dc3", "#ff5a00", "#690f00", "#1e96ff", "#c300a5", "#87784b", "#d27896", "#3c2d4b")
"""Colours of curves, without a green. A search found them: each has a contrast of at least 3 with white, and any two
are at least 26 apart in CIELAB, also as people without one kind of cones see them (Machado et al. 2009)."""

MARKERS = ("o", "s", "D", ">", "d", "<", "p", "h")
"""Markers of curves, of which one sees that they are hollow; triangles up and down, and crosses, mean other things."""

MARKER_DISTANCE, MARKER_SHIFT = 0.2, 0.03
"""Distance between two markers of a line, and shift of the markers from one line to the next, relative to the panel's
diagonal."""

NAMES = re.compile(r"\b([TV])_(sync|cens|m|p)\b")  # quantities of the thesis that are written with an index


class Look(NamedTuple):
    """How a curve looks."""

    colour: str
    marker: str


def style(font_pt: float = 8.0) -> Any:
    """Return settings of matplotlib for figures with letters of this size."""
    return {
        **dict.fromkeys(("font.size", "axes.labelsize", "axes.titlesize", "figure.titlesize"), font_pt),
        **dict.fromkeys(("legend.fontsize", "xtick.labelsize", "ytick.labelsize"), font_pt - 1),
        **dict.fromkeys(("axes.linewidth", "hatch.linewidth", "xtick.major.width", "ytick.major.width"), 0.6),
        "legend.handlelength": 2.4,
        "lines.linewidth": 1,
        "lines.markersize": 3.5,
    }


def typeset(text: str) -> str:
    r"""Return a text for matplotlib: quantities of the thesis with their indices, all else as it is.

    >>> typeset("T_sync for $5")
    '$T_\\mathrm{sync}$ for \\$5'
    """
    return NAMES.sub(r"$\1_\\mathrm{\2}$", text.replace("$", r"\$"))


def count_trials(trials: Sequence[int]) -> str:
    """Return the number of trials at points, as text for titles.

    >>> count_trials([20, 20]), count_trials([5, 20]), count_trials([1])
    ('20 trials a point', '5 to 20 trials a point', '1 trial a point')
    """
    low, high = min(trials), max(trials)
    trials_a_point = f"{counted(high, 'trial')} a point"
    return f"{low} to {trials_a_point}" if low < high else trials_a_point


def make_panels(
    title: str, titles: Sequence[str], labels: Sequence[str], width_cm: float | None = None
) -> tuple[Figure, list[Axes]]:
    """Make a figure with a panel for each title, row by row; the panels share their scales.

    With several labels of vertical axes the panels stand below each other, and each has its own vertical scale. The
    width is by default that of a column for one panel, and that of a page for several.
    """
    count, is_stack = len(titles), len(labels) > 2
    if count > MAX_PANELS:
        said = f"there would be {count} panels, one for each combination of the other axes"
        raise EpuckSimError(f"{said}; allowed: up to {MAX_PANELS}; draw against other axes, or --form curves")
    width_cm = width_cm or (COLUMN_CM if count == 1 or is_stack else PAGE_CM)
    columns = min(count if count <= 3 else math.ceil(math.sqrt(count)), max(1, int(width_cm / MIN_PANEL_CM)))
    columns = 1 if is_stack else columns
    if width_cm / columns * LETTERS_PER_CM < MIN_LETTERS * rcParams["font.size"]:
        raise EpuckSimError("letters leave panels no room; give a smaller --font-pt or a larger --width-cm")
    rows = math.ceil(count / columns)
    figure = Figure(figsize=(width_cm / 2.54, width_cm / 2.54), dpi=300, layout="constrained")
    if title:
        letters = int(width_cm * LETTERS_PER_CM / rcParams["font.size"])
        figure.suptitle(typeset(textwrap.fill(title, letters, break_on_hyphens=False)))
    grid = figure.subplots(rows, columns, sharex=True, sharey=not is_stack, squeeze=False).ravel()
    for unused in grid[count:]:
        unused.remove()
    panels = list(grid[:count])
    for panel, text in zip(panels, titles, strict=True):
        panel.set_title(typeset(text))
    for row, panel in enumerate(panels[::columns]):
        panel.set_ylabel(typeset(labels[1 + row] if is_stack else labels[1]))
    for panel in panels[-columns:]:  # the lowest of each column, though the last row may be shorter
        panel.set_xlabel(typeset(labels[0]))
        panel.tick_params(labelbottom=True)
    return figure, panels


def finish(figure: Figure, panels: Sequence[Axes], shape: float = 0.72) -> None:
    """Add a legend below the panels, and set the figure's height so that each is `shape` times as high as it is wide.

    Panels are at least as high as their vertical labels.
    """
    for panel in panels:
        # or matplotlib would, when the figure is saved, choose as many ticks as fit with labels of its own size
        panel.tick_params(labelsize=rcParams["xtick.labelsize"])
    add_shared_legend(figure, panels)
    width, height = figure.get_size_inches()
    height += sum(legend.get_window_extent().height for legend in figure.legends) / figure.dpi  # or nothing has room
    figure.set_size_inches(width, height)
    rows = len({panel.get_subplotspec().rowspan.start for panel in panels})  # type: ignore[union-attr] # has one
    engine = figure.get_layout_engine()
    assert engine is not None
    engine.execute(figure)
    box = panels[0].get_position()
    labels = max(panel.yaxis.label.get_window_extent().height for panel in panels) / figure.dpi
    wanted = max(shape * box.width * width, labels)
    figure.set_size_inches(width, round(height + rows * (wanted - box.height * height), 2))


def add_shared_legend(figure: Figure, panels: Sequence[Axes]) -> None:
    """Add a legend below the panels with each of their labels once, in as many columns as have room.

    A label that is wider than the figure is wrapped, and ends after two lines, unless this makes labels equal.
    """
    handles: dict[str, Any] = {}
    for panel in panels:
        for handle, label in zip(*panel.get_legend_handles_labels(), strict=True):
            handles.setdefault(label, handle)
    if not handles:
        return
    for columns in range(min(4, len(handles)), 0, -1):
        legend = figure.legend(handles.values(), handles.keys(), loc="outside lower center", ncols=columns)
        if legend.get_window_extent().width < 0.98 * figure.bbox.width:  # or its frame is cut
            return
        legend.remove()
    letters = int(figure.get_figwidth() * 2.54 * LETTERS_PER_CM / rcParams["font.size"]) - 4
    labels = [textwrap.fill(label, letters, max_lines=2, placeholder=" …") for label in handles]
    if len(set(labels)) < len(labels):
        labels = [textwrap.fill(label, letters) for label in handles]
    figure.legend(handles.values(), labels, loc="outside lower center")


def add_colour_bar(panels: Sequence[Axes], colours: ScalarMappable, **options: Any) -> Colorbar:
    """Add a colour bar beside panels."""
    figure = panels[0].get_figure()
    assert figure is not None
    return figure.colorbar(colours, ax=panels, fraction=BAR, aspect=BAR_ASPECT, **options)


def choose_looks(count: int) -> list[Look]:
    """Return the looks of curves; up to 64 all differ, in the colour, the marker or both.

    >>> choose_looks(9)[0] == choose_looks(9)[8]
    False
    """
    rounds = [divmod(number, len(COLOURS)) for number in range(count)]
    return [Look(COLOURS[place], MARKERS[(place + past) % len(MARKERS)]) for past, place in rounds]


def draw_course(panel: Axes, x: Any, values: FloatArray, place: int, look: Look, label: str, line: str = "-") -> None:
    """Draw a line over time, (n,), with few markers; lines with different `place` have them at different places."""
    # matplotlib cannot space markers on a line without any point
    every = (place * MARKER_SHIFT, MARKER_DISTANCE) if np.isfinite(values).any() else None
    panel.plot(x, values, line, color=look.colour, marker=look.marker, markevery=every, label=label or None)


def shifted(x: FloatArray, number: FloatArray | int, count: int, is_log: bool) -> FloatArray:
    """Return places, (n,), beside points of an axis for what belongs to one of several curves.

    >>> shifted(np.array([1.0, 2.0]), 0, 2, False)
    array([0.875, 1.875])
    """
    places = np.log10(x) if is_log else x
    gap = float(np.diff(places).min()) if len(x) > 1 else 1.0
    moved: FloatArray = places + gap * ((number + 0.5) / count - 0.5) / 2
    return 10**moved if is_log else moved


def draw_crosses(panel: Axes, x: FloatArray, colour: str, label: str = "") -> None:
    """Draw crosses on the upper edge of a panel, at x, (n,), where there is no value."""
    place: Any = {"transform": panel.get_xaxis_transform(), "clip_on": False, "in_layout": False, "zorder": 3}
    panel.plot(x, np.ones(len(x)), "x", color=colour, label=label or None, **place)


def set_names(panel: Axes, names: Sequence[str]) -> None:
    """Write names, if any, at 0, 1 and so on of the horizontal axis, aslant or in lines that split no value or unit."""
    if not names:
        return
    figure = panel.get_figure(root=True)
    assert figure is not None
    room_cm = 2.54 * panel.get_window_extent().width / figure.dpi / len(names)
    room = max(1, int(room_cm * LETTERS_PER_CM / rcParams["font.size"]))
    kept = [re.sub(r" (?==)|(?<==) |(?<=\d) (?=[^\W\d])", "\N{NO-BREAK SPACE}", name) for name in names]
    lines = [textwrap.wrap(name.replace("_", "_ "), room, break_long_words=False) for name in kept]
    texts = ["\n".join(each).replace("_ ", "_") for each in lines]
    looks: dict[str, Any] = {}
    if max(len(line) for each in lines for line in each) > room:
        texts, looks = list(names), {"rotation": 30, "ha": "right", "rotation_mode": "anchor"}
    panel.set_xticks(range(len(names)), list(map(typeset, texts)), **looks)
    panel.set_xlim(-0.5, len(names) - 0.5)


PLAIN = (1e-3, 1e5)  # ends of the range whose numbers are written out; where a panel has others, all are powers of ten
SHORT = 1.5  # decades up to which powers of ten have factors between them, and plain numbers are better


def draw_intervals(panel: Axes, x: Any, low: FloatArray, high: FloatArray, colour: str, label: str = "") -> None:
    """Draw intervals as a band, but as bars where they have no neighbour, as a band has no area there; NaN for none."""
    panel.fill_between(x, low, high, color=colour, alpha=BAND, linewidth=0, label=label)
    known = np.pad(~np.isnan(low + high), 1)
    alone = known[1:-1] & ~known[:-2] & ~known[2:]
    if alone.any():
        panel.vlines(x[alone], low[alone], high[alone], color=colour, linewidth=1)


def has_log_scale(of: str | None, values: FloatArray, scale: str | None = None) -> bool:
    """Return whether values, (n,), have a logarithmic scale: T_sync has, and a measure if its values are far apart.

    If `scale` is given, `linear` or `log`, it decides; EpuckSimError is raised for `log` if not all are positive.
    """
    known = values[np.isfinite(values)]
    if scale == "log" and (known <= 0).any():
        raise EpuckSimError(f"--log: {of} has values that are not positive, such as {known.min():g}; give --linear")
    return scale == "log" or (scale is None and (of in T_SYNC or (len(known) > 0 and is_logarithmic(of, known))))


def make_logarithmic(axes: Axes, *names: str) -> None:
    """Make the named scales, of "x" and "y", logarithmic; both have plain numbers, or both powers of ten."""
    for name in names:
        axes.set(**{f"{name}scale": "log"})
        axis = axes.xaxis if name == "x" else axes.yaxis
        axis.set_major_locator(_LogLocator())
        axis.set_major_formatter(partial(_label_tick, axis))
        axis.set_minor_formatter(NullFormatter())


def mark_wholes(axis: Axis, values: FloatArray) -> None:
    """Leave out ticks between whole numbers on a linear axis where all values, (n,), are whole."""
    locator = axis.get_major_locator()
    if isinstance(locator, MaxNLocator) and not (values % 1).any():
        locator.set_params(integer=True)


def is_plain(low: float, high: float) -> bool:
    """Return whether numbers of an axis between two positive ends are written out, rather than as powers of ten.

    >>> is_plain(0.05, 12.8), is_plain(10, 300_000)
    (True, False)
    """
    return PLAIN[0] <= low and high < PLAIN[1]


def format_tick(number: float, *, plain: bool = True) -> str:
    r"""Return a number as figures show it.

    >>> format_tick(0.05), format_tick(30000), format_tick(20000, plain=False), format_tick(0.1, plain=False)
    ('0.05', '30000', '$2\\cdot10^{4}$', '$10^{-1}$')
    """
    if plain:
        return f"{number:.15g}"
    exponent = math.floor(math.log10(number) + 1e-9)
    digits = f"{number / 10.0**exponent:.3g}"
    factor = "" if digits == "1" else rf"{digits}\cdot"
    return f"${factor}10^{{{exponent}}}$"


def _has_plain_numbers(axis: Axis) -> bool:
    """Return whether all logarithmic axes of the panel of this one have plain numbers, or this one, if it is short."""
    panel = axis.axes
    assert panel is not None
    low, high = sorted(axis.get_view_interval())
    shown = [axis] if high <= low * 10**SHORT else [panel.xaxis, panel.yaxis]
    return all(is_plain(*sorted(each.get_view_interval())) for each in shown if each.get_scale() == "log")


class _LogLocator(LogLocator):
    """Ticks at 1, 2 and 5 of each decade, or at 1 alone where these numbers would overlap."""

    axis: Axis  # matplotlib sets it

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Return the ticks between two ends."""
        room = self.axis.get_tick_space() / 3 if _has_plain_numbers(self.axis) else SHORT
        is_short = 0 < vmax <= vmin * 10**room
        for subs in ((1, 2, 5),) if is_short else ((1,), (1, 2, 5)):
            self.set_params(subs=subs)
            found = super().tick_values(vmin, vmax)
            if sum(vmin <= tick <= vmax for tick in found) > 1:  # one tick alone tells nothing
                return found
        return AutoLocator().tick_values(vmin, vmax)


def _label_tick(axis: Axis, number: float, _: int | None = None) -> str:
    """Return a plain number, or a power of ten where a number of the panel is very small or large."""
    return format_tick(number, plain=_has_plain_numbers(axis)) if number > 0 else ""
