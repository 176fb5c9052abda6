"""A swarm of robots as records in one block of memory, which Python and compiled code read alike.

`swarm_at` carves the block into arrays, in a fixed order: `swarm.robots[3].ring_on`, `swarm.scene[0].step`. The block
holds no addresses: the scene has the offsets of its arrays, and the functions to call (controllers, sensors, Chipmunk)
are numbers in an array of addresses that each process fills for itself. So a copy of the block is a copy of the swarm,
in this process or another, except for the contacts that Chipmunk remembers.

In compiled code, a record is a reference. Take records from arrays of the block only: a record would outlive an array
that was made in compiled code.
"""

from collections import namedtuple
from collections.abc import Mapping
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from epuck_sim import arena
from epuck_sim.arrays import ByteArray
from epuck_sim.control.interface import ACTUATORS, MAX_MESSAGES, SENSORS
from epuck_sim.faults import AFFECTED, FAULT
from epuck_sim.util.generators import GENERATOR_WORDS
from epuck_sim.util.jit import jit_inline
from epuck_sim.util.native import carve, record_type

RAYS = 3  # rays of each infrared sensor

SENSED = record_type(
    [
        ("step_ms", "i8"),  # whole ms of this control step on the robot's own clock
        ("infrared", "f8", SENSORS),  # counts: readings of the proximity sensors
        ("distance_mm", "i8", SENSORS),  # distances that belong to them
        ("new_picture", "?"),  # whether the camera's row is one that the controller has not seen
        ("pulses", "i8"),  # number of radio pulses that arrive
        ("messages", "i8", MAX_MESSAGES),  # messages of the first of them
    ]
)
"""Readings of a robot's controller in a control step, beside its row of pixels."""

ROBOT = record_type(
    [
        ("x", "f8"),  # cm
        ("y", "f8"),  # cm
        ("heading", "f8"),  # rad, counts full turns
        ("vx", "f8"),  # cm/s: velocity of the body until the next control step
        ("vy", "f8"),  # cm/s
        ("spin", "f8"),  # rad/s
        ("radius_cm", "f8"),  # of its body
        ("mass_g", "f8"),
        ("left_cm_s", "f8"),  # wheels as commanded, within their limit
        ("right_cm_s", "f8"),
        ("ring_command", "?"),  # whether the ring is commanded to be lit
        ("ring_on", "?"),  # whether it is lit: the same, unless it has a fault
        ("ring_before", "?"),  # whether it was lit a control step before, as others see it
        ("starts", "?"),  # whether its controller starts when `scene.starts` is true
        ("number", "i8"),
        ("present", "?"),  # whether the robot is in the arena; others are parked far outside, at rest, in the dark
        ("may_touch", "?"),  # whether it may have contacts in this control step that Chipmunk must resolve
        ("partner", "i8"),  # the only robot that it may touch, its own number for walls only, or -1: `bodies.contacts`
        ("in_space", "?"),  # whether its body is in Chipmunk's space
        ("is_stuck", "?"),  # whether it stays where it is, whatever is commanded
        ("sends", "?"),  # whether its radio pulse is on the air
        ("actuators", ACTUATORS),  # commands of its controller
        ("sensors", SENSED),
        ("wheel_limit_cm_s", "f8"),  # largest speed of a wheel
        ("wheel_base_cm", "f8"),  # distance between its wheels
        ("wheel_gain", "f8", 2),  # factor of each wheel's speed
        ("clock_rate", "f8"),  # rate of its clock, relative to real time
        ("own_step_ms", "f8"),  # ms of a control step by its clock
        ("infrared_gain", "f8", SENSORS),  # factor of each sensor's reading
        ("stuck_until_s", "f8"),  # time until which it stays stuck, or free
        ("infrared_noise", "f8", SENSORS),  # standard normal numbers of this control step
        ("wheel_noise", "f8", 2),  # numbers from [0, 1) of this control step
        ("first_picture", "f8"),  # instant of its camera's first picture, in control steps
        ("pictures", "i8"),  # number of pictures that its camera has taken
        ("picture_arrives", "i8"),  # control step in which the last of them arrives
        ("random", "u8", 4),  # stream from which its controller draws
        ("signal_random", "u8", 4),  # from which its camera, or radio, draws
        ("variation_random", "u8", 4),  # from which its imperfections are drawn
        ("faults", "i8"),  # which kinds of faults it has, a bit each; kept where there are faults
        ("flash_number", "i8"),  # number of flashes that it has begun; counted where there are faults
        ("starts_anew_at", "f8"),  # share of its period at which a fault restarts its oscillator in this step; -1: none
        ("left_over_ms", "f8"),  # fraction of a millisecond that a faulty clock has not counted yet
        ("held_phase", "i8"),  # phase, as bits, and ring's command before its controller runs, for a frozen oscillator
        ("held_ring", "i8"),
    ]
)
"""A robot."""

