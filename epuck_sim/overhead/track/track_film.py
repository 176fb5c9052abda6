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
from epuck_sim.overhead.film.frame import Frame, Passing
from epuck_sim.overhead.film.live_camera import LiveCamera
from epuck_sim.overhead.film.reader import open_film
from epuck_sim.overhead.film.writer import film_file
from epuck_sim.overhead.track.annotate import Annotator
from epuck_sim.overhead.track.film_calibration import DESCRIPTION, described_lens, find_lens, with_description
from epuck_sim.overhead.track.history import Snapshot
from epuck_sim.overhead.track.result import Known, Track, conclude, threshold_so_far_s
from epuck_sim.overhead.track.ring_counter import Moment, Tracker, follow
from epuck_sim.overhead.track.ring_detection import Ring, RingFinder
from epuck_sim.util.atomic_write import atomic_write

HEAD_FRAMES = 90
"""So many frames are kept while a camera's lens is not known yet, in which there may be flashes: 6 s of 15 a second."""


def track_film(name: str, known: Known, rings: Path | None, passing: Passing) -> Track:
    """Return what the film `name`, a path or an address, tells; rings: a table of all of them to write.

    Raises FilmError for what is no film, or one that tells nothing.
    """
    with open_film(name) as film:
        lens, calibration = described_lens(film, known, film.description), DESCRIPTION
        known = with_description(known, film.description)
        if lens is None:
            lens, calibration = find_lens(film, known)
    tracker = Tracker(lens)
    with open_film(name) as film, ring_table(rings) as note:
        for frame in passing(film.frames(), film.duration_s):
            note(frame, tracker.look(frame))
        return conclude(name, tracker, calibration, known, tuple(film.warnings))


def annotate_film(track: Track, path: Path, passing: Passing) -> None:
    """Write a film that was tracked again, with the rings found and the histogram drawn; raises as `film_file` does."""
    lens = track.lens
    with (
        open_film(track.film) as film,
        annotated_film(path, lens.width_px, lens.height_px, track.period_s) as write,
    ):
        frames = passing(film.frames(), film.duration_s)
        for moment in follow(frames, Tracker(lens), track.period_s, lambda: track.threshold_ms / 1000):
            write(moment)


def snapshot(track: Track) -> Snapshot:
    """Return the frame of a film that was tracked in which the swarm is synchronised, or else its last one."""
    at_s = math.inf if track.t_sync_s is None else track.start_s + track.t_sync_s
    begins_s = track.times_s[track.times_s <= at_s][-1]  # of the frame that stands for that moment
    with open_film(track.film) as film:
        frame = next(frame for frame in film.frames() if frame.time_s >= begins_s)
    rings = RingFinder(track.lens).find(frame.picture)
    return Snapshot(frame.time_s, frame.picture, np.array([ring[3:] for ring in rings]).reshape(-1, 3))


def track_camera(
    number: int, known: Known, period_s: float, rings: Path | None, annotated: Path | None, passing: Passing
) -> Track:
    """Return what a camera has seen until the swarm was synchronised, or until Ctrl-C.

    period_s: of the oscillators, which has to be known while the camera films; rings: a table to write; annotated: a
    film of what was seen, with the rings found and the histogram drawn.
    Raises FilmError where there is no such camera, or it saw no light. One that fails while it films is a warning.
    """
    known = known._replace(period_s=period_s)
    warnings: list[str] = []
    with LiveCamera(number) as camera:
        head: deque[Frame] = deque(maxlen=HEAD_FRAMES)
        lens, calibration = find_lens(_Heading(camera, head), known)
        tracker = Tracker(lens)
        frames = passing(_while_plugged_in(chain(head, camera.frames()), warnings), None)
        with (
            ring_table(rings) as note,
            annotated_film(annotated, lens.width_px, lens.height_px, period_s) as write,
        ):
            try:
                for moment in follow(frames, tracker, period_s, lambda: threshold_so_far_s(tracker, period_s, known)):
                    note(moment.frame, moment.rings)
                    write(moment)
                    if moment.t_sync_s is not None:
                        break
            except KeyboardInterrupt:
                pass  # what was seen until then is told
            return conclude(camera.name, tracker, calibration, known, tuple(warnings))


class _Heading:
    """A camera of which the last frames that were asked for are kept: who looks for its lens must not lose them."""

    def __init__(self, camera: LiveCamera, kept: deque[Frame]) -> None:
        self.name, self.width_px, self.height_px = camera.name, camera.width_px, camera.height_px
        self._camera, self._kept = camera, kept

    def frames(self) -> Iterator[Frame]:
        """Yield the frames as they come."""
        for frame in self._camera.frames():
            self._kept.append(frame)
            yield frame


def _while_plugged_in(frames: Iterable[Frame], warnings: list[str]) -> Iterator[Frame]:
    """Yield a camera's frames for as long as it gives any, and warn of what ended them."""
    try:
        yield from frames
    except FilmError as error:
        warnings.append(str(error))


@contextmanager
def ring_table(path: Path | None) -> Iterator[Callable[[Frame, Sequence[Ring]], None]]:
    """Yield what notes the rings in a frame in a table, which takes the name `path` when the block ends; or nowhere.

    Raises EpuckSimError where it cannot be written.
    """
    if path is None:
        yield lambda *_: None
        return
    with atomic_write(path) as part, part.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["time_s", *Ring._fields])

        def note(frame: Frame, rings: Sequence[Ring]) -> None:
            time_s = f"{frame.time_s:.6f}"  # however long the film is
            writer.writerows([time_s, *(f"{value:.6g}" for value in ring)] for ring in rings)

        yield note


@contextmanager
def annotated_film(
    path: Path | None, width_px: int, height_px: int, period_s: float
) -> Iterator[Callable[[Moment], None]]:
    """Yield what writes a moment into the film `path`, with its rings and the histogram drawn; or nowhere.

    Raises as `film_file` does.
    """
    if path is None:
        yield lambda _: None
        return
    annotator = Annotator(width_px, height_px, period_s)
    with film_file(path, annotator.width_px, annotator.height_px, {"annotated": True}, path.stem) as writer:

        def write(moment: Moment) -> None:
            writer.write(Frame(moment.frame.time_s, annotator.annotate(*moment)))

        yield write
