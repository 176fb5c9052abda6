"""A swarm of point agents as one block of memory, which Python and compiled code read alike.

All that changes while time runs, and the rules, stand in one array of bytes: a record, the scene, and behind it one
array for each quantity, each contiguous, as the inner loops need it. The scene has the offsets at which each begins and
ends. A block holds no addresses, so a copy of the block is a copy of the swarm, in this process or another: functions
to call, such as a search for neighbours or a user's response curve, are numbers in an array of addresses.

Compiled code takes from a block the arrays that it works on: `native.carve(block, Oscillators)` is a named tuple of
those that belong together.

Times are in cycles of the nominal period, counted from the start of the present cycle: however long a trial lasts, they
keep their digits, because whole cycles are subtracted exactly.
"""

from collections import namedtuple
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from epuck_sim.arrays import ByteArray, IndexArray
from epuck_sim.faults import AFFECTED, FAULT
from epuck_sim.util.generators import GENERATOR_WORDS, SEQUENCE_WORDS
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.native import record_type

STREAM = record_type([("words", "u8", 4)])  # state of a random number generator; see `util.rng`

FLOAT, INT, INDEX, FLAG, BYTE = map(np.dtype, (np.float64, np.int64, np.uint32, np.bool_, np.uint8))
WORD_BYTES = 8
VECTOR_BYTES = 32  # arrays begin at multiples of this, from which a processor loads its vectors fastest

ARRAYS: Mapping[str, tuple[np.dtype[Any], str]] = {
    # oscillators
    "next_firing": (FLOAT, "agents"),  # cycles: time of each oscillator's next firing
    "period": (FLOAT, "agents"),  # cycles: 1 without jitter
    "block_earliest": (FLOAT, "blocks"),  # cycles: the earliest time in each block of `next_firing`
    "group_earliest": (FLOAT, "groups"),  # the earliest time in each group of blocks
    "part_earliest": (FLOAT, "parts"),  # the earliest time in each part
    # trajectories
    "origin": (FLOAT, "rows"),  # cm: where each trajectory began
    "heading": (FLOAT, "rows"),  # unit vectors
    "speed": (FLOAT, "agents"),  # cm per cycle
    "start_cycle": (FLOAT, "agents"),  # the cycle in which each trajectory began
    "start_time": (FLOAT, "agents"),  # the time in that cycle, 0 to 1
    "end_cycle": (FLOAT, "agents"),  # the cycle in which each trajectory ends; inf for an agent that stands still
    "end_time": (FLOAT, "agents"),  # the time in that cycle
    "wall": (INT, "agents"),  # the wall that is reached: 2 * axis, or 2 * axis + 1 for the far one; or `NO_WALL`
    "end_times": (FLOAT, "agents"),  # cycles: scratch: when trajectories end, of all agents or of candidates
    "streams": (STREAM, "agents"),  # the agents' random number generators
    "run_end_cycle": (FLOAT, "agents"),  # the cycle in which each run ends, -1 before the first
    "run_end_time": (FLOAT, "agents"),  # the time in that cycle, 0 to 1
    "run_speeds": (FLOAT, "run_speeds"),  # cm per cycle: speeds from which each run's speed is drawn
    # neighbours
    "counts": (INT, "agents"),  # number of neighbours of each agent
    "cached_until": (FLOAT, "agents"),  # cycles: time until which each agent's cached neighbours are valid
    "skip_count": (INT, "agents"),  # number of each agent's next pulses for which caching is skipped
    # search: index k of an array of candidates belongs to the k-th candidate
    "candidates": (INDEX, "agents"),  # the agents among which neighbours are searched for
    "positions": (FLOAT, "rows"),  # cm: positions of the candidates
    "headings": (FLOAT, "rows"),  # unit vectors: headings of the candidates that the cell list found
    "square_distance": (FLOAT, "agents"),  # cm^2: from the firing agent, which has inf itself
    "axial_distance": (FLOAT, "agents"),  # cm: components of these distances along the axis of the cone
    "margin": (FLOAT, "agents"),  # cm^2: not negative within the cone; then cycles until which they stay
    "selected": (INDEX, "agents"),  # scratch: the k nearest candidates come first
    "bucket_of": (INDEX, "agents"),  # scratch of the selection of the k nearest
    "bucket_end": (INDEX, "agents"),  # scratch of the selection of the k nearest
    "cell_start": (INT, "cell_starts"),  # index in `agents_by_cell` at which each cell begins
    "agents_by_cell": (INDEX, "agents"),  # agents, sorted by cell
    "cell_of_agent": (INDEX, "agents"),  # scratch: the cell of each agent
    "is_drawn": (FLAG, "agents"),  # scratch: whether each agent has been drawn for the present pulse
    "receiver_streams": (STREAM, "agents"),  # generators from which agents draw their receivers
    # what happened at the last instant
    "fired": (INDEX, "events"),  # the agents that fired, in the order of the cascade: the first `scene.fired`
    "received": (INDEX, "events"),  # the agents whose phases were shifted, even to 1: the first `scene.received`
    "is_done": (FLAG, "agents"),  # scratch: whether each agent has fired or received a pulse at this instant
    "reached": (INDEX, "events"),  # scratch: agents at which a pulse arrived: the first `scene.reached`
    "is_reached": (FLAG, "events"),  # scratch: whether each agent is in `reached`
    "headings_before": (FLOAT, "rows"),  # headings at this instant before any agent reoriented
    # faults
    "faults": (FAULT, "faults"),
    "affected": (AFFECTED, "affected"),  # (faults * agents,)
    "is_mute": (FLAG, "faulty"),  # whether each agent sends no pulses
    "is_deaf": (FLAG, "faulty"),  # whether it receives none
    "base_period": (FLOAT, "faulty"),  # cycles: its period without faults
    "base_speed": (FLOAT, "faulty"),  # cm per cycle: its speed without faults
    "heard": (INDEX, "faulty"),  # scratch: the receivers that hear a pulse: the first `scene.heard`
    # results for Python
    "positions_now": (FLOAT, "rows"),  # cm
    "phases_now": (FLOAT, "agents"),
    "curve": (BYTE, "curve"),  # the coupling, and the parameters of a user's response curve; see `phase_response`
    "members": (INDEX, "members"),  # the last array, as it may be large: each agent's neighbours
}
"""The arrays of a block in their order: type, length, and what they hold.

Most have the length `agents`; `rows` are one row of agents for each axis, one after the other; `events` are one more
than agents. Some have a length of 0: `groups` and `parts` in small swarms, see `oscillators.BRANCHES`; `cell_starts`
without a cell list; `run_speeds` where agents keep theirs; `curve`, bytes, where it is shipped; all of faults where
there are none. `members` has room for the neighbours of one agent, or of all agents if neighbours are cached.
"""