CAMERA = record_type(
    [
        ("first", "i8"),  # first pixel of the central window; pixels outside are always 0
        ("end", "i8"),  # pixel after the last one of the central window
        ("left_rad", "f8"),  # angle of the middle of pixel 0, left of straight ahead
        ("pixels_per_rad", "f8"),  # pixels in one radian, counted to the right
        ("half_view_rad", "f8"),  # largest angle between straight ahead and the edge of the central window
        ("range_cm", "f8"),  # rings farther away are not seen
        ("reflection_range_cm", "f8"),  # longest way, by a wall, on which a ring's reflection is seen; 0: none
        ("forward_cm", "f8"),  # distance of the camera ahead of the robot's centre
        ("interval", "f8"),  # control steps from one picture to the next; 0: a picture in each, without delay
        ("latency", "f8"),  # longest time, in control steps, that a picture takes to arrive
    ]
)
"""The camera of a group's robots; where its pixels look stands in `Swarm.rays`."""

RAY = record_type([("cos", "f8"), ("sin", "f8")])  # direction of a pixel in the body's frame

CONE = record_type(
    [
        ("range_cm", "f8"),
        ("cos", "f8"),  # cosine of half the opening angle; -2 for a full circle
        ("of_vision", "?"),  # whether the cone is the receiver's; else it is the sender's
        ("occlusion", "?"),  # whether robots and obstacles hide rings
        ("by_parts", "?"),  # whether any part of a robot counts, as Enki's camera sees it; else its centre does
        ("half_view_rad", "f8"),  # of that camera; infinite all around
        ("forward_cm", "f8"),  # distance of that camera ahead of the robot's centre
    ]
)
"""The sector in which flashes, or radio pulses, reach a group's robots."""

RADIO = record_type(
    [
        ("loss", "f8"),  # probability with which a receiver misses a pulse
        ("collisions", "?"),  # whether several pulses at once destroy each other
        ("half_duplex", "?"),  # whether a robot that sends receives nothing
        ("slots", "i8"),  # number of control steps that pulses are on their way, plus one
        ("first", "i8"),  # index of its first record in `Swarm.air`
    ]
)
"""The radio of a group's robots."""

PULSES = record_type([("count", "i8"), ("messages", "i8", MAX_MESSAGES)])
"""Pulses that arrive at one robot in one control step."""

INFRARED = record_type(
    [
        ("count", "i8"),  # number of sensors
        ("x", "f8", SENSORS),  # cm ahead of the axle's centre
        ("y", "f8", SENSORS),  # cm to the left of it
        ("cos", "f8", (SENSORS, RAYS)),  # directions of the rays in the body's frame
        ("sin", "f8", (SENSORS, RAYS)),
        ("stretch", "f8"),  # distance of a flat wall on a side ray, relative to that on the centre ray
        ("reach_cm", "f8"),  # largest distance from the body's centre to the end of a ray
        ("range_cm", "f8"),  # distance beyond which a reading is 0
        ("peak_counts", "f8"),  # largest reading, m
        ("peak_cm", "f8"),  # distance of the largest reading, x0
        ("width_cm2", "f8"),  # width of the peak, c
        ("by_table", "?"),  # whether distances come from the firmware's table instead of the inverse response
        ("sees_robots", "?"),  # whether rays end at robots; else only at walls and obstacles
        ("noise_counts", "f8"),  # standard deviation of the noise
        ("met_cm", "f8", (SENSORS, RAYS)),  # scratch: distances at which rays of the robot that senses end
    ]
)
"""The proximity sensors of a group's robots."""

