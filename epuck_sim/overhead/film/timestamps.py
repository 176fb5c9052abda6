"""The times of a film's frames: its own stamps, and what to make of those that are missing or do not grow."""

from array import array
from fractions import Fraction
from statistics import median

GAP = 1.5
"""A time between two frames that is longer than so many usual ones is a gap: halfway to a frame that was dropped."""

RESTART_S = 1.0
"""A stamp so far behind the one before is that of a clock which began anew, not of a frame out of order."""


class FilmClock:
    """Turns the stamps of frames into times that grow from 0, and keeps account of those that do not."""

    last_s: float

    def __init__(self, nominal_s: Fraction) -> None:
        self._nominal_s = float(nominal_s)
        self._zero_s: Fraction | None = None
        self._intervals_s = array("d")  # 8 bytes a frame: half a megabyte in an hour
        self._doubled = self._unordered = self._missing = self._restarts = 0
        self.last_s = -1.0

    @property
    def usual_s(self) -> float:
        """The median time from one frame to the next."""
        return median(self._intervals_s) if self._intervals_s else self._nominal_s

    def time_s(self, stamp_s: Fraction | None) -> float | None:
        """Return the time of the next frame, or None where it is to be left out."""
        if stamp_s is None:
            self._missing += 1
            return self._go_on(self._expected_s())
        if self._zero_s is None:
            self._zero_s = stamp_s - Fraction(self._expected_s())
        since_s = float(stamp_s - self._zero_s) - self.last_s
        if self.last_s >= 0 and since_s < -RESTART_S:
            self._restarts += 1
            self._zero_s = stamp_s - Fraction(self._expected_s())
        elif self.last_s >= 0 and since_s <= 0:
            self._doubled += since_s == 0
            self._unordered += since_s < 0
            return None
        return self._go_on(float(stamp_s - self._zero_s))

    def _expected_s(self) -> float:
        """Return the time of a frame that tells none."""
        return 0.0 if self.last_s < 0 else self.last_s + self._average_s()

    def _average_s(self) -> float:
        return self.last_s / len(self._intervals_s) if self._intervals_s else self._nominal_s

    def _go_on(self, time_s: float) -> float:
        if self.last_s >= 0:
            self._intervals_s.append(time_s - self.last_s)
        self.last_s = time_s
        return time_s

    def warnings(self) -> list[str]:
        """Return what was wrong with the stamps so far, in plain words."""
        told = {
            "frames with the time stamp of the one before, left out": self._doubled,
            "frames with a time stamp before that of the one before, left out": self._unordered,
            "jumps back of the time stamps, taken as if the film went on at once": self._restarts,
            f"frames without a time stamp, put {1000 * self._average_s():.3g} ms after the one before": self._missing,
        }
        found = [f"{what}: {number}" for what, number in told.items() if number]
        limit_s = GAP * self.usual_s
        gaps = [interval for interval in self._intervals_s if interval > limit_s]
        if gaps:
            found.append(
                f"gaps longer than {GAP:g} times the usual {1000 * self.usual_s:.3g} ms from frame to frame: "
                f"{len(gaps)}, the longest {max(gaps):.3g} s; frames were dropped"
            )
        return found
