"""Some consecutive rows of a trial, column by column."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from epuck_sim.arena import Arena
from epuck_sim.arrays import BoolArray, FloatArray, IntArray
from epuck_sim.embodied.infrared import SENSORS


class RowBatch(NamedTuple):
    """Consecutive rows: control steps of robots, or moments of point-like agents.

    Below, `count` is the number of robots or agents. Arrays that the level or the model leaves out have no rows.
    """

    time_ns: IntArray
    """(rows,) simulated time, ns."""
    ring_on: BoolArray
    """(rows, count) whether the ring is lit; of agents, whether they fired just before."""
    phase_ms: FloatArray
    """(rows, count) phases, ms."""
    poses: FloatArray
    """(rows, count, 3) cm, cm, rad: x, y, heading."""
    order_parameter: FloatArray
    """(rows,) of all oscillators."""
    flashes: IntArray
    """(flashes, 3) row, number of the robot or agent, and which of its own flashes this is, from 1."""
    firings: IntArray
    """(firings,) rows in which the reference fires."""
    firing_order: FloatArray
    """(firings,) order parameter that the trial measured there."""
    ring_before: BoolArray = np.empty((0, 0), np.bool_)
    """(rows, robots) the rings of the step before, which are those that other robots see."""
    camera: npt.NDArray[np.uint8] = np.empty((0, 0, 0), np.uint8)
    """(rows, robots, pixels) 1 where a lit ring is seen."""
    distance_mm: npt.NDArray[np.uint16] = np.empty((0, 0, SENSORS), np.uint16)
    """(rows, robots, 8) mm: infrared distances."""
    movables: FloatArray = np.empty((0, 0, 2))
    """(rows, movables, 2) cm: where the arena's movables are; no rows without any."""
    arenas: Sequence[tuple[int, Arena]] = ()
    """Of robots, rows from which on walls and obstacles stand, and the arena with them; the first row is 0. Movables
    are elsewhere."""
    wheels_cm_s: FloatArray = np.empty((0, 0, 2))
    """(rows, robots, 2) cm/s: left and right wheel, as commanded."""
    links: IntArray = np.empty((0, 4), np.int64)
    """(links, 4) row, agent that fires, agent that receives the pulse, and 1 where that shifts its phase."""