GROUP = record_type(
    [
        ("first", "i8"),  # number of its first robot
        ("count", "i8"),  # number of its robots
        ("pixels", "i8"),  # length of the row that its controllers read
        ("row", "i8"),  # index in `Swarm.pixels` of the rows that controllers read
        ("in_view", "i8"),  # index of the rows that show the present view: `row`, unless pictures are delivered later
        ("waiting", "i8"),  # index of the rows that wait for delivery
        ("ray", "i8"),  # index in `Swarm.rays` of pixel 0
        ("camera", CAMERA),
        ("cone", CONE),
        ("radio", RADIO),
        ("infrared", INFRARED),
        ("memory", "i8"),  # offset in the block of its robots' memories: records of their controller's type, and one
        # more, the memory of the robot `scene.serving` before its controller ran
        ("memory_bytes", "i8"),  # size of such a record
        ("controller", "i8"),  # index of its entries in the addresses, see `GroupControllers.addresses`
        ("parameters", "i8"),  # offset in the block of the record of its controller's parameters, right before `memory`
        ("phase", "i8"),  # offset in a memory of the phase in ms; -1 for robots that are no oscillators
        ("phase_is_float", "?"),  # else it is a whole number
        ("period", "i8"),  # offset in the parameters of the period in s
        ("sense", "i8"),  # index in `Swarm.senses` of its first sensor in a file of its own
    ]
)
"""A group of robots with the same controller and sensors."""

MEMBER = record_type([("x", "f8"), ("y", "f8"), ("radius_cm", "f8"), ("robot", "i8")])
"""A robot in a cell, where it is, cm, and how large."""

CIRCLE = record_type([("x", "f8"), ("y", "f8"), ("radius", "f8")])  # a round obstacle or a movable, cm

EDGE = record_type([("ax", "f8"), ("ay", "f8"), ("bx", "f8"), ("by", "f8"), ("polygon", "i8")])
"""An edge of another obstacle, cm, from a to b counter-clockwise, and the obstacle's number."""

SENSE = record_type(
    [
        ("name", "i8"),  # number of its name among those of all, see `EmbodiedScenario.sensor_names`
        ("first", "i8"),  # number of the first robot that has it
        ("count", "i8"),  # number of these robots
        ("parameters", "i8"),  # offset in `Swarm.sensed` of the record of its parameters
        ("readings", "i8"),  # offset there of the records of the robots' readings
        ("random", "i8"),  # offset of the robots' streams, four words each
        ("kept", "i8"),  # offset of a copy of the readings before faults set them to 0; the streams end there
        ("floats", "i8"),  # number of words at the beginning of a reading that are floats; others are whole numbers
    ]
)
"""A sensor in a file of its own, of one group."""

LAMP = record_type([(name, "f8") for name in ("x", "y", "height", "strength")])
"""A lamp above the floor, cm; its strength is the light on the floor right below."""

CHANGE = record_type([("time_ms", "f8"), ("fault", "i8"), ("robot", "i8"), ("begins", "?")])
"""A fault of a robot that has begun or ended."""

CALL = record_type([("function", "i8"), ("argument", "i8")])
"""A call: index in the addresses of a function (block, addresses, argument), and its argument."""

SPACE, GROUND, HIDE, KEEP = range(4)
"""Indices in the addresses: Chipmunk's space, the body of the floor, and the function (block, addresses, robot) that
writes to the scratch numbers which lit rings faults leave visible to a robot. Last the offset in bytes, from the block,
of what cameras keep; 0 if nobody asks: the number of sightings, that of words for them, and these, see `list_seen`."""

ARRAYS = 23  # number of arrays in a block, the scene included; see `DTYPES`

