"""Tracks a camera while it films: the swarm is watched, and what is seen is written, until it is synchronised."""

from collections import deque
from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack
from itertools import chain
from pathlib import Path
from typing import NamedTuple, Self

from epuck_sim.errors import FilmError
from epuck_sim.overhead.film.frame import Frame, Picture, ProgressWrapper
from epuck_sim.overhead.film.live_camera import LiveCamera
from epuck_sim.overhead.film.live_page import LivePage, live_page
from epuck_sim.overhead.film.writer import FilmWriter, growing_film_file
from epuck_sim.overhead.lens_file import read_lens
from epuck_sim.overhead.track.analysis import analyse, current_threshold_s
from epuck_sim.overhead.track.annotate import Annotator
from epuck_sim.overhead.track.film_calibration import TrackOptions, calibrate
from epuck_sim.overhead.track.light import is_lit
from epuck_sim.overhead.track.result import Track
from epuck_sim.overhead.track.ring_counter import RingCounter, TrackedFrame, track_frames
from epuck_sim.overhead.track.spread import is_synchronised
from epuck_sim.overhead.track.track_film import RingWriter, ring_writer
from epuck_sim.util.atomic_write import growing_text

HEAD_FRAMES = 90
"""Number of frames kept while a live camera is calibrated, so that their flashes count: 6 s at 15 frames per second."""

LIVE_FRAMES = 30
"""Number of frames in which rings are studied while a live camera waits, once the room is dark."""

LIVE_LIT_S = 30.0
"""Time for which a live camera waits for the room to be dark before it is tracked as it is."""


class Watching(NamedTuple):
    """What is written and shown while a camera films; None for what is not."""

    record: Path | None = None
    """A film of all that the camera delivers, to track it again."""
    rings: Path | None = None
    """A CSV table of all rings in all frames."""
    annotate: Path | None = None
    """A film with the rings found and the histogram drawn."""
    port: int | None = None
    """Port of a page that shows the same as `annotate`."""


def track_camera(
    number: int,
    options: TrackOptions,
    watching: Watching,
    progress: ProgressWrapper,
    tell: Callable[[str], None],
    lens: Path | None = None,
) -> Track:
    """Track a live camera until the swarm is synchronised, or until Ctrl-C.

    Files have their names from the beginning, and can be read up to about a second before the last frame, also if the
    process is killed. A camera that drops out is opened again; if it does not come back, that ends the film.

    Args:
        number: 0 for the first camera.
        options: What is known of the scene; the period of the oscillators must be, while the camera films.
        watching: What is written and shown.
        progress: Shows how long the camera has filmed.
        tell: Tells the user at once what happens to the camera, and why an answer is not believed.
        lens: The file of a calibrated lens.

    Raises:
        FilmError: There is no such camera, it saw no light, or the period is not known.
        EpuckSimError: A file cannot be written.
    """
    period_s = options.period_s
    if period_s is None:
        raise FilmError(f"camera {number}: the period of the oscillators is not known")
    with LiveCamera(number, tell) as live, _Outputs(live, watching, period_s, tell) as outputs:
        if lens is not None:
            options = options._replace(lens=read_lens(lens, (live.width_px, live.height_px)))
        waiting = _Waiting(live, outputs, tell)
        counter = RingCounter(calibrate(waiting, options, LIVE_FRAMES, LIVE_LIT_S))
        outputs.begin()
        ends: list[str] = []
        later = map(outputs.record, _until_unplugged(live.frames(), ends))
        frames = progress(chain(waiting.take_back(), later), None)
        synchronised = _Synchrony(live, counter, options, period_s, tell)
        try:
            for tracked in track_frames(
                frames,
                counter,
                period_s,
                synchronised.threshold_s,
                lambda time_s: counter.lit_since(time_s - period_s / 2),
            ):
                outputs.write(tracked)
                track = synchronised.track(tracked)
                if track is not None:
                    return track
        except KeyboardInterrupt:
            pass  # the frames until then are analysed
        return analyse(live.name, counter.counted(), options, (*live.warnings, *ends))


