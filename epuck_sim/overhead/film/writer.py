"""Films in files: H.264 in MP4, which any browser plays."""

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
from epuck_sim.overhead.film.frame import Frame
from epuck_sim.util.atomic_write import check_target, publish, temporary_path

ENDING = ".mp4"

TICKS_PER_S = 90_000
"""Time stamps are so fine; the usual clock of MPEG films."""

KEYFRAMES_S = 10.0
"""After so long a picture is stored whole: who seeks in the film need not decode all that comes before."""

ENCODER = {"crf": "24", "preset": "veryfast", "mbtree": "0"}
"""Of libx264: a quality at which rings keep their shape though noise is lost, and speed before size.

Its macroblock tree coarsens what will soon be gone, as flashes are; and with the instructions AVX-512 it gives the
same frames another file each time. Without it, 24 is what 20 is with it.
"""

CONTAINER = {"movflags": "+faststart", "movie_timescale": str(TICKS_PER_S)}
"""Of the MP4 file: its index comes first, so that a browser need not fetch the whole film before it plays any of it;
and when its first frame is shown is as fine as the time stamps."""


class FilmWriter:
    """Writes frames into a film's file, made by `film_file`."""

    def __init__(self, path: Path, part: Path, width_px: int, height_px: int, metadata: Mapping[str, str]) -> None:
        """Begin the file `part`, which will become `path`."""
        self._path = path
        self._shape = (height_px, width_px, 3)
        self._last_tick = -1
        self._keyframe_s: float | None = None
        with self._as_film_error():
            self._container = av.open(part, "w", format="mp4", options=CONTAINER)
        self._container.metadata.update(metadata)
        self._stream = self._container.add_stream("libx264", options=ENCODER)
        self._stream.width, self._stream.height = width_px, height_px
        self._stream.pix_fmt = "yuv420p"
        codec = self._stream.codec_context
        self._stream.time_base = codec.time_base = Fraction(1, TICKS_PER_S)
        codec.thread_count = 1  # the same frames give the same file
        # how pictures are turned into luma and chroma; players would take large ones for BT.709
        codec.colorspace, codec.color_range = Colorspace.ITU601, ColorRange.MPEG

    def write(self, frame: Frame) -> None:
        """Add a frame, later than the ones before. Raises FilmError where it cannot be written."""
        if frame.picture.shape != self._shape:
            raise FilmError(f"{self._path}: a picture of shape {frame.picture.shape}; allowed: {self._shape}")
        picture = av.VideoFrame.from_ndarray(frame.picture, format="rgb24")
        # frames that are closer than a tick still follow one another
        self._last_tick = max(round(frame.time_s * TICKS_PER_S), self._last_tick + 1)
        picture.pts, picture.time_base = self._last_tick, Fraction(1, TICKS_PER_S)
        if self._keyframe_s is None or frame.time_s - self._keyframe_s >= KEYFRAMES_S:
            picture.pict_type = PictureType.I
            self._keyframe_s = frame.time_s
        with self._as_film_error():
            self._container.mux(self._stream.encode(picture))

    def finish(self) -> None:
        """Write what is pending, and the file's end."""
        if self._last_tick < 0:
            raise FilmError(f"{self._path}: cannot be written: the film has no frame")
        with self._as_film_error():
            self._container.mux(self._stream.encode())
            self._container.close()

    def abandon(self) -> None:
        """Close the file as it is."""
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
    """Yield a writer of a film, which takes the name `path` when the block ends without an error.

    description: is stored with the film, as JSON in the `comment` of its metadata. Raises FilmError for a name that
    does not end in .mp4 and for an odd side, which H.264 cannot have, and EpuckSimError where nothing can be written.
    """
    if path.suffix != ENDING:
        raise FilmError(f"{path}: is no name for a film; allowed: names that end in {ENDING}")
    if width_px % 2 or height_px % 2:
        raise FilmError(f"{path}: pictures of {width_px} x {height_px} pixels; allowed: even sides; crop or pad them")
    metadata = {"title": title, "comment": json.dumps(description)}
    check_target(path)
    with temporary_path(path) as part:
        writer = FilmWriter(path, part, width_px, height_px, metadata)
        try:
            yield writer
            writer.finish()
        finally:
            writer.abandon()
        publish(part, path)
