"""What kind of file a film is in: whether there are pictures in it, what it says of itself, and what is wrong."""

import json
from pathlib import Path
from typing import Any

import av
from av.container import InputContainer
from av.stream import Disposition
from av.video.stream import VideoStream

from epuck_sim.errors import FilmError

TEXT_CODECS = frozenset({"ansi", "bintext", "idf", "xbin"})
"""FFmpeg draws text files as films of a terminal; here they are mistakes."""

MOVIE_BOXES = frozenset({b"ftyp", b"mdat", b"free", b"skip", b"wide", b"moov"})
"""What MP4 and QuickTime files may begin with."""

CUT_OFF = (
    "was cut off before its recording was finished: the index at the end of an MP4 film (`moov`) is missing, and "
    "without it nothing can be read; record it again, or copy it again if the original is whole"
)


def checked_file(path: str) -> str:
    """Return what FFmpeg is to open; whole, as it takes `film:2.mp4` for an address."""
    file = Path(path).absolute()
    if not path.strip():
        raise FilmError("the film's name is empty; give a film's file")
    if file.is_fifo():
        raise FilmError(f"{path}: is a pipe, which can be read only once; save the film in a file first")
    if file.is_dir():
        raise FilmError(
            f"{path}: is a directory; give a film in it, or numbered pictures such as {path}/frames_%04d.png"
        )
    if file.is_file() and not file.stat().st_size:
        raise FilmError(f"{path}: is empty: nothing was recorded, or the copy failed; record or copy it again")
    return str(file)


def reason(source: str, error: Exception) -> str:
    """Return why a film cannot be opened, and what to do."""
    if isinstance(error, FileNotFoundError):
        return (
            "no such file; allowed: a film, numbered pictures such as frames_%04d.png whose first number is 0 to 4, or "
            "an address such as http://..."
        )
    if _lacks_index(source):
        return CUT_OFF
    told = getattr(error, "strerror", None) or str(error)
    return f"cannot be read as a film: {told}; allowed: what FFmpeg reads, such as MP4, MKV, AVI or GIF"


def _lacks_index(source: str) -> bool:
    """Whether a file is an MP4 or QuickTime film whose boxes end without a whole index."""
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
    """Return the first stream of pictures; the cover of a song is none."""
    for stream in container.streams.video:
        if stream.disposition & Disposition.attached_pic:
            continue
        if stream.codec_context is None:
            raise FilmError(f"{name}: there is no decoder for its pictures; convert it: ffmpeg -i {name} film.mp4")
        if stream.codec_context.name in TEXT_CODECS:
            raise FilmError(f"{name}: is a text, not a film; allowed: what FFmpeg reads, such as MP4, MKV, AVI or GIF")
        return stream
    if _lacks_index(container.name):
        raise FilmError(f"{name}: {CUT_OFF}")
    kinds = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
    raise FilmError(f"{name}: holds no moving pictures, only {kinds}; give the film itself")


def duration_s(container: InputContainer, stream: VideoStream) -> float | None:
    """Return how long a film says it lasts; None if it does not say."""
    if container.format.name == "avi" and stream.frames and stream.average_rate:
        return float(stream.frames / stream.average_rate)  # as planned; FFmpeg measures the rest from the file's size
    if stream.duration and stream.time_base:
        return float(stream.duration * stream.time_base)
    return container.duration / av.time_base if container.duration else None


def description(metadata: dict[str, str]) -> dict[str, Any] | None:
    """Return what this package wrote into the comment, whose name Matroska spells in capitals."""
    comments = [value for key, value in metadata.items() if key.lower() == "comment"]
    try:
        told = json.loads(comments[0]) if comments else None
    except ValueError:
        return None
    return told if isinstance(told, dict) and "epuck_sim" in told else None
