"""Cameras that take fewer pictures than there are control steps, and hand them on late (thesis 4.3.1).

Each camera takes a picture at its own instants, `interval` apart from a random beginning on; the picture is that of the
control step in which the instant lies. The controller has it once a latency of its own is over. Times here are in
control steps.
"""

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.util.jit import jit
from epuck_sim.util.rng import uniform

_NONE = -2
"""The step in which a picture arrives that was never taken."""


class CameraClock:
    """The cameras of a group of robots: what they look at becomes the pictures that controllers have."""

    seen: IntArray
    """(robots, pixels) what is in view; to be written in each control step, before `tick`."""

    def __init__(
        self,
        interval: float,
        latency: float,
        streams: StreamArray,
        camera: IntArray,
        new_picture: BoolArray,
    ) -> None:
        """Begin with no picture taken.

        interval: from one picture to the next, at least 1; latency: the most that a picture takes, at most the
        interval; streams: (robots, 4); written to are (robots, pixels) camera, and (robots,) new_picture.
        """
        robots = len(streams)
        self.seen = np.zeros(camera.shape, np.int64)
        first = np.array([interval * uniform(stream) for stream in streams])
        taken, arrival = np.zeros(robots, np.int64), np.full(robots, _NONE)
        waiting = np.zeros_like(self.seen)
        self._arguments = (interval, latency, streams, first, taken, arrival, self.seen, waiting, camera, new_picture)

    def tick(self, step: int) -> None:
        """Take the pictures of this control step, and hand on those that arrive in it."""
        _take_pictures(step, *self._arguments)


@jit
def _take_pictures(
    step: int,
    interval: float,
    latency: float,
    streams: StreamArray,
    first: FloatArray,
    taken: IntArray,
    arrival: IntArray,
    seen: IntArray,
    waiting: IntArray,
    camera: IntArray,
    new_picture: BoolArray,
) -> None:
    """Carry out `CameraClock.tick`.

    first: (robots,) instants of the first pictures; taken: (robots,) pictures so far; arrival: (robots,) the step in
    which the last of them, (robots, pixels) waiting, arrives: in which the next is taken at the latest.
    """
    for robot in range(len(taken)):
        new_picture[robot] = arrival[robot] == step
        if new_picture[robot]:
            camera[robot] = waiting[robot]
        instant = first[robot] + taken[robot] * interval
        if instant < step + 1.0:
            taken[robot] += 1
            waiting[robot] = seen[robot]
            arrival[robot] = int(instant + latency * uniform(streams[robot]))
            if arrival[robot] == step:
                new_picture[robot] = True
                camera[robot] = seen[robot]
