"""Films: any that FFmpeg can read, frame by frame at its own time stamps, and H.264 in MP4, which any browser plays.

A webcam's rate wanders (15 to 16 frames a second in thesis Appendix C), and its recording program drops or doubles
frames; the spread of a histogram in seconds needs the true times.
"""

import json
import math
import re
from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager, nullcontext
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import Any

import av
import numpy as np
from av.container import InputContainer, OutputContainer
from av.error import FFmpegError, InvalidDataError
from av.stream import Disposition
from av.video.frame import PictureType, VideoFrame
from av.video.reformatter import ColorRange, Colorspace, VideoReformatter
from av.video.stream import VideoStream

from epuck_sim.errors import FilmError
from epuck_sim.overhead.camera import Frame, Light
from epuck_sim.util.atomic_write import check_target, publish, temporary_path

EARLY_S = 1.0  # least time that a film must lack at its declared end to count as cut off; sound may outlast pictures
TIMEOUT_S = 15.0  # longest time that an address on the network may take to answer
UNSTAMPED_RATE = 25  # frame rate where neither time stamps nor the file give one, as FFmpeg's for numbered pictures
RESTART_S = 1.0  # a time stamp further back than this shows a clock that restarted, not a frame out of order
LONGEST_GAP_S = 86_400.0  # a longer gap between time stamps shows a clock that was reset: no camera pauses for a day

WHOLE_PX = 16  # divisor of the widths that FFmpeg converts to separate colours as a whole, without errors at the right
NO_FILM = (
    "; allowed: what FFmpeg reads, such as MP4, MKV, AVI or GIF; an MP4 film that was cut off while it was recorded "
    "lacks its index (`moov`): record it again, or copy it again if the original is whole"
)
TEXT_CODECS = frozenset({"ansi", "bintext", "idf", "xbin"})  # FFmpeg's, which show text files as films of a terminal
ANY_METADATA: dict[str, Any] = {"metadata_errors": "replace"} if int(av.__version__.partition(".")[0]) < 19 else {}
"""Options to open films whose metadata are not UTF-8; PyAV needs none from version 19 on."""


@contextmanager
def open_film(path_or_url: str) -> Iterator["Film"]:
    """Open a file, numbered pictures (`frames_%04d.png`) or an address; raise FilmError if no picture can be read."""
    is_address = "://" in path_or_url
    source, options = (path_or_url, {}) if is_address else _file_for_ffmpeg(path_or_url)
    try:
        container = av.open(source, options=options, timeout=TIMEOUT_S if is_address else None, **ANY_METADATA)
    except FileNotFoundError as error:
        allowed = "a film, numbered pictures such as frames_%04d.png, or an address such as http://..."
        raise FilmError(f"{path_or_url}: no such file; allowed: {allowed}") from error
    except (FFmpegError, OSError, ValueError) as error:
        hint = NO_FILM if isinstance(error, InvalidDataError) else "; check the address" if is_address else ""
        why = getattr(error, "strerror", None) or error
        raise FilmError(f"{path_or_url}: cannot be read as a film: {why}{hint}") from error
    with container:
        yield Film(path_or_url, container, _picture_stream(path_or_url, container))