_PLACES = {name: (dtype, 2 * WORD_BYTES * number) for number, (name, (dtype, _)) in enumerate(ARRAYS.items())}

_RESPONSE = ("coupling", "refractory", "dissipation", "knee", "early_slope", "last_phase")
RESPONSE = record_type([("curve", "i8"), *((name, "f8") for name in _RESPONSE)])
"""A response curve and its parameters, see `phase_response.Response`; and the phase of a user's curve's last call."""

LIMITS = record_type(
    [
        ("pulses", "i8"),  # counted from the beginning of the trial; the instant that reaches it is completed
        ("cycles", "i8"),  # of firings of the reference, counted from the beginning of the trial
        ("last_cycle", "f8"),  # nothing happens after `last_time` of this cycle
        ("last_time", "f8"),  # cycles since the start of that cycle
        ("max_offset", "f8"),  # cycles: the order parameter is measured if all phases are this near to the reference's
    ]
)
"""Limits that end a call of `events.advance`."""

SCENE = record_type(
    [
        ("at", "i8", (len(ARRAYS), 2)),  # offsets in the block at which each array begins and ends
        ("agents", "i8"),
        ("dimensions", "i8"),
        # time
        ("now", "f8"),  # the present time: usually that of the last event
        ("cycle", "f8"),  # number of the present cycle, from 0
        ("earliest_end", "f8"),  # a lower bound of the time at which the first trajectory ends
        ("positions_time", "f8"),  # time for which `positions` holds all agents; NaN if it holds none
        ("sorted_at", "f8"),  # time at which agents were sorted into cells last; -inf before the first
        # the space, a segment, square or cube from 0 to its side, and the agents' motion
        ("side_cm", "f8"),
        ("is_cyclic", "?"),  # whether agents that leave on one side enter on the opposite one, else they are reflected
        ("is_mirrored", "?"),  # whether walls reflect agents as mirrors do, instead of in a random direction
        ("has_runs", "?"),  # whether agents walk at random, in straight runs; else they go from wall to wall
        ("run", "f8"),  # cycles: mean duration of a run, or the shortest if durations follow a power law
        ("tail", "f8"),  # power of a uniform number that is a duration in units of the shortest; 0 if exponential
        ("persistence", "f8"),  # mean cosine of the turns, 0 to 1
        ("max_speed", "f8"),  # cm per cycle: speed of the fastest agent, or the fastest that any may have later
        # the neighbourhood
        ("kind", "i8"),  # see `neighbours`
        ("k", "i8"),  # number of neighbours of kinds `NEAREST` and `RANDOM`
        ("radius_cm", "f8"),  # of the cone or range; `UNLIMITED_CM` if there is none
        ("cos", "f8"),  # cosine of half the cone's angle, or `FULL_CIRCLE_COS`
        ("sin", "f8"),  # sine of half the cone's angle
        ("row", "i8"),  # largest number of neighbours of an agent that are cached
        ("is_cached", "?"),  # whether neighbours are cached at all
        ("closing_time", "f8"),  # cycles in which the two fastest agents can approach each other by 1 cm
        ("search_radius_cm", "f8"),  # of the first search in the cell list
        ("cells", "i8"),  # number of cells along each axis
        ("cell_cm", "f8"),  # side of a cell
        # responses to pulses, and when a trial ends
        ("response", RESPONSE),
        ("reorients_on_emitting", "?"),
        ("reorients_on_receiving", "?"),  # agents whose phase a pulse shifts
        ("reorients_on_arriving", "?"),  # agents at which a pulse arrives, whether or not it shifts their phase
        ("sends_every_pulse", "?"),  # whether pulses are sent even when there is no agent left to be shifted
        ("reference", "i8"),  # the agent whose firings are counted as cycles
        ("is_relative", "?"),  # whether order is that of phases relative to the reference's; see `measure_order`
        ("threshold", "f8"),  # order parameter at which the swarm is synchronised; inf if there is none
        ("max_offset", "f8"),  # if a phase is farther from the reference's, in cycles, the threshold is not reached
        # what happened
        ("limits", LIMITS),  # of the last call
        ("fired", "i8"),  # numbers of agents in the arrays of these names
        ("received", "i8"),
        ("reached", "i8"),
        ("heard", "i8"),
        ("instants", "i8"),  # number of instants at which agents fired
        ("cycles", "i8"),  # of firings of the reference
        ("firings", "i8"),  # of firings of all agents
        ("pulses", "i8"),  # of pulses whose receivers were looked for; an instant without any counts as one
        ("is_synchronised", "?"),  # whether the last instant brought synchrony
        ("order_parameter", "f8"),  # that at the last firing of the reference; NaN before it is measured
        # how a trial begins
        ("has_positions", "?"),  # whether positions, headings, and phases with periods, are given; else they are drawn
        ("has_headings", "?"),
        ("has_phases", "?"),
        ("seed", "u8", SEQUENCE_WORDS),  # the trial's seed sequence, one of its children, and that one's generator
        ("child", "u8", SEQUENCE_WORDS),
        ("generator", "u8", GENERATOR_WORDS),
    ]
)
"""State and constants that all agents share."""

