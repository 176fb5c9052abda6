"""The pace at which a trial is shown while it runs: that of real robots or a multiple, with pauses, or step by step."""

import time
from collections.abc import Callable

PAUSE, STEP, END = " ", "n", "q"
"""Keys that pause the trial and let it go on, that take one step, and that end it."""

MOST_LATE_S = 2.0
"""A trial that is later than this, in seconds, goes on from there at its pace; one that is less late catches up."""

LOOK_S = 0.1
"""Time between two looks at the viewer during a pause, in seconds."""

Wait = Callable[[float], str]
"""Waits for a number of seconds, or until keys are pressed, and returns these."""


def sleep(seconds: float) -> str:
    """Wait where there are no keys to press."""
    if seconds > 0:
        time.sleep(seconds)
    return ""


class Pace:
    """When each step of a trial is due."""

    is_paused: bool
    """Whether the trial stands still after the step that is due, until a key is pressed."""

    def __init__(self, speed: float, wait: Wait = sleep) -> None:
        """Set the pace.

        Args:
            speed: How many times as fast as real robots.
            wait: Waits between steps.
        """
        self._speed = speed
        self._wait = wait
        self._began: float | None = None
        self._steps_wanted = 0
        self.is_paused = False

    def wait_until(self, time_s: float) -> None:
        """Wait for the moment at which this simulated time, in seconds, is to be shown.

        Raises:
            KeyboardInterrupt: `END` was pressed.
        """
        now = time.monotonic()
        if self._began is None:
            self._began = now - time_s / self._speed
        late = now - self._began - time_s / self._speed
        if late > MOST_LATE_S:
            self._began += late
        self._obey(self._wait(0.0))
        while (early := self._began + time_s / self._speed - time.monotonic()) > 0:
            self._obey(self._wait(early))

    def stand_still(self, look: Callable[[], None]) -> None:
        """Wait until the trial is to go on, by one step or for good; call `look` now and then.

        Raises:
            KeyboardInterrupt: `END` was pressed.
        """
        stopped = time.monotonic()
        while self.is_paused and not self._steps_wanted:
            look()
            self._obey(self._wait(LOOK_S))
        self._steps_wanted = max(self._steps_wanted - 1, 0)
        assert self._began is not None, "a trial stands still at a step"
        self._began += time.monotonic() - stopped

    def _obey(self, keys: str) -> None:
        for key in keys:
            if key == END:
                raise KeyboardInterrupt
            if key == PAUSE:
                self.is_paused, self._steps_wanted = not self.is_paused, 0
            elif key == STEP:
                self._steps_wanted += self.is_paused
                self.is_paused = True
