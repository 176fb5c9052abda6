"""Reads any film that FFmpeg can, frame by frame, at the times of its own stamps and never at a nominal rate.

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
from epuck_sim.overhead.film.container import checked_file, description, duration_s, picture_stream, reason
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.overhead.film.timestamps import FilmClock

EARLY_S = 1.0
"""A film that ends so long before it says it does was cut off; sound may well end a little later than the pictures."""

TIMEOUT_S = 15.0
"""How long an address on the network may take to answer."""

UNSTAMPED_RATE = 25
"""Frames a second where neither stamps nor the file tell: what FFmpeg takes for pictures without times."""


@contextmanager
def open_film(path_or_url: str) -> Iterator["Film"]:
    """Yield a film: of a file, of numbered pictures (`frames_%04d.png`), or at an address (`http://...`).

    Raises FilmError where there is none, it is damaged beyond use or holds no pictures that can be decoded.
    """
    source = path_or_url if "://" in path_or_url else checked_file(path_or_url)
    timeout = TIMEOUT_S if "://" in path_or_url else None
    try:
        container = av.open(source, metadata_errors="replace", timeout=timeout)
    except (FFmpegError, OSError, ValueError) as error:
        raise FilmError(f"{path_or_url}: {reason(source, error)}") from error
    with container:
        film = Film(path_or_url, container, picture_stream(path_or_url, container))
        try:
            yield film
        finally:
            film.close()


class Film:
    """A film that is being read; memory holds a frame at a time, whatever its length."""

    name: str
    """The path or address."""
    width_px: int
    height_px: int
    description: dict[str, Any] | None
    """What this package wrote into the film about it; None in a film from elsewhere."""
    duration_s: float | None
    """As the file says, which need not be true; None where it does not."""

    def __init__(self, name: str, container: InputContainer, stream: VideoStream) -> None:
        self.name = name
        self.description = description(container.metadata)
        self.duration_s = duration_s(container, stream)
        self._container, self._stream = container, stream
        self._format = container.format.name
        self._rate = stream.average_rate or Fraction(UNSTAMPED_RATE)
        self._clock = FilmClock(1 / self._rate)
        self._damaged = 0
        self._ended_early = ""
        decoded = self._decode()
        first = next(decoded, None)
        if first is None:
            raise FilmError(f"{name}: none of its pictures can be decoded: damaged or cut off; record or copy it again")
        self.width_px, self.height_px = first.width, first.height
        self._frames = self._read(first, decoded)

    def frames(self) -> Iterator[Frame]:
        """Return the frames in the order of their times; the first is at 0. A later call goes on where one left off.

        Of frames with the same time stamp only the first is kept. Raises FilmError where the size of the pictures
        changes.
        """
        return self._frames

    @property
    def warnings(self) -> list[str]:
        """What was wrong with the frames that were read; about the film's end, once all were."""
        found = [self._ended_early] if self._ended_early else []
        if self._damaged:
            found.append(f"damaged frames: {self._damaged}; they were left out, or are patched up from others")
        if self._format == "image2":
            found.append(
                f"numbered pictures have no times: {float(self._rate):g} a second are assumed; to give another rate, "
                f"make a film of them: ffmpeg -framerate RATE -i {self.name} film.mkv"
            )
        return found + self._clock.warnings()

    def close(self) -> None:
        """End the reading: there are no more frames."""
        self._frames.close()

    def _decode(self) -> Iterator[VideoFrame]:
        """Yield what can be decoded, whatever is damaged."""
        self._stream.codec_context.thread_count = 1  # threads would hold a few frames each
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
        in_rgb = VideoReformatter()  # one for all: making one takes longer than its work
        picture: VideoFrame | None = first
        while picture is not None:
            if (picture.width, picture.height) != (self.width_px, self.height_px):
                raise FilmError(
                    f"{self.name}: its pictures change from {self.width_px} x {self.height_px} to "
                    f"{picture.width} x {picture.height} px after {self._clock.last_s:.3f} s; cut the film there"
                )
            time_s = self._clock.time_s(self._stamp_s(picture))
            if time_s is not None:
                pixels = in_rgb.reformat(picture, format="rgb24").to_ndarray()
                yield Frame(time_s, np.ascontiguousarray(pixels, np.uint8))
            lasted_s = picture.duration * picture.time_base if picture.duration and picture.time_base else 0
            picture = next(others, None)
        self._check_end(float(lasted_s))

    def _stamp_s(self, picture: VideoFrame) -> Fraction | None:
        """Return when a picture is shown; AVI files only tell when it is decoded, in the same order."""
        ticks = picture.dts if self._format == "avi" else picture.pts
        return None if ticks is None or picture.time_base is None else ticks * picture.time_base

    def _check_end(self, lasted_s: float) -> None:
        """Compare the end, which the last picture reached after so long, with what the file says of it."""
        read_s = self._clock.last_s + max(lasted_s, self._clock.usual_s)
        missing_s = (self.duration_s or 0.0) - read_s
        if not self._ended_early and missing_s > max(EARLY_S, 3 * self._clock.usual_s):
            self._ended_early = (
                f"the film ends early: {read_s:.1f} of {self.duration_s:.1f} s could be read; the file was cut off "
                "or is damaged"
            )
