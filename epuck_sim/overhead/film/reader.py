"""Reads any film that FFmpeg can read, frame by frame, at its own time stamps and never at a nominal rate.

A webcam's rate wanders (15 to 16 frames a second in thesis Appendix C), and its recording program drops or doubles
frames; the spread of a histogram in seconds needs the true times.
"""

from collections.abc import Generator, Iterator
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

import av
import numpy as np
from av.container import InputContainer
from av.error import FFmpegError
from av.video.frame import VideoFrame
from av.video.reformatter import VideoReformatter
from av.video.stream import VideoStream

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film.container import (
    duration_s,
    explain_open_error,
    picture_stream,
    read_description,
    resolve_file,
)
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.film.timestamps import FilmClock

EARLY_S = 1.0
"""Seconds before its declared end from which a film counts as cut off; sound may outlast the pictures slightly."""

TIMEOUT_S = 15.0
"""Longest time, in seconds, that an address on the network may take to answer."""

UNSTAMPED_RATE = 25
"""Frame rate assumed where neither time stamps nor the file give one; FFmpeg assumes the same for numbered pictures."""


@contextmanager
def open_film(path_or_url: str) -> Iterator["Film"]:
    """Open a film for the duration of a `with` block.

    Args:
        path_or_url: A file, numbered pictures (`frames_%04d.png`), or an address (`http://...`).

    Raises:
        FilmError: There is no such film, it is damaged beyond use, or none of its pictures can be decoded.
    """
    source = path_or_url if "://" in path_or_url else resolve_file(path_or_url)
    timeout = TIMEOUT_S if "://" in path_or_url else None
    try:
        container = av.open(source, metadata_errors="replace", timeout=timeout)
    except (FFmpegError, OSError, ValueError) as error:
        raise FilmError(f"{path_or_url}: {explain_open_error(source, error)}") from error
    with container:
        film = Film(path_or_url, container, picture_stream(path_or_url, container))
        try:
            yield film
        finally:
            film.close()


class Film:
    """A film that is being read; only one frame at a time is in memory, whatever the film's length."""

    name: str
    """The path or address."""
    width_px: int
    height_px: int
    description: dict[str, Any] | None
    """The description that this package stored in the film; None in a film from elsewhere."""
    duration_s: float | None
    """Duration that the file declares, which may be wrong; None if it declares none."""
    is_pictures: bool
    """Whether it is a series of numbered pictures, which have no times."""

    def __init__(self, name: str, container: InputContainer, stream: VideoStream) -> None:
        self.name = name
        self.description = read_description(container.metadata)
        self.duration_s = duration_s(container, stream)
        self._container, self._stream = container, stream
        self._format = container.format.name
        self.is_pictures = self._format == "image2"
        self._rate = stream.average_rate or Fraction(UNSTAMPED_RATE)
        self._clock = FilmClock(1 / self._rate)
        self._damaged = 0
        self._ended_early = ""
        decoded = self._decode()
        first = next(decoded, None)
        if first is None:
            raise FilmError(f"{name}: none of its pictures can be decoded: damaged or cut off; record or copy it again")
        is_sideways = first.rotation % 180 != 0
        self.width_px, self.height_px = (first.height, first.width) if is_sideways else (first.width, first.height)
        self._frames = self._read(first, decoded)

    def frames(self) -> Iterator[Frame]:
        """Return the frames in the order of their times; the first is at 0.

        Only the first of several frames with the same time stamp is kept. A later call continues with the next frame.

        Raises:
            FilmError: The size of the pictures changes.
        """
        return self._frames

    @property
    def warnings(self) -> list[str]:
        """Defects of the frames read so far, and of the film's end once all frames have been read."""
        found = [self._ended_early] if self._ended_early else []
        if self._damaged:
            found.append(f"damaged frames: {self._damaged}; they were left out or patched from their neighbours")
        if self.is_pictures:
            found.append(
                f"numbered pictures have no times: {float(self._rate):g} frames per second are assumed; for another "
                f"rate, convert them to a film: ffmpeg -framerate RATE -i {self.name} film.mkv"
            )
        return found + self._clock.warnings()

    def close(self) -> None:
        """Stop reading; `frames` yields nothing more."""
        self._frames.close()

    def _decode(self) -> Iterator[VideoFrame]:
        """Yield the pictures that can be decoded, skipping damaged ones."""
        self._stream.codec_context.thread_count = 1  # each thread would hold a few frames
        packets = self._container.demux(self._stream)
        while True:
            try:
                packet = next(packets, None)
            except FFmpegError as error:
                self._ended_early = f"the film cannot be read to its end: {error.strerror}"
                packet = None
            try:
                pictures = self._stream.decode(packet)
            except FFmpegError as error:
                self._damaged += not isinstance(error, EOFError)
                pictures = []
            self._damaged += sum(picture.is_corrupt for picture in pictures)
            yield from pictures
            if packet is None:
                return

    def _read(self, first: VideoFrame, others: Iterator[VideoFrame]) -> Generator[Frame]:
        reformatter = VideoReformatter()  # shared by all frames: creating one takes longer than using it
        picture: VideoFrame | None = first
        while picture is not None:
            if (picture.width, picture.height) != (first.width, first.height):
                raise FilmError(
                    f"{self.name}: the size of its pictures changes from {first.width} x {first.height} to "
                    f"{picture.width} x {picture.height} px after {self._clock.last_s:.3f} s; cut the film there"
                )
            time_s = self._clock.time_s(self._stamp_s(picture))
            if time_s is not None:
                pixels = reformatter.reformat(picture, format="rgb24").to_ndarray()
                turned = np.rot90(pixels, round(first.rotation / 90))  # as players show it
                yield Frame(time_s, np.ascontiguousarray(turned, np.uint8))
            lasted_s = picture.duration * picture.time_base if picture.duration and picture.time_base else 0
            picture = next(others, None)
        self._check_end(float(lasted_s))

    def _stamp_s(self, picture: VideoFrame) -> Fraction | None:
        """Return the time stamp of a picture; AVI files store only decoding times, which have the same order."""
        ticks = picture.dts if self._format == "avi" else picture.pts
        return None if ticks is None or picture.time_base is None else ticks * picture.time_base

    def _check_end(self, lasted_s: float) -> None:
        """Note whether the film ends before its declared end; lasted_s: duration of the last picture."""
        read_s = self._clock.last_s + max(lasted_s, self._clock.median_interval_s)
        missing_s = (self.duration_s or 0.0) - read_s
        if not self._ended_early and missing_s > max(EARLY_S, 3 * self._clock.median_interval_s):
            self._ended_early = (
                f"the film ends early: {read_s:.1f} of {self.duration_s:.1f} s could be read; the file was cut off "
                "or is damaged"
            )