SCENE = record_type(
    [
        ("at", "i8", ARRAYS + 1),  # offsets of the arrays, see `Swarm`; the last is the size of the block
        ("step", "i8"),  # number of the last control step; -1 before the first
        ("step_ms", "i8"),
        ("step_s", "f8"),
        ("physics_steps", "i8"),  # physics steps in a control step
        ("physics_s", "f8"),  # seconds of a physics step
        ("width_cm", "f8"),
        ("height_cm", "f8"),
        ("circles", "i8"),  # numbers of circles and edges in use; the arrays may have room for more
        ("edges", "i8"),
        ("first_movable", "i8"),  # index of the first circle that is a movable
        ("columns", "i8"),  # of the cell list
        ("rows", "i8"),
        ("cell_width_cm", "f8"),
        ("cell_height_cm", "f8"),
        ("largest_cm", "f8"),  # radius of the largest robot
        ("brightness", "f8"),  # of the floor where there is no patch and no picture
        ("picture_rows", "i8"),  # of the floor's picture; 0 if there is none
        ("picture_columns", "i8"),
        ("smooth", "?"),  # whether contacts are without friction
        ("touch", "?"),  # whether robots touch each other; else they pass through each other
        ("moved_publicly", "?"),  # whether bodies move by pymunk's public interface, between calls of compiled code
        ("clocks_differ", "?"),
        ("hides_flashes", "?"),  # whether faults may keep robots from seeing flashes
        ("slip", "f8"),  # largest relative deviation of a wheel's speed; 0: no noise
        ("infrared_noise", "?"),  # whether noise is drawn
        ("mean_free_s", "f8"),  # mean time for which a robot is free, and stuck
        ("mean_stuck_s", "f8"),
        ("noise_random", "u8", GENERATOR_WORDS),  # generator of the infrared noise, see `util.generators`
        ("slip_random", "u8", GENERATOR_WORDS),  # of the wheels'
        ("placement_random", "u8", GENERATOR_WORDS),  # of places
        ("robots_vary", "?"),  # whether `ROBOT.variation_random` is drawn from
        ("signals_draw", "?"),  # whether `ROBOT.signal_random` is
        ("spread", "f8", 4),  # half-widths of the factors of both wheels, each wheel, clocks, and infrared readings
        ("serving", "i8"),  # robot whose controller, or sensor in a file of its own, is running; -1 if none is
        ("sensing", "i8"),  # number from 1 in `Swarm.senses` of the sensor that is running; 0 if none is
        ("kept_random", "u8", 4),  # stream and actuators of the robot `serving` before its code ran
        ("kept_actuators", ACTUATORS),
        ("starts", "?"),  # whether controllers start on the robots with `starts`, instead of running a step
        ("changes", "i8"),  # number of records in `Swarm.log`
        ("reference", "i8"),  # robot whose firings are counted, if it is an oscillator; else -1
        ("reference_phase", "i8"),  # offset in the block of its phase, and whether that is a float
        ("reference_is_float", "?"),
        ("lit_phase", "f8"),  # its phase in the last control step, if its ring was commanded to be lit; else NaN
        ("late", "i8"),  # index in `Swarm.calls` of the first call after commands are carried out
        ("calls", "i8"),  # number of calls
        ("bodies", "i8"),  # index in the addresses of the first robot's body; its shape follows, then the next robot's
        ("surfaces", "i8"),  # of the shapes of walls and obstacles
        ("surface_count", "i8"),
        ("movables", "i8"),  # of the bodies of movables
        ("drives", "i8"),  # of the bodies that move with the robots' wheels; -1 without movables
    ]
)
"""State and constants that all robots share."""

INT64, FLOAT64, BYTE = map(np.dtype, (np.int64, np.float64, np.uint8))

