"""The pace of a trial that is shown while it runs: keys pause it, take steps and end it; a clock stands for time."""

from typing import Any

import pytest

from epuck_sim.recording import live as pace_module
from epuck_sim.recording.live import END, MOST_LATE_S, PAUSE, STEP, Pace


class Clock:
    """Time that passes while a pace waits, and keys that are pressed at given times."""

    def __init__(self, *pressed: tuple[float, str]) -> None:
        self.now = 0.0
        self.pressed = list(pressed)

    def monotonic(self) -> float:
        return self.now

    def wait(self, seconds: float) -> str:
        if self.pressed and self.pressed[0][0] <= self.now + seconds:
            at, keys = self.pressed.pop(0)
            self.now = max(self.now, at)
            return keys
        self.now += seconds
        return ""


@pytest.fixture
def begin(monkeypatch) -> Any:
    def begin(*pressed: tuple[float, str], speed: float = 1.0) -> tuple[Clock, Pace]:
        clock = Clock(*pressed)
        monkeypatch.setattr(pace_module, "time", clock)
        return clock, Pace(speed, clock.wait)

    return begin


def shown_at(clock: Clock, pace: Pace, steps: int, step_s: float = 0.1) -> list[float]:
    """Return when each step is shown."""
    times = []
    for number in range(steps):
        pace.wait_until(number * step_s)
        times.append(round(clock.now, 6))
        if pace.is_paused:
            pace.stand_still(lambda: None)
    return times


@pytest.mark.parametrize("speed", [0.5, 1, 4])
def test_steps_are_shown_at_their_times(speed: float, begin) -> None:
    assert shown_at(*begin(speed=speed), 5) == pytest.approx([number * 0.1 / speed for number in range(5)])


def test_a_pause_lasts_until_the_key_is_pressed_again_and_nothing_is_hurried_after_it(begin) -> None:
    assert shown_at(*begin((0.15, PAUSE), (7.2, PAUSE)), 5) == pytest.approx([0, 0.1, 0.2, 7.3, 7.4])


def test_a_key_takes_one_step(begin) -> None:
    times = shown_at(*begin((0.15, STEP), (5, STEP), (9, STEP + STEP), (20, PAUSE)), 8)
    assert times == pytest.approx([0, 0.1, 0.2, 5.1, 9.1, 9.2, 20.1, 20.2])


def test_the_step_key_pauses_a_trial_that_runs(begin) -> None:
    _, pace = begin((0.05, STEP))
    pace.wait_until(0.0)
    pace.wait_until(0.1)
    assert pace.is_paused


def test_the_end_key_ends_it_at_once_running_or_paused(begin) -> None:
    for pressed in ([(0.12, END)], [(0.12, PAUSE), (3, END)]):
        clock, pace = begin(*pressed)
        with pytest.raises(KeyboardInterrupt):
            shown_at(clock, pace, 5)
        assert clock.now == pressed[-1][0]


def test_a_pause_looks_whether_the_viewer_is_still_there(begin) -> None:
    _, pace = begin((0.0, PAUSE))
    pace.wait_until(0.0)
    with pytest.raises(EOFError):
        pace.stand_still(lambda: (_ for _ in ()).throw(EOFError))


def test_short_delays_are_caught_up_with_and_long_ones_are_not(begin) -> None:
    clock, pace = begin()
    pace.wait_until(0.0)
    clock.now += 0.9 * MOST_LATE_S
    pace.wait_until(0.1)
    pace.wait_until(2.5)
    assert clock.now == pytest.approx(2.5)
    clock.now += 30
    pace.wait_until(2.6)
    pace.wait_until(2.7)
    assert clock.now == pytest.approx(32.6)
