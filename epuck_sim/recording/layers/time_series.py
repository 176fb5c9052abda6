"""What a recording plots over time: flashes, order parameter, phases, wheel speeds."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import rerun as rr
from rerun.chunk import Chunk

from epuck_sim.arrays import FloatArray
from epuck_sim.recording.buffers.robots import Columns
from epuck_sim.recording.chunks import moving, still
from epuck_sim.recording.level import Level
from epuck_sim.recording.population import Population

FLASHES = "/flashes"
"""A scalar at each flash: whose it is, by number; `cycle`: which of its flashes it is, from 1."""

ORDER_AT_STEPS = "/order/steps"
"""A scalar in each row: the order parameter of all oscillators."""

ORDER_AT_FIRINGS = "/order/firings"
"""A scalar at each firing of the reference: the order parameter as the trial measures it."""

THRESHOLD = "/order/threshold"
"""Beyond it the swarm is synchronised, if anything ends the trial before its time."""

PHASES = "/phases"
"""(count,) ms in each row."""

WHEELS = "/wheels"
"""(2 robots,) cm/s at each step: left and right wheel of each robot, as commanded."""

UNBLURRED: dict[str, Any] = {"aggregation_policy": "MinMax"}
"""From afar a line is drawn by its extremes: the mean of many cycles would be flat."""

RED = (225, 40, 40)
GREY = (150, 150, 150)
BLUE = (60, 130, 230)


def series_styles(subject: Population, level: Level) -> Iterator[Chunk]:
    """Yield how the plots look."""
    yield still(FLASHES, rr.SeriesPoints(colors=RED, markers="circle", marker_sizes=3, names="flash"))
    yield still(ORDER_AT_STEPS, rr.SeriesLines(colors=GREY, widths=1, names=f"at each {subject.moment}", **UNBLURRED))
    yield still(ORDER_AT_FIRINGS, rr.SeriesPoints(colors=BLUE, marker_sizes=4, names="at firings of the reference"))
    yield still(THRESHOLD, rr.SeriesLines(colors=RED, widths=1, names="synchronised"))
    if level is not Level.SUMMARY:
        yield still(PHASES, rr.SeriesLines(names=_names(subject), **UNBLURRED))


def series(columns: Columns, threshold: float | None, level: Level) -> Iterator[Chunk]:
    """Yield what the plots show of these rows; threshold: of the order parameter, None where it ends no trial."""
    time_ns = columns.time_ns
    if len(columns.flashes):
        rows, flashing, cycles = columns.flashes.T
        numbers = rr.Scalars.columns(scalars=flashing)
        yield moving(FLASHES, time_ns[rows], *numbers, *rr.AnyValues.columns(cycle=cycles))
    if len(columns.firings):
        order = rr.Scalars.columns(scalars=columns.firing_order)
        yield moving(ORDER_AT_FIRINGS, time_ns[columns.firings], *order)
    yield moving(ORDER_AT_STEPS, time_ns, *rr.Scalars.columns(scalars=columns.order_parameter))
    if threshold is not None:
        yield moving(THRESHOLD, time_ns[[0, -1]], *rr.Scalars.columns(scalars=[threshold, threshold]))
    if level is not Level.SUMMARY:
        yield moving(PHASES, time_ns, *_rows_of(columns.phase_ms))


def set_wheels(subject: Population) -> Iterator[Chunk]:
    """Yield how the plot of the wheels looks."""
    sides = [f"{robot} {side}" for robot in _names(subject) for side in ("left", "right")]
    yield still(WHEELS, rr.SeriesLines(names=sides, **UNBLURRED))


def wheels(columns: Columns) -> Iterator[Chunk]:
    """Yield what it shows of these steps."""
    yield moving(WHEELS, columns.time_ns, *_rows_of(columns.wheels_cm_s))


def _names(subject: Population) -> list[str]:
    return [f"{subject.noun} {number}" for number in range(subject.size)]


def _rows_of(values: FloatArray) -> rr.ComponentColumnList:
    """Return (rows, ...) values as scalars, row by row."""
    flat = values.reshape(len(values), -1)
    return rr.Scalars.columns(scalars=flat.ravel()).partition(np.full(len(flat), flat.shape[1]))
