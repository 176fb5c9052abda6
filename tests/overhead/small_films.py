"""Small films for the tests of the reader: every picture encodes its number; a test chooses the time stamps."""

from collections.abc import Iterable, Sequence
from fractions import Fraction
from pathlib import Path
from typing import NamedTuple

import av
import numpy as np

BITS = 8


class Kind(NamedTuple):
    """A container and codec to write films with."""

    ending: str
    codec: str
    pixels: str
    tick_s: Fraction
    """Unit of its time stamps."""


MP4 = Kind("mp4", "libx264", "yuv420p", Fraction(1, 90_000))
MKV = Kind("mkv", "libx264", "yuv420p", Fraction(1, 1000))
MKV_OF_JPEG = Kind("mkv", "mjpeg", "yuvj420p", Fraction(1, 1000))
TS = Kind("ts", "libx264", "yuv420p", Fraction(1, 90_000))
WEBM = Kind("webm", "libvpx", "yuv420p", Fraction(1, 1000))
GIF = Kind("gif", "gif", "rgb8", Fraction(1, 100))
AVI = Kind("avi", "mjpeg", "yuvj420p", Fraction(1, 15))
AVI_LATER = Kind("avi", "libx264", "yuv420p", Fraction(1, 15))
BARE = Kind("h264", "libx264", "yuv420p", Fraction(1, 25))


def numbered_picture(number: int, width_px: int = 64, height_px: int = 48) -> np.ndarray:
    """Return a picture whose columns are bits of `number`, white for 1, over a lower half that is red."""
    picture = np.zeros((height_px, width_px, 3), np.uint8)
    for bit in range(BITS):
        picture[:, bit * width_px // BITS : (bit + 1) * width_px // BITS] = 255 * (number >> bit & 1)
    picture[height_px // 2 :] = (220, 20, 20)
    return picture


def number_in(picture: np.ndarray) -> int:
    height_px, width_px = picture.shape[:2]
    columns = [(2 * bit + 1) * width_px // (2 * BITS) for bit in range(BITS)]
    return sum(1 << bit for bit, column in enumerate(columns) if picture[height_px // 4, column].mean() > 127)


def write_film(
    path: Path,
    ticks: Sequence[int],
    kind: Kind = MP4,
    size: tuple[int, int] = (64, 48),
    comment: str = "",
    options: dict[str, str] | None = None,
) -> Path:
    """Write a film of numbered pictures; ticks: increasing time stamps in the unit of its kind."""
    with av.open(path, "w", options=options or {}) as container:
        if comment:
            container.metadata["comment"] = comment
        stream = container.add_stream(kind.codec, rate=15)
        stream.width, stream.height = size
        stream.pix_fmt = kind.pixels
        stream.time_base = stream.codec_context.time_base = kind.tick_s
        for number, stamp in enumerate(ticks):
            frame = av.VideoFrame.from_ndarray(numbered_picture(number, *size), format="rgb24")
            frame.pts, frame.time_base = stamp, kind.tick_s
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    return path


def write_packets(
    path: Path, stamps: Iterable[int], _: Kind = MKV, pictures: Sequence[np.ndarray] | None = None, comment: str = ""
) -> Path:
    """Write an MKV film of numbered pictures, or others, whose time stamps, in ms, need not increase."""
    stamps = list(stamps)
    pictures = [numbered_picture(number) for number in range(len(stamps))] if pictures is None else pictures
    with av.open(path, "w") as container:
        container.metadata["comment"] = comment
        stream = container.add_stream("mjpeg", rate=30, options={"qmin": "2", "qmax": "2"})
        stream.height, stream.width, _ = pictures[0].shape
        stream.pix_fmt = "yuvj444p"
        stream.time_base = stream.codec_context.time_base = MKV.tick_s
        for number, (stamp, picture) in enumerate(zip(stamps, pictures, strict=True)):
            frame = av.VideoFrame.from_ndarray(picture, format="rgb24")
            frame.pts, frame.time_base = number, MKV.tick_s
            for packet in stream.encode(frame):
                packet.pts, packet.dts = stamp, min(number, stamp)
                container.mux(packet)
    return path


def write_sound(path: Path, codec: str = "pcm_s16le") -> Path:
    with av.open(path, "w") as container:
        stream = container.add_stream(codec, rate=8000)
        sound = av.AudioFrame.from_ndarray(np.zeros((1, 8000), np.int16), format="s16", layout="mono")
        sound.rate = 8000
        container.mux(stream.encode(sound))
        container.mux(stream.encode())
    return path


def cut_off(path: Path, share: float = 0.6) -> Path:
    """Keep the first part of a file."""
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    return path
