"""Reads a camera that is plugged in, to measure synchrony in real time as the experiments did (thesis 4.3.1)."""

import time
from collections.abc import Generator, Iterator
from types import TracebackType
from typing import Self

import cv2
import numpy as np

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film.frame import Frame


class LiveCamera:
    """A context manager that keeps a camera open; the film of a camera has no end.

    >>> with LiveCamera(0) as camera:  # doctest: +SKIP
    ...     for frame in camera.frames():
    ...         print(frame.time_s, frame.picture.mean())
    """

    name: str
    width_px: int
    height_px: int

    def __init__(self, number: int) -> None:
        """Open a camera.

        Args:
            number: 0 for the first camera, 1 for the second, and so on.

        Raises:
            FilmError: The camera cannot be opened, or delivers no picture.
        """
        self.name = f"camera {number}"
        if number < 0:
            raise FilmError(f"{self.name} cannot be opened; allowed: 0 for the first camera, 1 for the second ...")
        logged = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # our message is enough
        try:
            self._capture = cv2.VideoCapture(number)
        finally:
            cv2.utils.logging.setLogLevel(logged)
        if not self._capture.isOpened():
            self._capture.release()
            raise FilmError(
                f"{self.name} cannot be opened; allowed: the number of a camera that is plugged in, 0 for the first, "
                "which this user may read and no other program uses"
            )
        self._zero_s: float | None = None
        try:
            self._first = self._next_frame()
        except FilmError:
            self._capture.release()
            raise
        self.height_px, self.width_px = self._first.picture.shape[:2]
        self._frames = self._read()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._frames.close()
        self._capture.release()

    def frames(self) -> Iterator[Frame]:
        """Return the frames as they arrive, with their times of arrival; the first is at 0.

        A later call continues with the next frame.

        Raises:
            FilmError: The camera delivers no more pictures.
        """
        return self._frames

    def _read(self) -> Generator[Frame]:
        yield self._first
        while True:
            yield self._next_frame()

    def _next_frame(self) -> Frame:
        grabbed = self._capture.grab()
        now_s = time.monotonic()  # before decoding, which takes a varying time
        got, picture = self._capture.retrieve() if grabbed else (False, None)
        if not got or picture is None:
            raise FilmError(f"{self.name} delivers no more pictures: was it unplugged, or does another program use it?")
        if self._zero_s is None:
            self._zero_s = now_s
        return Frame(now_s - self._zero_s, cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False))
