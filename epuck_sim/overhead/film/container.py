"""Film containers: find the stream of pictures, the duration and our metadata, and explain what is wrong."""

import json
from pathlib import Path
from typing import Any

import av
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from epuck_sim.errors import FilmError

TEXT_CODECS = frozenset({"ansi", "bintext", "idf", "xbin"})
"""Codecs by which FFmpeg renders text files as films of a terminal; such a file is a mistake here."""

MOVIE_BOXES = frozenset({b"ftyp", b"mdat", b"free", b"skip", b"wide", b"moov"})
"""Types of the box that an MP4 or QuickTime file may begin with."""

READABLE = "what FFmpeg reads, such as MP4, MKV, AVI or GIF"

CUT_OFF = (
    "was cut off before its recording was finished: the index at the end of an MP4 film (`moov`) is missing, and "
    "without it nothing can be read; record it again, or copy it again if the original is whole"
)


def resolve_file(path: str) -> str:
    """Return the absolute path for FFmpeg, which would take the relative path `film:2.mp4` for an address.

    Raises:
        FilmError: The name is empty, or names a pipe, a directory or an empty file.
    """
    file = Path(path).absolute()
    if not path.strip():
        raise FilmError("the film's name is empty; give the file of a film")
    if file.is_fifo():
        raise FilmError(f"{path}: is a pipe, which can be read only once; save the film in a file first")
    if file.is_dir():
        raise FilmError(
            f"{path}: is a directory; give a film inside it, or numbered pictures such as {path}/frames_%04d.png"
        )
    if file.is_file() and not file.stat().st_size:
        raise FilmError(f"{path}: is empty: nothing was recorded, or the copy failed; record or copy it again")
    return str(file)


def explain_open_error(source: str, error: Exception) -> str:
    """Return why FFmpeg could not open `source`, and what the user can do."""
    if isinstance(error, FileNotFoundError):
        return (
            "no such file; allowed: a film, numbered pictures such as frames_%04d.png whose first number is 0 to 4, or "
            "an address such as http://..."
        )
    if _lacks_index(source):
        return CUT_OFF
    reason = getattr(error, "strerror", None) or str(error)
    return f"cannot be read as a film: {reason}; allowed: {READABLE}"


def _lacks_index(source: str) -> bool:
    """Return whether a file is an MP4 or QuickTime film without a complete index."""
    if not Path(source).is_file():
        return False
    end, at = Path(source).stat().st_size, 0
    with Path(source).open("rb") as file:
        while at + 8 <= end:
            file.seek(at)
            size, kind = int.from_bytes(file.read(4)), file.read(4)
            if kind not in MOVIE_BOXES and at == 0:
                return False
            size = int.from_bytes(file.read(8)) if size == 1 else size or end - at
            if kind == b"moov":
                return at + size > end
            at += max(size, 8)
    return at > 0


def picture_stream(name: str, container: InputContainer) -> VideoStream:
    """Return the first video stream that is not a cover picture.

    Raises:
        FilmError: The container holds no moving pictures, or none that can be decoded.
    """
    for stream in container.streams.video:
        if stream.disposition & Disposition.attached_pic:
            continue
        if stream.codec_context is None:
            raise FilmError(f"{name}: no decoder for its pictures is available; convert it: ffmpeg -i {name} film.mp4")
        if stream.codec_context.name in TEXT_CODECS:
            raise FilmError(f"{name}: is a text file, not a film; allowed: {READABLE}")
        return stream
    if _lacks_index(container.name):
        raise FilmError(f"{name}: {CUT_OFF}")
    kinds = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
    raise FilmError(f"{name}: holds no moving pictures, only {kinds}; give the film itself")


def duration_s(container: InputContainer, stream: VideoStream) -> float | None:
    """Return the duration that the film declares; None if it declares none."""
    if container.format.name == "avi" and stream.frames and stream.average_rate:
        return float(
            stream.frames / stream.average_rate
        )  # the declared length; FFmpeg would estimate from the file's size
    if stream.duration and stream.time_base:
        return float(stream.duration * stream.time_base)
    return container.duration / av.time_base if container.duration else None


def read_description(metadata: dict[str, str]) -> dict[str, Any] | None:
    """Return the description that this package wrote into a film's comment; None if there is none."""
    comments = [value for key, value in metadata.items() if key.lower() == "comment"]  # Matroska writes COMMENT
    try:
        parsed = json.loads(comments[0]) if comments else None
    except ValueError:
        return None
    return parsed if isinstance(parsed, dict) and "epuck_sim" in parsed else None
