"""Tracks a film from its file to its `Track`, or a camera while it films."""

import csv
import math
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import chain
from pathlib import Path

import numpy as np

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film.frame import Frame, ProgressWrapper
from epuck_sim.overhead.film.live_camera import LiveCamera
from epuck_sim.overhead.film.reader import open_film
from epuck_sim.overhead.film.writer import film_file
from epuck_sim.overhead.lens_file import read_lens
from epuck_sim.overhead.track.analysis import analyse, current_threshold_s
from epuck_sim.overhead.track.annotate import Annotator
from epuck_sim.overhead.track.film_calibration import (
    Excerpt,
    TrackOptions,
    calibrate,
    described_geometry,
    parse_metadata,
)
from epuck_sim.overhead.track.result import Snapshot, Track
from epuck_sim.overhead.track.ring_counter import RingCounter, TrackedFrame, track_frames
from epuck_sim.overhead.track.ring_detection import Ring, RingFinder
from epuck_sim.overhead.track.tag_reading import Readings, TagReader, read_tags
from epuck_sim.util.atomic_write import atomic_write

HEAD_FRAMES = 90
"""Number of frames kept while a live camera is calibrated, so that their flashes count: 6 s at 15 frames per second."""


LIVE_FRAMES = 30
"""Number of dark frames in which rings are studied while a live camera waits."""


def track_film(
    name: str, options: TrackOptions, rings: Path | None, progress: ProgressWrapper, lens: Path | None = None
) -> Track:
    """Track a film.

    Args:
        name: A path or an address.
        options: What is known of the film.
        rings: A CSV table to write with all rings in all frames.
        progress: Shows how far the film has been read.
        lens: The file of a calibrated lens.

    Raises:
        FilmError: The film cannot be read, or shows no swarm.
        EpuckSimError: The table cannot be written.
    """
    with open_film(name) as film:
        metadata = parse_metadata(film.description)
        if lens is not None:
            options = options._replace(lens=read_lens(lens, (film.width_px, film.height_px)))
        described = described_geometry(film, options, metadata)
        options = options.with_defaults(metadata)
        geometry = described or calibrate(Excerpt(film, options), options)
    counter = RingCounter(geometry)
    with open_film(name) as film, ring_table(rings) as write_rings:
        for frame in progress(Excerpt(film, options).frames(), film.duration_s):
            write_rings(frame, counter.process(frame))
        return analyse(name, counter, options, tuple(film.warnings))


def find_tags(track: Track, dictionary: str, progress: ProgressWrapper) -> Readings:
    """Read a tracked film again, and return the tags on top of its robots; raises FilmError as `track_film` does."""
    with open_film(track.film) as film:
        frames = progress(Excerpt(film, track.options).frames(), film.duration_s)
        trial = (frame for frame in frames if frame.time_s >= track.start_s)
        return read_tags(trial, TagReader(track.geometry.camera, dictionary))


def annotate_film(track: Track, path: Path, progress: ProgressWrapper) -> None:
    """Read a tracked film again, and write it with the rings found and the histogram drawn; raises as `film_file`."""
    camera = track.geometry.camera
    with (
        open_film(track.film) as film,
        annotated_film(path, camera.width_px, camera.height_px, track.period_s) as write,
    ):
        frames = progress(Excerpt(film, track.options).frames(), film.duration_s)
        counter, threshold_s = RingCounter(track.geometry), track.threshold_ms / 1000
        for tracked in track_frames(frames, counter, track.period_s, lambda: threshold_s, track.steady):
            write(tracked if track.confidence != "none" else tracked._replace(t_sync_s=None))


def snapshot(track: Track) -> Snapshot:
    """Return the frame of a tracked film in which the swarm becomes synchronised, or else the last one."""
    at_s = math.inf if track.t_sync_s is None else track.start_s + track.t_sync_s
    begins_s = track.times_s[track.times_s <= at_s][-1]  # the frame that stands for that moment
    with open_film(track.film) as film:
        frames = Excerpt(film, track.options).frames()
        frame = next(frame for frame in frames if frame.time_s >= begins_s)
    geometry = track.geometry
    finder = RingFinder(geometry.camera, geometry.ring_light)
    seen = finder.find(frame.picture, geometry.background)
    rings = [ring for ring in seen if geometry.is_on_floor(ring.x_cm, ring.y_cm)]
    return Snapshot(frame.time_s, frame.picture, np.array([ring[3:6] for ring in rings]).reshape(-1, 3))


