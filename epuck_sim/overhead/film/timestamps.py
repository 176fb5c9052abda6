"""The times of a film's frames: from its own time stamps, even where some are missing or do not increase."""

from array import array
from fractions import Fraction
from statistics import median

GAP = 1.5
"""Shortest gap between frames, in median intervals: halfway to one dropped frame."""

RESTART_S = 1.0
"""Seconds before the previous time stamp from which a clock counts as restarted, not a frame as out of order."""

LONGEST_GAP_S = 86_400.0
"""Seconds after the previous time stamp from which a clock counts as set anew: no camera is still for a day."""


class FilmClock:
    """Turns the time stamps of frames into times that increase from 0, and counts the stamps that do not."""

    last_s: float
    """Time of the last frame; -1 before the first one."""

    def __init__(self, nominal_s: Fraction) -> None:
        """Begin before the first frame; nominal_s: interval between frames that the file declares."""
        self._nominal_s = float(nominal_s)
        self._zero_s: Fraction | None = None
        self._intervals_s = array("d")  # 8 bytes a frame: half a megabyte in an hour
        self._doubled = self._unordered = self._missing = self._restarts = 0
        self.last_s = -1.0

    @property
    def median_interval_s(self) -> float:
        """Median time from one frame to the next."""
        return median(self._intervals_s) if self._intervals_s else self._nominal_s

    def time_s(self, stamp_s: Fraction | None) -> float | None:
        """Return the time of the next frame, whose time stamp is `stamp_s`; None if the frame must be left out."""
        if stamp_s is None:
            self._missing += 1
            return self._advance(self._expected_s())
        if self._zero_s is None:
            self._zero_s = stamp_s - Fraction(self._expected_s())
        since_s = float(stamp_s - self._zero_s) - self.last_s
        if self.last_s >= 0 and not -RESTART_S <= since_s <= LONGEST_GAP_S:
            self._restarts += 1
            self._zero_s = stamp_s - Fraction(self._expected_s())
        elif self.last_s >= 0 and since_s <= 0:
            self._doubled += since_s == 0
            self._unordered += since_s < 0
            return None
        return self._advance(float(stamp_s - self._zero_s))

    def _expected_s(self) -> float:
        """Return the time of the next frame if it has no usable time stamp."""
        return 0.0 if self.last_s < 0 else self.last_s + self._average_s()

    def _average_s(self) -> float:
        return self.last_s / len(self._intervals_s) if self._intervals_s else self._nominal_s

    def _advance(self, time_s: float) -> float:
        if self.last_s >= 0:
            self._intervals_s.append(time_s - self.last_s)
        self.last_s = time_s
        return time_s

    def warnings(self) -> list[str]:
        """Return a sentence for each kind of defect among the time stamps so far."""
        defects = {
            "frames left out because they have the time stamp of the previous one": self._doubled,
            "frames left out because their time stamp is before that of the previous one": self._unordered,
            "jumps of the time stamps, across which the film is taken to continue": self._restarts,
            f"frames without a time stamp, placed {1000 * self._average_s():.3g} ms after the previous one": (
                self._missing
            ),
        }
        found = [f"{defect}: {number}" for defect, number in defects.items() if number]
        usual_s = self.median_interval_s
        gaps = [interval for interval in self._intervals_s if interval > GAP * usual_s]
        if gaps:
            found.append(
                f"gaps longer than {GAP:g} times the usual {1000 * usual_s:.3g} ms between frames: {len(gaps)}, "
                f"the longest {max(gaps):.3g} s; frames were dropped"
            )
        return found
