"""Trials that are recorded and filmed at once, and their films."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from epuck_sim import Simulation, film_trial, record, run_trial
from epuck_sim.overhead.film import open_film
from epuck_sim.overhead.filming import film_recording
from epuck_sim.scenario.embodied import EmbodiedScenario


def record_and_film(folder: Path, scenario: EmbodiedScenario, look: Callable[..., None]) -> None:
    """Run a trial that is recorded as t.rrd and filmed as t.mp4, and that `look` observes, too."""
    with record(folder / "t.rrd", scenario, 1) as recorder, film_trial(folder / "t.mp4", scenario, 1) as camera:
        run_trial(Simulation(scenario, 1), [recorder, camera, look])


def films_of(folder: Path) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Return the frames of the film of such a trial, and those of a film of its recording."""
    film_recording(folder / "t.rrd", [], folder / "again.mp4", lambda rows, _: rows)
    return frames_of(folder / "t.mp4"), frames_of(folder / "again.mp4")


def frames_of(path: Path) -> list[np.ndarray]:
    """Return the frames of a film."""
    with open_film(str(path)) as film:
        return [frame.picture.copy() for frame in film.frames()]