class _Synchrony:
    """Judges, whenever the swarm seems to be synchronised, whether it is."""

    def __init__(
        self,
        live: LiveCamera,
        counter: RingCounter,
        options: TrackOptions,
        period_s: float,
        tell: Callable[[str], None],
    ) -> None:
        self._live, self._counter, self._options, self._period_s, self._tell = live, counter, options, period_s, tell
        self._reasons: tuple[str, ...] = ()

    def threshold_s(self) -> float:
        """Return the spread of a synchronised swarm, by what has been seen."""
        return current_threshold_s(self._counter, self._period_s, self._options)

    def track(self, tracked: TrackedFrame) -> Track | None:
        """Return the result if this frame completes a synchronised period; None, and tell why, if it is doubtful."""
        if tracked.evaluation is None or not is_synchronised(tracked.evaluation, self.threshold_s()):
            return None
        track = analyse(self._live.name, self._counter.counted(), self._options, tuple(self._live.warnings))
        if track.t_sync_s is not None:
            return track
        if track.reasons != self._reasons:
            self._reasons = track.reasons
            self._tell(f"not yet believed to be synchronised: {'; '.join(track.reasons)}")
        return None


class _Outputs(ExitStack):
    """Writes and shows what a camera films, from its first frame on."""

    def __init__(self, live: LiveCamera, watching: Watching, period_s: float, tell: Callable[[str], None]) -> None:
        super().__init__()
        self._tell = tell
        self._name, self._size_px = live.name, (live.width_px, live.height_px)
        self._watching = watching
        self._annotator = Annotator(*self._size_px, period_s)
        self._page: LivePage | None = None
        self._film: FilmWriter | None = None
        self._annotated: FilmWriter | None = None
        self._write_rings: RingWriter | None = None

    def __enter__(self) -> Self:
        to, title = self._watching, self._name
        try:
            if to.port is not None:
                self._page = self.enter_context(live_page(title, to.port))
                self._tell(f"{self._page.address} shows {title}")
            if to.record is not None:
                self._film = self.enter_context(growing_film_file(to.record, *self._size_px, title))
        except BaseException:
            self.close()
            raise
        return self

    def record(self, frame: Frame) -> Frame:
        """Write a frame as it comes from the camera, and return it."""
        if self._film is not None:
            self._film.write(frame)
        return frame

    def show(self, picture: Picture) -> None:
        """Show a picture on the page."""
        if self._page is not None:
            self._page.show(picture)

    def begin(self) -> None:
        """Begin the files of what is found."""
        to, size_px = self._watching, (self._annotator.width_px, self._annotator.height_px)
        if to.rings is not None:
            self._write_rings = ring_writer(self.enter_context(growing_text(to.rings)))
        if to.annotate is not None:
            self._annotated = self.enter_context(growing_film_file(to.annotate, *size_px, self._name))

    def write(self, tracked: TrackedFrame) -> None:
        """Write and show a frame with what was found in it."""
        if self._write_rings is not None:
            self._write_rings(tracked.frame, tracked.rings)
        if self._annotated is None and self._page is None:
            return
        picture = self._annotator.annotate(*tracked)
        self.show(picture)
        if self._annotated is not None:
            self._annotated.write(Frame(tracked.frame.time_s, picture))


class _Waiting:
    """A camera whose last frames are kept, so that those read for the calibration are tracked, too."""

    def __init__(self, camera: LiveCamera, outputs: _Outputs, tell: Callable[[str], None]) -> None:
        self._tell = tell
        self.name, self.width_px, self.height_px = camera.name, camera.width_px, camera.height_px
        self._camera, self._outputs = camera, outputs
        self._head: deque[Frame] = deque(maxlen=HEAD_FRAMES)

    def frames(self) -> Iterator[Frame]:
        """Yield the frames as they arrive."""
        for frame in map(self._outputs.record, self._camera.frames()):
            self._outputs.show(frame.picture)
            if not self._head and is_lit(frame.picture):
                self._tell(f"the room is lit; tracking begins when it is dark, or after {LIVE_LIT_S:g} s")
            self._head.append(frame)
            yield frame

    def take_back(self) -> Iterator[Frame]:
        """Yield the last frames again, and forget them: pictures are large."""
        while self._head:
            yield self._head.popleft()


def _until_unplugged(frames: Iterable[Frame], ends: list[str]) -> Iterator[Frame]:
    """Yield a camera's frames; if the camera fails for good, end and say so."""
    try:
        yield from frames
    except FilmError as error:
        ends.append(str(error))
