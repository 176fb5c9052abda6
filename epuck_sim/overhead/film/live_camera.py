"""Reads a camera that is plugged in, to measure synchrony in real time as the experiments did (thesis 4.3.1)."""

import time
from collections.abc import Callable, Generator, Iterator
from types import TracebackType
from typing import Self

import cv2
import numpy as np

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film.frame import Frame

PATIENCE_S = 30.0
"""Time for which a camera that drops out is tried again: a loose plug, a hub that restarts."""

PAUSE_S = 0.5
"""Time between two tries."""


class LiveCamera:
    """A context manager that keeps a camera open; the film of a camera has no end.

    >>> with LiveCamera(0, print) as camera:  # doctest: +SKIP
    ...     for frame in camera.frames():
    ...         print(frame.time_s, frame.picture.mean())
    """

    name: str
    width_px: int
    height_px: int
    warnings: list[str]
    """When it dropped out."""

    def __init__(self, number: int, tell: Callable[[str], None]) -> None:
        """Open a camera.

        Args:
            number: 0 for the first camera, 1 for the second, and so on.
            tell: Tells the user at once, in a sentence, that the camera drops out or is back.

        Raises:
            FilmError: The camera cannot be opened, or delivers no picture.
        """
        self.name = f"camera {number}"
        self.warnings = []
        self._number, self._tell = number, tell
        if number < 0:
            raise FilmError(f"{self.name} cannot be opened; allowed: 0 for the first camera, 1 for the second ...")
        self._open()
        if not self._capture.isOpened():
            self._capture.release()
            raise FilmError(
                f"{self.name} cannot be opened; allowed: the number of a camera that is plugged in, 0 for the first, "
                "which this user may read and no other program uses"
            )
        self._zero_s = time.monotonic()
        first = self._grab()
        if first is None:
            self._capture.release()
            raise FilmError(f"{self.name} delivers no picture: does another program use it?")
        self._zero_s += first.time_s
        self._first = Frame(0.0, first.picture)
        self.height_px, self.width_px = first.picture.shape[:2]
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

        A later call continues with the next frame. A camera that drops out, or delivers pictures of another size, is
        opened again; its frames are missing until then.

        Raises:
            FilmError: The camera has delivered no more such pictures for `PATIENCE_S`.
        """
        return self._frames

    def _open(self) -> None:
        logged = cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # our message is enough
        try:
            self._capture = cv2.VideoCapture(self._number)
        finally:
            cv2.utils.logging.setLogLevel(logged)

    def _read(self) -> Generator[Frame]:
        frame = self._first
        while True:
            yield frame
            last_s = frame.time_s
            next_frame = self._grab()
            fault = self._fault(next_frame)
            frame = self._try_again(fault, last_s) if next_frame is None or fault else next_frame

    def _grab(self) -> Frame | None:
        """Return the next picture of any size; None if there is none."""
        grabbed = self._capture.grab()
        time_s = time.monotonic() - self._zero_s  # before decoding, which takes a varying time
        got, picture = self._capture.retrieve() if grabbed else (False, None)
        if not got or picture is None:
            return None
        return Frame(time_s, cv2.cvtColor(picture, cv2.COLOR_BGR2RGB).astype(np.uint8, copy=False))

    def _fault(self, frame: Frame | None) -> str:
        """Return what is wrong with a frame; nothing if it continues the film."""
        if frame is None:
            return "delivers no pictures"
        rows, columns = frame.picture.shape[:2]
        if (columns, rows) == (self.width_px, self.height_px):
            return ""
        return f"delivers pictures of {columns} x {rows} px instead of {self.width_px} x {self.height_px}"

    def _try_again(self, fault: str, last_s: float) -> Frame:
        """Open the camera again and again, and return the frame that continues the film."""
        self._tell(f"{self.name} {fault}; it is tried again for {PATIENCE_S:.0f} s")
        end_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < end_s:
            self._capture.release()
            time.sleep(PAUSE_S)
            self._open()
            self._capture.set(cv2.CAP_PROP_FRAME_WIDTH, self.width_px)
            self._capture.set(cv2.CAP_PROP_FRAME_HEIGHT, self.height_px)
            frame = self._grab()
            fault = self._fault(frame)
            if frame is not None and not fault:
                self.warnings.append(f"{self.name} dropped out from {last_s:.1f} to {frame.time_s:.1f} s")
                self._tell(f"{self.name} is back after {frame.time_s - last_s:.1f} s")
                return frame
        raise FilmError(
            f"{self.name} {fault}, for {PATIENCE_S:.0f} s now: was it unplugged, or does another program use it?"
        )