class Film:
    """A film that is being read; only one frame at a time is in memory, whatever the film's length."""

    def __init__(self, name: str, container: InputContainer, stream: VideoStream) -> None:
        self.name = name  # the path or address
        self.description = _read_description(container.metadata)
        """The description that this package stored in the film; None in a film from elsewhere."""
        self.duration_s = _duration_s(container, stream)
        """Duration that the file declares, which may be wrong; None if it declares none."""
        self.is_pictures = container.format.name == "image2"
        """Whether it is a series of numbered pictures, which have no times."""
        self._container, self._stream = container, stream
        self.rate = float(stream.average_rate or UNSTAMPED_RATE)  # frames per second that the file declares
        self._clock = FilmClock(1 / self.rate)
        self._damaged = 0
        self.ended_early = ""  # what is to be said of a file that could not be read to its end
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
        FilmError is raised where the size of the pictures changes.
        """
        return self._frames

    @property
    def warnings(self) -> list[str]:
        """Defects of the frames read so far, and of the film's end once all frames have been read."""
        found = [self.ended_early] if self.ended_early else []
        if self._damaged:
            found.append(f"damaged frames: {self._damaged}; they were left out or patched from their neighbours")
        return found + self._clock.warnings()

    def _decode(self) -> Iterator[VideoFrame]:
        """Yield the pictures that can be decoded, skipping damaged ones."""
        self._stream.codec_context.thread_count = 1  # each thread would hold a few frames
        packets = self._container.demux(self._stream)
        while True:
            try:
                packet = next(packets, None)
            except FFmpegError as error:
                self.ended_early = f"the film cannot be read to its end: {error.strerror}"
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

    def _read(self, first: VideoFrame, others: Iterator[VideoFrame]) -> Iterator[Frame]:
        reformatter = VideoReformatter()  # shared by all frames: creating one takes longer than using it
        has_no_stamps = self._container.format.name == "avi"  # AVI has only decoding times, in the same order
        for picture in chain([first], others):
            if (picture.width, picture.height) != (first.width, first.height):
                sizes = f"from {first.width} x {first.height} to {picture.width} x {picture.height} px"
                said = f"the size of its pictures changes {sizes} after {self._clock.last_s:.3f} s"
                raise FilmError(f"{self.name}: {said}; cut the film there")
            ticks, unit_s = picture.dts if has_no_stamps else picture.pts, picture.time_base
            time_s = self._clock.time_s(None if ticks is None or unit_s is None else ticks * unit_s)
            if time_s is not None:
                turned = (np.rot90(colour, round(first.rotation / 90)) for colour in _colours(picture, reformatter))
                yield Frame(time_s, colours=[np.ascontiguousarray(colour) for colour in turned])  # as players show it
            lasted_s = float(picture.duration * unit_s) if picture.duration and unit_s else 0.0
        usual_s = self._clock.average_s
        read_s = self._clock.last_s + max(lasted_s, usual_s)
        if not self.ended_early and (self.duration_s or 0.0) - read_s > max(EARLY_S, 3 * usual_s):
            said = f"{read_s:.1f} of {self.duration_s:.1f} s could be read; the file was cut off or is damaged"
            self.ended_early = f"the film ends early: {said}"


class FilmClock:
    """Turns the time stamps of frames into times that increase from 0, and counts the stamps that do not."""

    def __init__(self, nominal_s: float) -> None:
        """Begin before the first frame; nominal_s: interval between frames that the file declares."""
        self.last_s = -1.0  # time of the last frame; -1 before the first one
        self._nominal_s = nominal_s
        self._zero_s: Fraction | None = None
        self._intervals = self._doubled = self._unordered = self._missing = self._restarts = 0

    @property
    def average_s(self) -> float:
        """Mean time from one frame to the next."""
        return self.last_s / self._intervals if self._intervals else self._nominal_s

    def time_s(self, stamp_s: Fraction | None) -> float | None:
        """Return the time of the next frame, whose time stamp is `stamp_s`; None if the frame must be left out."""
        is_first = self.last_s < 0
        time_s = 0.0 if is_first else self.last_s + self.average_s  # if it has no usable time stamp
        if stamp_s is None:
            self._missing += 1
        else:
            if self._zero_s is None:
                self._zero_s = stamp_s - Fraction(time_s)
            since_s = float(stamp_s - self._zero_s) - self.last_s
            if not is_first and not -RESTART_S <= since_s <= LONGEST_GAP_S:
                self._restarts += 1
                self._zero_s = stamp_s - Fraction(time_s)
            elif not is_first and since_s <= 0:
                self._doubled += since_s == 0
                self._unordered += since_s < 0
                return None
            time_s = float(stamp_s - self._zero_s)
        self._intervals += not is_first
        self.last_s = time_s
        return time_s

    def warnings(self) -> list[str]:
        """Return a sentence for each kind of defect among the time stamps so far."""
        placed = f"placed {1000 * self.average_s:.3g} ms after the previous one"
        defects = {
            "frames left out because they have the time stamp of the previous one": self._doubled,
            "frames left out because their time stamp is before that of the previous one": self._unordered,
            "jumps of the time stamps, across which the film is taken to continue": self._restarts,
            f"frames without a time stamp, {placed}": self._missing,
        }
        return [f"{defect}: {number}" for defect, number in defects.items() if number]


def _colours(picture: VideoFrame, reformatter: VideoReformatter) -> Iterable[Light]:
    """Return red, green and blue, which come apart in half the time that they take pixel by pixel."""
    if picture.width % WHOLE_PX:
        return np.moveaxis(reformatter.reformat(picture, format="rgb24", threads=1).to_ndarray(), -1, 0)
    return _planes(reformatter.reformat(picture, format="gbrp", threads=1))


def _planes(picture: VideoFrame) -> list[Light]:
    """Return red, green and blue of a picture that holds them apart, where they are in memory."""
    green, blue, red = (np.frombuffer(memoryview(plane), np.uint8) for plane in picture.planes)
    return [colour.reshape(picture.height, -1)[:, : picture.width] for colour in (red, green, blue)]


