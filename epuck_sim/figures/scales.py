"""Logarithmic scales of figures, and the one kind of numbers on their ticks."""

import math
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import Formatter, LogLocator, NullFormatter

from epuck_sim.arrays import FloatArray
from epuck_sim.errors import EpuckSimError
from epuck_sim.scenario.axes import is_logarithmic as spans_decades

PLAIN = (1e-3, 1e5)
"""Ends of the range whose numbers are written out; where a panel has others, all are powers of ten."""


def is_logarithmic(key: str, values: FloatArray) -> bool:
    """Return whether an axis with these values, (n,), is logarithmic: they are positive, and speeds or far apart."""
    return spans_decades(key, float(values.min()), float(values.max()))


def has_log_scale(of: str | None, values: FloatArray, scale: str | None = None) -> bool:
    """Return whether values, (n,), have a logarithmic scale: those of T_sync, and of a measure that are far apart.

    Args:
        of: Name of the measure; None for T_sync.
        values: (n,) values; those that are not finite do not count.
        scale: `linear` or `log`, if that is asked for.

    Raises:
        EpuckSimError: A logarithmic scale is asked for, and not all values are positive.
    """
    known = values[np.isfinite(values)]
    if scale == "log" and (known <= 0).any():
        raise EpuckSimError(f"--log: {of} has values that are not positive, such as {known.min():g}; give --linear")
    return scale == "log" or (scale is None and (of is None or (len(known) > 0 and is_logarithmic(of, known))))


def make_logarithmic(axes: Axes, *names: str) -> None:
    """Make the named scales, of "x" and "y", logarithmic; both have plain numbers, or both powers of ten."""
    for name in names:
        axes.set(**{f"{name}scale": "log"})
        axis = axes.xaxis if name == "x" else axes.yaxis
        axis.set_major_locator(_LogLocator())
        axis.set_major_formatter(_LogFormatter())
        axis.set_minor_formatter(NullFormatter())


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
    """Return whether all logarithmic axes of the panel of this one have plain numbers."""
    panel = axis.axes
    assert panel is not None
    shown = [each for each in (panel.xaxis, panel.yaxis) if each.get_scale() == "log"]
    return all(is_plain(*sorted(each.get_view_interval())) for each in shown)


class _LogLocator(LogLocator):
    """Ticks at 1, 2 and 5 of each decade, or at 1 alone where these numbers would overlap."""

    axis: Axis  # matplotlib sets it

    def tick_values(self, vmin: float, vmax: float) -> Sequence[float]:
        """Return the ticks between two ends."""
        room = self.axis.get_tick_space() / 3 if _has_plain_numbers(self.axis) else 1.5
        self.set_params(subs=(1, 2, 5) if 0 < vmax <= vmin * 10**room else (1,))
        return super().tick_values(vmin, vmax)


class _LogFormatter(Formatter):
    """Plain numbers, or powers of ten where a number of the panel is very small or large."""

    axis: Axis  # matplotlib sets it

    def __call__(self, x: float, pos: int | None = None) -> str:  # noqa: ARG002 - matplotlib's signature
        """Return the label of a tick."""
        return format_tick(x, plain=_has_plain_numbers(self.axis)) if x > 0 else ""