SCENE_BYTES = SCENE.itemsize

CURVE, SEARCH, CONTINUE, BEGIN_RUN, REORIENT, HEAR = range(6)
"""Numbers of functions to call: a user's response curve, and the functions (block, addresses, agent, time) that
find the receivers of an agent's pulse, continue an agent's trajectory, begin its next run, reorient all agents, and
leave out the receivers that faults keep from an agent's pulse."""

CALLS = 6  # length of the array of addresses

POSITION_SEED, PHASE_SEED, MOTION_SEED, RECEIVER_SEED, SCHEDULE_SEED, FAULT_SEED = range(6)
"""Children of a trial's seed: positions and speeds; phases and periods; directions and runs; receivers; changes by the
schedule; faults."""


def make_block(sizes: Mapping[str, int]) -> ByteArray:
    """Return a block of zeros for a swarm with these lengths of `ARRAYS`."""
    end, at = SCENE_BYTES, []
    for dtype, size in ARRAYS.values():
        place = -(-end // VECTOR_BYTES) * VECTOR_BYTES
        end = place + dtype.itemsize * sizes[size]
        at.append((place, end))
    block = aligned_bytes(end)
    scene_of(block).at = at
    return block


def aligned_bytes(size: int) -> ByteArray:
    """Return (size,) zeros for a block, at an address that is a multiple of `VECTOR_BYTES`."""
    room = np.zeros(size + VECTOR_BYTES, np.uint8)
    first = -room.__array_interface__["data"][0] % VECTOR_BYTES
    return room[first : first + size]


def scene_of(block: ByteArray) -> Any:
    """Return the scene of a block for Python, a record, in place."""
    return block[:SCENE_BYTES].view(SCENE)[0]


def array_in(blocks: ByteArray, name: str) -> npt.NDArray[Any]:
    """Return (..., n) an array of ARRAYS in (..., bytes) blocks of one kind, in place."""
    dtype, at = _PLACES[name]
    first, end = blocks[..., at : at + 2 * WORD_BYTES].reshape(-1, 2 * WORD_BYTES)[0].view(np.int64)
    return blocks[..., first:end].view(dtype)


class Arrays:
    """Arrays of a block for Python, in place, by their names in `ARRAYS`; those with a row an axis are (rows, n)."""

    def __init__(self, block: ByteArray) -> None:
        self.block, self.scene = block, scene_of(block)

    def __getattr__(self, name: str) -> npt.NDArray[Any]:
        if name not in ARRAYS:
            raise AttributeError(name)
        array, dtype = array_in(self.block, name), ARRAYS[name][0]
        if ARRAYS[name][1] == "rows":
            array = array.reshape(self.scene.dimensions, -1)
        elif dtype == STREAM:
            array = array.view(np.uint64).reshape(-1, 4)
        elif dtype.names:
            array = array.view(np.recarray)
        setattr(self, name, array)
        return array


KEPT_FIELDS = (
    *("now", "cycle", "fired", "received", "reached", "instants", "cycles", "firings", "pulses"),
    *("is_synchronised", "order_parameter"),
)
KEPT_ARRAYS = (
    *("next_firing", "period", "origin", "heading", "speed", "start_cycle", "start_time", "end_cycle", "end_time"),
    *("wall", "streams", "run_end_cycle", "run_end_time", "receiver_streams", "fired", "received", "headings_before"),
    *("affected", "is_mute", "is_deaf", "base_period", "base_speed"),
)
"""Arrays and fields that a swarm keeps when its rules change while it runs."""


def state_of(block: ByteArray) -> dict[str, npt.NDArray[Any]]:
    """Return (1,) each field of the scene that changes, or limits a call, in place: ten times as fast as a record."""
    scene = block[:SCENE_BYTES].view(SCENE)
    return {name: scene[name] for name in (*KEPT_FIELDS, "limits", "max_offset")}


def keep_state(before: Arrays, after: Arrays) -> None:
    """Copy the state of a swarm to another block, which has other rules."""
    for name in KEPT_FIELDS:
        after.scene[name] = before.scene[name]
    for name in KEPT_ARRAYS:
        getattr(after, name)[:] = getattr(before, name)


def _part(name: str, fields: str) -> Any:
    """Return the class of the named tuples of some arrays, and of the scene, that `native.carve` makes."""
    part = cast(Any, namedtuple)(name, fields)  # its own type demands literal names
    part.places = [(SCENE, None) if field == "scene" else _PLACES[field] for field in part._fields]
    return part


Oscillators: Any = _part("Oscillators", "scene next_firing period block_earliest group_earliest part_earliest")

_MOTION = "origin heading speed start_cycle start_time end_cycle end_time wall end_times streams"
Trajectories: Any = _part("Trajectories", f"scene {_MOTION} run_end_cycle run_end_time run_speeds")
"""The present straight path of each agent, and the present run of its random walk."""

_MEASURED = "square_distance axial_distance margin selected bucket_of bucket_end"
_LISTED = "cell_start agents_by_cell cell_of_agent is_drawn receiver_streams"
_FOUND = "members counts cached_until skip_count"
Neighbours: Any = _part("Neighbours", f"scene {_FOUND} candidates positions headings {_MEASURED} {_LISTED}")
"""The neighbours that were found last, and the candidates among which they are searched for."""

Instant: Any = _part("Instant", "scene fired received is_done curve reached is_reached headings_before heard")
Faulty: Any = _part("Faulty", "faults affected is_mute is_deaf")
Observed: Any = _part("Observed", "positions_now phases_now")  # results for Python


@jit_inline
def entry_of(indices: IndexArray, place: int) -> int:
    """Return an entry of an array of indices as a signed number: one type for all, and known not to be negative."""
    return int(np.int64(indices[place]))