def _file_for_ffmpeg(path: str) -> tuple[str, dict[str, str]]:
    """Return the name by which FFmpeg opens a file, or numbered pictures, and the option that it needs for these."""
    file = Path(path).absolute()  # it would take the relative path `film:2.mp4` for an address
    if not path.strip():
        raise FilmError("the film's name is empty; give the file of a film")
    if file.is_fifo():
        raise FilmError(f"{path}: is a pipe, which can be read only once; save the film in a file first")
    if file.is_dir():
        inside = f"a film inside it, or numbered pictures such as {path}/frames_%04d.png"
        raise FilmError(f"{path}: is a directory; give {inside}")
    if file.is_file() and not file.stat().st_size:
        raise FilmError(f"{path}: is empty: nothing was recorded, or the copy failed; record or copy it again")
    parts, numbers = re.split(r"%\d*d", file.name), []
    if len(parts) == 2 and not file.exists():
        name = re.compile("([0-9]+)".join(map(re.escape, parts)))
        numbers = [int(match[1]) for each in file.parent.glob("*") if (match := name.fullmatch(each.name))]
    if not numbers:
        return str(file), {}
    # a % in the folder's name does not belong to the pattern; without the first number, FFmpeg tries only 0 to 4
    return f"{file.parent}/".replace("%", "%%") + file.name, {"start_number": str(min(numbers))}


def _picture_stream(name: str, container: InputContainer) -> VideoStream:
    """Return the first video stream that is not a cover picture; raise FilmError if there is none to decode."""
    for stream in container.streams.video:
        if stream.disposition & Disposition.attached_pic:
            continue
        if stream.codec_context is None:
            raise FilmError(f"{name}: no decoder for its pictures is available; convert it: ffmpeg -i {name} film.mp4")
        if stream.codec_context.name in TEXT_CODECS:
            raise FilmError(f"{name}: is a text file, not a film; give the film itself")
        return stream
    kinds = ", ".join(sorted({stream.type for stream in container.streams})) or "nothing"
    raise FilmError(f"{name}: holds no moving pictures, only {kinds}: cut off, or not the film itself; give the film")


def _duration_s(container: InputContainer, stream: VideoStream) -> float | None:
    if container.format.name == "avi" and stream.frames and stream.average_rate:
        return float(stream.frames / stream.average_rate)  # FFmpeg would estimate the duration from the file's size
    if stream.duration and stream.time_base:
        return float(stream.duration * stream.time_base)
    from_0 = "matroska" in container.format.name  # its duration counts from 0, not from the first frame
    before = max(container.start_time or 0, 0) if from_0 else 0
    return (container.duration - before) / av.time_base if container.duration else None


def _read_description(metadata: dict[str, str]) -> dict[str, Any] | None:
    """Return the description that this package wrote into a film's comment; None if there is none."""
    comments = [value for key, value in metadata.items() if key.lower() == "comment"]  # Matroska writes COMMENT
    try:
        parsed = json.loads(comments[0]) if comments else None
    except ValueError:
        return None
    return parsed if isinstance(parsed, dict) and "epuck_sim" in parsed else None


SUFFIX = ".mp4"
TICKS_PER_S = 90_000  # resolution of the time stamps; the usual clock of MPEG films
KEYFRAME_INTERVAL_S = 10.0  # between pictures that are stored whole: seeking does not decode from the beginning

ENCODER_OPTIONS = {"crf": "22", "preset": "veryfast", "x264-params": "mbtree=0:scenecut=0:bframes=0"}
"""Options of libx264: a quality at which rings keep their shape though noise is lost, and speed before size.

The macroblock tree (mbtree) is off: it coarsens short-lived detail such as flashes, and with AVX-512 instructions it
makes a different file from the same frames each time. A flash is no new scene, to be stored whole: without such
pictures, and those that refer to later ones, encoding takes 0.6 of the time and films two thirds of the space, though
a crf of 22 is finer than 24, and rings are nearer to those of the frames (0.07 mm instead of 0.09).
`ultrafast` takes 0.6 of the time, but its rings are 8 % off in size, from which scales follow.
"""

WAITING = 8  # most pictures that wait for the encoder: it goes on in the dark, where they are made faster than encoded

CLOCK = {"movie_timescale": str(TICKS_PER_S)}  # gives the time of the first frame the resolution of the others
WHOLE = {"movflags": "+faststart"}
"""Options of an MP4 file whose index comes first: a browser can play it before it has fetched all of it."""
GROWING = {"movflags": "+empty_moov+default_base_moof", "frag_duration": "500000", "flush_packets": "1"}
"""Options of an MP4 file of fragments of half a second, each with its own index: it can be read while it grows."""