DTYPES: Mapping[str, np.dtype[Any]] = {
    "scene": SCENE,  # (1,)
    "robots": ROBOT,
    "groups": GROUP,
    "calls": CALL,  # calls that sense and run controllers; from `scene.late` on, those after commands
    "cells": INT64,  # (cells + 1,) index in `members` at which each cell, row by row, begins
    "members": MEMBER,  # the robots, cell by cell, within a cell by their numbers
    "circles": CIRCLE,  # round obstacles, and movables behind them
    "edges": EDGE,  # edges of the other obstacles
    "rays": RAY,  # directions of the pixels of each group
    "faults": FAULT,
    "affected": AFFECTED,  # (faults * robots,)
    "senses": SENSE,  # sensors in files of their own, group by group
    "sensed": BYTE,  # their parameters, readings and streams
    "bytes": BYTE,  # memories of the robots, and parameters of their controllers
    "pixels": INT64,  # rows of cameras, group by group, see `GROUP`; 1 where a lit ring is seen
    "air": PULSES,  # of each group with radios, (slots, robots)
    "log": CHANGE,  # changes of faults since Python last read it
    # scratch: 3 for each robot, and 2 for each pixel of the longest row. Sensors of flashes list the numbers of lit
    # robots, then a label of each robot: the value of a pixel that shows it, 0 if its ring is dark or hidden by faults
    "numbers": INT64,
    "depths": FLOAT64,  # scratch: 3 for each pixel of the longest row
    "patches": np.dtype((np.record, arena.PATCH)),  # patches of the floor; later ones lie on top of earlier ones
    "patch_edges": EDGE,  # edges of those patches that are polygons
    "lamps": LAMP,
    "picture": BYTE,  # (rows * columns,) levels of the floor's picture, row by row from the wall of largest y on
}
"""Types of the arrays of a block, in order; Python and compiled code use the same names."""

assert len(DTYPES) == ARRAYS

Swarm: Any = cast(Any, namedtuple)("Swarm", DTYPES)  # its own type demands literal names
"""The arrays of a block by their names in `DTYPES`; compiled code gets them by `native.carve`."""
Swarm.places = [(dtype, 8 * number) for number, dtype in enumerate(DTYPES.values())]  # of `scene.at`

SENSED_BYTES, BYTES, PIXELS, PATCHES = map(list(DTYPES).index, ("sensed", "bytes", "pixels", "patches"))
"""Indices of four arrays in a block. From `PIXELS` to before `PATCHES`, all is 0 before the first step of a trial; from
`PATCHES` on, nothing changes while trials run."""


@jit_inline
def swarm_at(block: ByteArray) -> Swarm:
    """Return the arrays of a block in compiled code; Python has `open_block`."""
    arrays: Swarm = carve(block, Swarm)
    return arrays


@jit_inline
def copy_array(source: Any, target: Any) -> None:
    """Copy an array, in a loop: numba takes four seconds to compile an array assignment."""
    for place in range(len(target)):
        target[place] = source[place]


def make_block(lengths: Mapping[str, int]) -> ByteArray:
    """Return a block of zeros, with these lengths of the arrays of a `Swarm`, except the scene; 0 if left out."""
    sizes = [dtype.itemsize * lengths.get(name, name == "scene") for name, dtype in DTYPES.items()]
    offsets = np.cumsum([0, *(-(-size // 8) * 8 for size in sizes[:-1]), sizes[-1]])  # each array begins at a word
    block = np.zeros(int(offsets[-1]), np.uint8)
    block[_AT].view(np.int64)[:] = offsets
    return block


def open_block(block: ByteArray) -> Swarm:
    """Return the arrays of a block for Python: `swarm.robots.x` is the x of all robots, (robots,), in place."""
    at, arrays = block[_AT].view(np.int64).tolist(), []
    for first, end, dtype in zip(at[:-1], at[1:], DTYPES.values(), strict=True):
        kind: Any = np.recarray if dtype.names else np.ndarray
        arrays.append(np.ndarray.__new__(kind, ((end - first) // dtype.itemsize,), dtype, block, first))
    return Swarm(*arrays)


_AT = slice(8 * (ARRAYS + 1))  # where a scene has its offsets


def group_of(swarm: Swarm, robot: int) -> int:
    """Return the number of the group that a robot belongs to."""
    return int(np.searchsorted(swarm.groups["first"], robot, side="right")) - 1


def offset_of(field: str) -> int:
    """Return the offset of a field in the record of a robot, in bytes."""
    assert ROBOT.fields
    return ROBOT.fields[field][1]


def poses_of(robots: npt.NDArray[np.void]) -> npt.NDArray[np.float64]:
    """Return (robots, 3) cm, cm, rad: x, y and heading of robots, in place."""
    return np.ndarray((len(robots), 3), np.float64, robots, offset_of("x"), (robots.strides[0], 8))
