"""Cameras that take fewer pictures than there are control steps, and deliver them late (thesis 4.3.1).

Each camera takes pictures at instants of its own, `interval` apart, the first at a random time; a picture shows the
control step in which its instant lies. The controller receives it after a random latency. Times here are in control
steps.
"""

import numpy as np

from epuck_sim.arrays import BoolArray, FloatArray, IntArray, StreamArray
from epuck_sim.util.jit import jit
from epuck_sim.util.rng import uniform

_NEVER = -2
"""Arrival step before a camera has taken its first picture."""


class CameraClock:
    """The clock of a group's cameras: decides which of the pictures in view controllers receive, and when."""

    in_view: IntArray
    """(robots, pixels) what each camera looks at; to be written in each control step, before `tick`."""

    def __init__(
        self,
        interval: float,
        latency: float,
        streams: StreamArray,
        camera: IntArray,
        new_picture: BoolArray,
    ) -> None:
        """Begin with no picture taken.

        Args:
            interval: Control steps from one picture to the next, at least 1.
            latency: Longest time in control steps that a picture takes to arrive, at most the interval.
            streams: (robots, 4) random streams.
            camera: (robots, pixels) the picture that each controller has; written.
            new_picture: (robots,) whether it arrived in this step; written.
        """
        robots = len(streams)
        self.in_view = np.zeros(camera.shape, np.int64)
        first = np.array([interval * uniform(stream) for stream in streams])
        taken, arrival = np.zeros(robots, np.int64), np.full(robots, _NEVER)
        waiting = np.zeros_like(self.in_view)
        own = (interval, latency, streams, first, taken, arrival)
        self._arguments = (*own, self.in_view, waiting, camera, new_picture)

    def tick(self, step: int) -> None:
        """Take the pictures of this control step, and deliver those that arrive in it."""
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
    in_view: IntArray,
    waiting: IntArray,
    camera: IntArray,
    new_picture: BoolArray,
) -> None:
    """Carry out `CameraClock.tick`.

    Args:
        step: Number of the control step.
        interval: See `CameraClock`.
        latency: See `CameraClock`.
        streams: See `CameraClock`.
        first: (robots,) instants of the first pictures.
        taken: (robots,) number of pictures taken.
        arrival: (robots,) step in which the last of them arrives, which is not after the next one is taken.
        in_view: See `CameraClock`.
        waiting: (robots, pixels) the last picture taken.
        camera: See `CameraClock`.
        new_picture: See `CameraClock`.
    """
    for robot in range(len(taken)):
        new_picture[robot] = arrival[robot] == step
        if new_picture[robot]:
            camera[robot] = waiting[robot]
        instant = first[robot] + taken[robot] * interval
        if instant < step + 1.0:
            taken[robot] += 1
            waiting[robot] = in_view[robot]
            arrival[robot] = int(instant + latency * uniform(streams[robot]))
            if arrival[robot] == step:
                new_picture[robot] = True
                camera[robot] = in_view[robot]