def track_camera(
    number: int,
    options: TrackOptions,
    period_s: float,
    rings: Path | None,
    annotated: Path | None,
    progress: ProgressWrapper,
) -> Track:
    """Track a live camera until the swarm is synchronised, or until Ctrl-C.

    A camera that fails while it films ends the film with a warning.

    Args:
        number: 0 for the first camera.
        options: What is known of the scene.
        period_s: Period of the oscillators, which must be known while the camera films.
        rings: A CSV table to write with all rings in all frames.
        annotated: A film to write with the rings found and the histogram drawn.
        progress: Shows how long the camera has filmed.

    Raises:
        FilmError: There is no such camera, or it saw no light.
        EpuckSimError: A file cannot be written.
    """
    options = options._replace(period_s=period_s)
    warnings: list[str] = []
    with LiveCamera(number) as live:
        head: deque[Frame] = deque(maxlen=HEAD_FRAMES)
        geometry = calibrate(_KeepingFrames(live, head), options, LIVE_FRAMES)
        camera, counter = geometry.camera, RingCounter(geometry)
        frames = progress(_until_unplugged(chain(head, live.frames()), warnings), None)
        with (
            ring_table(rings) as write_rings,
            annotated_film(annotated, camera.width_px, camera.height_px, period_s) as write,
        ):
            try:
                for tracked in track_frames(
                    frames, counter, period_s, lambda: current_threshold_s(counter, period_s, options)
                ):
                    write_rings(tracked.frame, tracked.rings)
                    write(tracked)
                    if tracked.t_sync_s is not None:
                        break
            except KeyboardInterrupt:
                pass  # the frames until then are analysed
            return analyse(live.name, counter, options, tuple(warnings))


class _KeepingFrames:
    """A camera whose last frames are kept, so that those read for the calibration are tracked, too."""

    def __init__(self, camera: LiveCamera, kept: deque[Frame]) -> None:
        self.name, self.width_px, self.height_px = camera.name, camera.width_px, camera.height_px
        self._camera, self._kept = camera, kept

    def frames(self) -> Iterator[Frame]:
        """Yield the frames as they arrive."""
        for frame in self._camera.frames():
            self._kept.append(frame)
            yield frame


def _until_unplugged(frames: Iterable[Frame], warnings: list[str]) -> Iterator[Frame]:
    """Yield a camera's frames; if the camera fails, end and add a warning."""
    try:
        yield from frames
    except FilmError as error:
        warnings.append(str(error))


@contextmanager
def ring_table(path: Path | None) -> Iterator[Callable[[Frame, Sequence[Ring]], None]]:
    """Yield a function that writes the rings of a frame into a CSV table; it writes nothing if `path` is None."""
    if path is None:
        yield lambda *_: None
        return
    with atomic_write(path) as part, part.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time_s", *Ring._fields])

        def write_rings(frame: Frame, rings: Sequence[Ring]) -> None:
            time_s = f"{frame.time_s:.6f}"  # microseconds, however long the film is
            writer.writerows([time_s, *(f"{value:.6g}" for value in ring)] for ring in rings)

        yield write_rings


@contextmanager
def annotated_film(
    path: Path | None, width_px: int, height_px: int, period_s: float
) -> Iterator[Callable[[TrackedFrame], None]]:
    """Yield a function that annotates a frame and writes it into a film; it writes nothing if `path` is None.

    Args:
        path: The film.
        width_px: Width of the pictures without annotation.
        height_px: Height of the pictures without annotation.
        period_s: Period of the oscillators.

    Raises:
        EpuckSimError: As `film_file` does.
    """
    if path is None:
        yield lambda _: None
        return
    annotator = Annotator(width_px, height_px, period_s)
    with film_file(path, annotator.width_px, annotator.height_px, {"annotated": True}, path.stem) as writer:

        def write(tracked: TrackedFrame) -> None:
            writer.write(Frame(tracked.frame.time_s, annotator.annotate(*tracked)))

        yield write