class FilmWriter:
    """Writes frames into the file of a film; `film_file` makes one."""

    has_frames = False  # whether a frame was encoded

    def __init__(self, container: OutputContainer, encoder: ThreadPoolExecutor, size_px: tuple[int, int]) -> None:
        self._last_tick = -1
        self._keyframe_s = -math.inf
        self._reformatter, self._encoder, self._has_failed = VideoReformatter(), encoder, False
        self._waiting: deque[Future[None]] = deque()
        self._container, self._stream = container, container.add_stream("libx264", options=ENCODER_OPTIONS)
        self._stream.width, self._stream.height = size_px
        self._stream.pix_fmt = "yuv420p"
        codec = self._stream.codec_context
        self._stream.time_base = codec.time_base = Fraction(1, TICKS_PER_S)
        codec.thread_count = 1  # so that the same frames give the same file
        # the conversion to luma and chroma, stated because players would assume BT.709 for large pictures
        codec.colorspace, codec.color_range = Colorspace.ITU601, ColorRange.MPEG

    def write(self, frame: Frame) -> None:
        """Add a frame that is later than all frames before it; raise what the encoding of one before it raised."""
        colours = frame.colours
        picture = VideoFrame(colours[0].shape[1], len(colours[0]), "gbrp")  # converted faster than pixel by pixel
        for plane, colour in zip(_planes(picture), colours, strict=True):
            plane[:] = colour
        if len(self._waiting) == WAITING and not self._waiting[0].done():  # or else the encoder converts it
            picture = self._reformatter.reformat(picture, format="yuv420p", threads=1)
        # frames closer than a tick still get increasing time stamps
        self._last_tick = max(round(frame.time_s * TICKS_PER_S), self._last_tick + 1)
        picture.pts, picture.time_base = self._last_tick, Fraction(1, TICKS_PER_S)
        if frame.time_s - self._keyframe_s >= KEYFRAME_INTERVAL_S:
            picture.pict_type = PictureType.I
            self._keyframe_s = frame.time_s
        if len(self._waiting) == WAITING:
            self._waiting.popleft().result()
        self._waiting.append(self._encoder.submit(self._encode, picture))

    def finish(self) -> None:
        """Wait until all frames are in the file; raise what their encoding raised."""
        self._encoder.shutdown()  # waits also for a picture that Ctrl-C kept from the queue
        for encoded in self._waiting:
            encoded.result()
        if self.has_frames:  # or FFmpeg would crash
            self._encode(None)

    def _encode(self, picture: VideoFrame | None) -> None:
        """Write a picture, or what the encoder still holds, unless that has failed before: FFmpeg would crash."""
        if not self._has_failed:
            self._has_failed = True  # until it is written
            self._container.mux(self._stream.encode(picture))
            self._has_failed, self.has_frames = False, True


@contextmanager
def film_file(
    path: Path, width_px: int, height_px: int, description: Mapping[str, Any], title: str = "", *, grows: bool = False
) -> Iterator[FilmWriter]:
    """Yield a writer of a film, which gets the name `path` when the block ends without an error.

    Both sides of the pictures are even, as H.264 requires. The description is stored as JSON in the `comment` of the
    film's metadata, beside the title. With `grows`, the film has its name from the beginning, and errors leave it: it
    can be read up to about a second before the last frame, even if the process is killed. FilmError is raised if the
    name does not end in .mp4, a side is odd, or there is no frame, and EpuckSimError if the file cannot be written.
    """
    if path.suffix != SUFFIX:
        raise FilmError(f"{path}: is not a film's name; allowed: names that end in {SUFFIX}")
    if width_px % 2 or height_px % 2:
        raise FilmError(f"{path}: pictures of {width_px} x {height_px} pixels; allowed: even sides; crop or pad them")
    check_target(path)
    with nullcontext(path) if grows else temporary_path(path) as part:
        try:
            options = CLOCK | (GROWING if grows else WHOLE)
            with av.open(part, "w", format="mp4", options=options) as container, ThreadPoolExecutor(1) as encoder:
                container.metadata.update({"title": title, "comment": json.dumps(description)})
                writer = FilmWriter(container, encoder, (width_px, height_px))
                try:
                    yield writer
                finally:
                    writer.finish()
        except FFmpegError as error:
            raise FilmError(f"{path}: cannot be written: {error.strerror}") from error
        if not grows and not writer.has_frames:
            raise FilmError(f"{path}: cannot be written: the film has no frame")
        if not grows:
            publish(part, path)
