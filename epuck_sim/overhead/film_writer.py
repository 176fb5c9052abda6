"""Writes films as H.264 in MP4, which any browser plays."""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from fractions import Fraction
from pathlib import Path
from typing import Any

import av
from av.error import FFmpegError
from av.video.frame import PictureType
from av.video.reformatter import ColorRange, Colorspace

from epuck_sim.errors import FilmError
from epuck_sim.overhead.frame import Frame
from epuck_sim.util.atomic_write import check_target, publish, temporary_path

SUFFIX = ".mp4"
TICKS_PER_S = 90_000  # resolution of the time stamps; the usual clock of MPEG films
KEYFRAME_INTERVAL_S = 10.0  # between pictures that are stored whole: seeking does not decode from the beginning

ENCODER_OPTIONS = {"crf": "24", "preset": "veryfast", "mbtree": "0"}
"""Options of libx264: a quality at which rings keep their shape though noise is lost, and speed before size.

The macroblock tree (mbtree) is off: it coarsens short-lived detail such as flashes, and with AVX-512 instructions it
makes a different file from the same frames each time. A crf of 24 without it is about as good as 20 with it.
"""

CONTAINER_OPTIONS = {"movflags": "+faststart", "movie_timescale": str(TICKS_PER_S)}
"""Options of the MP4 file: the index comes first, so that a browser can play the film before it has fetched all of it,
and the time of the first frame has the resolution of the other time stamps."""

GROWING_OPTIONS = {
    "movflags": "+empty_moov+default_base_moof",
    "movie_timescale": str(TICKS_PER_S),
    "frag_duration": "500000",
    "flush_packets": "1",
}
"""Options of an MP4 file of fragments of half a second, each with its own index: it can be read while it grows."""


class FilmWriter:
    """Writes frames into the file of a film; `film_file` and `growing_film_file` make one."""

    def __init__(
        self, path: Path, part: Path, size_px: tuple[int, int], metadata: dict[str, str], options: dict[str, str]
    ) -> None:
        """Create the file `part`, with options of the container; errors name `path`, which it becomes in the end."""
        width_px, height_px = size_px
        self._path = path
        self._shape = (height_px, width_px, 3)
        self._last_tick = -1
        self._keyframe_s: float | None = None
        with self._as_film_error():
            self._container = av.open(part, "w", format="mp4", options=options)
        self._container.metadata.update(metadata)
        self._stream = self._container.add_stream("libx264", options=ENCODER_OPTIONS)
        self._stream.width, self._stream.height = width_px, height_px
        self._stream.pix_fmt = "yuv420p"
        codec = self._stream.codec_context
        self._stream.time_base = codec.time_base = Fraction(1, TICKS_PER_S)
        codec.thread_count = 1  # so that the same frames give the same file
        # the conversion to luma and chroma, stated because players would assume BT.709 for large pictures
        codec.colorspace, codec.color_range = Colorspace.ITU601, ColorRange.MPEG

    def write(self, frame: Frame) -> None:
        """Add a frame whose time is after those of all frames before.

        Raises:
            FilmError: The frame cannot be written, or has another size than the film.
        """
        if frame.picture.shape != self._shape:
            raise FilmError(f"{self._path}: a picture of shape {frame.picture.shape}; allowed: {self._shape}")
        picture = av.VideoFrame.from_ndarray(frame.picture, format="rgb24")
        # frames closer than a tick still get increasing time stamps
        self._last_tick = max(round(frame.time_s * TICKS_PER_S), self._last_tick + 1)
        picture.pts, picture.time_base = self._last_tick, Fraction(1, TICKS_PER_S)
        if self._keyframe_s is None or frame.time_s - self._keyframe_s >= KEYFRAME_INTERVAL_S:
            picture.pict_type = PictureType.I
            self._keyframe_s = frame.time_s
        with self._as_film_error():
            self._container.mux(self._stream.encode(picture))

    @property
    def has_frames(self) -> bool:
        """Whether a frame was written."""
        return self._last_tick >= 0

    def finish(self) -> None:
        """Write pending frames and the index, and close the file."""
        if not self.has_frames:
            raise FilmError(f"{self._path}: cannot be written: the film has no frame")
        with self._as_film_error():
            self._container.mux(self._stream.encode())
            self._container.close()

    def close(self) -> None:
        """Close the file as it is, if it is still open."""
        with suppress(FFmpegError):
            self._container.close()

    @contextmanager
    def _as_film_error(self) -> Iterator[None]:
        try:
            yield
        except FFmpegError as error:
            raise FilmError(f"{self._path}: cannot be written: {error.strerror}") from error


@contextmanager
def film_file(
    path: Path, width_px: int, height_px: int, description: Mapping[str, Any], title: str = ""
) -> Iterator[FilmWriter]:
    """Yield a writer of a film, which gets the name `path` when the block ends without an error.

    Both sides of the pictures are even, as H.264 requires. The description is stored as JSON in the `comment` of the
    film's metadata, beside the title.

    Raises:
        FilmError: The name does not end in .mp4, or a side is odd.
        EpuckSimError: The file cannot be written.
    """
    _check(path, width_px, height_px)
    metadata = {"title": title, "comment": json.dumps(description)}
    with temporary_path(path) as part:
        writer = FilmWriter(path, part, (width_px, height_px), metadata, CONTAINER_OPTIONS)
        try:
            yield writer
            writer.finish()
        finally:
            writer.close()
        publish(part, path)


@contextmanager
def growing_film_file(path: Path, width_px: int, height_px: int, title: str) -> Iterator[FilmWriter]:
    """Yield a writer of a film, as `film_file`, that has the name `path` from the beginning.

    It can be read up to about a second before the last frame, also if the process is killed; errors leave it.
    """
    _check(path, width_px, height_px)
    metadata = {"title": title, "comment": json.dumps({})}
    writer = FilmWriter(path, path, (width_px, height_px), metadata, GROWING_OPTIONS)
    try:
        yield writer
    except BaseException:
        with suppress(FilmError):  # the reason is what ended the block
            writer.finish()
        raise
    else:
        if writer.has_frames:
            writer.finish()
    finally:
        writer.close()


def _check(path: Path, width_px: int, height_px: int) -> None:
    if path.suffix != SUFFIX:
        raise FilmError(f"{path}: is not a film's name; allowed: names that end in {SUFFIX}")
    if width_px % 2 or height_px % 2:
        raise FilmError(f"{path}: pictures of {width_px} x {height_px} pixels; allowed: even sides; crop or pad them")
    check_target(path)
