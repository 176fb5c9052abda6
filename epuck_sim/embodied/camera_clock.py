"""Cameras that take fewer pictures than there are control steps, and deliver them late (thesis 4.3.1).

Each camera takes pictures at instants of its own, `interval` apart, the first at a random time; a picture shows the
control step in which its instant lies. The controller receives it after a random latency. Times here are in control
steps.
"""

from typing import NamedTuple

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.util.jit import jit_inline, jit_no_alloc
from epuck_sim.util.rng import uniform

_NEVER = -2
"""Arrival step before a camera has taken its first picture."""


class CameraClock(NamedTuple):
    """The clock of a group's cameras: decides which of the pictures in view controllers receive, and when."""

    interval: float
    """Control steps from one picture to the next, at least 1."""
    latency: float
    """Longest time in control steps that a picture takes to arrive, at most the interval."""
    streams: StreamArray
    """(robots, 4) random streams."""
    first: FloatArray
    """(robots,) instants of the first pictures."""
    taken: IntArray
    """(robots,) number of pictures taken."""
    arrival: IntArray
    """(robots,) step in which the last of them arrives, which is not after the next one is taken."""
    in_view: IntArray
    """(robots, pixels) what each camera looks at; to be written in each control step, before `take_pictures`."""
    waiting: IntArray
    """(robots, pixels) the last picture taken."""
    camera: IntArray
    """(robots, pixels) the picture that each controller has."""
    new_picture: BoolArray
    """(robots,) whether it arrived in this step."""


def start_camera_clock(
    interval: float, latency: float, streams: StreamArray, camera: IntArray, new_picture: BoolArray
) -> CameraClock:
    """Return a clock that has taken no picture yet, for as many robots as there are streams; see `CameraClock`."""
    clock = CameraClock(
        interval=interval,
        latency=latency,
        streams=streams,
        first=np.empty(len(streams)),
        taken=np.empty(len(streams), np.int64),
        arrival=np.empty(len(streams), np.int64),
        in_view=np.zeros(camera.shape, np.int64),
        waiting=np.zeros(camera.shape, np.int64),
        camera=camera,
        new_picture=new_picture,
    )
    restart_camera_clock(clock)
    return clock


def restart_camera_clock(clock: CameraClock) -> None:
    """Set a clock to before its first pictures, whose instants are drawn from its streams."""
    clock.first[:] = [clock.interval * uniform(stream) for stream in clock.streams]
    clock.taken[:] = 0
    clock.arrival[:] = _NEVER
    clock.in_view[:] = 0
    clock.waiting[:] = 0


def forget_pictures(clock: CameraClock, robot: int) -> None:
    """Have no picture wait for delivery to a robot; its camera goes on at its instants."""
    if len(clock.arrival):  # none where cameras take a picture in each control step
        clock.arrival[robot] = _NEVER


@jit_no_alloc
def take_pictures(clock: CameraClock, step: int) -> None:
    """Take the pictures of this control step, and deliver those that arrive in it."""
    for robot in range(len(clock.taken)):
        clock.new_picture[robot] = clock.arrival[robot] == step
        if clock.new_picture[robot]:
            _copy_picture(clock.waiting[robot], clock.camera[robot])
        instant = clock.first[robot] + clock.taken[robot] * clock.interval
        if instant < step + 1.0:
            clock.taken[robot] += 1
            _copy_picture(clock.in_view[robot], clock.waiting[robot])
            clock.arrival[robot] = int(instant + clock.latency * uniform(clock.streams[robot]))
            if clock.arrival[robot] == step:
                clock.new_picture[robot] = True
                _copy_picture(clock.in_view[robot], clock.camera[robot])


@jit_inline
def _copy_picture(source: IntArray, target: IntArray) -> None:
    """Copy a picture; a loop, as numba compiles the assignment of an array for four seconds."""
    for pixel in range(len(target)):
        target[pixel] = source[pixel]
