"""The result of tracking a film (thesis 4.3.1, Appendix C)."""

from typing import Any, Literal, NamedTuple

from epuck_sim.arrays import FloatArray, IntArray
from epuck_sim.overhead.film.frame import Picture
from epuck_sim.overhead.track.film_calibration import TrackOptions
from epuck_sim.overhead.track.flashes import Flash
from epuck_sim.overhead.track.geometry import Geometry
from epuck_sim.overhead.track.spread import (
    Evaluation,
)


class Track(NamedTuple):
    """What was found in a film."""

    film: str
    """Name of the film or camera."""
    frames: int
    """Number of frames, including those of a lit beginning."""
    fps: float
    """Frames per second, by the median time from one frame to the next."""
    duration_s: float
    """Duration of the trial."""
    start_s: float
    """Beginning of the trial on the film's clock: the first dark frame."""
    calibration: str
    """What the camera was determined from."""
    period_s: float
    """Period of the oscillators."""
    flash_ms: float
    """Duration of a flash; 0.075 periods if it cannot be estimated."""
    threshold_ms: float
    """Standard deviation of the histogram at which the swarm counts as synchronised."""
    estimated: tuple[str, ...]
    """Which of `period_s` and `threshold_ms` were estimated from the film."""
    rings_outside: int
    """Number of rings seen outside of the floor, in all frames; they are left out."""
    always_lit: int
    """Number of places with rings that stayed lit for longer than half a period; they are left out."""
    position_error_mm: float | None
    """Standard error of positions that the geometry gives; None if the film does not tell."""
    robots_seen: int
    """Largest number of rings lit at once in two consecutive frames."""
    flashes_per_period: float
    """Mean number of flashes per period, over the time without gaps between frames."""
    t_sync_s: float | None
    """Time from the beginning of the trial to the flash around which the histogram was first narrow enough."""
    t_sync_periods: float | None
    """The same time in periods."""
    t_sync_cycles: float | None
    """Mean number of flashes of a robot by that time, as simulated trials count cycles; coupling makes them shorter
    than periods."""
    t_sync_onsets_s: float | None
    """Time from the beginning of the trial to the first flash around which the onsets in a period have an order
    parameter of 0.95 or more."""
    t_sync_onsets_periods: float | None
    """The same time in periods."""
    confidence: Literal["high", "low", "none"]
    """Whether T_sync, or that there is none, can be trusted: `low` if something is doubtful, `none` if nothing can be
    said."""
    reasons: tuple[str, ...]
    """Sentences about why there is no T_sync; empty if there is one."""
    warnings: tuple[str, ...]
    """Sentences about what is doubtful."""
    times_s: FloatArray
    """(frames,) s: times of the trial's frames on the film's clock."""
    counts: IntArray
    """(frames,) lit rings in each of them."""
    evaluations: tuple[Evaluation, ...]
    """Evaluations of the histogram, in order of time."""
    flashes: tuple[Flash, ...]
    """Flashes of the trial, in order of their onsets, without those of rings that are always lit."""
    steady: tuple[Flash, ...]
    """Rings that are always lit, as flashes."""
    geometry: Geometry
    """The camera that took the film, and the floor."""
    options: TrackOptions
    """What was known of the film."""

    def summary(self) -> dict[str, Any]:
        """Return the fields that are texts, numbers, or tuples of texts."""
        others = {"times_s", "counts", "evaluations", "flashes", "steady", "geometry", "options"}
        return {name: value for name, value in self._asdict().items() if name not in others}

    def periods_at(self, time_s: Any) -> Any:
        """Return a time, or (n,) times, on the film's clock in periods since the beginning of the trial."""
        return (time_s - self.start_s) / self.period_s


class Snapshot(NamedTuple):
    """A frame of a film, and the rings found in it."""

    time_s: float
    """Time of the frame on the film's clock."""
    picture: Picture
    rings_px: FloatArray
    """(rings, 3) px: column, row, radius."""
