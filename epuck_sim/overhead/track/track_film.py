"""Tracks a film from its file to its `Track`."""

import csv
import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

import numpy as np

from epuck_sim.overhead.film.frame import Frame, ProgressWrapper
from epuck_sim.overhead.film.reader import open_film
from epuck_sim.overhead.film.writer import film_file
from epuck_sim.overhead.lens_file import read_lens
from epuck_sim.overhead.track.analysis import analyse
from epuck_sim.overhead.track.annotate import Annotator
from epuck_sim.overhead.track.film_calibration import (
    Excerpt,
    TrackOptions,
    calibrate,
    described_geometry,
    parse_metadata,
)
from epuck_sim.overhead.track.flashes import REACH_CM
from epuck_sim.overhead.track.light import Background
from epuck_sim.overhead.track.result import Snapshot, Track
from epuck_sim.overhead.track.ring_counter import RingCounter, track_frames
from epuck_sim.overhead.track.ring_detection import Ring, RingFinder
from epuck_sim.overhead.track.tag_reading import Readings, TagReader, read_tags
from epuck_sim.util.atomic_write import atomic_write

RingWriter = Callable[[Frame, Sequence[Ring]], None]
"""Writes the rings of a frame into a table."""


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
        warnings = tuple(film.warnings)
    return analyse(name, counter.counted(), options, warnings)


def describes_floor(name: str) -> bool:
    """Return whether a film's description says how large the floor is; raises FilmError if it cannot be read."""
    with open_film(name) as film:
        return parse_metadata(film.description).arena_cm is not None


def find_tags(track: Track, dictionary: str, progress: ProgressWrapper) -> Readings:
    """Read a tracked film again, and return the tags on top of its robots; raises FilmError as `track_film` does."""
    with open_film(track.film) as film:
        frames = progress(Excerpt(film, track.options).frames(), film.duration_s)
        trial = (frame for frame in frames if frame.time_s >= track.start_s)
        return read_tags(trial, TagReader(track.geometry.camera, dictionary))


def annotate_film(track: Track, path: Path, progress: ProgressWrapper) -> None:
    """Read a tracked film again, and write it with the rings found and the histogram drawn; raises as `film_file`."""
    camera = track.geometry.camera
    annotator = Annotator(camera.width_px, camera.height_px, track.period_s)
    counter, threshold_s = RingCounter(track.geometry), track.threshold_ms / 1000

    def steady(time_s: float) -> int:
        return sum(flash.onset_s <= time_s < flash.end_s for flash in track.steady)

    with (
        open_film(track.film) as film,
        film_file(path, annotator.width_px, annotator.height_px, {"annotated": True}, path.stem) as writer,
    ):
        frames = progress(Excerpt(film, track.options).frames(), film.duration_s)
        for tracked in track_frames(frames, counter, track.period_s, lambda: threshold_s, steady):
            shown = tracked if track.confidence != "none" else tracked._replace(t_sync_s=None)
            writer.write(Frame(tracked.frame.time_s, annotator.annotate(*shown)))


def snapshot(track: Track) -> Snapshot:
    """Return the frame of a tracked film in which the swarm becomes synchronised, or else the last one."""
    at_s = math.inf if track.t_sync_s is None else track.start_s + track.t_sync_s
    begins_s = track.times_s[track.times_s <= at_s][-1]  # the frame that stands for that moment
    geometry = track.geometry
    background = Background(geometry.background)
    with open_film(track.film) as film:
        for frame in Excerpt(film, track.options).frames():
            without_rings = background.update(frame)
            if frame.time_s >= begins_s:
                break
    steady_cm = [(flash.x_cm, flash.y_cm) for flash in track.steady if flash.onset_s <= frame.time_s <= flash.end_s]
    finder = RingFinder(geometry.camera, geometry.ring_light)
    rings = [
        ring
        for ring in finder.find(frame.picture, without_rings)
        if geometry.is_on_floor(ring.x_cm, ring.y_cm)
        and all(math.dist(ring[:2], place_cm) > REACH_CM for place_cm in steady_cm)
    ]
    return Snapshot(frame.time_s, frame.picture, np.array([ring[3:6] for ring in rings]).reshape(-1, 3))


@contextmanager
def ring_table(path: Path | None) -> Iterator[RingWriter]:
    """Yield a function that writes the rings of a frame into a CSV table; it writes nothing if `path` is None."""
    if path is None:
        yield lambda *_: None
        return
    with atomic_write(path) as part, part.open("w", newline="") as file:
        yield ring_writer(file)


def ring_writer(file: TextIO) -> RingWriter:
    """Write the head of a CSV table of rings, and return a function that writes the rings of a frame."""
    writer = csv.writer(file, lineterminator="\n")
    writer.writerow(["time_s", *Ring._fields])

    def write_rings(frame: Frame, rings: Sequence[Ring]) -> None:
        time_s = f"{frame.time_s:.6f}"  # microseconds, however long the film is
        writer.writerows([time_s, *(f"{value:.6g}" for value in ring)] for ring in rings)

    return write_rings
